//! The start of the search: the fabric followed frame by frame.

use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use super::best_path::Pool;
use super::look::Gains;
use super::{LevelSearch, Positions, Problem, SpacetimeSettings, diverged};
use crate::motion::terms::FrameSystem;
use crate::motion::terms::low_rank::FrameFactor;
use crate::motion::terms::shear::{FEW, MANY};
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::{Error, Result};
use tessuto_core::math::factor::Scratch;
use tessuto_core::math::minimise::{Model, Policy};

/// How loose the priors of a follower are at the finest level; at coarser ones they are looser, in equal ratios.
#[derive(Debug, Clone, Copy)]
pub(super) enum Start {
    /// As the priors are.
    Strict,
    /// Spreads of strain and shear larger by `start_spread`, of signed bending by `start_bend`, at all levels.
    Loose,
}

impl Start {
    /// Factors on spreads and tail where the fraction `left`, 1 to 0, of the way from coarse to fine remains.
    pub(super) fn loosened(self, settings: &SpacetimeSettings, left: f64) -> ([f64; 2], f64) {
        let s = settings;
        let spreads = match self {
            Self::Strict => [s.start_spread.powf(left), 1.0],
            Self::Loose => [s.start_spread, s.start_bend],
        };
        (spreads, s.start_tail.powf(left))
    }
}

/// Those that the fabric is first followed with.
const FIRST: [Start; STARTS] = [Start::Strict, Start::Loose];
/// Number of them.
pub(super) const STARTS: usize = 2;
/// Fraction of the last frame's velocity that a frame is expected to go on with.
const INERTIA: f64 = 0.9;
/// Damping, the same at the start of each frame and level, is relative to the pull.
const POLICY: Policy =
    Policy { lambda: 1e-3, accepted: [0.3, 0.0], rejected: [10.0, 1e-2], attempts: 6, ..Policy::PATIENT };
/// Most Gauss-Newton steps of a frame at one level.
const STEPS: usize = 16;
/// A frame is found when no vertex moves by more than this `[m]`, or a step lowers its E by less than this part:
/// only the basin counts, `refine` goes on from there.
const FOUND: f64 = 2e-5;
const LEAST_GAIN: f64 = 1e-3;

/// A sheet whose smooth shear is larger than this many of the spreads it is given is one that shears as a whole; it is
/// followed again with that shear as the spread of as many modes as it takes.
const SHEARS: f64 = 8.0;

/// What [`Problem::track`] goes on from.
#[derive(Serialize, Deserialize)]
pub(super) struct Tracked {
    /// Spread of the smooth shear in use `[rad]`.
    pub(super) smooth: f64,
    /// One of each kind of start.
    pub(super) followers: [Follower; STARTS],
}

/// The sheet as followed with one kind of start, in one direction of time.
#[derive(Serialize, Deserialize)]
pub(super) struct Follower {
    /// Positions so far, in the order in which they are followed.
    pub(super) frames: Vec<Positions>,
    /// Gains of the last of them, by resolution and camera.
    pub(super) gains: Vec<Vec<Gains>>,
    /// The place of the first of them at which its objective was no longer finite, with that objective; it stands
    /// still from there on.
    pub(super) lost: Option<(usize, f64)>,
}

impl Problem<'_> {
    /// Follows the fabric frame by frame, coarse to fine, each frame starting from its predecessors: E of one
    /// frame, with ½ ‖x_n − x̂_n‖²/σ_a² for the acceleration, x̂_n = x_{n−1} + 0.9 (x_{n−1} − x_{n−2}).
    ///
    /// A frame has several minima, and the next ones follow into the same: a sheet that shortens in the image may
    /// turn or bend. So the fabric is followed twice at the same time. In both tails shorten from level to level,
    /// from those of a start to the priors' own: what a coarse image shows of a fold is too little to allow one,
    /// and without the folds that a frame has, the next ones go astray. Spreads of one are larger by
    /// `start_spread` at the coarsest level and their own at the finest; those of the other stay larger, that of
    /// signed bending by `start_bend`. A sheet that turns out to shear as a whole is followed once more, with room
    /// for that in its prior.
    ///
    /// What both find is the pool that `refine` starts from, or the best of it alone where they agree.
    ///
    /// If a frame's objective is no longer finite in either, the last good positions are held from there on and the
    /// failure is returned with them.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] if it is to go on from a state that does not match; what the session's
    /// observer returns.
    pub fn track(&mut self, session: &mut Session) -> Result<(Pool, Option<Error>)> {
        let given = self.settings.shear_smooth;
        let mut tracked: Tracked = session.restore("track")?.unwrap_or_else(|| self.start(given));
        self.follow(&mut tracked, session)?;
        let mut best = self.best(&tracked);
        let found = self.priors.shear.smooth_shear(&tracked.followers[best].frames);
        let lost = tracked.followers[best].lost.is_some();
        if !lost && tracked.smooth == given && found > SHEARS * given {
            tracked = self.start(found);
            self.follow(&mut tracked, session)?;
            best = self.best(&tracked);
        }
        if let Some((frame, value)) = tracked.followers[best].lost {
            let failure = diverged(&format!("frame {frame}"), value);
            return Ok((Pool::of(tracked.followers[best].frames.clone()), Some(failure)));
        }
        let pool = self.followed(&tracked);
        session.finish("track", &tracked);
        Ok((pool, None))
    }

    /// Nothing but the first frames known, with the spread `smooth` of the smooth shear.
    pub(super) fn start(&self, smooth: f64) -> Tracked {
        let known = &self.start.known;
        let levels = self.level_count();
        let follower = || Follower {
            frames: known.clone(),
            gains: vec![vec![vec![[1.0; 3]; known[0].len()]; self.eyes.len()]; levels],
            lost: None,
        };
        Tracked { smooth, followers: std::array::from_fn(|_| follower()) }
    }

    /// Searches of all levels, coarse to fine, which learn from `inform` what is known of the clip, their priors
    /// loosened by the spreads and the tail of what part of the way is `left`: 1 at the coarsest level, 0 at the
    /// finest.
    pub(super) fn levels(
        &self,
        inform: impl Fn(&mut LevelSearch),
        loosened: impl Fn(f64) -> ([f64; 2], f64),
    ) -> Vec<LevelSearch<'_, '_>> {
        let mut levels: Vec<_> = self.coarse_to_fine().map(|level| self.at_level(level)).collect();
        let last = (levels.len() - 1).max(1) as f64;
        for (k, level) in levels.iter_mut().enumerate() {
            inform(level);
            let (spreads, tail) = loosened(1.0 - k as f64 / last);
            level.loosen(spreads, tail);
        }
        levels
    }

    /// Number of frames that are followed forward, if the smooth shear ends with the spread `smooth`.
    pub(super) fn forward_steps(&self, smooth: f64) -> usize {
        let once = self.scene.frames.len() - 1;
        if smooth == self.settings.shear_smooth { once } else { 2 * once }
    }

    /// The follower with the lowest E, of those that were lost last.
    fn best(&self, tracked: &Tracked) -> usize {
        let until = |f: &Follower| f.lost.map_or(usize::MAX, |(frame, _)| frame);
        let last = tracked.followers.iter().map(until).max().unwrap_or(0);
        let value = |f: &Follower| match until(f) == last {
            true => self.objective(&f.frames).iter().map(|(_, value)| value).sum(),
            false => f64::INFINITY,
        };
        let values = tracked.followers.each_ref().map(value);
        (1..STARTS).fold(0, |best, k| if values[k] < values[best] { k } else { best })
    }

    /// Follows the fabric through the frames that are left, with the smooth shear that `tracked` names.
    fn follow(&mut self, tracked: &mut Tracked, session: &mut Session) -> Result<()> {
        let count = self.scene.frames.len();
        self.priors.shear.smooth = tracked.smooth;
        self.priors.shear.rank = if tracked.smooth == self.settings.shear_smooth { FEW } else { MANY };
        let mut searches =
            FIRST.map(|start| self.levels(|_| (), |left| start.loosened(&self.settings, left)));
        let done = tracked.followers[0].frames.len();
        let matches = |f: &Follower| {
            f.frames.len() == done && f.gains.len() == searches[0].len() && self.matches(&f.frames, &f.gains)
        };
        if !(tracked.smooth > 0.0 && (1..=count).contains(&done) && tracked.followers.iter().all(matches)) {
            return Err(foreign_state("track"));
        }
        let known = &self.start.known;
        if self.start.way.is_some() && done == known.len() {
            // Only the gains of the clip's first frame are 1.
            for (levels, follower) in searches.iter_mut().zip(&mut tracked.followers) {
                follower.gains = Follower::at(done - 1, known, levels).gains;
            }
        }
        let steps = self.forward_steps(tracked.smooth);
        for n in done..count {
            // Neither keeps more than one core busy.
            let both = searches.iter_mut().zip(&mut tracked.followers).collect();
            let values: Vec<f64> =
                parallel::consume(both, |_, (levels, follower)| follower.follow(n, |k| k, levels));
            let epoch = Epoch {
                stage: "track".into(),
                step: steps + 1 + n - count,
                of: steps,
                active_frames: n + 1,
                losses: named([("total", values[0])]),
                parameters: named([("shear_smooth", tracked.smooth)]),
            };
            session.step(&epoch, &tracked.followers[0].frames, Some(&*tracked))?;
        }
        Ok(())
    }
}

impl Follower {
    /// One that starts from where `motion`, shape [N, V], is in frame `n`.
    pub(super) fn at(n: usize, motion: &[Positions], levels: &mut [LevelSearch]) -> Self {
        let gains = levels.iter_mut().map(|level| {
            level.looks.iter_mut().for_each(|look| look.set_ways(motion));
            level.update_gain(n, &motion[n]);
            level.gains(n)
        });
        Self { gains: gains.collect(), frames: vec![motion[n].clone()], lost: None }
    }

    /// Its frames, if it was not lost.
    pub(super) fn found(&self) -> Option<Vec<Positions>> {
        self.lost.is_none().then(|| self.frames.clone())
    }

    /// Adds the frame at place `k` of the order in which it follows them, given by `frame_at`; returns its objective.
    pub(super) fn follow(
        &mut self,
        k: usize,
        frame_at: impl Fn(usize) -> usize,
        levels: &mut [LevelSearch],
    ) -> f64 {
        let last = &self.frames[k - 1];
        if let Some((_, value)) = self.lost {
            self.frames.push(last.clone());
            return value;
        }
        let (n, adjacent) = (frame_at(k), frame_at(k - 1));
        // Predict the frame from the two before.
        let predicted: Positions = match k.checked_sub(2) {
            Some(k) => last.iter().zip(&self.frames[k]).map(|(x, old)| *x + (*x - *old) * INERTIA).collect(),
            None => last.clone(),
        };
        // Fit it at every resolution.
        let mut x = predicted.clone();
        let mut value = 0.0;
        let mut scratch = Scratch::default();
        for (level, gains) in levels.iter_mut().zip(&mut self.gains) {
            level.set_gains(n, gains);
            let frames = n as f64 - adjacent as f64;
            for look in &mut level.looks {
                look.set_way(n, predicted.iter().zip(last).map(|(x, last)| (*x - *last) / frames));
            }
            level.follow_from(n, adjacent, last);
            (x, value) = level.fit_frame(n, x, &predicted, 1.0, &mut scratch);
            if !value.is_finite() {
                self.lost = Some((k, value));
                self.frames.push(last.clone());
                return value;
            }
            *gains = level.gains(n);
            level.looks.iter_mut().for_each(|look| look.set_adjacent(n, Vec::new()));
        }
        self.frames.push(x);
        value
    }
}

impl LevelSearch<'_, '_> {
    /// Gains of a frame, by camera.
    pub(super) fn gains(&self, frame: usize) -> Vec<Gains> {
        self.looks.iter().map(|look| look.gains[frame].clone()).collect()
    }

    pub(super) fn set_gains(&mut self, frame: usize, gains: &[Gains]) {
        self.looks.iter_mut().zip(gains).for_each(|(look, gains)| look.gains[frame].clone_from(gains));
    }

    /// Compares `frame` with what the `adjacent` one shows with the sheet at `x`.
    fn follow_from(&mut self, frame: usize, adjacent: usize, x: &Positions) {
        for look in &mut self.looks {
            let observed = look.observe(adjacent, x, self.compares);
            look.set_adjacent(frame, look.explained([frame, adjacent], observed));
        }
    }

    /// Fits one frame with a pull towards its prediction, `strength` times that of the acceleration term; returns
    /// its positions and the objective, with which it ends where that is not finite.
    pub(super) fn fit_frame(
        &mut self,
        frame: usize,
        mut x: Positions,
        predicted: &Positions,
        strength: f64,
        scratch: &mut Scratch,
    ) -> (Positions, f64) {
        let kappa = strength * self.acceleration_weight;
        let iterations = self.problem.settings.iterations.min(STEPS);
        let mut model = Pulled { search: self, frame, predicted, kappa, scratch, moved: 0.0 };
        let value = POLICY.minimise(&mut model, &mut x, iterations);
        (x, value)
    }
}

/// One frame with a pull of ½ `kappa` ‖x − `predicted`‖².
struct Pulled<'s, 'p, 'a> {
    search: &'s mut LevelSearch<'p, 'a>,
    frame: usize,
    predicted: &'s Positions,
    kappa: f64,
    scratch: &'s mut Scratch,
    /// How far the last step took the vertex that it took farthest `[m]`.
    moved: f64,
}

impl Pulled<'_, '_, '_> {
    fn pull(&self, x: &Positions) -> f64 {
        0.5 * self.kappa * x.iter().zip(self.predicted).map(|(x, p)| (*x - *p).length_squared()).sum::<f64>()
    }
}

impl Model for Pulled<'_, '_, '_> {
    type Point = Positions;
    type System = FrameSystem;

    fn refresh(&mut self, x: &Positions) {
        self.search.update_gain(self.frame, x);
    }

    fn linearise(&mut self, x: &Positions) -> (f64, FrameSystem) {
        let (values, mut system) = self.search.terms(self.frame).linearise(self.search.problem.cloth, x);
        let gradient = system.gradient.iter_mut().zip(x.iter().zip(self.predicted));
        gradient.for_each(|(g, (x, p))| *g += (*x - *p) * self.kappa);
        (values.iter().sum::<f64>() + self.pull(x), system)
    }

    fn step(&mut self, x: &Positions, system: &FrameSystem, lambda: f64) -> Option<(Positions, f64)> {
        let cloth = self.search.problem.cloth;
        let factor = FrameFactor::new(cloth, system, self.kappa * (1.0 + lambda), self.scratch);
        let step = factor.solve(cloth, &system.gradient, self.scratch);
        factor.recycle(self.scratch);
        self.moved = step.iter().fold(0.0, |m: f64, s| m.max(s.length()));
        let next: Positions = x.iter().zip(&step).map(|(x, s)| *x - *s).collect();
        let value = self.search.terms(self.frame).value(&next) + self.pull(&next);
        Some((next, value))
    }

    fn found(&self, before: f64, after: f64) -> bool {
        self.moved < FOUND || before - after < LEAST_GAIN * after
    }
}

#[cfg(test)]
mod tests {
    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use tessuto_sim::Cloth;

    #[test]
    fn a_fold_costs_less_from_level_to_level() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let mut folded = scene.template.positions.clone();
        folded[0] = folded[0].lerp(folded[1], 0.3);
        let cost = |level: &LevelSearch| {
            let terms = level.terms(1);
            let strain = terms.list().into_iter().find(|term| term.name() == "strain").unwrap();
            strain.value(&folded)
        };
        let levels = problem.levels(|_| (), |left| ([1.0; 2], 100f64.powf(left)));
        let costs: Vec<f64> = levels.iter().map(cost).collect();
        println!("strain {costs:?}");
        assert!(costs.len() > 1 && costs.windows(2).all(|of| of[1] < 0.5 * of[0]));
        assert_eq!(costs[costs.len() - 1], cost(&problem.at_level(0)));
    }

    #[test]
    fn the_lower_objective_counts_but_a_lost_follower_does_not() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let settings =
            SpacetimeSettings { resolution: 1e5, levels: 1, track_levels: 0, ..Default::default() };
        let mut problem = Problem::new(&scene, &cloth, settings).unwrap();
        let mut tracked = problem.start(problem.settings.shear_smooth);
        problem.follow(&mut tracked, &mut Session::silent()).unwrap();
        let value = |f: &Follower| problem.objective(&f.frames).iter().map(|(_, value)| value).sum::<f64>();
        let [a, b] = tracked.followers.each_ref().map(value);
        println!("objectives {a} {b}");
        assert!(a != b, "both starts ended alike: {a}");
        let best = problem.best(&tracked);
        assert_eq!(best, usize::from(b < a));
        tracked.followers.swap(0, 1);
        assert_eq!(problem.best(&tracked), 1 - best);
        tracked.followers[1 - best].lost = Some((2, f64::NAN));
        assert_eq!(problem.best(&tracked), best);
        tracked.followers[best].lost = Some((1, f64::NAN));
        assert_eq!(problem.best(&tracked), 1 - best);
    }
}
