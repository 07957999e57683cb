//! From windows that were followed to poses: rotations first, then all, and what of it the windows tell.

use std::collections::BTreeSet;

use glam::{DMat2, DVec3};
use tessuto_core::parallel;

use super::bundle::{Bundle, Freedom, State};
use super::observed::{Point, place};
use super::resect::{Resection, Sight};
use super::smooth::smoothen;
use super::start::everything;
use super::track::{Followed, Track};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::math::median::median;

/// Points are found with this many frames, and those in which windows were detected; the others are found with these.
const FRAMES: usize = 64;
/// Iterations of a model without translations.
const ITERATIONS: usize = 80;
/// A window stands still whose residuals are, in the median, less than this many σ.
const STILL: f64 = 3.0;

/// What was found.
pub(super) struct Found {
    /// camera_from_world of every frame; lengths have no unit.
    pub poses: Vec<Pose>,
    pub freedom: Freedom,
    /// Windows that stand still, and all.
    pub windows: [usize; 2],
    /// Standard deviation of what is left of the place of a window, in the median of these `[px]`.
    pub left: f64,
    /// How far translations move windows against each other, root mean square `[px]`; zero where they are not free.
    pub parallax: f64,
}

/// The poses of `frames` frames in which `camera` saw what was followed: at least two, of which each saw some.
pub(super) fn solve(camera: &Camera, followed: &Followed, frames: usize) -> Found {
    let chosen = chosen(followed, frames);
    let (of, tracks) = among(&followed.tracks, &chosen);
    let turned = |n: &usize| Pose { rotation: followed.turns[*n], translation: DVec3::ZERO };
    let points = tracks.iter().map(|track| Point { at: track.at, inverse_depth: 1.0 });
    let start = State { poses: chosen.iter().map(turned).collect(), points: points.collect() };

    let bundle = |freedom: Freedom| Bundle::new(camera, &tracks, freedom);
    let [mut still, mut turns, mut all] = [Freedom::Still, Freedom::Turns, Freedom::All].map(bundle);
    let mut at_rest = State { poses: vec![Pose::IDENTITY; chosen.len()], ..start.clone() };
    still.minimise(&mut at_rest, ITERATIONS);
    let mut turning = start;
    turns.minimise(&mut turning, ITERATIONS);
    let moving = everything(&mut all, &turning);

    let evidence = [still.evidence(&at_rest), turns.evidence(&turning), all.evidence(&moving)];
    let best = (0..3).min_by(|a, b| evidence[*a].total_cmp(&evidence[*b])).unwrap_or(0);
    let mut bundle = [still, turns, all].into_iter().nth(best).unwrap_or_else(|| bundle(Freedom::Still));
    let mut state = [&at_rest, &turning, &moving][best].clone();
    if bundle.freedom == Freedom::All {
        smoothen(&mut bundle, &mut state, chosen.iter().map(|n| *n as f64).collect());
    }
    let state = &state;
    let turned = |from: usize, to: usize| Pose {
        rotation: followed.turns[to] * followed.turns[from].transpose(),
        translation: DVec3::ZERO,
    };
    let poses = others(&bundle, state, followed, &chosen, &of, &turned);
    let (windows, left) = residuals(&bundle, state);
    let parallax =
        if bundle.freedom == Freedom::All { parallax(camera, &tracks, [&turning, state]) } else { 0.0 };
    Found { poses, freedom: bundle.freedom, windows: [windows, tracks.len()], left, parallax }
}

/// Which tracks are in the frames `chosen`, and the tracks as these count frames.
pub(super) fn among(tracks: &[Track], chosen: &[usize]) -> (Vec<usize>, Vec<Track>) {
    let slot = |frame: usize| chosen.binary_search(&frame).ok();
    let within = |(k, track): (usize, &Track)| {
        let seen = track.seen.iter().filter_map(|(n, at)| Some((slot(*n)?, *at)));
        let track = Track { host: slot(track.host)?, seen: seen.collect(), ..*track };
        (!track.seen.is_empty()).then_some((k, track))
    };
    tracks.iter().enumerate().filter_map(within).unzip()
}

/// Frames with which points are found: the first, those in which windows were detected, and some over all.
pub(super) fn chosen(followed: &Followed, frames: usize) -> Vec<usize> {
    let hosts = followed.tracks.iter().map(|track| track.host);
    let mut chosen: BTreeSet<usize> = hosts.chain([0]).collect();
    let count = frames.min(FRAMES);
    chosen.extend((0..count).map(|k| k * (frames - 1) / (count - 1).max(1)));
    chosen.into_iter().collect()
}

/// Poses of all frames: those chosen as they are, the others from the points, beginning with the one before after `way`
/// from that frame to this one.
pub(super) fn others(
    bundle: &Bundle,
    state: &State,
    followed: &Followed,
    chosen: &[usize],
    of: &[usize],
    way: &(dyn Fn(usize, usize) -> Pose + Sync),
) -> Vec<Pose> {
    let pose = |n: usize| {
        let slot = match chosen.binary_search(&n) {
            Ok(slot) => return state.poses[slot],
            Err(after) => after - 1,
        };
        let start = way(chosen[slot], n).after(&state.poses[slot]);
        let sights = of.iter().enumerate().filter_map(|(k, t)| {
            let host = &state.poses[bundle.tracks[k].host];
            Sight::of(&followed.tracks[*t], n, host, &state.points[k])
        });
        let Bundle { camera, freedom, variance, .. } = *bundle;
        let near = bundle.smooth.as_ref().map(|smooth| smooth.between(&state.poses, n as f64));
        Resection { camera, sights: sights.collect(), freedom, variance, near }.solve(start)
    };
    parallel::map(followed.turns.len(), pose)
}

/// How many windows stand still, and what is left of the place of one `[px]`.
pub(super) fn residuals(bundle: &Bundle, state: &State) -> (usize, f64) {
    let variance = bundle.likeliest(state);
    let still = |t: &usize| {
        let of: Vec<f64> = bundle.squares(state, *t).skip(1).collect();
        median(of).is_some_and(|square| square < STILL * STILL * 2.0 * variance)
    };
    let windows = (0..bundle.tracks.len()).filter(still).count();
    let spread = median(bundle.tracks.iter().map(|track| spread(&track.root)).collect()).unwrap_or(0.0);
    (windows, variance.sqrt() * spread)
}

/// Standard deviation, root mean square of both directions, of a place with the certainty W.
fn spread(root: &DMat2) -> f64 {
    let inverse = root.inverse();
    (0.5 * (inverse.x_axis.length_squared() + inverse.y_axis.length_squared())).sqrt()
}

/// How far apart two states have the windows, root mean square `[px]`.
fn parallax(camera: &Camera, tracks: &[Track], states: [&State; 2]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (t, track) in tracks.iter().enumerate() {
        for (frame, _) in &track.seen {
            let [a, b] = states.map(|s| place(camera, &s.poses[track.host], &s.poses[*frame], &s.points[t]));
            if let (Some(a), Some(b)) = (a, b) {
                sum += a.distance_squared(b);
                count += 1;
            }
        }
    }
    (sum / f64::from(count.max(1))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::*;

    fn followed(tracks: Vec<Track>, poses: &[Pose]) -> Followed {
        // Rotations as the brightness has them, a little off.
        let off = |n: usize| glam::DMat3::from_rotation_x(3e-3 * (n as f64).sin());
        let turns = poses.iter().enumerate().map(|(n, pose)| off(n) * pose.rotation);
        Followed { tracks, turns: turns.collect() }
    }

    #[test]
    fn a_hand_that_shakes_is_found_among_places_that_move_by_themselves() {
        for (seed, frames, wild) in [(1, 12, 0), (2, 12, 50), (3, 70, 0)] {
            let (camera, tracks, truth) =
                made::tracks(seed, frames, if frames > 60 { 90 } else { 250 }, wild, 0.1);
            let found = solve(&camera, &followed(tracks, &truth.poses), frames);
            let [turned, way] = made::apart(&found.poses, &truth.poses);
            let [still, all] = found.windows;
            println!(
                "{turned:.4}°, {way:.3} of the way; {still} of {all} to {:.3} px, {:.2} px",
                found.left, found.parallax
            );
            assert_eq!(found.freedom, Freedom::All);
            assert!(turned < 0.03 && way < 0.15, "{turned} {way}");
            assert!(still.abs_diff(all - wild) < 15 && found.left < 0.2 && found.parallax > 0.3);
        }
    }

    #[test]
    fn a_camera_that_only_turns_or_stands_still_is_told() {
        let (camera, tracks, mut truth) = made::tracks(4, 10, 200, 0, 0.1);
        truth.poses.iter_mut().for_each(|pose| pose.translation = DVec3::ZERO);
        let still = vec![Pose::IDENTITY; 10];
        for (poses, freedom) in [(&truth.poses, Freedom::Turns), (&still, Freedom::Still)] {
            let of = State { poses: poses.clone(), points: truth.points.clone() };
            let tracks = made::seen(&camera, &tracks, &of, 0.1, 9);
            let found = solve(&camera, &followed(tracks, poses), 10);
            println!("{:?}, {:?}", found.freedom, made::apart(&found.poses, poses));
            assert_eq!(found.freedom, freedom);
            assert!(made::apart(&found.poses, poses)[0] < 0.01 && found.parallax == 0.0);
            assert!(found.poses.iter().all(|pose| pose.translation == DVec3::ZERO));
        }
    }
}
