//! How long one unit of the camera's path is, where its lengths have none.
//!
//! Poses that were found from images alone have no unit. The images of the sheet do not depend on it either: where
//! the sheet is, seen from the camera, its own size tells, and a path of another length only carries it elsewhere in
//! the world, X_nv(s) = x_nv + s C_n with the camera's place C_n. But something of most sheets stands still in the
//! world, or nearly: what is held. So the sheet is followed, and s is the one for which
//!
//!   Σ_v r_v² / (r_v² + ε²), r_v² = mean over n of ‖(x_nv − x_0v) + s (C_n − C_0)‖²,
//!
//! is lowest: vertices that come to rest count, by how far they do not, and those that move anyway do not. What rest
//! is, the vertex tells that rests best: ε is its r. By how much that does not rest is also how well s is known. No
//! edge is held still while it is looked for: what is held rests with any length that it is held with.

use glam::DVec3;

use super::{Positions, Problem, SpacetimeSettings};
use crate::session::Session;
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::scene::{PoseUnit, Scene, View};
use tessuto_sim::Cloth;

/// Least ε, of the sheet's size: what is followed is not followed better.
const REST: f64 = 2e-4;
/// A length that nothing of the sheet tells is used, too, if it leaves the camera's place uncertain by less than this
/// part of the sheet's size: a hand that shakes.
const SHORT: f64 = 0.02;
/// Spread of vertices that stand still `[m]`: they are not held.
const NOT_HELD: f64 = 1e6;
/// How often the sheet is followed, from then on with the path's length found so far; in the end it is refined, too.
const PASSES: usize = 2;
/// Rounds of weights.
const ROUNDS: usize = 50;

/// A length, and its standard deviation by how far the vertex moves that moves least `[m]`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Length {
    metres: f64,
    sd: f64,
}

impl Length {
    /// Whether the unit of the camera's `path` is known, or the path so short that a sheet of this `size` `[m]` is
    /// where it is anyway.
    fn serves(self, path: &[DVec3], size: f64) -> bool {
        let squares = path.iter().map(|c| c.distance_squared(path[0]));
        let reach = (squares.sum::<f64>() / path.len() as f64).sqrt();
        self.metres > 0.0 && (self.sd < self.metres || self.sd * reach < SHORT * size)
    }
}

/// `scene` with the poses of its camera in metres.
///
/// # Errors
/// [`Error::Input`] for a camera that does not move, and a sheet that is lost; those of following it.
pub fn scaled(scene: &Scene, cloth: &Cloth, settings: &SpacetimeSettings) -> Result<Scene> {
    let refused = |problem: &str| {
        let hint = Hint::from("give the metres in one unit of its poses").with(Remedy::PoseScale);
        Error::input("the length of the camera's path", problem, hint)
    };
    let poses = scene.poses.as_deref().ok_or_else(|| refused("cannot be found: the camera stands still"))?;
    let with = |Length { metres: length, sd }: Length| {
        let pose = |pose: &Pose| Pose { translation: pose.translation * length, ..*pose };
        let of_all = |poses: &[Pose]| -> Vec<Pose> { poses.iter().map(pose).collect() };
        let more = scene.more.iter().map(|view| View { poses: of_all(&view.poses), ..view.clone() });
        let (poses, more) = (Some(of_all(poses)), more.collect());
        Scene { poses, more, pose_unit: PoseUnit::Found { length, sd }, ..scene.clone() }
    };
    let path: Vec<DVec3> = poses.iter().map(|pose| pose.in_world(DVec3::ZERO)).collect();
    let settings = SpacetimeSettings { still: NOT_HELD, ..settings.clone() };
    let mut found = Length { metres: 0.0, sd: 0.0 };
    for pass in 0..PASSES {
        // By the first camera alone: until the unit is known, others would see the sheet elsewhere. Of a long clip by
        // what is searched together.
        let moved = Scene { more: Vec::new(), ..with(found) };
        let moved = moved.span(0..scene.frames.len().min(settings.window));
        let mut problem = Problem::new(&moved, cloth, settings.clone())?;
        let (mut pool, lost) = problem.track(&mut Session::silent())?;
        if let Some(lost) = lost {
            return Err(refused(&format!("cannot be found: the sheet is lost, {lost}")));
        }
        let frames = match pass + 1 == PASSES {
            true => problem.refine(&mut pool, &mut Session::silent())?.0,
            false => pool.best,
        };
        let more = best(&frames, &path[..frames.len()], scene.template.area().sqrt());
        found = Length { metres: found.metres + more.metres, ..more };
    }
    let Length { metres, sd } = found;
    if !found.serves(&path, scene.template.area().sqrt()) {
        return Err(refused(&format!("is {metres:.3} ± {sd:.3} m a unit: nothing of the sheet rests")));
    }
    Ok(with(found))
}

/// What is to be added to the length that `frames` were followed with, of a sheet of this `size` `[m]`.
fn best(frames: &[Positions], path: &[DVec3], size: f64) -> Length {
    let count = frames.len() as f64;
    let ways: Vec<DVec3> = path.iter().map(|c| *c - path[0]).collect();
    let c = ways.iter().map(|way| way.length_squared()).sum::<f64>() / count;
    // r² = a + 2 b s + c s².
    let of_vertex = |v: usize| {
        let moved = frames.iter().map(|x| x[v] - frames[0][v]);
        let sums =
            moved.zip(&ways).fold((0.0, 0.0), |(a, b), (x, way)| (a + x.length_squared(), b + x.dot(*way)));
        (sums.0 / count, sums.1 / count)
    };
    let of: Vec<(f64, f64)> = (0..frames[0].len()).map(of_vertex).collect();
    let rest = |s: f64, (a, b): &(f64, f64)| (a + 2.0 * b * s + c * s * s).max(0.0);
    let epsilon = |s: f64| {
        let least = of.iter().map(|ab| rest(s, ab)).fold(f64::INFINITY, f64::min);
        least + (REST * size).powi(2)
    };
    // Where most of the sheet rests best, which has no ε yet; then among what rests there.
    let value = |s: f64| of.iter().map(|ab| ((REST * size).powi(2) + rest(s, ab)).ln()).sum::<f64>();
    let starts = of.iter().map(|(_, b)| -b / c);
    let mut s = starts.min_by(|p, q| value(*p).total_cmp(&value(*q))).unwrap_or(0.0);
    for _ in 0..ROUNDS {
        let epsilon = epsilon(s);
        let weigh = |ab: &(f64, f64)| {
            let weight = (1.0 + rest(s, ab) / epsilon).powi(-2);
            [weight, -weight * ab.1 / c]
        };
        let [all, sum] = of.iter().map(weigh).fold([0.0; 2], |a, b| std::array::from_fn(|k| a[k] + b[k]));
        s = sum / all;
    }
    let least = of.iter().map(|ab| rest(s, ab)).fold(f64::INFINITY, f64::min);
    Length { metres: s, sd: (least / c).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_that_nothing_tells_serves_where_the_camera_hardly_moves() {
        let path = |way: f64| [DVec3::ZERO, DVec3::new(way, 0.0, 0.0), DVec3::new(0.0, way, 0.0)];
        let known = Length { metres: 2.0, sd: 0.2 };
        let unknown = Length { metres: 1.7, sd: 1.9 };
        assert!(known.serves(&path(0.2), 0.5) && !unknown.serves(&path(0.2), 0.5));
        assert!(unknown.serves(&path(0.005), 0.5));
        assert!(!Length { metres: -0.1, sd: 0.1 }.serves(&path(0.005), 0.5));
    }

    /// A sheet of which the upper row rests while the others swing and drift, seen by a camera that moves.
    #[test]
    fn what_rests_tells_the_length() {
        let path: Vec<DVec3> =
            (0..20).map(|n| DVec3::new(0.02 * f64::from(n), 0.01 * f64::from(n).sin(), 0.0)).collect();
        let right = 0.37;
        let frames: Vec<Positions> = (0..20)
            .map(|n| {
                let at = |v: usize| {
                    let swing = 0.01
                        * (v / 5) as f64
                        * DVec3::new((0.3 * f64::from(n)).sin(), 0.0, 0.02 * f64::from(n));
                    let noise = 3e-4 * DVec3::new((7.0 * (v as f64) + f64::from(n)).sin(), 0.0, 0.0);
                    let x = DVec3::new(0.1 * (v % 5) as f64, 0.1 * (v / 5) as f64, 1.0);
                    x + swing + noise - right * path[n as usize]
                };
                (0..25).map(at).collect()
            })
            .collect();
        let found = best(&frames, &path, 0.5);
        println!("{found:?}");
        assert!((found.metres - right).abs() < 2.0 * found.sd && (found.metres / right - 1.0).abs() < 0.01);
        assert!(found.sd < 0.02 * right);
    }
}
