//! A disc over a plate: the drape test of Cusick, ISO 9073-9 and BS 5058.
//!
//! A disc of fabric lies on a smaller plate, whose light from below throws the shadow of the hanging rim. The drape
//! coefficient is the shadow's ring over the flat ring, (shadow − plate)/(disc − plate): 1 for a board, near 0 for a
//! fabric without bending stiffness. Nodes are the folds.
//!
//! The ring is simulated as a continuum on a polar lattice whose inner rings are held. A triangle cannot bend, and a
//! sheet of stiff triangles would bend along the lattice only: membrane and shear stiffness are therefore lowered to
//! at most [`TENSION`] weights of the ring's width, where the ring grows by less than a percent. It is not prevented
//! from passing through itself.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::GRAVITY;
use super::plate::{Lattice, Plate, clamp};
use super::rest::{Search, at_rest};
use crate::cloth::AREA_DENSITY;
use tessuto_core::error::Result;
use tessuto_core::math::rng::Rng;

/// Radius of the plate `[m]`.
pub const PLATE: f64 = 0.09;
/// Radius of the disc `[m]`.
pub const DISC: f64 = 0.15;
/// Most tension per strain, in weights per width of the ring.
pub const TENSION: f64 = 200.0;
/// Cells along a radius and around.
const CELLS: [usize; 2] = [8, 96];
/// Bending lengths that are simulated `[m]`: shorter ones fold finer than the lattice, longer ones are a board. Others
/// count as the nearest of these; all measured fabrics lie between them.
const BENDING_LENGTHS: [f64; 2] = [4e-3, 0.5];
/// The sheet is not perfectly flat at first: random heights of this size `[m]`.
const UNEVEN: f64 = 5e-4;
/// A fold stands out by at least this fraction of the ring's width.
const FOLD: f64 = 0.05;

/// A draped disc.
#[derive(Debug, Clone, PartialEq)]
pub struct Drape {
    /// Fraction of the flat ring that the shadow covers.
    pub coefficient: f64,
    /// Number of folds.
    pub nodes: usize,
    /// The rim from above, around the plate's centre `[m]`.
    pub outline: Vec<DVec2>,
}

/// Drapes the disc of a fabric of `density` [kg/m²].
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] if the simulation is not finite.
pub fn drape(fabric: &Plate, density: f64) -> Result<Drape> {
    drape_of(fabric, density, CELLS)
}

/// [`drape`] with this many cells along a radius and around.
///
/// # Errors
/// As [`drape`].
pub fn drape_of(fabric: &Plate, density: f64, [rings, around]: [usize; 2]) -> Result<Drape> {
    let scale = AREA_DENSITY / density;
    let most = TENSION * AREA_DENSITY * GRAVITY * (DISC - PLATE);
    let [softest, stiffest] = BENDING_LENGTHS.map(|c| AREA_DENSITY * GRAVITY * c.powi(3));
    let soft = |k: f64| (k * scale).min(most);
    let plate = Plate {
        membrane: fabric.membrane.map(soft),
        shear: soft(fabric.shear),
        bending: fabric.bending.map(|d| (d * scale).clamp(softest, stiffest)),
    };
    let h = (DISC - PLATE) / rings as f64;
    // Ring 1 lies on the border of the plate.
    let radius = |ring: usize| PLATE + (ring as f64 - 1.0) * h;
    let point = |column: usize, ring: usize| {
        let angle = TAU * column as f64 / around as f64;
        DVec2::new(angle.cos(), angle.sin()) * radius(ring)
    };
    let lattice = Lattice { columns: around, rows: rings + 2, closed: true };
    let mesh = lattice.mesh(point);
    let (cloth, mut stiffness) = lattice.cloth(&mesh, &plate);
    let held: Vec<usize> = (0..2 * around).collect();
    clamp(&cloth, &held, &mut stiffness);
    let mut rng = Rng::new(1, 0);
    let mut uneven = mesh.positions.clone();
    uneven.iter_mut().skip(2 * around).for_each(|p| p.z += UNEVEN * rng.signed());
    let search = Search { swings: 100, steps: 150, still: 1e-5 };
    let x = at_rest(&cloth, &stiffness, &uneven, &held, DVec3::Z * GRAVITY, &search)?;
    let outline: Vec<DVec2> = x[(rings + 1) * around..].iter().map(|p| DVec2::new(p.x, p.y)).collect();
    // Both areas are those of polygons of as many corners.
    let polygon = 0.5 * around as f64 * (TAU / around as f64).sin();
    let [plate, disc] = [PLATE, DISC].map(|r| polygon * r * r);
    let coefficient = (shadow(&outline) - plate) / (disc - plate);
    let radii: Vec<f64> = outline.iter().map(|p| p.length()).collect();
    Ok(Drape { coefficient, nodes: nodes(&radii, FOLD * (DISC - PLATE)), outline })
}

/// Area of the outline's shadow around the plate, which covers what is nearer `[m²]`.
fn shadow(outline: &[DVec2]) -> f64 {
    let beyond = |p: &DVec2| *p * (PLATE / p.length().max(f64::MIN_POSITIVE)).max(1.0);
    let points: Vec<DVec2> = outline.iter().map(beyond).collect();
    let next = points.iter().cycle().skip(1);
    0.5 * points.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
}

/// Maxima of a closed curve of radii that stand out by more than `least` from the minima on both sides.
fn nodes(radii: &[f64], least: f64) -> usize {
    let Some(lowest) = (0..radii.len()).min_by(|a, b| radii[*a].total_cmp(&radii[*b])) else { return 0 };
    let (mut count, mut rising) = (0, true);
    let (mut low, mut high) = (radii[lowest], radii[lowest]);
    for k in 1..=radii.len() {
        let r = radii[(lowest + k) % radii.len()];
        if rising {
            high = high.max(r);
            if high - low > least && high - r > least {
                count += 1;
                (rising, low) = (false, r);
            }
        } else {
            low = low.min(r);
            if r - low > least {
                (rising, high) = (true, r);
            }
        }
        if rising {
            low = low.min(r);
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folds_are_counted_and_a_board_does_not_drape() {
        let wave = |k: f64, size: f64| -> Vec<f64> {
            (0..96).map(|i| 0.12 + size * (k * TAU * f64::from(i) / 96.0).cos()).collect()
        };
        assert_eq!(nodes(&wave(6.0, 0.02), 0.003), 6);
        assert_eq!(nodes(&wave(6.0, 0.001), 0.003), 0);
        let board = Plate { membrane: [1e4; 2], shear: 1e4, bending: [0.1; 2] };
        let flat = drape_of(&board, 0.2, [4, 48]).unwrap();
        assert!(flat.coefficient > 0.99 && flat.nodes == 0, "{} {}", flat.coefficient, flat.nodes);
        // What is softer than any fabric hangs down, and the simulation ends.
        let nothing = drape_of(&Plate { bending: [1e-15; 2], ..board }, 0.2, [4, 48]).unwrap();
        assert!((0.0..0.2).contains(&nothing.coefficient), "{}", nothing.coefficient);
    }

    #[test]
    fn softer_fabric_hangs_lower_in_folds() {
        let of = |bending: f64| {
            let fabric = Plate { membrane: [300.0; 2], shear: 30.0, bending: [bending; 2] };
            drape_of(&fabric, 0.15, [6, 72]).unwrap()
        };
        let (soft, stiff) = (of(5e-6), of(5e-5));
        println!("{:.3} {} · {:.3} {}", soft.coefficient, soft.nodes, stiff.coefficient, stiff.nodes);
        assert!(soft.coefficient < stiff.coefficient && stiff.coefficient < 1.0);
        assert!(soft.nodes >= 3, "{}", soft.nodes);
    }
}
