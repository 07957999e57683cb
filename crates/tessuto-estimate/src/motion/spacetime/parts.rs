//! Clips of any length: the search goes through long ones part by part.
//!
//! What it holds in memory grows with the number of frames: pyramids of the images, what every point of the sheet
//! shows in each, systems and their factors. A frame depends on the images of others only through a few adjacent
//! ones. So a clip of more than `window` frames is searched in as few parts of equal length as hold no more, which
//! overlap by [`OVERLAP`] frames. Every part compares its frames with the clip's first one, as a whole clip does,
//! and begins where the part before found its first frames. What a clip asks for, its light and its accelerations
//! are each part's own.
//!
//! Over the overlap the earlier part's motion passes into the later one's, with a weight t that grows from 0 to 1:
//! the first frame of the later one is the earlier one's, whose last frames nothing follows. Where the two differ, so
//! may they be off: the variance is that of the mixture, (1 − t) σ₀² + t σ₁² + t (1 − t) ‖x₀ − x₁‖².

use std::borrow::Cow;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{Positions, Problem, SpacetimeSettings, Start};
use crate::io::scene::back::name;
use crate::motion::terms::shading::Light;
use crate::session::{Session, foreign_state};
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::{Back, Scene};
use tessuto_sim::Cloth;

/// Frames that two adjacent parts have in common.
pub const OVERLAP: usize = 12;
/// How many of these are known where the later one begins: of two the sheet's velocity follows.
const KNOWN: usize = 2;
/// What each part goes through.
const STAGES: [&str; 4] = ["track", "refine", "fuse", "deviation"];
/// Name of the state between two parts.
const PARTS: &str = "parts";

/// The positions of all frames of a clip, searched part by part.
pub struct Search<'a> {
    clip: &'a Scene,
    cloth: &'a Cloth,
    settings: &'a SpacetimeSettings,
    /// Frames of every part.
    parts: Vec<Range<usize>>,
    /// What following the sheet through each showed.
    learnt: Vec<Learnt>,
}

/// What was found.
pub struct Found {
    /// Positions, shape [N, V].
    pub frames: Vec<Positions>,
    /// Standard deviation of every vertex `[m]`, shape [N, V]; none where the search failed.
    pub deviations: Option<Vec<Vec<f64>>>,
    /// Why they are not better.
    pub failure: Option<Error>,
}

/// What following the sheet shows of a part of the clip.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Learnt {
    light: Light,
    /// Spread of accelerations `[m/s²]`.
    acceleration: f64,
    /// Spread of the smooth shear `[rad]`, and number of its modes.
    shear: (f64, usize),
    /// What the other side looks like.
    back: Back,
}

/// What the parts so far made of their frames.
#[derive(Default, Serialize, Deserialize)]
struct Joined {
    /// Shape [., V].
    frames: Vec<Positions>,
    /// Shape [., V] `[m]`.
    deviations: Vec<Vec<f64>>,
    /// Of every part.
    learnt: Vec<Learnt>,
}

impl<'a> Search<'a> {
    /// A search through `clip`, which nothing is known of.
    pub fn new(clip: &'a Scene, cloth: &'a Cloth, settings: &'a SpacetimeSettings) -> Self {
        Self { clip, cloth, settings, parts: parts(clip.frames.len(), settings.window), learnt: Vec::new() }
    }

    /// Finds the positions of all frames and how far they may be off. Samples are drawn by `seed`.
    ///
    /// # Errors
    /// Those of reading the frames; [`Error::Input`] if it is to go on from a state that does not match; what the
    /// session's observer returns.
    pub fn find(&mut self, seed: u64, session: &mut Session) -> Result<Found> {
        let several = self.parts.len() > 1;
        let mut joined: Joined = if several { session.restore(PARTS)? } else { None }.unwrap_or_default();
        let until = joined.learnt.len().checked_sub(1).map_or(Some(0), |k| self.parts.get(k).map(|p| p.end));
        let vertices = self.cloth.vertex_count();
        if until != Some(joined.frames.len())
            || joined.deviations.len() != joined.frames.len()
            || joined.frames.iter().any(|x| x.len() != vertices || x.iter().any(|p| !p.is_finite()))
            || joined.deviations.iter().any(|of_frame| of_frame.len() != vertices)
        {
            return Err(foreign_state(PARTS));
        }
        for k in joined.learnt.len()..self.parts.len() {
            let part = self.parts[k].clone();
            if several {
                session.begin_part(k, self.parts.len(), &STAGES, &joined.frames[..part.start]);
            }
            let scene = self.scene_of(&part);
            let mut problem = self.problem(&scene, &part, &joined.frames)?;
            let found = problem.find(seed, session)?;
            let same = joined.learnt.iter().all(|learnt| learnt.back == Back::Same);
            let learnt = problem.learnt();
            if same && learnt.back != Back::Same && self.clip.known.back.is_none() {
                session.note(&format!(
                    "{} is a colour that the first frame does not show: it is treated as the fabric's other side (key \
                     \"back\" of scene.json)",
                    name(learnt.back)
                ));
            }
            joined.learnt.push(learnt);
            let of_part = found.deviations.as_deref();
            let unknown = vec![vec![0.0; vertices]; found.frames.len()];
            join(&mut joined.deviations, of_part.unwrap_or(&unknown), part.start, |pair, [n, k], t| {
                deviations_between(pair, &joined.frames[n], &found.frames[k], t)
            });
            join(&mut joined.frames, &found.frames, part.start, |[a, b], _, t| between(a, b, t));
            if found.failure.is_some() {
                session.end_part(&[]);
                // Nothing is known of what follows.
                let last = joined.frames.last().cloned().unwrap_or_default();
                joined.frames.resize(self.clip.frames.len(), last);
                self.learnt = joined.learnt;
                return Ok(Found { frames: joined.frames, deviations: None, failure: found.failure });
            }
            if several {
                session.end_part(&STAGES);
                session.finish(PARTS, &joined);
            }
        }
        self.learnt = joined.learnt;
        Ok(Found { frames: joined.frames, deviations: Some(joined.deviations), failure: None })
    }

    /// What the fabric's other side was found to look like, or told.
    pub fn back(&self) -> Back {
        let differs = self.learnt.iter().map(|learnt| learnt.back).find(|back| *back != Back::Same);
        differs.unwrap_or(Back::Same)
    }

    /// The positions again, part by part, given the motion `made` by their causes, shape [N, V] `[m]`
    /// ([`Problem::along`]). What was found before stays where it explains the images better.
    ///
    /// # Errors
    /// Those of reading the frames.
    pub fn along(&self, frames: &[Positions], made: &[Positions]) -> Result<Vec<Positions>> {
        let mut joined: Vec<Positions> = Vec::with_capacity(frames.len());
        for (part, learnt) in self.parts.iter().zip(&self.learnt) {
            let scene = self.scene_of(part);
            let mut problem = self.problem(&scene, part, frames)?;
            problem.recall(learnt);
            let found = frames[part.clone()].to_vec();
            let along = problem.along(found.clone(), &made[part.clone()]);
            let found = problem.by_pictures(found, along);
            join(&mut joined, &found, part.start, |[a, b], _, t| between(a, b, t));
        }
        Ok(joined)
    }

    /// The frames of a part of the clip.
    fn scene_of(&self, part: &Range<usize>) -> Cow<'a, Scene> {
        match self.parts.len() {
            1 => Cow::Borrowed(self.clip),
            _ => Cow::Owned(self.clip.span(part.clone())),
        }
    }

    /// The search through the `scene` of a `part`, given what was found of the frames before and of its first ones.
    fn problem<'s>(
        &'s self,
        scene: &'s Scene,
        part: &Range<usize>,
        found: &[Positions],
    ) -> Result<Problem<'s>> {
        let settings = self.settings.clone();
        if part.start == 0 {
            return Problem::new(scene, self.cloth, settings);
        }
        let way = found[1].iter().zip(&found[0]).map(|(q, p)| *q - *p).collect();
        let start = Start { known: found[part.start..][..KNOWN].to_vec(), way: Some(way) };
        Problem::of_part(self.clip, scene, self.cloth, settings, start)
    }
}

impl Problem<'_> {
    /// The positions of all frames at once, and how far they may be off.
    fn find(&mut self, seed: u64, session: &mut Session) -> Result<Found> {
        session.begin(STAGES[0]);
        let (mut pool, lost) = self.track(session)?;
        session.begin(STAGES[1]);
        let (mut frames, stuck) = self.refine(&mut pool, session)?;
        let lies = pool.asked.as_ref().is_some_and(|asked| asked.plane.is_some());
        if lies && self.start.way.is_none() {
            session
                .note("much of the fabric stays in the plane of the template: it is treated as lying on it");
        }
        if stuck.is_none() {
            session.begin(STAGES[2]);
            frames = self.fuse(frames, &pool, session)?;
        }
        session.begin(STAGES[3]);
        let failure = lost.or(stuck);
        let deviations = match failure {
            None => Some(self.deviations(&frames, &pool, seed, session)?),
            Some(_) => None,
        };
        Ok(Found { frames, deviations, failure })
    }

    /// What following the sheet showed.
    fn learnt(&self) -> Learnt {
        let shear = &self.priors.shear;
        let shear = (shear.smooth, shear.rank);
        Learnt { light: self.light, acceleration: self.acceleration, shear, back: self.back }
    }

    /// Goes on from what following the sheet showed.
    fn recall(&mut self, learnt: &Learnt) {
        (self.light, self.acceleration) = (learnt.light, learnt.acceleration);
        (self.priors.shear.smooth, self.priors.shear.rank) = learnt.shear;
    }
}

/// The parts of a clip of `count` frames of which none has more than `window`, or than the overlaps need.
fn parts(count: usize, window: usize) -> Vec<Range<usize>> {
    if count <= window {
        return std::iter::once(0..count).collect();
    }
    let most = window.max(2 * OVERLAP) - OVERLAP;
    let (new, number) = (count - OVERLAP, (count - OVERLAP).div_ceil(most));
    (0..number).map(|k| k * new / number..(k + 1) * new / number + OVERLAP).collect()
}

/// Adds what the part from frame `start` on `found` to what is `joined` before it; `mixed` makes one of both, given
/// their places in either and t.
fn join<T: Clone>(
    joined: &mut Vec<T>,
    found: &[T],
    start: usize,
    mixed: impl Fn([&T; 2], [usize; 2], f64) -> T,
) {
    let overlap = joined.len() - start;
    for k in 0..overlap.min(found.len()) {
        let t = k as f64 / (overlap - 1).max(1) as f64;
        joined[start + k] = mixed([&joined[start + k], &found[k]], [start + k, k], t);
    }
    joined.extend_from_slice(&found[overlap.min(found.len())..]);
}

/// The deviations of both of a pair, which found `x` and `y` there, mixed.
fn deviations_between([a, b]: [&Vec<f64>; 2], x: &Positions, y: &Positions, t: f64) -> Vec<f64> {
    let of_vertex = |v: usize| {
        let apart = x[v].distance_squared(y[v]);
        ((1.0 - t) * a[v].powi(2) + t * b[v].powi(2) + t * (1.0 - t) * apart).sqrt()
    };
    (0..a.len()).map(of_vertex).collect()
}

fn between(a: &Positions, b: &Positions, t: f64) -> Positions {
    a.iter().zip(b).map(|(a, b)| a.lerp(*b, t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Checkpoints;
    use crate::synth::{Settings, make};

    #[test]
    fn parts_are_of_one_length_and_none_is_longer_than_the_window() {
        let (one, all) = (parts(1, 24), parts(200, 200));
        assert!(one.len() == 1 && one[0] == (0..1) && all.len() == 1 && all[0] == (0..200));
        for (count, window) in [(201, 200), (600, 200), (3000, 200), (25, 24), (1000, 24), (1000, 10)] {
            let parts = parts(count, window);
            let longest = parts.iter().map(|part| part.len()).max().unwrap();
            assert!(longest <= window.max(2 * OVERLAP), "{parts:?}");
            assert!(parts.iter().all(|part| longest - part.len() <= 1), "{parts:?}");
            assert!(parts[0].start == 0 && parts.last().unwrap().end == count, "{parts:?}");
            assert!(parts.windows(2).all(|two| two[0].end == two[1].start + OVERLAP), "{parts:?}");
        }
        assert_eq!(parts(201, 200).len(), 2);
    }

    #[test]
    fn over_the_overlap_one_passes_into_the_other_and_where_they_differ_they_are_less_sure() {
        let mut joined: Vec<f64> = vec![0.0; 5];
        join(&mut joined, &[1.0; 4], 2, |[a, b], places, t| {
            assert_eq!(places[0], places[1] + 2);
            a + t * (b - a)
        });
        assert_eq!(joined, [0.0, 0.0, 0.0, 0.5, 1.0, 1.0]);
        let [x, y] = [0.0, 2.0].map(|z| vec![glam::DVec3::Z * z]);
        let mixed = |t: f64| deviations_between([&vec![3.0], &vec![5.0]], &x, &y, t)[0];
        assert_eq!([0.0, 0.5, 1.0].map(mixed), [3.0, 18f64.sqrt(), 5.0]);
    }

    /// A clip of three parts with a window of 24 frames, small and quick to search.
    fn clip() -> (Scene, SpacetimeSettings) {
        let settings = Settings::default().with(|s| {
            s.frames = 38;
            s.size = 96;
            s.grid = [5, 5];
            s.wind = 4.0;
            s.seed = 5;
        });
        let quick = SpacetimeSettings {
            iterations: 6,
            resolution: 60.0,
            levels: 1,
            track_levels: 1,
            ..SpacetimeSettings::default()
        };
        (make(&settings).unwrap(), quick)
    }

    #[test]
    fn parts_find_what_all_frames_at_once_find() {
        let (scene, quick) = clip();
        let cloth = Cloth::new(&scene.template);
        let found = |window: usize| {
            let settings = SpacetimeSettings { window, ..quick.clone() };
            let mut search = Search::new(&scene, &cloth, &settings);
            (search.find(0, &mut Session::silent()).unwrap(), search.parts.len())
        };
        let ((all, one), (by_parts, three)) = (found(38), found(24));
        assert_eq!((one, three), (1, 3));
        let truth = scene.truth.vertices.as_ref().unwrap();
        let off = |found: &Found| {
            let pairs = found.frames.iter().flatten().zip(truth.iter().flatten());
            pairs.map(|(a, b)| a.distance(*b)).sum::<f64>() / (38.0 * 25.0)
        };
        let deviations = [&all, &by_parts].map(|found| found.deviations.as_ref().unwrap());
        let pairs = all.frames.iter().flatten().zip(by_parts.frames.iter().flatten());
        let apart = pairs.zip(deviations[0].iter().flatten()).skip(25);
        let ratios = apart.map(|((a, b), deviation)| (a.distance(*b) / deviation).powi(2));
        let ratio = (ratios.sum::<f64>() / (37.0 * 25.0)).sqrt();
        println!("{} m and {} m off, {ratio:.3} deviations apart", off(&all), off(&by_parts));
        assert!(off(&by_parts) < 1.3 * off(&all) && ratio < 0.5);
        let sizes = deviations.map(|d| d.iter().flatten().sum::<f64>());
        println!("deviations {sizes:?}");
        assert!(by_parts.frames.len() == 38 && (sizes[1] / sizes[0] - 1.0).abs() < 0.5);
    }

    #[test]
    fn it_goes_on_within_any_part() {
        let (scene, quick) = clip();
        let settings = SpacetimeSettings { window: 24, iterations: 2, ..quick };
        let cloth = Cloth::new(&scene.template);
        let mut steps = 0;
        let mut most = (0, 0);
        let mut counting = Session::new(|epoch, motion| {
            steps += 1;
            most = (most.0.max(motion.len()), most.1.max(epoch.active_frames));
            assert!(epoch.step <= epoch.of, "{epoch:?}");
            Ok(())
        });
        let whole = Search::new(&scene, &cloth, &settings).find(0, &mut counting).unwrap();
        drop(counting);
        assert_eq!(most, (38, 38), "steps are told of the whole clip");
        let folder = tempfile::tempdir().unwrap();
        let open = || Checkpoints::open(folder.path(), "scene".into(), std::time::Duration::ZERO);
        for until in [steps / 2, 9 * steps / 10] {
            let mut done = 0;
            let mut killed = Session::new(|_, _| {
                done += 1;
                if done == until { Err(foreign_state("stopped")) } else { Ok(()) }
            });
            killed.keep_in(open(), None).unwrap();
            assert!(Search::new(&scene, &cloth, &settings).find(0, &mut killed).is_err());
            drop(killed);
            let mut session = Session::silent();
            session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
            let mut search = Search::new(&scene, &cloth, &settings);
            let found = search.find(0, &mut session).unwrap();
            assert!(found.frames == whole.frames && found.deviations == whole.deviations, "after {until}");
            assert_eq!(search.learnt.len(), 3);
            open().remove().unwrap();
        }
    }
}
