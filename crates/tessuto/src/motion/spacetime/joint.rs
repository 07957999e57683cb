//! One step on all frames together.

use glam::DVec3;
use rayon::prelude::*;

use super::acceleration::{self, second_differences, second_differences_transposed};
use super::refine::DAMPING;
use super::{LevelSearch, Positions};
use crate::math::conjugate_gradients::{Measure, conjugate_gradients};
use crate::math::factor::Scratch;
use crate::motion::terms::low_rank::FrameFactor;
use crate::motion::terms::{FrameSystem, TERMS};
use crate::sim::Cloth;

/// Conjugate gradients end when the square of the preconditioned residual has fallen to this fraction, or after so many
/// iterations.
const CG_TOLERANCE: f64 = 1e-3;
const CG_LIMIT: usize = 60;

/// What [`LevelSearch::joint_step`] found.
pub(super) struct JointStep {
    /// Sum over the frames of every term before the step.
    pub terms: [f64; TERMS],
    /// The acceleration term before the step.
    pub acceleration: f64,
    /// Positions after it, shape [N, V]; `None` if it does not lower E.
    pub next: Option<Vec<Positions>>,
}

impl JointStep {
    /// E before the step.
    pub fn value(&self) -> f64 {
        self.terms.iter().sum::<f64>() + self.acceleration
    }
}

impl LevelSearch<'_, '_> {
    /// One Gauss-Newton step on the frames 1 … N−1, damped by κλ with the weight κ of the acceleration term.
    pub fn joint_step(&self, frames: &[Positions], lambda: f64) -> JointStep {
        let cloth = self.problem.cloth;
        let kappa = self.acceleration_weight;
        // Linearise every frame.
        let linearised: Vec<_> =
            frames.par_iter().enumerate().skip(1).map(|(n, x)| self.terms(n).linearise(cloth, x)).collect();
        let mut terms = [0.0; TERMS];
        linearised.iter().for_each(|(values, _)| (0..TERMS).for_each(|k| terms[k] += values[k]));
        let systems: Vec<FrameSystem> = linearised.into_iter().map(|(_, system)| system).collect();
        let mut step = JointStep {
            terms,
            acceleration: acceleration::value(&self.departure(frames), kappa),
            next: None,
        };
        // Solve for the step.
        let joint = JointSystem { cloth, systems: &systems, kappa, lambda };
        let gradient = joint.gradient(&self.departure(frames));
        let change = joint.solve(&gradient);
        // Take it if it helps.
        let mut next = frames.to_vec();
        for (x, s) in next[1..].iter_mut().zip(&change) {
            x.iter_mut().zip(s).for_each(|(x, s)| *x -= *s);
        }
        let values: Vec<f64> =
            next.par_iter().enumerate().skip(1).map(|(n, x)| self.terms(n).value(x)).collect();
        let next_value = values.iter().sum::<f64>() + acceleration::value(&self.departure(&next), kappa);
        step.next = (next_value <= step.value()).then_some(next);
        step
    }

    /// `frames` after so many joint steps, the priors as [`Self::anneal`] sets them for `t` of the number of the step.
    pub fn joint_steps(
        &mut self,
        mut frames: Vec<Positions>,
        count: usize,
        t: impl Fn(usize) -> f64,
    ) -> Vec<Positions> {
        let mut damping = DAMPING;
        for k in 0..count {
            self.anneal(t(k));
            self.update_references(&frames);
            match self.joint_step(&frames, damping.lambda).next {
                Some(next) => {
                    frames = next;
                    damping.accept();
                }
                None => damping.reject(),
            }
        }
        frames
    }
}

/// The system H + κ DᵀD + κλ over the frames 1 … N−1, with the frames' own matrices in H.
pub(super) struct JointSystem<'a> {
    pub cloth: &'a Cloth,
    pub systems: &'a [FrameSystem],
    /// Weight κ of the acceleration term [1/m²].
    pub kappa: f64,
    pub lambda: f64,
}

impl JointSystem<'_> {
    /// ∂E/∂x at `frames`, shape [N−1, V].
    pub fn gradient(&self, frames: &[Positions]) -> Vec<Positions> {
        let bent = bend_in_time(frames);
        let frame = |(system, bent): (&FrameSystem, &Positions)| {
            system.gradient.iter().zip(bent).map(|(g, b)| *g + *b * self.kappa).collect()
        };
        self.systems.iter().zip(&bent[1..]).map(frame).collect()
    }

    pub fn multiply(&self, p: &[Positions]) -> Vec<Positions> {
        let mut padded = vec![vec![DVec3::ZERO; self.cloth.vertex_count()]];
        padded.extend_from_slice(p);
        let bent = bend_in_time(&padded);
        (0..p.len())
            .into_par_iter()
            .map(|n| {
                let mut out = self.systems[n].multiply(self.cloth, &p[n]);
                for (i, out) in out.iter_mut().enumerate() {
                    *out += (bent[n + 1][i] + p[n][i] * self.lambda) * self.kappa;
                }
                out
            })
            .collect()
    }

    /// Cholesky factor of every frame's block, its neighbours in time left out, to the digits that a preconditioner needs.
    pub fn factors(&self) -> Vec<FrameFactor> {
        let diagonal = self.kappa * (acceleration::DIAGONAL + self.lambda);
        let factor = |scratch: &mut Scratch, system: &FrameSystem| {
            FrameFactor::new(self.cloth, system, diagonal, scratch).rounded(scratch)
        };
        self.systems.par_iter().map_init(Scratch::default, factor).collect()
    }

    /// Solves the system for `rhs`, shape [N−1, V].
    pub fn solve(&self, rhs: &Vec<Positions>) -> Vec<Positions> {
        self.solve_with(&self.factors(), rhs, CG_TOLERANCE, CG_LIMIT)
    }

    /// Solves the system for `rhs`, shape [N−1, V], given [`Self::factors`], tolerance and limit of the conjugate gradients.
    pub fn solve_with(
        &self,
        factors: &[FrameFactor],
        rhs: &Vec<Positions>,
        tolerance: f64,
        limit: usize,
    ) -> Vec<Positions> {
        let precondition = |r: &Vec<Positions>| -> Vec<Positions> {
            let solve = |scratch: &mut Scratch, (r, factor): (&Positions, &FrameFactor)| {
                factor.solve(self.cloth, r, scratch)
            };
            r.par_iter().zip(factors).map_init(Scratch::default, solve).collect()
        };
        let end = (Measure::Preconditioned, tolerance);
        conjugate_gradients(rhs, |p| self.multiply(p), precondition, end, limit).0
    }
}

/// DᵀD x of the second differences D in time.
fn bend_in_time(frames: &[Positions]) -> Vec<Positions> {
    second_differences_transposed(&second_differences(frames), [frames.len(), frames[0].len()])
}
