//! The simulation against closed forms: cantilevers, hanging, sheared and bent sheets, on three kinds of mesh at
//! three resolutions, by both elastic models and by the sheets of the textile tests.
//!
//! `cargo run --release -p tessuto-sim --example standards` prints the tables of docs/experiments/standards.md in about
//! a minute. `... --example standards drape` prints how the drape test depends on its mesh instead, and
//! `... --example standards curve` points of the master curve.

use std::f64::consts::FRAC_PI_4;

use tessuto_core::error::Result;
use tessuto_core::glam::{DVec2, DVec3};
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Face, Mesh, Positions, grid};
use tessuto_sim::cloth::AREA_DENSITY;
use tessuto_sim::per_width::per_width;
use tessuto_sim::textile::plate::Plate;
use tessuto_sim::textile::rest::{Search, at_rest};
use tessuto_sim::textile::{GRAVITY, cantilever, drape, elastica};
use tessuto_sim::{Cloth, Fabric, Stiffness};

/// Cells along the longer side.
const RESOLUTIONS: [usize; 3] = [10, 20, 40];
/// Stretch [N/m], bend and shear [J/rad²] stiffness of the springs.
const SPRINGS: [f64; 3] = [200.0, 1e-3, 3e-4];
const FABRIC: Fabric = Fabric { warp: 200.0, weft: 150.0, poisson: 0.0, shear: 12.0, bend: 1e-5 };

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Grid,
    UnevenQuads,
    UnevenTriangles,
}

#[derive(Clone, Copy, PartialEq)]
enum Model {
    Springs,
    Continuum,
}

const CASES: [(Model, Kind, &str); 6] = [
    (Model::Springs, Kind::Grid, "springs, grid"),
    (Model::Springs, Kind::UnevenQuads, "springs, uneven quads"),
    (Model::Springs, Kind::UnevenTriangles, "springs, uneven triangles"),
    (Model::Continuum, Kind::Grid, "continuum, grid"),
    (Model::Continuum, Kind::UnevenQuads, "continuum, uneven quads"),
    (Model::Continuum, Kind::UnevenTriangles, "continuum, uneven triangles"),
];

/// A sheet of `cells` cells of size `step`, the first corner at the origin; texture coordinates are x and y.
/// Vertices inside are off by up to a quarter of a cell where they are uneven, but not in the first `straight` columns.
fn sheet(kind: Kind, cells: [usize; 2], step: DVec2, straight: usize) -> Mesh {
    let [columns, rows] = cells.map(|n| n + 1);
    let size = step * DVec2::new(cells[0] as f64, cells[1] as f64);
    let mut mesh = grid(columns, rows, size, 0.0);
    let mut rng = Rng::new(11, 0);
    for (v, p) in mesh.positions.iter_mut().enumerate() {
        *p += (0.5 * size).extend(0.0);
        let (column, row) = (v % columns, v / columns);
        let inside = column >= straight.max(1) && column + 1 < columns && row > 0 && row + 1 < rows;
        if kind != Kind::Grid && inside {
            *p += (DVec2::new(rng.signed(), rng.signed()) * step * 0.25).extend(0.0);
        }
    }
    if kind == Kind::UnevenTriangles {
        let quads = std::mem::take(&mut mesh.faces);
        for quad in quads {
            let pairs = if rng.signed() > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
            for corners in pairs {
                let corners: Vec<u32> = corners.iter().map(|k| quad.vertices[*k]).collect();
                mesh.faces.push(Face { vertices: corners.clone(), uvs: corners });
            }
        }
    }
    mesh.uvs = mesh.positions.iter().map(|p| DVec2::new(p.x, p.y)).collect();
    mesh
}

/// Cloth of either model with its stiffness, and what it says of itself.
struct Subject {
    mesh: Mesh,
    cloth: Cloth,
    model: Model,
    bend: f64,
}

impl Subject {
    fn new(model: Model, mesh: Mesh) -> Self {
        let (cloth, bend) = match model {
            Model::Springs => (Cloth::new(&mesh), SPRINGS[1]),
            Model::Continuum => (Cloth::continuum(&mesh), FABRIC.bend),
        };
        Self { mesh, cloth, model, bend }
    }

    fn stiffness(&self) -> Stiffness {
        match self.model {
            Model::Springs => Stiffness::uniform(&self.cloth, [SPRINGS[0], self.bend, SPRINGS[2]]),
            Model::Continuum => Fabric { bend: self.bend, ..FABRIC }.stiffness(&self.cloth),
        }
    }

    /// Bending [N·m] of both directions, membrane of both and shear [N/m] as the program gives them.
    fn told(&self, x: &Positions) -> ([f64; 2], [f64; 2], f64) {
        match self.model {
            Model::Continuum => ([self.bend; 2], [FABRIC.warp, FABRIC.weft], FABRIC.shear),
            Model::Springs => {
                let k = [SPRINGS[0], self.bend, SPRINGS[2]];
                let widths = per_width(&self.cloth, &self.mesh, k, std::slice::from_ref(x)).expect("a panel");
                (widths.bending, widths.membrane, widths.shear)
            }
        }
    }
}

/// Drop over reach of a cantilever of 0.1 m against the elastica of the D that the program gives, for a Γ near
/// `target`, off by a part.
fn hung(model: Model, kind: Kind, cells: usize, target: f64) -> Result<f64> {
    let length = 0.1;
    // The hinges at the last held column bend over half a cell on both sides: there the strip begins.
    let h = length / (cells as f64 - 0.5);
    let mut subject = Subject::new(model, sheet(kind, [cells + 1, 4], DVec2::new(h, h), 3));
    // The held columns, one more than the clamp.
    let columns = cells + 2;
    let held: Vec<usize> = (0..subject.mesh.positions.len()).filter(|v| v % columns < 3).collect();
    let weight = AREA_DENSITY * GRAVITY * length.powi(3);
    if model == Model::Continuum {
        subject.bend = weight / target;
    }
    let mut off = 0.0;
    for _ in 0..if model == Model::Springs { 8 } else { 1 } {
        let k = subject.stiffness();
        let search = Search::default();
        let x = at_rest(&subject.cloth, &k, &subject.mesh.positions, &held, DVec3::Z * GRAVITY, &search)?;
        let middle = 2 * columns;
        let way = x[middle + columns - 1] - x[middle + 2];
        // What half a cell at the clamp, level nearly, reaches out more.
        let ratio = way.z / (way.x + 0.5 * h);
        let gamma = weight / subject.told(&x).0[0];
        off = ratio / elastica::drop_over_reach(gamma) - 1.0;
        subject.bend *= gamma / target;
    }
    Ok(off)
}

/// What a sheet of 0.3 m hung by its upper edge grows by, against ρ g L²/(2 E).
fn grown(model: Model, kind: Kind, cells: usize) -> Result<f64> {
    let length = 0.3;
    let h = length / cells as f64;
    let across = cells / 2;
    let subject = Subject::new(model, sheet(kind, [across, cells], DVec2::new(h, h), 0));
    let columns = across + 1;
    let held: Vec<usize> = (0..columns).collect();
    let x = &subject.mesh.positions;
    let rest =
        at_rest(&subject.cloth, &subject.stiffness(), x, &held, DVec3::Y * GRAVITY, &Search::default())?;
    let end = x.len() - columns;
    let grown = (end..x.len()).map(|v| rest[v].y - x[v].y).sum::<f64>() / columns as f64;
    let expected = AREA_DENSITY * GRAVITY * length * length / (2.0 * subject.told(x).1[1]);
    Ok(grown / expected - 1.0)
}

/// Energy of a square of 0.2 m whose border is sheared by an angle of 2°, the inside at rest, against ½ G γ² A.
fn sheared(model: Model, kind: Kind, cells: usize) -> Result<f64> {
    let side = 0.2;
    let subject = Subject::new(model, sheet(kind, [cells, cells], DVec2::splat(side / cells as f64), 0));
    let angle = 2f64.to_radians();
    // A trellis: both directions turn by half of the angle and keep their lengths.
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let turn = |p: &DVec3| DVec3::new(cosine * p.x + sine * p.y, sine * p.x + cosine * p.y, 0.0);
    let x: Positions = subject.mesh.positions.iter().map(turn).collect();
    let columns = cells + 1;
    let ends = [0, cells];
    let border = |v: &usize| ends.contains(&(v % columns)) || ends.contains(&(v / columns));
    let held: Vec<usize> = (0..x.len()).filter(border).collect();
    let k = subject.stiffness();
    let rest = at_rest(&subject.cloth, &k, &x, &held, DVec3::ZERO, &Search::default())?;
    let energy = subject.cloth.energy(&k, &rest).total();
    Ok(energy / (0.5 * subject.told(&x).2 * angle * angle * side * side) - 1.0)
}

/// Moment of a sheet of 0.2 m bent around a cylinder of radius 0.05 m whose axis is turned by `turn`, against D κ
/// A. The halves of cells at the ends, which no hinge bends, do not count.
fn bent(model: Model, kind: Kind, cells: usize, turn: f64) -> f64 {
    let side = 0.2;
    let subject = Subject::new(model, sheet(kind, [cells, cells], DVec2::splat(side / cells as f64), 0));
    let k = subject.stiffness();
    let (sine, cosine) = turn.sin_cos();
    let round = |curvature: f64| -> Positions {
        let of = |p: &DVec3| {
            let along = cosine * p.x + sine * p.y;
            let across = cosine * p.y - sine * p.x;
            let phi = along * curvature;
            let (out, height) = (phi.sin() / curvature, (1.0 - phi.cos()) / curvature);
            DVec3::new(cosine * out - sine * across, sine * out + cosine * across, height)
        };
        subject.mesh.positions.iter().map(of).collect()
    };
    let curvature = 20.0;
    let energy = |c: f64| subject.cloth.energy(&k, &round(c)).bend;
    let moment = (energy(curvature * 1.001) - energy(curvature * 0.999)) / (0.002 * curvature);
    let [warp, weft] = subject.told(&round(curvature)).0;
    let own = warp * cosine * cosine + weft * sine * sine;
    let counted = side * side * (cells as f64 - 1.0) / cells as f64;
    moment / (own * curvature * counted) - 1.0
}

fn row(name: &str, offs: [f64; 3]) {
    let shown = offs.map(|off| format!("{:+.1}", 100.0 * off));
    println!("| {name} | {} |", shown.join(" | "));
}

fn title(name: &str) {
    println!("\n{name}\n\n| off by, % | 10 cells | 20 cells | 40 cells |\n|---|---|---|---|");
}

fn each(title_of: &str, of: impl Fn(Model, Kind, usize) -> Result<f64>) -> Result<()> {
    title(title_of);
    for (model, kind, name) in CASES {
        let mut offs = [0.0; 3];
        for (off, cells) in offs.iter_mut().zip(RESOLUTIONS) {
            *off = of(model, kind, cells)?;
        }
        row(name, offs);
    }
    Ok(())
}

fn strips() -> Result<()> {
    for gamma in [1.0, 8.0, 30.0] {
        let mut offs = [0.0; 3];
        for (off, cells) in offs.iter_mut().zip(RESOLUTIONS) {
            let strip = cantilever::hang(AREA_DENSITY * GRAVITY * 1e-3 / gamma, 0.1, cells)?;
            *off = strip.slope().tan() / elastica::drop_over_reach(gamma) - 1.0;
        }
        row(&format!("strip of the card, Γ = {gamma}"), offs);
    }
    Ok(())
}

fn drapes() -> Result<()> {
    println!("| bending length, mm | cells | drape coefficient, % | nodes |\n|---|---|---|---|");
    for length in [0.012, 0.018, 0.027f64] {
        for cells in [[6, 72], [8, 96], [12, 144]] {
            let bending = 0.15 * GRAVITY * length.powi(3);
            let fabric = Plate { membrane: [300.0; 2], shear: 30.0, bending: [bending; 2] };
            let began = std::time::Instant::now();
            let found = drape::drape_of(&fabric, 0.15, cells)?;
            let coefficient = 100.0 * found.coefficient;
            println!("| {:.0} | {cells:?} | {coefficient:.1} | {} |", 1e3 * length, found.nodes);
            eprintln!("{:.2} s", began.elapsed().as_secs_f64());
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    match std::env::args().nth(1).as_deref() {
        Some("drape") => return drapes(),
        Some("curve") => {
            for k in 0..=70 {
                let gamma = 10f64.powf(-3.0 + 0.1 * f64::from(k));
                println!("{gamma:.9} {:.9}", elastica::drop_over_reach(gamma));
            }
            return Ok(());
        }
        _ => {}
    }
    for gamma in [1.0, 8.0, 30.0] {
        each(&format!("Cantilever, Γ = {gamma}: drop over reach"), |m, k, n| hung(m, k, n, gamma))?;
    }
    title("Cantilevers of `textile::cantilever`: drop over reach");
    strips()?;
    each("Hanging sheet: growth", grown)?;
    each("Sheared square: energy", sheared)?;
    for (name, turn) in
        [("warp", 0.0), ("weft", 2.0 * FRAC_PI_4), ("bias", FRAC_PI_4), ("other bias", -FRAC_PI_4)]
    {
        each(&format!("Cylinder along the {name}: moment"), |m, k, n| Ok(bent(m, k, n, turn)))?;
    }
    Ok(())
}
