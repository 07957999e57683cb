//! Made images and tracks, for tests.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::bundle::State;
use super::observed::{Point, place, stepped};
use super::surroundings::Surroundings;
use super::track::Track;
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::image::Image;
use tessuto_core::math::rng::Rng;

/// Brightness without a repeat, 0 to 255.
pub fn waves(p: DVec2) -> f64 {
    let [u, v] = p.to_array();
    let wave = (0.31 * u + 0.05 * v).sin() + (0.11 * u - 0.27 * v).sin() + (0.021 * u + 0.19 * v).cos();
    128.0 + 35.0 * wave
}

/// A frame without fabric, whose pixels show `brightness`.
pub fn plain(width: usize, height: usize, brightness: impl Fn(DVec2) -> f64) -> Surroundings {
    let mut image = Image::new(width, height, 3);
    for k in 0..width * height {
        let value = brightness(DVec2::new((k % width) as f64, (k / width) as f64)) / 255.0;
        image.data[3 * k..3 * k + 3].fill(value as f32);
    }
    Surroundings::of(&image, &Image::new(width, height, 1), 8)
}

/// A world far away, with large shapes and small ones, seen by a camera that is turned.
pub fn sky(camera: &Camera, turn: DMat3) -> Surroundings {
    plain(camera.width, camera.height, |p| {
        let d = turn.transpose() * camera.ray(p);
        let p = DVec2::new(d.x, d.y) / d.z * camera.fx;
        0.4 * waves(p) + 0.6 * waves(0.11 * p)
    })
}

/// A camera that a hand holds before points 1 to 4 m away, their tracks with this noise `[px]`, and the truth. Some of
/// the points are first seen in the last frame but one, and `wild` ones are anywhere.
pub fn tracks(
    seed: u64,
    frames: usize,
    count: usize,
    wild: usize,
    noise: f64,
) -> (Camera, Vec<Track>, State) {
    let camera = Camera { fx: 600.0, fy: 600.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let mut rng = Rng::new(seed, 0);
    let mut poses = vec![Pose::IDENTITY];
    for _ in 1..frames {
        let step: Vec<f64> = (0..6).map(|k| rng.signed() * if k < 3 { 0.02 } else { 0.01 }).collect();
        poses.push(stepped(&Pose::IDENTITY, &step));
    }
    let mut points = Vec::new();
    let mut tracks = Vec::new();
    for k in 0..count {
        let at = DVec2::new(620.0 * rng.uniform() + 10.0, 460.0 * rng.uniform() + 10.0);
        let point = Point { at, inverse_depth: 0.25 + 0.75 * rng.uniform() };
        let host = if k % 3 == 2 { frames - 2 } else { 0 };
        let mut off = || noise * DVec2::new(rng.normal(), rng.normal());
        let first = at + off();
        let mut seen = Vec::new();
        for frame in host + 1..frames {
            let there = place(&camera, &poses[host], &poses[frame], &point).unwrap() + off();
            let stray = if k < wild { DVec2::new(3.0 * frame as f64, 9.0 + k as f64) } else { DVec2::ZERO };
            seen.push((frame, there + stray));
        }
        tracks.push(Track { host, at: first, root: DMat2::IDENTITY / noise.max(0.05), seen });
        points.push(point);
    }
    (camera, tracks, State { poses, points })
}

/// The windows of `tracks` as they are seen from other poses and points, with this noise `[px]`.
pub fn seen(camera: &Camera, tracks: &[Track], state: &State, noise: f64, seed: u64) -> Vec<Track> {
    let mut rng = Rng::new(seed, 2);
    let mut seen = |k: usize, track: &Track| {
        let mut of = |(n, _): &(usize, DVec2)| {
            let off = noise * DVec2::new(rng.normal(), rng.normal());
            let there = place(camera, &state.poses[track.host], &state.poses[*n], &state.points[k]);
            (*n, there.unwrap_or_default() + off)
        };
        track.seen.iter().map(&mut of).collect()
    };
    tracks.iter().enumerate().map(|(k, track)| Track { seen: seen(k, track), ..*track }).collect()
}

/// The factor by which the places of `found` lie best on those of `truth`.
pub fn scale(found: &[Pose], truth: &[Pose]) -> f64 {
    let centre = |pose: &Pose| pose.in_world(DVec3::ZERO);
    let dot = |a: &[Pose], b: &[Pose]| a.iter().zip(b).map(|(a, b)| centre(a).dot(centre(b))).sum::<f64>();
    dot(found, truth) / dot(found, found).max(1e-12)
}

/// Worst rotation `[°]`, and worst way after the best scale, as a part of the longest.
pub fn apart(found: &[Pose], truth: &[Pose]) -> [f64; 2] {
    let centre = |pose: &Pose| pose.in_world(DVec3::ZERO);
    let scale = scale(found, truth);
    let longest = truth.iter().map(|pose| centre(pose).length()).fold(1e-6, f64::max);
    found.iter().zip(truth).fold([0.0; 2], |worst: [f64; 2], (a, b)| {
        let off = centre(a) * scale - centre(b);
        [worst[0].max(a.apart(b)[0].to_degrees()), worst[1].max(off.length() / longest)]
    })
}

/// A state near another one.
pub fn disturbed(state: &State, seed: u64) -> State {
    let mut rng = Rng::new(seed, 1);
    let mut out = state.clone();
    for pose in out.poses.iter_mut().skip(1) {
        let step: Vec<f64> = (0..6).map(|_| 2e-3 * rng.signed()).collect();
        *pose = stepped(pose, &step);
    }
    for point in &mut out.points {
        point.at += 0.3 * DVec2::new(rng.signed(), rng.signed());
        point.inverse_depth *= 1.0 + 0.2 * rng.signed();
    }
    out
}
