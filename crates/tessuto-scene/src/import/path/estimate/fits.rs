//! Whether poses are those of a clip: windows of what stands still around the fabric are followed through a few of its
//! frames, and each is to be seen where the poses have one point at rest, at any depth ahead of the camera.
//!
//! The depth is free, so lengths may have any unit. Rotations, the directions of translations and their order are
//! tested; of two frames near each other a wrong translation looks like another depth, so frames far apart are compared
//! where windows can be followed that far.

use std::cell::RefCell;

use glam::{DMat3, DVec2, DVec3};
use tessuto_core::parallel;

use super::features::radius;
use super::observed::{Point, observed, place};
use super::surroundings::Surroundings;
use super::track::{Followed, Track, follow_in};
use super::{FEWEST, WIDEST};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::math::median::median;

/// Frames that are compared over the whole clip, and in each of the parts below.
const LOOKS: usize = 13;
const IN_PART: usize = 5;
/// Where windows are lost from one of these to the next, frames nearer to each other are compared in this many parts.
const PARTS: usize = 3;
const NEARER: usize = 4;
/// This part of the frames looked at must be compared, or nearer ones are looked at.
const ENOUGH: f64 = 0.5;
/// Where the fabric is known in the first frame alone, a frame that shows fewer of its windows than this part of the
/// most is not compared: what is found in it may be the fabric, or in front.
const LOST: f64 = 0.4;
/// Images are shrunk until their width is at most this `[px]`.
const WIDTH: usize = 500;
/// A distance that counts half of the most when a window's depth is found `[px]`.
const FAR: f64 = 1.0;
/// Steps of that.
const STEPS: usize = 4;
/// Poses of another kind explain the clip if places are off by less than this part of what they are by the given ones.
const EXPLAINS: f64 = 0.25;
/// Poses are doubted if places are farther off than this `[px]`, in wide images than this part of the width.
const DOUBTED: f64 = 2.0;
const DOUBTED_PART: f64 = 1.0 / 640.0;

/// Where the fabric is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// In all frames.
    All,
    /// In the first one, and about there in the others: windows begin in the first frame alone.
    First,
}

/// How far what stands still is from where the poses have it in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameFit {
    /// The frame.
    pub frame: usize,
    /// Median distance `[px]`.
    pub off: f64,
    /// Number of places.
    pub places: usize,
}

/// What poses that do not fit may have been mistaken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mistake {
    /// y and z of the camera point up and back, as OpenGL has them.
    Axes,
    /// World from camera instead of camera from world.
    Inverse,
    /// The last one first.
    Order,
}

/// What a clip says of poses.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFit {
    /// The frames that show enough, in order; none where too little is around the fabric.
    pub frames: Vec<FrameFit>,
    /// What explains the clip better by far than the poses as they are.
    pub mistake: Option<Mistake>,
    /// Poses are doubted if places are farther off in some frame `[px]`.
    pub doubted: f64,
}

impl PoseFit {
    /// The frame in which places are farthest off.
    pub fn worst(&self) -> Option<FrameFit> {
        self.frames.iter().copied().reduce(|a, b| if b.off > a.off { b } else { a })
    }

    /// What was found, in words.
    pub fn sentence(&self) -> String {
        self.worst().map_or_else(
            || "too little is around the fabric to test them".to_owned(),
            |FrameFit { frame, off, places }| {
                let more = if off > self.doubted { "" } else { "at most " };
                format!(
                    "what stands still around the fabric is {more}{off:.1} px from where they have it (median of \
                     {places} places in frame {frame})"
                )
            },
        )
    }

    /// What is probably wrong with the poses, if they are doubted.
    pub fn doubt(&self) -> Option<&'static str> {
        self.worst().filter(|worst| worst.off > self.doubted)?;
        Some(match self.mistake {
            Some(Mistake::Axes) => {
                "they fit with y and z of the camera turned about, as OpenGL has them: give x right, y down, z ahead"
            }
            Some(Mistake::Inverse) => {
                "they fit the other way round: give camera from world, not world from camera"
            }
            Some(Mistake::Order) => "they fit in the reverse order: give them in the order of the frames",
            None => {
                "check that they are this clip's, one per frame, in the frames' order, and the focal length"
            }
        })
    }
}

/// Windows followed through these frames of the clip.
struct Run {
    frames: Vec<usize>,
    followed: Followed,
}

/// How well `poses`, camera_from_world of every frame, explain what stands still in the clip of `camera` around the
/// fabric; `look` gives a frame, shape [height, width, 3], and where the fabric is in it, shape [height, width, 1]. It
/// is asked for about a dozen over the whole clip, and for more where these are too far apart.
///
/// # Errors
/// Those of reading frames.
pub fn pose_fit(
    camera: &Camera,
    poses: &[Pose],
    known: Known,
    look: &(dyn Fn(usize) -> Result<(Image, Image)> + Sync),
) -> Result<PoseFit> {
    let factor = camera.width.div_ceil(WIDTH).max(1);
    let small = camera.downsampled(factor);
    let (last, mut step) = (poses.len().saturating_sub(1), poses.len().div_ceil(LOOKS - 1).max(1));
    let mut spans = vec![spread(0, last, LOOKS)];
    let clip = Clip { camera: small, factor, known, look };
    let mut best = clip.judged(poses, &[]);
    loop {
        let runs = spans.iter().filter(|frames| frames.len() > 2).map(|frames| clip.run(frames));
        let runs: Vec<Run> = runs.collect::<Result<_>>()?;
        let found = clip.judged(poses, &runs);
        let looked = runs.iter().map(|run| run.frames.len() - 1).sum::<usize>();
        let enough = found.frames.len() as f64 >= ENOUGH * looked as f64;
        if found.frames.len() > best.frames.len() || enough {
            best = found;
        }
        if enough || step == 1 {
            return Ok(best);
        }
        step = (step / NEARER).max(1);
        let reach = step * (IN_PART - 1);
        let parts = if known == Known::All { PARTS } else { 1 };
        let start = |part: usize| part * last.saturating_sub(reach) / (PARTS - 1);
        spans = (0..parts).map(|k| spread(start(k), (start(k) + reach).min(last), IN_PART)).collect();
    }
}

/// `count` frames from `first` to `last`, evenly spread; all where there are fewer.
fn spread(first: usize, last: usize, count: usize) -> Vec<usize> {
    let mut frames: Vec<usize> = (0..count).map(|k| first + k * (last - first) / (count - 1)).collect();
    frames.dedup();
    frames
}

/// What windows are followed in.
struct Clip<'a> {
    /// Of the shrunk frames.
    camera: Camera,
    /// Pixels of a frame, in each direction, that become one.
    factor: usize,
    known: Known,
    look: &'a (dyn Fn(usize) -> Result<(Image, Image)> + Sync),
}

impl Clip<'_> {
    /// Follows windows through `frames`.
    fn run(&self, frames: &[usize]) -> Result<Run> {
        let radius = radius([self.camera.width, self.camera.height]);
        let seen = parallel::try_map(frames.len(), |k| {
            let (rgb, mask) = (self.look)(frames[k])?;
            let shrunk = |image: Image| if self.factor > 1 { image.downsampled(self.factor) } else { image };
            Ok(Some(Surroundings::of(&shrunk(rgb), &shrunk(mask), radius)))
        })?;
        let seen = RefCell::new(seen);
        let read = |k: usize| Ok(seen.borrow_mut()[k].take().expect("each is read once"));
        let mut followed = follow_in(&self.camera, frames.len(), read)?;
        followed.tracks.retain(|track| self.known == Known::All || track.host == 0);
        Ok(Run { frames: frames.to_vec(), followed })
    }

    /// What the windows of `runs` say of `poses`.
    fn judged(&self, poses: &[Pose], runs: &[Run]) -> PoseFit {
        let of =
            |poses: &[Pose]| -> Vec<FrameFit> { runs.iter().flat_map(|run| self.fits(poses, run)).collect() };
        let worst = |frames: &[FrameFit]| frames.iter().map(|frame| frame.off).fold(0.0, f64::max);
        let frames = of(poses);
        let kinds = [Mistake::Axes, Mistake::Inverse, Mistake::Order];
        let others = kinds.map(|mistake| (worst(&of(&mistake.undone(poses))), mistake));
        let best = others.into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a });
        let mistake = best.filter(|(off, _)| *off < EXPLAINS * worst(&frames)).map(|(_, mistake)| mistake);
        let width = self.camera.width * self.factor;
        PoseFit { frames, mistake, doubted: DOUBTED.max(DOUBTED_PART * width as f64) }
    }

    /// The frames of a run that show enough.
    fn fits(&self, poses: &[Pose], run: &Run) -> Vec<FrameFit> {
        let poses: Vec<Pose> = run.frames.iter().map(|n| poses[*n]).collect();
        let offs = parallel::over(&run.followed.tracks, |track| offs(&self.camera, &poses, track));
        let mut seen = vec![(Vec::new(), Vec::new()); poses.len()];
        for (track, offs) in run.followed.tracks.iter().zip(offs) {
            for ((k, at), off) in track.seen.iter().zip(offs) {
                seen[*k].0.push(*at);
                seen[*k].1.push(self.factor as f64 * off);
            }
        }
        let most = seen.iter().map(|(places, _)| places.len()).max().unwrap_or_default() as f64;
        let lost = |count: usize| self.known == Known::First && (count as f64) < LOST * most;
        let fit = |(k, (places, offs)): (usize, (Vec<DVec2>, Vec<f64>))| {
            let enough = spreads(&self.camera, &places) && !lost(places.len());
            let (frame, places) = (run.frames[k], places.len());
            enough.then(|| median(offs)).flatten().map(|off| FrameFit { frame, off, places })
        };
        seen.into_iter().enumerate().filter_map(fit).collect()
    }
}

impl Mistake {
    /// The poses as they are without it.
    fn undone(self, poses: &[Pose]) -> Vec<Pose> {
        let back =
            Pose { rotation: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)), translation: DVec3::ZERO };
        match self {
            Self::Axes => poses.iter().map(|pose| back.after(pose).after(&back)).collect(),
            Self::Inverse => poses.iter().map(Pose::inverse).collect(),
            Self::Order => poses.iter().rev().copied().collect(),
        }
    }
}

/// Whether these are enough places, and not all in one part of the image.
fn spreads(camera: &Camera, places: &[DVec2]) -> bool {
    let count = places.len() as f64;
    let mean = places.iter().sum::<DVec2>() / count;
    let squares = places.iter().map(|p| (*p - mean) * (*p - mean)).sum::<DVec2>() / count;
    let side = DVec2::new(camera.width as f64, camera.height as f64);
    places.len() >= FEWEST && squares.cmpge((WIDEST * side).powf(2.0)).all()
}

/// How far a window is seen from its point in every frame that shows it `[px]`; the point is at the depth that suits
/// most frames.
fn offs(camera: &Camera, poses: &[Pose], track: &Track) -> Vec<f64> {
    let host = &poses[track.host];
    let most = camera.width as f64;
    let point = |inverse_depth: f64| Point { at: track.at, inverse_depth };
    let off = |rho: f64, (k, at): &(usize, DVec2)| {
        place(camera, host, &poses[*k], &point(rho)).map_or(most, |there| there.distance(*at).min(most))
    };
    let cost = |rho: f64| {
        let costs = track.seen.iter().map(|seen| off(rho, seen).powi(2)).map(|d| d / (d + FAR * FAR));
        costs.sum::<f64>()
    };
    let alone = track.seen.iter().map(|seen| nearest(camera, [host, &poses[seen.0]], track.at, seen.1));
    let candidates = std::iter::once(0.0).chain(alone).map(|rho| (cost(rho), rho));
    let mut best = candidates.reduce(|a, b| if b.0 < a.0 { b } else { a }).unwrap_or_default();
    for _ in 0..STEPS {
        let sums = track.seen.iter().filter_map(|(k, at)| {
            let there = observed(camera, host, &poses[*k], &point(best.1))?;
            let (way, slope) = (*at - there.at, DVec2::new(there.by_point[0][2], there.by_point[1][2]));
            let weight = (1.0 + way.length_squared() / (FAR * FAR)).powi(-2);
            Some(DVec2::new(weight * slope.dot(way), weight * slope.length_squared()))
        });
        let sums: DVec2 = sums.sum();
        let next = (best.1 + sums.x / sums.y).max(0.0);
        if !next.is_finite() || cost(next) >= best.0 {
            break;
        }
        best = (cost(next), next);
    }
    track.seen.iter().map(|seen| off(best.1, seen)).collect()
}

/// One over the depth at which a point at `at` in the first pose is nearest to `there` in the other one, by least
/// squares of the rays that meet; not behind the camera.
fn nearest(camera: &Camera, [host, pose]: [&Pose; 2], at: DVec2, there: DVec2) -> f64 {
    let way = pose.after(&host.inverse());
    let (a, b, o) = (way.rotation * camera.ray(at), way.translation, camera.ray(there));
    let [p, q] = [a, b].map(|v| v.truncate() - o.truncate() * v.z);
    let rho = -p.dot(q) / q.length_squared();
    if rho.is_finite() { rho.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::{Settings, film, filmed};

    /// Frames of a made clip, their masks, and where the camera was.
    struct Made {
        camera: Camera,
        frames: Vec<(Image, Image)>,
        poses: Vec<Pose>,
    }

    fn made(seed: u64, [count, size]: [usize; 2], [orbit, shake]: [f64; 2]) -> Made {
        let settings = Settings::default().with(|s| {
            (s.frames, s.size, s.grid, s.seed) = (count, size, [9, 9], seed);
            (s.orbit, s.shake, s.surroundings) = (orbit, shake, true);
        });
        let scene = film(&settings).unwrap();
        let masks = (0..count).map(|n| scene.frames.frame(n).unwrap().mask.clone());
        let frames = filmed(&scene, seed).unwrap().into_iter().zip(masks).collect();
        Made { camera: scene.camera, frames, poses: scene.poses.unwrap() }
    }

    impl Made {
        fn fit(&self, poses: &[Pose], known: Known) -> PoseFit {
            let mask = |n: usize| &self.frames[if known == Known::All { n } else { 0 }].1;
            let look = |n: usize| Ok((self.frames[n].0.clone(), mask(n).clone()));
            pose_fit(&self.camera, poses, known, &look).unwrap()
        }
    }

    #[test]
    fn poses_of_the_clip_explain_it_in_any_unit_and_others_do_not() {
        let clip = made(3, [8, 240], [8.0, 0.005]);
        let scaled = |by: f64| -> Vec<Pose> {
            clip.poses.iter().map(|pose| Pose { translation: pose.translation * by, ..*pose }).collect()
        };
        for known in [Known::All, Known::First] {
            let worst = |poses: &[Pose]| {
                let fit = clip.fit(poses, known);
                println!("{known:?}: {} {:?}", fit.sentence(), fit.mistake);
                (fit.worst().unwrap().off, fit.doubt().is_some(), fit.mistake)
            };
            for by in [1.0, 40.0] {
                let (off, doubted, mistake) = worst(&scaled(by));
                assert!(off < 0.4 && !doubted && mistake.is_none(), "{off} px");
            }
            let (off, doubted, mistake) = worst(&Mistake::Axes.undone(&clip.poses));
            assert!(off > 10.0 && doubted && mistake == Some(Mistake::Axes));
            let shuffled: Vec<Pose> = (0..8).map(|n| clip.poses[(7 * n + 3) % 8]).collect();
            let (off, doubted, mistake) = worst(&shuffled);
            assert!(off > 5.0 && doubted && mistake.is_none());
        }
        for mistake in [Mistake::Inverse, Mistake::Order] {
            let fit = clip.fit(&mistake.undone(&clip.poses), Known::All);
            println!("{mistake:?}: {}", fit.sentence());
            assert!(fit.mistake == Some(mistake) && fit.doubt().is_some());
        }
    }

    #[test]
    fn frames_too_far_apart_are_compared_with_nearer_ones() {
        // 4° from one frame to the next.
        let clip = made(2, [36, 200], [140.0, 0.0]);
        let [right, wrong] =
            [clip.poses.clone(), Mistake::Axes.undone(&clip.poses)].map(|poses| clip.fit(&poses, Known::All));
        println!("{}; {}", right.sentence(), wrong.sentence());
        let numbers: Vec<usize> = right.frames.iter().map(|frame| frame.frame).collect();
        println!("{numbers:?}");
        assert!(right.doubt().is_none() && wrong.mistake == Some(Mistake::Axes));
    }

    #[test]
    fn too_little_around_the_fabric_says_nothing() {
        let mut clip = made(1, [4, 96], [8.0, 0.0]);
        clip.frames.iter_mut().for_each(|(rgb, _)| rgb.data.fill(0.5));
        let fit = clip.fit(&clip.poses, Known::All);
        assert!(fit.frames.is_empty() && fit.doubt().is_none() && fit.sentence().contains("too little"));
        assert!(clip.fit(&clip.poses[..1], Known::All).frames.is_empty());
    }
}
