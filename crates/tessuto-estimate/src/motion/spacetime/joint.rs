//! All frames together: their objective, and how a step is solved for.

use glam::DVec3;
use tessuto_core::parallel;

use super::acceleration::{self, second_differences, second_differences_transposed};
use super::{LevelSearch, Positions};
use crate::motion::terms::low_rank::FrameFactor;
use crate::motion::terms::{FrameSystem, TERMS};
use tessuto_core::math::conjugate_gradients::{Measure, conjugate_gradients};
use tessuto_core::math::factor::Scratch;
use tessuto_core::math::minimise::{Model, Policy};
use tessuto_sim::Cloth;

/// Damping is relative to the acceleration term.
pub(super) const POLICY: Policy =
    Policy { lambda: 1e-3, accepted: [0.3, 1e-6], rejected: [8.0, 0.0], ..Policy::PATIENT };
/// Conjugate gradients end when the square of the preconditioned residual has fallen to this fraction, or after this
/// many iterations.
const CG_TOLERANCE: f64 = 1e-3;
const CG_LIMIT: usize = 60;

/// All frames but the first at one level: steps are damped by κλ with the weight κ of the acceleration term.
pub(super) struct Joint<'s, 'p, 'a> {
    pub search: &'s mut LevelSearch<'p, 'a>,
    /// Where the priors are, as [`LevelSearch::anneal`] takes it.
    pub annealed: f64,
    /// Sum over the frames of every term, and the acceleration term, before the last step.
    pub before: ([f64; TERMS], f64),
}

impl<'s, 'p, 'a> Joint<'s, 'p, 'a> {
    /// The priors as the settings want them.
    pub fn new(search: &'s mut LevelSearch<'p, 'a>) -> Self {
        Self { search, annealed: 1.0, before: ([0.0; TERMS], 0.0) }
    }
}

impl Model for Joint<'_, '_, '_> {
    /// Shape [N, V].
    type Point = Vec<Positions>;
    type System = Vec<FrameSystem>;

    fn refresh(&mut self, frames: &Self::Point) {
        self.search.anneal(self.annealed);
        self.search.update_references(frames);
    }

    fn linearise(&mut self, frames: &Self::Point) -> (f64, Self::System) {
        let (search, cloth) = (&*self.search, self.search.problem.cloth);
        let linearised: Vec<_> = parallel::later(frames, |(n, x)| search.terms(n).linearise(cloth, x));
        let mut terms = [0.0; TERMS];
        linearised.iter().for_each(|(values, _)| (0..TERMS).for_each(|k| terms[k] += values[k]));
        let acceleration = acceleration::value(&search.departure(frames), search.acceleration_weight);
        self.before = (terms, acceleration);
        let systems = linearised.into_iter().map(|(_, system)| system).collect();
        (terms.iter().sum::<f64>() + acceleration, systems)
    }

    fn step(&mut self, x: &Self::Point, systems: &Self::System, lambda: f64) -> Option<(Self::Point, f64)> {
        let (search, kappa) = (&*self.search, self.search.acceleration_weight);
        let joint = JointSystem { cloth: search.problem.cloth, systems, kappa, lambda };
        let change = joint.solve(&joint.gradient(&search.departure(x)));
        let mut next = x.clone();
        for (x, s) in next[1..].iter_mut().zip(&change) {
            x.iter_mut().zip(s).for_each(|(x, s)| *x -= *s);
        }
        let values: Vec<f64> = parallel::later(&next, |(n, x)| search.terms(n).value(x));
        let value = values.iter().sum::<f64>() + acceleration::value(&search.departure(&next), kappa);
        Some((next, value))
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
        parallel::map(p.len(), |n| {
            let mut out = self.systems[n].multiply(self.cloth, &p[n]);
            for (i, out) in out.iter_mut().enumerate() {
                *out += (bent[n + 1][i] + p[n][i] * self.lambda) * self.kappa;
            }
            out
        })
    }

    /// Cholesky factor of every frame's block, its neighbours in time left out, to the digits that a
    /// preconditioner needs.
    pub fn factors(&self) -> Vec<FrameFactor> {
        let diagonal = self.kappa * (acceleration::DIAGONAL + self.lambda);
        let factor = |scratch: &mut Scratch, system: &FrameSystem| {
            FrameFactor::new(self.cloth, system, diagonal, scratch).rounded(scratch)
        };
        parallel::map_with(self.systems.len(), Scratch::default, |scratch, n| {
            factor(scratch, &self.systems[n])
        })
    }

    /// Solves the system for `rhs`, shape [N−1, V].
    pub fn solve(&self, rhs: &Vec<Positions>) -> Vec<Positions> {
        self.solve_with(&self.factors(), rhs, CG_TOLERANCE, CG_LIMIT)
    }

    /// Solves the system for `rhs`, shape [N−1, V], given [`Self::factors`], tolerance and limit of the conjugate
    /// gradients.
    pub fn solve_with(
        &self,
        factors: &[FrameFactor],
        rhs: &Vec<Positions>,
        tolerance: f64,
        limit: usize,
    ) -> Vec<Positions> {
        let precondition = |r: &Vec<Positions>| -> Vec<Positions> {
            let solve = |scratch: &mut Scratch, n: usize| factors[n].solve(self.cloth, &r[n], scratch);
            parallel::map_with(r.len(), Scratch::default, solve)
        };
        let end = (Measure::Preconditioned, tolerance);
        conjugate_gradients(rhs, |p| self.multiply(p), precondition, end, limit).0
    }
}

/// DᵀD x of the second differences D in time.
fn bend_in_time(frames: &[Positions]) -> Vec<Positions> {
    second_differences_transposed(&second_differences(frames), [frames.len(), frames[0].len()])
}
