//! Follows windows of what is around the fabric through the frames. Each is looked for where the camera's rotation
//! carries it, always with its image in the frame where it was first seen, so that errors do not add up.

use std::path::Path;

use glam::{DMat2, DMat3, DVec2};
use rayon::prelude::*;
use tessuto_core::parallel;

use super::features::{detect, radius};
use super::patch::{Patch, Warp};
use super::surroundings::Surroundings;
use super::turn::turn;
use tessuto_core::camera::Camera;
use tessuto_core::error::Result;

/// Windows are looked for in sizes of the image, from this one of an image with a shorter side of at least so many
/// pixels.
const SIZES: [usize; 2] = [2, 700];
/// Windows are detected again if less than this part is left of those that were followed after the last time.
const FEW: f64 = 0.7;
/// A window that was not found in this many frames is given up.
const MISSES: usize = 10;
/// Differences that are left of a window: at most this many times the noise, and this part of its contrast, by squares.
const LEFT: [f64; 2] = [2.0, 0.3];
/// Standard deviation of places beside noise: of interpolation and of pixels that are no points `[px]`.
const BESIDE: f64 = 0.03;
/// A window that is found back in the frame before further off than this many standard deviations, and pixels, is lost.
const BACK: [f64; 2] = [3.0, 0.1];

/// Where a window was seen.
pub(super) struct Track {
    /// The frame in which it was first seen, and where `[px]`.
    pub host: usize,
    pub at: DVec2,
    /// W with WᵀW the inverse of the covariance of its place [1/px].
    pub root: DMat2,
    /// The other frames, rising, and where in these `[px]`.
    pub seen: Vec<(usize, DVec2)>,
}

/// What was followed.
pub(super) struct Followed {
    pub tracks: Vec<Track>,
    /// How the camera is turned in every frame, against the first one, as the brightness of all the image has it.
    pub turns: Vec<DMat3>,
}

struct Feature {
    /// By sizes, finest first.
    patches: Vec<Patch>,
    track: Track,
    now: Warp,
    misses: usize,
    radius: usize,
    /// Standard deviation of its place, root mean square of both directions `[px]`.
    sd: f64,
}

/// Follows windows through the `frames` of the scene in `folder`; `said` hears of every frame.
///
/// # Errors
/// Those of reading the frames.
pub(super) fn follow(
    folder: &Path,
    camera: &Camera,
    frames: usize,
    said: &(dyn Fn(&str) + Sync),
) -> Result<Followed> {
    let radius = radius([camera.width, camera.height]);
    follow_in(camera, frames, |n| {
        said(&format!("rgbs/rgb_{n:03} followed"));
        Surroundings::read(folder, n, radius)
    })
}

/// The same of frames that `read` gives.
pub(super) fn follow_in(
    camera: &Camera,
    frames: usize,
    read: impl Fn(usize) -> Result<Surroundings>,
) -> Result<Followed> {
    let mut previous = read(0)?;
    let mut turns = vec![DMat3::IDENTITY];
    let (mut live, mut ended) = (detected(&previous, 0, &[]), Vec::new());
    let mut enough = FEW * live.len() as f64;
    for n in 1..frames {
        let current = read(n)?;
        let way = turn(camera, &previous, &current, DMat3::IDENTITY);
        turns.push(way * turns[n - 1]);
        live.par_iter_mut().for_each(|feature| feature.follow(camera, way, [&previous, &current], n));
        let (stay, go): (Vec<_>, Vec<_>) = live.into_iter().partition(|feature| feature.misses < MISSES);
        live = stay;
        ended.extend(go);
        let found = live.iter().filter(|feature| feature.misses == 0).count();
        if (found as f64) < enough && n + 1 < frames {
            let taken: Vec<DVec2> = live.iter().map(|feature| feature.now.at).collect();
            let more = detected(&current, n, &taken);
            enough = FEW * (found + more.len()) as f64;
            live.extend(more);
        }
        previous = current;
    }
    let tracks = ended.into_iter().chain(live).map(|feature| feature.track);
    Ok(Followed { tracks: tracks.filter(|track| track.seen.len() > 1).collect(), turns })
}

fn detected(seen: &Surroundings, host: usize, taken: &[DVec2]) -> Vec<Feature> {
    let grey = &seen.levels[0].grey;
    let radius = radius([grey.width, grey.height]);
    let coarsest = if grey.width.min(grey.height) < SIZES[1] { SIZES[0] - 1 } else { SIZES[0] };
    let feature = |[x, y]: &[usize; 2]| {
        let at = DVec2::new(*x as f64, *y as f64);
        let levels = seen.levels.iter().enumerate().take(coarsest + 1);
        let patches: Vec<Patch> =
            levels.map_while(|(k, level)| Patch::of(level, x >> k, y >> k, radius)).collect();
        let [a, b, c] = patches.first()?.tensor;
        // Of noise in the window, and besides.
        let tensor = DMat2::from_cols(DVec2::new(a, b), DVec2::new(b, c));
        let covariance =
            tensor.inverse() * seen.noise.powi(2) + DMat2::from_diagonal(DVec2::splat(BESIDE.powi(2)));
        let sd = (0.5 * (covariance.x_axis.x + covariance.y_axis.y)).sqrt();
        let track = Track { host, at, root: root(covariance.inverse()), seen: Vec::new() };
        Some(Feature { patches, track, now: Warp { at, linear: DMat2::IDENTITY }, misses: 0, radius, sd })
    };
    parallel::over(&detect(seen, taken), feature).into_iter().flatten().collect()
}

/// W with WᵀW = `m`, upper triangular.
fn root(m: DMat2) -> DMat2 {
    let a = m.x_axis.x.max(0.0).sqrt();
    let b = m.y_axis.x / a;
    DMat2::from_cols(DVec2::new(a, 0.0), DVec2::new(b, (m.y_axis.y - b * b).max(0.0).sqrt()))
}

impl Feature {
    /// Looks for the window in frame `n`, to which the camera turned by `way`.
    fn follow(&mut self, camera: &Camera, way: DMat3, [previous, current]: [&Surroundings; 2], n: usize) {
        let expected = carried(camera, way, self.now);
        let found = expected.and_then(|expected| self.found(expected, previous, current));
        match found {
            Some(warp) => {
                self.track.seen.push((n, warp.at));
                (self.now, self.misses) = (warp, 0);
            }
            None => {
                self.now = expected.unwrap_or(self.now);
                self.misses = if expected.is_none() { MISSES } else { self.misses + 1 };
            }
        }
    }

    fn found(&self, expected: Warp, previous: &Surroundings, current: &Surroundings) -> Option<Warp> {
        let clear = |warp: &Warp| current.clear(warp.at.x, warp.at.y);
        if !clear(&expected) {
            return None;
        }
        let mut warp = expected;
        for (k, patch) in self.patches.iter().enumerate().skip(1).rev() {
            let scale = (1 << k) as f64;
            // A size's window is around a pixel of that size, the finest one's beside its centre.
            let beside = self.beside(k);
            let centre = (warp.at - DVec2::splat((scale - 1.0) / 2.0)) / scale + warp.linear * beside;
            let start = Warp { at: centre, linear: warp.linear };
            // Its shape is the finest size's to tell.
            if let Some((found, left)) = patch.matched(&current.levels[k], start, 1e6)
                && left < 0.5 * patch.contrast.sqrt() + LEFT[0] * current.noise
            {
                warp.at += (found.at - centre) * scale;
            }
        }
        let patch = &self.patches[0];
        let (found, left) = patch.matched(&current.levels[0], warp, current.noise)?;
        let most = (LEFT[0] * current.noise).powi(2) + LEFT[1].powi(2) * patch.contrast;
        let whole = (found.linear.determinant() - 1.0).abs() < 0.6;
        let back = || self.misses > 0 || self.comes_back(&found, current, previous, current.noise);
        (clear(&found) && left * left < most && whole && back()).then_some(found)
    }

    /// Whether what is there is found in the frame before where the window was in that.
    fn comes_back(&self, found: &Warp, current: &Surroundings, previous: &Surroundings, noise: f64) -> bool {
        let [x, y] = [found.at.x, found.at.y].map(|v| v.round() as usize);
        let radius = self.radius;
        let Some(patch) = Patch::of(&current.levels[0], x, y, radius) else { return false };
        let back = self.now.linear * found.linear.inverse();
        let expected = self.now.at + back * (DVec2::new(x as f64, y as f64) - found.at);
        let there = patch.matched(&previous.levels[0], Warp { at: expected, linear: back }, noise);
        there.is_some_and(|(there, _)| there.at.distance(expected) < BACK[0] * self.sd + BACK[1])
    }

    /// From the finest window's centre to that of size `k`, in pixels of that.
    fn beside(&self, k: usize) -> DVec2 {
        let scale = (1 << k) as f64;
        let exact = (self.track.at - DVec2::splat((scale - 1.0) / 2.0)) / scale;
        DVec2::new((self.track.at.x as usize >> k) as f64, (self.track.at.y as usize >> k) as f64) - exact
    }
}

/// A window as a rotation of the camera carries it; `None` behind the camera.
fn carried(camera: &Camera, way: DMat3, warp: Warp) -> Option<Warp> {
    let q = way * camera.ray(warp.at);
    let rows = camera.projection_rows(q);
    let column = |d: glam::DVec3| DVec2::new(rows[0].dot(way * d), rows[1].dot(way * d));
    let by_place = DMat2::from_cols(column(glam::DVec3::X / camera.fx), column(glam::DVec3::Y / camera.fy));
    (q.z > 0.0).then(|| Warp { at: camera.project(q), linear: by_place * warp.linear })
}
