//! From windows that were followed to poses: rotations first, then all, and what of it the windows tell.

use std::collections::BTreeSet;

use glam::{DMat2, DQuat, DVec3};
use tessuto_core::parallel;

use super::bundle::{Bundle, Freedom, State};
use super::observed::{Point, place};
use super::resect::{Resection, Sight};
use super::track::{Followed, Track};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::math::median::median;
use tessuto_core::math::rng::Rng;

/// Points are found with this many frames, and those in which windows were detected; the others are found with these.
const FRAMES: usize = 64;
/// Depths from which all is tried to be found: equal, and this often random ones of this spread.
const STARTS: usize = 3;
const SPREAD: f64 = 0.3;
/// Iterations of a start, and to the end.
const ITERATIONS: [usize; 2] = [15, 80];
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
    still.minimise(&mut at_rest, ITERATIONS[1]);
    let mut turning = start;
    turns.minimise(&mut turning, ITERATIONS[1]);
    let moving = everything(&mut all, &turning);

    let evidence = [still.evidence(&at_rest), turns.evidence(&turning), all.evidence(&moving)];
    let best = (0..3).min_by(|a, b| evidence[*a].total_cmp(&evidence[*b])).unwrap_or(0);
    let bundle = [still, turns, all].into_iter().nth(best).unwrap_or_else(|| bundle(Freedom::Still));
    let state = [&at_rest, &turning, &moving][best];
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

/// The best of what several depths lead to.
fn everything(bundle: &mut Bundle, turning: &State) -> State {
    let mut best: Option<(f64, State)> = None;
    let mut try_from = |mut state: State, bundle: &mut Bundle| {
        bundle.minimise(&mut state, ITERATIONS[0]);
        let evidence = bundle.evidence(&state);
        if best.as_ref().is_none_or(|(least, _)| evidence < *least) {
            best = Some((evidence, state));
        }
        best.as_ref().map(|(_, state)| state.clone())
    };
    let mut found = try_from(turning.clone(), bundle);
    for k in 0..STARTS {
        let mut rng = Rng::new(k as u64, 0);
        let mut state = turning.clone();
        state.points.iter_mut().for_each(|point| point.inverse_depth = (SPREAD * rng.normal()).exp());
        found = try_from(state, bundle);
    }
    if let Some(state) = &found {
        found = try_from(reversed(state), bundle);
    }
    let mut state = found.unwrap_or_else(|| turning.clone());
    bundle.minimise(&mut state, ITERATIONS[1]);
    state
}

/// The relief turned inside out, which a camera that hardly moves sees nearly the same if it moves the other way.
fn reversed(state: &State) -> State {
    let mut out = state.clone();
    let mean = state.points.iter().map(|p| p.inverse_depth).sum::<f64>() / state.points.len().max(1) as f64;
    for pose in &mut out.poses {
        let t = pose.translation;
        let turn = DQuat::from_scaled_axis(2.0 * mean * DVec3::new(-t.y, t.x, 0.0));
        pose.rotation = glam::DMat3::from_quat(turn) * pose.rotation;
        pose.translation = DVec3::new(-t.x, -t.y, t.z);
    }
    out.points.iter_mut().for_each(|p| p.inverse_depth = 2.0 * mean - p.inverse_depth);
    out
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
            let track = &followed.tracks[*t];
            let place = track.seen.binary_search_by_key(&n, |(frame, _)| *frame).ok()?;
            let host = &state.poses[bundle.tracks[k].host];
            Some(Sight { host, point: &state.points[k], root: track.root, at: track.seen[place].1 })
        });
        let Bundle { camera, freedom, variance, .. } = *bundle;
        Resection { camera, sights: sights.collect(), freedom, variance }.solve(start)
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

    /// Worst rotation `[°]`, and worst way after the best scale, as a part of the longest.
    fn apart(found: &[Pose], truth: &[Pose]) -> [f64; 2] {
        let centre = |pose: &Pose| pose.in_world(DVec3::ZERO);
        let dot =
            |a: &[Pose], b: &[Pose]| a.iter().zip(b).map(|(a, b)| centre(a).dot(centre(b))).sum::<f64>();
        let scale = dot(found, truth) / dot(found, found).max(1e-12);
        let longest = truth.iter().map(|pose| centre(pose).length()).fold(1e-6, f64::max);
        found.iter().zip(truth).fold([0.0; 2], |worst: [f64; 2], (a, b)| {
            let off = centre(a) * scale - centre(b);
            [worst[0].max(a.apart(b)[0].to_degrees()), worst[1].max(off.length() / longest)]
        })
    }

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
            let [turned, way] = apart(&found.poses, &truth.poses);
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
        let mut rng = Rng::new(9, 0);
        truth.poses.iter_mut().for_each(|pose| pose.translation = DVec3::ZERO);
        let still = vec![Pose::IDENTITY; 10];
        for (poses, freedom) in [(&truth.poses, Freedom::Turns), (&still, Freedom::Still)] {
            let seen = |k: usize, track: &Track| {
                let of = |(n, _): &(usize, glam::DVec2)| {
                    let noise = 0.1 * glam::DVec2::new(rng.normal(), rng.normal());
                    let there = place(&camera, &poses[track.host], &poses[*n], &truth.points[k]);
                    (*n, there.unwrap_or_default() + noise)
                };
                track.seen.iter().map(of).collect()
            };
            let mut seen = seen;
            let tracks = tracks
                .iter()
                .enumerate()
                .map(|(k, track)| Track { seen: seen(k, track), ..*track })
                .collect();
            let found = solve(&camera, &followed(tracks, poses), 10);
            println!("{:?}, {:?}", found.freedom, apart(&found.poses, poses));
            assert_eq!(found.freedom, freedom);
            assert!(apart(&found.poses, poses)[0] < 0.01 && found.parallax == 0.0);
            assert!(found.poses.iter().all(|pose| pose.translation == DVec3::ZERO));
        }
    }
}
