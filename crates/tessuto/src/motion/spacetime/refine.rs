//! The search itself: all frames together.

use serde::{Deserialize, Serialize};

use super::noise::Asked;
use super::{Fitted, Positions, Problem, diverged};
use crate::error::Result;
use crate::math::damping::Damping;
use crate::motion::terms::TERMS;
use crate::session::{Epoch, Session, foreign_state, named};

/// Damping at the start of each level, relative to the acceleration term.
pub(super) const DAMPING: Damping =
    Damping { lambda: 1e-3, accepted: 0.3, rejected: 8.0, least: 1e-6, least_rejected: 0.0 };

/// Part of the iterations over which the priors go from the start's to their own.
pub(super) const ANNEALED: f64 = 0.7;

/// What [`Problem::refine`] goes on from.
#[derive(Serialize, Deserialize)]
struct Refined {
    frames: Vec<Positions>,
    /// Iterations so far, over all levels.
    steps: usize,
    lambda: f64,
    /// Vertices that stand still in what the search started from.
    still: Vec<u32>,
    /// What the clip asks for; the settings' own at the first level.
    asked: Asked,
    /// Gains at the present level.
    gains: Vec<Vec<[f32; 3]>>,
}

impl Problem<'_> {
    /// Lowers E over all `frames` together, coarse to fine.
    ///
    /// If the objective is no longer finite, the positions before that are returned with the failure.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if it is to go on from a state that does not match; what the session's observer returns.
    pub fn refine(&self, frames: Vec<Positions>, session: &mut Session) -> Result<Fitted> {
        let ladder = self.refined_levels();
        let levels = ladder.len();
        let still = self.still_vertices(&frames);
        let start =
            || Refined { frames, still, asked: Asked::default(), steps: 0, lambda: 0.0, gains: Vec::new() };
        let mut refined: Refined = session.restore("refine")?.unwrap_or_else(start);
        let iterations = self.settings.iterations;
        let count = self.scene.frames.len();
        let started = !refined.steps.is_multiple_of(iterations.max(1));
        let gains = refined.gains.len() == count || (!started && refined.gains.is_empty());
        if refined.frames.len() != count || !gains || !self.matches(&refined.frames, &refined.gains) {
            return Err(foreign_state("refine"));
        }
        for (k, level) in ladder.into_iter().enumerate() {
            if refined.steps >= (k + 1) * iterations {
                continue;
            }
            let mut search = self.at_level(level);
            search.still.clone_from(&refined.still);
            let first = refined.steps - k * iterations;
            match first {
                0 => {
                    refined.lambda = DAMPING.lambda;
                    // Of the start only how it bends tells much.
                    refined.asked = match k {
                        0 => self.asked_at_start(&refined.frames),
                        _ => self.asked(&refined.frames),
                    };
                }
                _ => search.gains = std::mem::take(&mut refined.gains),
            }
            search.asked = refined.asked.clone();
            for iteration in first..iterations {
                let mut damping = Damping { lambda: refined.lambda, ..DAMPING };
                search.anneal(refined.steps as f64 / (ANNEALED * (levels * iterations) as f64));
                search.update_references(&refined.frames);
                let step = search.joint_step(&refined.frames, damping.lambda);
                let value = step.value();
                if !value.is_finite() {
                    let failure = diverged(&format!("level {level}, iteration {iteration}"), value);
                    return Ok((refined.frames, Some(failure)));
                }
                refined.steps += 1;
                let mut losses = vec![("total", value)];
                let names = search.terms(0).list().map(|term| term.name());
                losses.extend((0..TERMS).map(|k| (names[k], step.terms[k])));
                losses.push(("acceleration", step.acceleration));
                let epoch = Epoch {
                    stage: "refine".into(),
                    step: refined.steps,
                    of: levels * iterations,
                    active_frames: count,
                    losses: named(losses),
                    parameters: named([("level", level as f64)]),
                };
                // Keep the step if it lowers E.
                match step.next {
                    Some(next) => {
                        refined.frames = next;
                        damping.accept();
                    }
                    None => damping.reject(),
                }
                refined.lambda = damping.lambda;
                refined.gains.clone_from(&search.gains);
                session.step(&epoch, &refined.frames, Some(&refined))?;
            }
        }
        session.finish("refine", &refined);
        Ok((refined.frames, None))
    }
}
