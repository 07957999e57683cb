//! The start of the search: the fabric followed frame by frame.

use serde::{Deserialize, Serialize};

use super::{Fitted, LevelSearch, Positions, Problem, diverged};
use crate::error::{Error, Result};
use crate::math::damping::Damping;
use crate::math::factor::Scratch;
use crate::motion::terms::low_rank::FrameFactor;
use crate::session::{Epoch, Session, foreign_state, named};

/// Fraction of the last frame's velocity that a frame is expected to go on with.
const INERTIA: f64 = 0.9;
/// Damping at the start of each frame and level, relative to the acceleration term.
const DAMPING: Damping =
    Damping { lambda: 1e-3, accepted: 0.3, rejected: 10.0, least: 0.0, least_rejected: 1e-2 };
/// Most Gauss-Newton steps of a frame at one level, and most attempts to shorten one of them.
const STEPS: usize = 8;
const ATTEMPTS: usize = 6;
/// A frame is found when no vertex moves by more than this `[m]`.
const FOUND: f64 = 2e-5;

/// A sheet whose smooth shear is larger than this many of the spreads it is given is one that shears as a whole; it is
/// followed again with that shear divided by `SHARE` as the spread.
const SHEARS: f64 = 8.0;
const SHARE: f64 = 4.0;

/// What [`Problem::track`] goes on from.
#[derive(Serialize, Deserialize)]
struct Tracked {
    /// Spread of the smooth shear in use `[rad]`.
    smooth: f64,
    /// Positions so far.
    frames: Vec<Positions>,
    /// Gains of the last of them, by resolution.
    gains: Vec<Vec<[f32; 3]>>,
}

impl Problem<'_> {
    /// Follows the fabric frame by frame, coarse to fine, each frame starting from its predecessors: E of one frame, with
    /// ½ ‖x_n − x̂_n‖²/σ_a² for the acceleration, x̂_n = x_{n−1} + 0.9 (x_{n−1} − x_{n−2}).
    ///
    /// A sheet that turns out to shear as a whole is followed once more, with room for that in its prior.
    ///
    /// If a frame's objective is no longer finite, the last good positions are held from there on and the failure is
    /// returned with them.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if it is to go on from a state that does not match; what the session's observer returns.
    pub fn track(&mut self, session: &mut Session) -> Result<Fitted> {
        let template = self.scene.template.positions.clone();
        let levels = self.observed.coarse_to_fine().count();
        let start = |smooth: f64| Tracked {
            smooth,
            frames: vec![template.clone()],
            gains: vec![vec![[1.0; 3]; template.len()]; levels],
        };
        let given = self.settings.shear_smooth;
        let mut tracked: Tracked = session.restore("track")?.unwrap_or_else(|| start(given));
        let mut lost = self.follow(&mut tracked, session)?;
        let found = self.priors.shear.smooth_shear(&tracked.frames);
        if lost.is_none() && tracked.smooth == given && found > SHEARS * given {
            tracked = start(found / SHARE);
            lost = self.follow(&mut tracked, session)?;
        }
        if lost.is_none() {
            session.finish("track", &tracked);
        }
        Ok((tracked.frames, lost))
    }

    /// Follows the fabric through the frames that are left, with the smooth shear that `tracked` names.
    fn follow(&mut self, tracked: &mut Tracked, session: &mut Session) -> Result<Option<Error>> {
        let count = self.scene.frames.len();
        self.priors.shear.smooth = tracked.smooth;
        let mut levels: Vec<_> = self.observed.coarse_to_fine().map(|level| self.at_level(level)).collect();
        let matches = tracked.smooth > 0.0
            && (1..=count).contains(&tracked.frames.len())
            && tracked.gains.len() == levels.len()
            && self.matches(&tracked.frames, &tracked.gains);
        if !matches {
            return Err(foreign_state("track"));
        }
        let before = if tracked.smooth == self.settings.shear_smooth { 0 } else { count - 1 };
        let mut scratch = Scratch::default();
        levels.iter_mut().for_each(|level| level.anneal(0.0));
        for n in tracked.frames.len()..count {
            // Predict the frame from the two before.
            let frames = &mut tracked.frames;
            let last = &frames[n - 1];
            let predicted: Positions = match n.checked_sub(2) {
                Some(k) => last.iter().zip(&frames[k]).map(|(x, old)| *x + (*x - *old) * INERTIA).collect(),
                None => last.clone(),
            };
            // Fit it at every resolution.
            let mut x = predicted.clone();
            let mut value = 0.0;
            for (level, gains) in levels.iter_mut().zip(&mut tracked.gains) {
                level.gains[n].clone_from(gains);
                level.set_adjacent(n, level.explained(n, level.observe(n - 1, last)));
                (x, value) = match level.fit_frame(n, x, &predicted, &mut scratch) {
                    Ok(fitted) => fitted,
                    Err(failure) => {
                        let held = frames[n - 1].clone();
                        frames.resize(count, held);
                        return Ok(Some(failure));
                    }
                };
                gains.clone_from(&level.gains[n]);
                level.set_adjacent(n, Vec::new());
            }
            frames.push(x);
            let epoch = Epoch {
                stage: "track".into(),
                step: n + before,
                of: count - 1 + before,
                active_frames: n + 1,
                losses: named([("total", value)]),
                parameters: named([("shear_smooth", tracked.smooth)]),
            };
            session.step(&epoch, &tracked.frames, Some(&*tracked))?;
        }
        Ok(None)
    }
}

impl LevelSearch<'_, '_> {
    /// Fits one frame with a pull towards its prediction.
    fn fit_frame(
        &mut self,
        frame: usize,
        mut x: Positions,
        predicted: &Positions,
        scratch: &mut Scratch,
    ) -> Result<(Positions, f64)> {
        let cloth = self.problem.cloth;
        let kappa = self.problem.acceleration_weight();
        let pull = |x: &Positions| -> f64 {
            0.5 * kappa * x.iter().zip(predicted).map(|(x, p)| (*x - *p).length_squared()).sum::<f64>()
        };
        let (mut damping, mut value) = (DAMPING, f64::INFINITY);
        for _ in 0..self.problem.settings.iterations.min(STEPS) {
            self.update_gain(frame, &x);
            let terms = self.terms(frame);
            let (values, system) = terms.linearise(cloth, &x);
            value = values.iter().sum::<f64>() + pull(&x);
            if !value.is_finite() {
                return Err(diverged(&format!("frame {frame}"), value));
            }
            let gradient: Positions =
                (0..x.len()).map(|i| system.gradient[i] + (x[i] - predicted[i]) * kappa).collect();
            // Shorten the step until the objective falls.
            for _ in 0..ATTEMPTS {
                let factor = FrameFactor::new(cloth, &system, kappa * (1.0 + damping.lambda), scratch);
                let step = factor.solve(cloth, &gradient, scratch);
                factor.recycle(scratch);
                let next: Positions = x.iter().zip(&step).map(|(x, s)| *x - *s).collect();
                let next_value = terms.value(&next) + pull(&next);
                if next_value <= value {
                    let moved = step.iter().fold(0.0, |m: f64, s| m.max(s.length()));
                    (x, value) = (next, next_value);
                    damping.accept();
                    if moved < FOUND {
                        return Ok((x, value));
                    }
                    break;
                }
                damping.reject();
            }
        }
        Ok((x, value))
    }
}
