//! Stiffnesses per width of the cloth: what the springs' own numbers mean whatever the mesh.
//!
//! A sheet that is bent to a cylinder of curvature κ, stretched by ε, or sheared by γ holds, per area A,
//!
//!   ½ D κ²,   ½ E ε²,   ½ G γ²,
//!
//! with the bending stiffness D [N·m], the membrane stiffness E and the shear stiffness G [N/m]. Springs do the same,
//! with the mean ℓ of a bending pair's arms and the length l of an edge, which make an angle α with the direction,
//! and with α and β of both arms of a shearing pair:
//!
//!   D = Σ B s ℓ² cos⁴α/A′,   E = Σ Y l² cos⁴α/A,   G = Σ S ¼ (cos 2α − cos 2β)²/A + Σ Y l² cos²α sin²α/A
//!
//! (in a mesh with quads, whose threads turn by half of γ and are not strained, G = Σ S/A);
//! on a regular grid of steps a along and b across D = B s a/b, E = Y a/b, G = 4 S/(a b), of many cells. The ends
//! of rows have no pair and do not bend: A′ is smaller than A by as much as pairs along the direction are shorter
//! than edges, together. All this is exact where every part of the sheet strains alike; uneven meshes give way.
//!
//! Bending pairs are soft while they are nearly straight: an angle φ has the moment B (θ − R) dθ/dφ = B s φ with
//! θ ≈ √(R² + φ²), the angle at rest R, and the secant s(φ) = 1 − R/√(R² + φ²). R is θ₀ = 8.1° where the pair is
//! straight; one that has a kink φ₀ in the plane has R² = θ₀² + φ₀², and the angle Φ between its arms has φ² = Φ² −
//! φ₀². What counts is the mean of s over the angles that the cloth has, weighted by φ²: that of the sheet of
//! constant D whose moments do the same work. All is in proportion to the area density, which is assumed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::angle::angle;
use super::cloth::{AREA_DENSITY, Cloth, arms};
use super::flat::panel;
use tessuto_core::mesh::{Mesh, Positions};

/// Stiffnesses of a sheet of [`AREA_DENSITY`], warp along u and weft along v of the texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerWidth {
    /// D of warp and weft [N·m].
    pub bending: [f64; 2],
    /// G [N/m].
    pub shear: f64,
    /// E of warp and weft [N/m].
    pub membrane: [f64; 2],
    /// Angle φ of the bending pairs `[rad]` at which they have D.
    pub bent: f64,
    /// What all of it is in proportion to [kg/m²].
    pub area_density: f64,
}

/// Stiffnesses per width of `cloth`, whose template is `template`, with `stiffness` stretch [N/m], bend and shear
/// [J/rad²], as bent in `frames`, shape [N, V] `[m]`. `None` where the texture coordinates are no flat panel.
pub fn per_width(
    cloth: &Cloth,
    template: &Mesh,
    stiffness: [f64; 3],
    frames: &[Positions],
) -> Option<PerWidth> {
    let flat = panel(template)?;
    let area = cloth.masses.iter().sum::<f64>() / AREA_DENSITY;
    let [stretch, bend, shear] = stiffness;
    let secant = mean_secant(cloth, frames);
    // cos² of the angles with both directions.
    let squares = |d: DVec3| {
        let all = d.length_squared().max(f64::MIN_POSITIVE);
        [d.x * d.x / all, d.y * d.y / all]
    };
    let (mut bending, mut membrane) = ([0.0; 2], [0.0; 2]);
    // Of pairs and of edges, along both directions.
    let (mut pairs_along, mut edges_along) = ([f64::MIN_POSITIVE; 2], [0.0; 2]);
    for pair in &cloth.bends {
        let [u, w] = arms(&flat, pair.vertices);
        let length = 0.5 * (u.length() + w.length());
        for (k, square) in squares(u + w).into_iter().enumerate() {
            bending[k] += bend * secant * length * length * square * square / area;
            pairs_along[k] += length * square * square;
        }
    }
    // Where faces are triangles edges brace them; elsewhere threads keep their lengths and turn by half of γ.
    let braced = template.faces.iter().all(|f| f.vertices.len() == 3);
    let mut by_shear = 0.0;
    for edge in &cloth.edges {
        let e = edge.along(&flat);
        let [x, y] = squares(e);
        for (k, square) in [x, y].into_iter().enumerate() {
            membrane[k] += stretch * e.length_squared() * square * square / area;
            edges_along[k] += e.length() * square * square;
        }
        if braced {
            by_shear += stretch * e.length_squared() * x * y / area;
        }
    }
    for pair in &cloth.shears {
        let [of_u, of_w] = arms(&flat, pair.vertices).map(|d| squares(d)[0] - squares(d)[1]);
        let square = if braced { 0.25 * (of_u - of_w) * (of_u - of_w) } else { 1.0 };
        by_shear += shear * square / area;
    }
    for k in 0..2 {
        bending[k] *= (edges_along[k] / pairs_along[k]).max(1.0);
    }
    Some(PerWidth { bending, shear: by_shear, membrane, bent: angle_of(secant), area_density: AREA_DENSITY })
}

/// Bending length c = (D/(ρ g))^⅓ `[m]` of a bending stiffness [N·m] at an area density [kg/m²]: that of a strip
/// that bends under its own weight by a fixed angle, as in BS 3356.
pub fn bending_length(bending: f64, density: f64) -> f64 {
    const GRAVITY: f64 = 9.81;
    (bending / (density * GRAVITY)).cbrt()
}

/// θ₀.
fn angle_of_straight() -> f64 {
    angle(DVec3::X, DVec3::X)
}

/// s of an angle φ of a pair that has the angle `rest` at rest.
fn secant_from(rest: f64, phi: f64) -> f64 {
    1.0 - rest / rest.hypot(phi)
}

/// Mean of s over the bending pairs of `frames`, weighted by φ².
fn mean_secant(cloth: &Cloth, frames: &[Positions]) -> f64 {
    let straight = angle_of_straight();
    let (mut work, mut squares) = (0.0, f64::MIN_POSITIVE);
    for x in frames {
        for pair in &cloth.bends {
            let [u, w] = arms(x, pair.vertices);
            let between = u.angle_between(w);
            let kink = (pair.rest_angle * pair.rest_angle - straight * straight).max(0.0);
            let square = (between * between - kink).max(0.0);
            work += secant_from(pair.rest_angle, square.sqrt()) * square;
            squares += square;
        }
    }
    work / squares
}

/// φ of a secant s.
fn angle_of(secant: f64) -> f64 {
    angle_of_straight() * ((1.0 - secant).powi(-2) - 1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textile::elastica::gamma_of;
    use crate::{Integrator, State, StepSettings, Stiffness, TiedCloth};
    use glam::DVec2;
    use tessuto_core::math::factor::Scratch;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    const K: [f64; 3] = [80.0, 2e-3, 3e-4];

    /// s of a pair that is straight at rest.
    fn secant(phi: f64) -> f64 {
        secant_from(angle_of_straight(), phi)
    }

    fn strip(columns: usize, rows: usize, size: DVec2) -> (Mesh, Cloth) {
        let mesh = grid(columns, rows, size, 0.0);
        let cloth = Cloth::new(&mesh);
        (mesh, cloth)
    }

    #[test]
    fn a_cylinder_a_longer_and_a_sheared_sheet_hold_their_energies() {
        let (mesh, cloth) = strip(31, 21, DVec2::new(0.45, 0.2));
        let area = 0.45 * 0.2;
        let stiffness = Stiffness::uniform(&cloth, K);
        // Both ways round; angles of 6° and 4°, where the secant differs.
        for (axis, curvature) in [(0, 7.0), (1, 7.0)] {
            let round = |p: &DVec3| {
                let s = p[axis] * curvature;
                let mut out = *p;
                out[axis] = s.sin() / curvature;
                out.z = (1.0 - s.cos()) / curvature;
                out
            };
            let bent: Positions = mesh.positions.iter().map(round).collect();
            let arc = [0.015, 0.01][axis];
            let widths = per_width(&cloth, &mesh, K, std::slice::from_ref(&bent)).unwrap();
            // The pairs across are straight and do not count.
            assert!((widths.bent / (curvature * arc) - 1.0).abs() < 0.05, "{}", widths.bent);
            // The energy of a spring that is soft at first is half of moment times angle for its own secant only
            // nearly.
            let own = widths.bending[axis] * secant(curvature * arc) / secant(widths.bent);
            let moment = moment_of(curvature * arc) * K[1] / arc * [0.015 / 0.01, 0.01 / 0.015][axis] * arc;
            // The rows at the border bend as the others do, and have half of the width.
            let rows = [21.0 / 20.0, 31.0 / 30.0][axis];
            let expected = rows * moment / (curvature * arc);
            assert!((own / expected - 1.0).abs() < 0.015, "axis {axis}: {own} {expected}");
            assert!(cloth.energy(&stiffness, &bent).bend > 0.0);
        }
        let widths = per_width(&cloth, &mesh, K, &[]).unwrap();
        let longer: Positions = mesh.positions.iter().map(|p| DVec3::new(p.x * 1.01, p.y, p.z)).collect();
        let energy = cloth.energy(&stiffness, &longer).stretch;
        assert!((energy / (0.5 * widths.membrane[0] * 1e-4 * area) - 1.0).abs() < 0.01);
        let sheared: Positions =
            mesh.positions.iter().map(|p| DVec3::new(p.x + 0.3 * p.y, p.y, p.z)).collect();
        let energy = cloth.energy(&stiffness, &sheared).shear;
        let angle = 0.3f64.atan();
        let ratio = energy / (0.5 * widths.shear * angle * angle * area);
        assert!((ratio - 1.0).abs() < 0.05, "shear {ratio}");
    }

    /// θ − θ₀ times dθ/dφ, by a difference.
    fn moment_of(phi: f64) -> f64 {
        let at = |phi: f64| {
            let theta = angle(DVec3::X, DVec3::new(phi.cos(), phi.sin(), 0.0));
            0.5 * (theta - angle_of_straight()).powi(2)
        };
        (at(phi + 1e-5) - at(phi - 1e-5)) / 2e-5
    }

    /// `cloth` of stiffnesses `k` at rest under gravity `g`, with `held` vertices.
    fn at_rest(cloth: &Cloth, k: [f64; 3], x: &[DVec3], held: &[usize], g: DVec3) -> Positions {
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 0.02,
            damping: 0.7,
            tolerance: 1e-10,
            newton_limit: 200,
        };
        let mut ties = vec![0.0; x.len()];
        held.iter().for_each(|v| ties[*v] = 1e5);
        let tied = TiedCloth::new(cloth, &ties, &settings);
        let stiffness = Stiffness::uniform(cloth, k);
        let mut state = State { x: x.to_vec(), v: vec![DVec3::ZERO; x.len()] };
        for _ in 0..400 {
            state = tied.step(&stiffness, state, x, |_| g, &mut Scratch::default()).unwrap().after;
        }
        state.x
    }

    #[test]
    fn a_hanging_strip_grows_by_its_weight() {
        let (mesh, cloth) = strip(4, 41, DVec2::new(0.03, 0.4));
        let x = at_rest(&cloth, K, &mesh.positions, &[0, 1, 2, 3], DVec3::Y * 9.81);
        let widths = per_width(&cloth, &mesh, K, &[]).unwrap();
        let grown = x[4 * 40].y - mesh.positions[4 * 40].y;
        // ρ g L²/(2 E)
        let expected = AREA_DENSITY * 9.81 * 0.4 * 0.4 / (2.0 * widths.membrane[1]);
        println!("grown by {grown:.3e} m, expected {expected:.3e} m");
        assert!((grown / expected - 1.0).abs() < 0.02, "{grown} {expected}");
    }

    #[test]
    fn a_cantilever_bends_as_its_weight_and_bending_stiffness_say() {
        let (length, step) = (0.1, 0.01);
        let (mesh, cloth) = strip(13, 5, DVec2::new(0.12, 0.04));
        // The first two columns and a half are clamped: the strip leaves straight.
        let held: Vec<usize> = (0..65).filter(|v| v % 13 < 3).collect();
        let x = at_rest(&cloth, K, &mesh.positions, &held, DVec3::Z * 9.81);
        let middle: Vec<DVec3> = (2..13).map(|c| x[2 * 13 + c]).collect();
        // The elastica from its free end: at each vertex D φ/step times the width is the moment of the weight beyond.
        let weight = AREA_DENSITY * 9.81;
        let mut worst = 0.0f64;
        for k in 1..6 {
            let phi = (middle[k] - middle[k - 1]).angle_between(middle[k + 1] - middle[k]);
            let moment: f64 = (k + 1..middle.len())
                .map(|j| {
                    let share = if j + 1 == middle.len() { 0.5 } else { 1.0 };
                    share * weight * step * (middle[j].x - middle[k].x)
                })
                .sum();
            let of_angle = {
                let bent: Positions = (0..65)
                    .map(|v| {
                        let s = (v % 13) as f64 * phi;
                        let r = step / phi;
                        DVec3::new(r * s.sin(), mesh.positions[v].y, r * (1.0 - s.cos()))
                    })
                    .collect();
                let widths = per_width(&cloth, &mesh, K, &[bent]).unwrap();
                widths.bending[0] * secant(phi) / secant(widths.bent)
            };
            worst = worst.max((of_angle * phi / step / moment - 1.0).abs());
        }
        let tip = middle[10].z - middle[0].z;
        println!("tip {tip:.4} m of {length} m down, moments within {worst:.3}");
        assert!(tip > 0.01 && worst < 0.12, "{tip} {worst}");
    }

    #[test]
    fn cantilevers_fall_to_the_master_curve() {
        // The pairs at the last held column bend over half a cell on both sides: there the strip begins.
        let half = 0.005;
        let length = 0.1f64 + half;
        let (mesh, cloth) = strip(13, 5, DVec2::new(0.12, 0.04));
        let held: Vec<usize> = (0..65).filter(|v| v % 13 < 3).collect();
        for bend in [4e-3, 1e-3, 2e-4] {
            let k = [800.0, bend, K[2]];
            let x = at_rest(&cloth, k, &mesh.positions, &held, DVec3::Z * 9.81);
            let bending = per_width(&cloth, &mesh, k, std::slice::from_ref(&x)).unwrap().bending[0];
            let gamma = AREA_DENSITY * 9.81 * length.powi(3) / bending;
            let tip = x[2 * 13 + 12] - x[2 * 13 + 2];
            let drop = tip.z / (tip.x + half);
            let by_curve = gamma_of(drop);
            println!("drop over reach {drop:.3}: Γ {by_curve:.2} by the curve, {gamma:.2} by D");
            assert!(drop > 0.2 && (by_curve / gamma).ln().abs() < 1.06f64.ln(), "{by_curve} {gamma}");
        }
    }

    #[test]
    fn an_uneven_sheet_on_a_cylinder_has_the_moment_of_its_bending_stiffness() {
        // Its threads have kinks in the plane, which hide an angle out of it.
        let (mut mesh, curvature) = (grid(21, 21, DVec2::splat(0.2), 0.0), 20.0);
        let mut rng = Rng::new(11, 0);
        for (v, p) in mesh.positions.iter_mut().enumerate() {
            if (1..20).contains(&(v % 21)) && (1..20).contains(&(v / 21)) {
                *p += DVec3::new(rng.signed(), rng.signed(), 0.0) * 0.0025;
            }
        }
        mesh.uvs = mesh.positions.iter().map(|p| DVec2::new(p.x, p.y)).collect();
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, K);
        let round = |curvature: f64| -> Positions {
            let of = |p: &DVec3| {
                let phi = p.x * curvature;
                DVec3::new(phi.sin() / curvature, p.y, (1.0 - phi.cos()) / curvature)
            };
            mesh.positions.iter().map(of).collect()
        };
        let energy = |c: f64| cloth.energy(&stiffness, &round(c)).bend;
        let moment = (energy(curvature * 1.001) - energy(curvature * 0.999)) / (0.002 * curvature);
        let told = per_width(&cloth, &mesh, K, &[round(curvature)]).unwrap().bending[0];
        // The halves of the cells at both ends do not bend.
        let own = told * curvature * 0.2 * 0.19;
        assert!((moment / own - 1.0).abs() < 0.05, "{moment} {own}");
    }
}
