//! Stiffnesses per width of the cloth: what the springs' own numbers mean whatever the mesh.
//!
//! A sheet that is bent to a cylinder of curvature κ, stretched by ε, or sheared by γ holds, per area A,
//!
//!   ½ D κ²,   ½ E ε²,   ½ G γ²,
//!
//! with the bending stiffness D [N·m], the membrane stiffness E and the shear stiffness G [N/m]. Springs that lie along the direction do
//! the same, with the mean ℓ of a bending pair's arms and the length l of an edge:
//!
//!   D = Σ B s ℓ²/A,   E = Σ Y l²/A,   G = Σ S/A;   on a regular grid of steps a along and b across D = B s a/b, E = Y a/b, G = 4 S/(a b).
//!
//! Bending pairs are soft while they are nearly straight: an angle φ has the moment B (θ − θ₀) dθ/dφ with θ ≈ √(θ₀² + φ²), θ₀ = 8.1°. What counts
//! is the secant s = 1 − θ₀/√(θ₀² + φ²) at the angles that the cloth has. All is in proportion to the area density, which is assumed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::angle::angle;
use super::cloth::{AREA_DENSITY, Cloth, arms};
use super::flat::panel;
use crate::mesh::{Mesh, Positions};

/// An edge or pair lies along a direction if it leaves it by less than this part of its length.
const ALONG: f64 = 0.5;

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
    /// Typical angle φ of the bending pairs `[rad]`, for which D holds.
    pub bent: f64,
    /// What all of it is in proportion to [kg/m²].
    pub area_density: f64,
}

/// Stiffnesses per width of `cloth`, whose template is `template`, with `stiffness` stretch [N/m], bend and shear [J/rad²], as bent in
/// `frames`, shape [N, V] `[m]`. `None` where the texture coordinates are no flat panel.
pub fn per_width(
    cloth: &Cloth,
    template: &Mesh,
    stiffness: [f64; 3],
    frames: &[Positions],
) -> Option<PerWidth> {
    let flat = panel(template)?;
    let area = cloth.masses.iter().sum::<f64>() / AREA_DENSITY;
    let [stretch, bend, shear] = stiffness;
    let bent = typical_angle(cloth, frames);
    let still = angle(DVec3::X, DVec3::X);
    let secant = 1.0 - still / still.hypot(bent);
    let direction = |d: DVec3| match d.abs() {
        d if d.y < ALONG * d.x => Some(0),
        d if d.x < ALONG * d.y => Some(1),
        _ => None,
    };
    let (mut bending, mut membrane) = ([0.0; 2], [0.0; 2]);
    for pair in &cloth.bends {
        let [u, w] = arms(&flat, pair.vertices);
        if let Some(k) = direction(u + w) {
            bending[k] += bend * secant * (0.5 * (u.length() + w.length())).powi(2) / area;
        }
    }
    for edge in &cloth.edges {
        let e = edge.along(&flat);
        if let Some(k) = direction(e) {
            membrane[k] += stretch * e.length_squared() / area;
        }
    }
    let shear = shear * cloth.shears.len() as f64 / area;
    Some(PerWidth { bending, shear, membrane, bent, area_density: AREA_DENSITY })
}

/// Bending length c = (D/(ρ g))^⅓ `[m]` of a bending stiffness [N·m] at an area density [kg/m²]: that of a strip that bends under its own weight
/// by a fixed angle, as in BS 3356.
pub fn bending_length(bending: f64, density: f64) -> f64 {
    const GRAVITY: f64 = 9.81;
    (bending / (density * GRAVITY)).cbrt()
}

/// Root mean square deflection of the bending pairs, without what straight ones have.
fn typical_angle(cloth: &Cloth, frames: &[Positions]) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for x in frames {
        for pair in &cloth.bends {
            let [u, w] = arms(x, pair.vertices);
            sum += u.angle_between(w).powi(2);
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::factor::Scratch;
    use crate::mesh::grid;
    use crate::sim::{Integrator, State, StepSettings, Stiffness, TiedCloth};
    use glam::DVec2;

    const K: [f64; 3] = [80.0, 2e-3, 3e-4];

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
            // Half of the pairs are straight.
            assert!((widths.bent * 2f64.sqrt() / (curvature * arc) - 1.0).abs() < 0.05, "{}", widths.bent);
            let at = |angle: f64| {
                let still = angle_of_straight();
                1.0 - still / still.hypot(angle)
            };
            // The energy of a spring that is soft at first is half of moment times angle for its own secant only nearly.
            let own = widths.bending[axis] * at(curvature * arc) / at(widths.bent);
            let moment = moment_of(curvature * arc) * K[1] / arc * [0.015 / 0.01, 0.01 / 0.015][axis] * arc;
            let expected = moment / (curvature * arc);
            assert!((own / expected - 1.0).abs() < 0.06, "axis {axis}: {own} {expected}");
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

    fn angle_of_straight() -> f64 {
        angle(DVec3::X, DVec3::X)
    }

    /// θ − θ₀ times dθ/dφ, by a difference.
    fn moment_of(phi: f64) -> f64 {
        let at = |phi: f64| {
            let theta = angle(DVec3::X, DVec3::new(phi.cos(), phi.sin(), 0.0));
            0.5 * (theta - angle_of_straight()).powi(2)
        };
        (at(phi + 1e-5) - at(phi - 1e-5)) / 2e-5
    }

    /// `cloth` at rest under gravity `g`, with `held` vertices.
    fn at_rest(cloth: &Cloth, x: &[DVec3], held: &[usize], g: DVec3) -> Positions {
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
        let stiffness = Stiffness::uniform(cloth, K);
        let mut state = State { x: x.to_vec(), v: vec![DVec3::ZERO; x.len()] };
        for _ in 0..400 {
            state = tied.step(&stiffness, state, x, |_| g, &mut Scratch::default()).unwrap().after;
        }
        state.x
    }

    #[test]
    fn a_hanging_strip_grows_by_its_weight() {
        let (mesh, cloth) = strip(4, 41, DVec2::new(0.03, 0.4));
        let x = at_rest(&cloth, &mesh.positions, &[0, 1, 2, 3], DVec3::Y * 9.81);
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
        let x = at_rest(&cloth, &mesh.positions, &held, DVec3::Z * 9.81);
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
                // Straight pairs across halve the mean square.
                let widths = per_width(&cloth, &mesh, K, &[bent]).unwrap();
                let still = angle_of_straight();
                let secant = |a: f64| 1.0 - still / still.hypot(a);
                widths.bending[0] * secant(phi) / secant(widths.bent)
            };
            worst = worst.max((of_angle * phi / step / moment - 1.0).abs());
        }
        let tip = middle[10].z - middle[0].z;
        println!("tip {tip:.4} m of {length} m down, moments within {worst:.3}");
        assert!(tip > 0.01 && worst < 0.12, "{tip} {worst}");
    }
}
