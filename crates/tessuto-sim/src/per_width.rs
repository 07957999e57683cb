//! Stiffnesses per width of the cloth: what the springs' own numbers mean whatever the mesh.
//!
//! A sheet that is bent to a cylinder of curvature κ, stretched by ε, or sheared by γ holds, per area A,
//!
//!   ½ D κ²,   ½ E ε²,   ½ G γ²,
//!
//! with the bending stiffness D [N·m], the membrane stiffness E and the shear stiffness G [N/m]. Springs that lie
//! along the direction do the same, with the mean ℓ of a bending pair's arms and the length l of an edge:
//!
//!   D = Σ B s ℓ²/A, E = Σ Y l²/A, G = Σ S/A; on a regular grid of steps a along and b across D = B s a/b, E = Y
//!   a/b, G = 4 S/(a b).
//!
//! Bending pairs are soft while they are nearly straight: an angle φ has the moment B (θ − θ₀) dθ/dφ = B s φ with
//! θ ≈ √(θ₀² + φ²), θ₀ = 8.1°, and the secant s(φ) = 1 − θ₀/√(θ₀² + φ²). What counts is its mean over the angles
//! that the cloth has, weighted by φ²: that of the sheet of constant D whose moments do the same work. All is in
//! proportion to the area density, which is assumed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::angle::angle;
use super::cloth::{AREA_DENSITY, Cloth, arms};
use super::flat::panel;
use tessuto_core::mesh::{Mesh, Positions};

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
    Some(PerWidth { bending, shear, membrane, bent: angle_of(secant), area_density: AREA_DENSITY })
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

/// s of an angle φ.
fn secant(phi: f64) -> f64 {
    let still = angle_of_straight();
    1.0 - still / still.hypot(phi)
}

/// Mean of s over the bending pairs of `frames`, weighted by φ².
fn mean_secant(cloth: &Cloth, frames: &[Positions]) -> f64 {
    let (mut work, mut squares) = (0.0, f64::MIN_POSITIVE);
    for x in frames {
        for pair in &cloth.bends {
            let [u, w] = arms(x, pair.vertices);
            let phi = u.angle_between(w);
            work += secant(phi) * phi * phi;
            squares += phi * phi;
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
    use crate::{Integrator, State, StepSettings, Stiffness, TiedCloth};
    use glam::DVec2;
    use tessuto_core::math::factor::Scratch;
    use tessuto_core::mesh::grid;

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
            // The pairs across are straight and do not count.
            assert!((widths.bent / (curvature * arc) - 1.0).abs() < 0.05, "{}", widths.bent);
            // The energy of a spring that is soft at first is half of moment times angle for its own secant only
            // nearly.
            let own = widths.bending[axis] * secant(curvature * arc) / secant(widths.bent);
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

    /// How far the end of a heavy elastic strip hangs below its clamp, over how far it reaches out, at Γ = ρ g
    /// L³/D: θ″ = −Γ (1 − s) cos θ, θ(0) = 0, θ′(1) = 0, by shooting. To this curve all cantilevers fall (Romero
    /// et al., "Physical validation of simulators in computer graphics", 2021).
    fn master_curve(gamma: f64) -> f64 {
        const STEPS: usize = 400;
        let h = 1.0 / STEPS as f64;
        let bend = |s: f64, theta: f64| -gamma * (1.0 - s) * theta.cos();
        // (θ′, drop, reach) at the end for a curvature at the clamp.
        let shoot = |curvature: f64| {
            let (mut theta, mut rate, mut drop, mut reach) = (0.0f64, curvature, 0.0, 0.0);
            for k in 0..STEPS {
                // The midpoint rule.
                let s = k as f64 * h;
                let (middle, rate_there) = (theta + 0.5 * h * rate, rate + 0.5 * h * bend(s, theta));
                rate += h * bend(s + 0.5 * h, middle);
                theta += h * rate_there;
                drop += h * middle.sin();
                reach += h * middle.cos();
            }
            (rate, drop / reach)
        };
        let (mut low, mut high) = (0.0, gamma);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if shoot(middle).0 > 0.0 { high = middle } else { low = middle }
        }
        shoot(low).1
    }

    #[test]
    fn cantilevers_fall_to_the_master_curve() {
        // Of a light one the deflection is an eighth of Γ.
        assert!((master_curve(1e-3) / 1.25e-4 - 1.0).abs() < 1e-3, "{}", master_curve(1e-3));
        let length = 0.1f64;
        let (mesh, cloth) = strip(13, 5, DVec2::new(0.12, 0.04));
        let held: Vec<usize> = (0..65).filter(|v| v % 13 < 3).collect();
        for bend in [4e-3, 1e-3, 2e-4] {
            let k = [800.0, bend, K[2]];
            let x = at_rest(&cloth, k, &mesh.positions, &held, DVec3::Z * 9.81);
            let bending = per_width(&cloth, &mesh, k, std::slice::from_ref(&x)).unwrap().bending[0];
            let gamma = AREA_DENSITY * 9.81 * length.powi(3) / bending;
            let tip = x[2 * 13 + 12] - x[2 * 13 + 2];
            let drop = tip.z / tip.x;
            // The Γ of a strip that hangs as far.
            let (mut low, mut high) = (0.0, 100.0);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if master_curve(middle) > drop { high = middle } else { low = middle }
            }
            println!("drop over reach {drop:.3}: Γ {low:.2} by the curve, {gamma:.2} by D");
            assert!(drop > 0.2 && (low / gamma).ln().abs() < 1.25f64.ln(), "{low} {gamma}");
        }
    }
}
