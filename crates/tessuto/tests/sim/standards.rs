//! The simulation against closed forms, by the stiffnesses per width that the program gives: what
//! docs/experiments/standards.md says is within 3 %. Its whole tables are printed by the example `standards` of
//! `tessuto-sim`.

use glam::{DVec2, DVec3};
use tessuto::mesh::grid;
use tessuto::sim::cloth::AREA_DENSITY;
use tessuto::sim::per_width::per_width;
use tessuto::sim::textile::plate::{Lattice, Plate};
use tessuto::sim::textile::rest::{Search, at_rest};
use tessuto::sim::textile::{GRAVITY, cantilever, elastica};
use tessuto::sim::{Cloth, Fabric, Stiffness};
use tessuto::{Mesh, Positions};

const SPRINGS: [f64; 3] = [200.0, 1e-3, 3e-4];
const FABRIC: Fabric = Fabric { warp: 200.0, weft: 150.0, poisson: 0.0, shear: 12.0, bend: 1e-5 };

fn within(what: &str, own: f64, expected: f64) {
    println!("{what}: {own:.4e}, expected {expected:.4e}");
    assert!((own / expected - 1.0).abs() < 0.03, "{what}: {own} {expected}");
}

/// Both models on a grid of square cells: springs and continuum, each with bending along x [N·m], membrane along y and
/// shear [N/m] as the program gives them for the shape `x`.
fn both(mesh: &Mesh, x: &Positions) -> [(Cloth, Stiffness, [f64; 3]); 2] {
    let springs = Cloth::new(mesh);
    let widths = per_width(&springs, mesh, SPRINGS, std::slice::from_ref(x)).unwrap();
    let stiffness = Stiffness::uniform(&springs, SPRINGS);
    let continuum = Cloth::continuum(mesh);
    let of_fabric = FABRIC.stiffness(&continuum);
    [
        (springs, stiffness, [widths.bending[0], widths.membrane[1], widths.shear]),
        (continuum, of_fabric, [FABRIC.bend, FABRIC.weft, FABRIC.shear]),
    ]
}

#[test]
fn a_hanging_sheet_grows_by_its_weight() {
    let (columns, rows, length) = (11, 21, 0.3);
    let mesh = grid(columns, rows, DVec2::new(0.15, length), 0.0);
    let held: Vec<usize> = (0..columns).collect();
    for (cloth, stiffness, [_, membrane, _]) in both(&mesh, &mesh.positions) {
        let search = Search::default();
        let x = at_rest(&cloth, &stiffness, &mesh.positions, &held, DVec3::Y * GRAVITY, &search).unwrap();
        // Springs at both sides have half of the weight of those between them: the mean of the lower edge.
        let edge = (columns * (rows - 1))..columns * rows;
        let grown = edge.map(|v| x[v].y - mesh.positions[v].y).sum::<f64>() / columns as f64;
        within("grown, m", grown, AREA_DENSITY * GRAVITY * length * length / (2.0 * membrane));
    }
}

#[test]
fn a_sheared_square_holds_its_energy() {
    let mesh = grid(21, 21, DVec2::splat(0.2), 0.0);
    let angle = 2f64.to_radians();
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let sheared: Positions = mesh
        .positions
        .iter()
        .map(|p| DVec3::new(cosine * p.x + sine * p.y, sine * p.x + cosine * p.y, 0.0))
        .collect();
    for (cloth, stiffness, [_, _, shear]) in both(&mesh, &mesh.positions) {
        let energy = cloth.energy(&stiffness, &sheared).total();
        within("energy, J", energy, 0.5 * shear * angle * angle * 0.04);
    }
}

#[test]
fn a_bent_strip_has_the_moment_of_its_curvature() {
    let (size, curvature) = (DVec2::new(0.2, 0.1), 20.0);
    let mesh = grid(21, 11, size, 0.0);
    let round = |curvature: f64| -> Positions {
        let of = |p: &DVec3| {
            let phi = p.x * curvature;
            DVec3::new(phi.sin() / curvature, p.y, (1.0 - phi.cos()) / curvature)
        };
        mesh.positions.iter().map(of).collect()
    };
    for (cloth, stiffness, [bending, _, _]) in both(&mesh, &round(curvature)) {
        let energy = |c: f64| cloth.energy(&stiffness, &round(c)).bend;
        let moment = (energy(curvature * 1.001) - energy(curvature * 0.999)) / (0.002 * curvature);
        // The halves of the cells at both ends do not bend.
        within("moment, N·m²", moment, bending * curvature * size.y * (size.x - 0.01));
    }
}

#[test]
fn cantilevers_are_the_elastica() {
    // Springs, whose bend is that of a Γ near 8; elsewhere they are off as the document says.
    let (cells, length) = (20usize, 0.1);
    let h = length / (cells as f64 - 0.5);
    let columns = cells + 2;
    let mesh = grid(columns, 5, DVec2::new((cells + 1) as f64 * h, 4.0 * h), 0.0);
    let cloth = Cloth::new(&mesh);
    let held: Vec<usize> = (0..mesh.positions.len()).filter(|v| v % columns < 3).collect();
    let k = [SPRINGS[0], 5e-4, SPRINGS[2]];
    let stiffness = Stiffness::uniform(&cloth, k);
    let (rest, search) = (&mesh.positions, Search::default());
    let x = at_rest(&cloth, &stiffness, rest, &held, DVec3::Z * GRAVITY, &search).unwrap();
    let way = x[3 * columns - 1] - x[2 * columns + 2];
    let told = per_width(&cloth, &mesh, k, std::slice::from_ref(&x)).unwrap().bending[0];
    let gamma = AREA_DENSITY * GRAVITY * length.powi(3) / told;
    println!("Γ {gamma:.2}");
    assert!((5.0..12.0).contains(&gamma), "{gamma}");
    within("springs, drop over reach", way.z / (way.x + 0.5 * h), elastica::drop_over_reach(gamma));
    // The strip of the card.
    for gamma in [1.0, 8.0, 30.0] {
        let strip = cantilever::hang(AREA_DENSITY * GRAVITY * 1e-3 / gamma, 0.1, 20).unwrap();
        within("strip, drop over reach", strip.slope().tan(), elastica::drop_over_reach(gamma));
    }
    // It bends alike in every direction, which grids of like diagonals do not.
    let lattice = Lattice { columns: 21, rows: 21, closed: false };
    let plate = Plate { membrane: [100.0; 2], shear: 50.0, bending: [1e-5; 2] };
    let mesh = lattice.mesh(|c, r| DVec2::new(c as f64, r as f64) * 0.01);
    let (cloth, stiffness) = lattice.cloth(&mesh, &plate);
    let bent = |[xx, yy, xy]: [f64; 3]| -> Positions {
        let height = |p: &DVec3| 0.5 * (xx * p.x * p.x + yy * p.y * p.y) + xy * p.x * p.y;
        mesh.positions.iter().map(|p| p.with_z(height(p))).collect()
    };
    let energy = |curvatures: [f64; 3]| cloth.energy(&stiffness, &bent(curvatures)).bend;
    let along = energy([0.01, 0.0, 0.0]) * 20.0 / 19.0;
    for twist in [0.005, -0.005] {
        // Straight hinges miss half a cell at each border, diagonal ones do not.
        within("bias", energy([0.005, 0.005, twist]), along * 0.5 * (1.0 + 19.0 / 20.0));
    }
}
