//! Where the search for all poses and points begins.

use glam::{DQuat, DVec3};
use tessuto_core::camera::Pose;

use super::bundle::{Bundle, Freedom, State};
use super::refine::{FARTHEST, inverse_depth};
use super::resect::{Resection, Sight};
use super::solve::among;

/// Frames of which poses are found first.
const FIRST: usize = 6;
/// A pose is looked for among at least so many known points, unless it is the next one.
const FEWEST: usize = 20;
/// Iterations with a part of the frames, and to the end.
const ITERATIONS: [usize; 2] = [30, 200];

/// Poses and points from those of few frames on, or from their mirror image, whichever explains more.
pub(super) fn everything(bundle: &mut Bundle, turning: &State) -> State {
    let grown = grown(bundle, turning);
    let both = [reversed(&grown), grown].map(|mut state| {
        bundle.minimise(&mut state, ITERATIONS[0]);
        (bundle.evidence(&state), state)
    });
    let [mirrored, grown] = both;
    let mut state = if mirrored.0 < grown.0 { mirrored.1 } else { grown.1 };
    bundle.minimise(&mut state, ITERATIONS[1]);
    state
}

/// Poses and points of the first few frames, then of twice as many, and so on to all: a part of a long way is found
/// where the whole is not, and leads to the next.
fn grown(whole: &Bundle, turning: &State) -> State {
    let (camera, frames) = (whole.camera, turning.poses.len());
    let mut state = turning.clone();
    let mut count = FIRST.min(frames);
    loop {
        let first: Vec<usize> = (0..count).collect();
        let (of, tracks) = among(whole.tracks, &first);
        let mut bundle = Bundle::new(camera, &tracks, Freedom::All);
        let points = of.iter().map(|k| state.points[*k]).collect();
        let mut part = State { poses: state.poses[..count].to_vec(), points };
        bundle.minimise(&mut part, ITERATIONS[0]);
        state.poses[..count].copy_from_slice(&part.poses);
        of.iter().zip(&part.points).for_each(|(k, point)| state.points[*k] = *point);
        if count == frames {
            return state;
        }
        let mut next = (2 * count).min(frames);
        for n in count..next {
            let turned = Pose {
                rotation: turning.poses[n].rotation * turning.poses[n - 1].rotation.transpose(),
                translation: DVec3::ZERO,
            };
            let known = of.iter().filter_map(|k| {
                let track = &whole.tracks[*k];
                Sight::of(track, n, &state.poses[track.host], &state.points[*k])
            });
            let sights: Vec<Sight> = known.collect();
            if sights.len() < FEWEST && n > count {
                next = n;
                break;
            }
            let mut one =
                Resection { camera, sights, freedom: Freedom::All, variance: bundle.variance, near: None };
            state.poses[n] = one.solve(turned.after(&state.poses[n - 1]));
        }
        let (seen, tracks) = among(whole.tracks, &(0..next).collect::<Vec<_>>());
        for (k, track) in seen.iter().zip(&tracks) {
            if of.binary_search(k).is_err() {
                let depth = inverse_depth(camera, &state.poses, track);
                state.points[*k].inverse_depth = depth.clamp(FARTHEST, 1.0 / FARTHEST);
            }
        }
        count = next;
    }
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

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::super::observed::{Point, place};
    use super::super::track::Track;
    use super::*;
    use glam::{DMat2, DMat3, DVec2};
    use tessuto_core::camera::Camera;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn a_camera_that_goes_far_around_is_found_by_windows_that_are_seen_for_a_short_time() {
        let camera = Camera { fx: 600.0, fy: 600.0, cx: 239.5, cy: 239.5, width: 480, height: 480 };
        let (frames, seen, centre) = (24, 5, 2.0 * DVec3::Z);
        for (seed, angle) in [(1, 30.0f64), (2, 80.0)] {
            let mut rng = Rng::new(seed, 0);
            let pose = |n: usize| {
                let turn = DMat3::from_rotation_y((angle * n as f64 / (frames - 1) as f64).to_radians());
                Pose { rotation: turn, translation: centre - turn * centre }
            };
            let truth: Vec<Pose> = (0..frames).map(pose).collect();
            let (mut tracks, mut points) = (Vec::new(), Vec::new());
            for k in 0..600 {
                let host = k % (frames - 1);
                let at = 460.0 * DVec2::new(rng.uniform(), rng.uniform()) + 10.0;
                let point = Point { at, inverse_depth: 1.0 / (1.5 + 1.5 * rng.uniform()) };
                let mut off = || 0.1 * DVec2::new(rng.normal(), rng.normal());
                let later = host + 1..(host + 1 + seen).min(frames);
                let shown =
                    later.filter_map(|n| Some((n, place(&camera, &truth[host], &truth[n], &point)? + off())));
                let seen = shown.filter(|(_, p)| p.min_element() > 5.0 && p.max_element() < 475.0).collect();
                tracks.push(Track { host, at: point.at, root: DMat2::IDENTITY / 0.1, seen });
                points.push(Point { at, inverse_depth: 1.0 });
            }
            let known: Vec<bool> = tracks.iter().map(|track: &Track| !track.seen.is_empty()).collect();
            let mut kept = known.iter();
            tracks.retain(|_| *kept.next().unwrap());
            let mut kept = known.iter();
            points.retain(|_| *kept.next().unwrap());
            // The rotations that explain windows without a translation fall short by a half.
            let half = |n: usize| Pose {
                rotation: DMat3::from_rotation_y((0.5 * angle * n as f64 / (frames - 1) as f64).to_radians()),
                translation: DVec3::ZERO,
            };
            let turning = State { poses: (0..frames).map(half).collect(), points };
            let mut bundle = Bundle::new(&camera, &tracks, Freedom::All);
            let found = everything(&mut bundle, &turning);
            let [turned, way] = made::apart(&found.poses, &truth);
            println!("{angle}°: {turned:.3}°, {way:.4} of the way");
            assert!(turned < 0.5 && way < 0.02, "{turned} {way}");
        }
    }
}
