//! Frames mirrored in depth: what the same image would show as well.
//!
//! Lengths that are seen from the front do not tell a sheet from its mirror image behind a plane across the view: bends change sign, or
//! the tilt of the whole sheet, or both. Perspective, light, outline and time tell them apart, but no gradient leads from one to the other.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::settle::settled;
use super::{Positions, Problem, apart};
use crate::math::factor::Scratch;

/// Movement between frames, as a fraction of the sheet's size, from which on inertia does not tell a frame from its mirror image.
const FAST: f64 = 0.03;

/// What is mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// Bends, about the sheet's mean plane.
    Relief,
    /// The tilt of that plane.
    Tilt,
    Both,
}

const PARTS: [Part; 3] = [Part::Relief, Part::Tilt, Part::Both];

impl Problem<'_> {
    /// `frames` with each one that moves fast mirrored and fitted by itself, the others as they are, shape [3, N, V].
    pub(super) fn mirrored(&self, frames: &[Positions]) -> Vec<Vec<Positions>> {
        let fast = fast(frames, self.scene.template.area().sqrt());
        let places: Vec<(Part, usize)> =
            PARTS.iter().flat_map(|part| fast.iter().map(|n| (*part, *n))).collect();
        let fitted: Vec<Positions> = (places.par_iter())
            .map_init(
                || (self.settling(), Scratch::default()),
                |(levels, scratch), (part, n)| {
                    settled(levels, *n, &mirror(*part, &frames[*n]), &frames[*n], scratch)
                },
            )
            .collect();
        let mut sides = vec![frames.to_vec(); PARTS.len()];
        for (k, ((_, n), x)) in places.iter().zip(fitted).enumerate() {
            sides[k / fast.len()][*n] = x;
        }
        sides
    }
}

/// Frames before or after which the vertices move by more than [`FAST`] of the sheet's `size` `[m]`, root mean square; not the first,
/// which is known.
fn fast(frames: &[Positions], size: f64) -> Vec<usize> {
    let moves = |n: usize| apart(&frames[n - 1], &frames[n]) > FAST * size;
    (1..frames.len()).filter(|n| moves(*n) || (n + 1 < frames.len() && moves(n + 1))).collect()
}

/// `x` with the depths of `part` mirrored along the view rays: every vertex keeps its place in the image.
fn mirror(part: Part, x: &[DVec3]) -> Positions {
    let plane = mean_plane(x);
    let mean = x.iter().map(|p| p.z).sum::<f64>() / x.len() as f64;
    let of = |p: &DVec3| {
        let on_plane = plane.dot(DVec3::new(p.x / p.z, p.y / p.z, 1.0));
        // Inverse depths are linear in the image of a plane.
        let (plane, relief) = (1.0 / on_plane, p.z - 1.0 / on_plane);
        let z = match part {
            Part::Relief => plane - relief,
            Part::Tilt => 2.0 * mean - plane + relief,
            Part::Both => 2.0 * mean - p.z,
        };
        *p * (z / p.z)
    };
    x.iter().map(of).collect()
}

/// The plane a u + b v + c = 1/z through points (u z, v z, z), least squares of the inverse depths: (a, b, c).
fn mean_plane(x: &[DVec3]) -> DVec3 {
    let (mut matrix, mut rhs) = (DMat3::ZERO, DVec3::ZERO);
    for p in x {
        let row = DVec3::new(p.x / p.z, p.y / p.z, 1.0);
        matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        rhs += row / p.z;
    }
    matrix.inverse() * rhs
}

#[cfg(test)]
mod tests {
    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use crate::sim::Cloth;

    /// Tilted and bent, each point along its ray.
    fn bent(x: &[DVec3]) -> Positions {
        x.iter().map(|p| *p * (1.0 + 0.3 * p.x - 0.1 * p.y + 2.0 * p.x * p.x)).collect()
    }

    fn off(a: &[DVec3], b: &[DVec3]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    #[test]
    fn mirror_images_keep_their_place_in_the_image() {
        let scene = still();
        let x = bent(&scene.template.positions);
        for part in PARTS {
            let mirrored = mirror(part, &x);
            let moved = x.iter().zip(&mirrored).map(|(a, b)| {
                assert!((*a / a.z).distance(*b / b.z) < 1e-12);
                (a.z - b.z).abs()
            });
            assert!(moved.fold(0.0, f64::max) > 5e-3, "{part:?} moves nothing");
        }
        assert!(off(&mirror(Part::Both, &mirror(Part::Both, &x)), &x) < 1e-12);
        // A plane has no relief.
        let plane: Positions = scene.template.positions.iter().map(|p| *p / (1.0 + 0.3 * p.x)).collect();
        assert!(off(&mirror(Part::Relief, &plane), &plane) < 1e-12);
    }

    #[test]
    fn the_right_one_is_among_the_mirror_images() {
        let mut scene = still();
        let right = bent(&scene.template.positions);
        scene.template.positions.clone_from(&right);
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        for (k, part) in PARTS.into_iter().enumerate() {
            let mut frames = vec![right.clone(); 4];
            frames[2] = mirror(part, &right);
            let sides = problem.mirrored(&frames);
            let found = off(&sides[k][2], &right);
            println!("{part:?}: {} m off before, {found} after", off(&frames[2], &right));
            assert_eq!(sides[k][0], right);
            assert!(found < 0.2 * off(&frames[2], &right));
        }
    }
}
