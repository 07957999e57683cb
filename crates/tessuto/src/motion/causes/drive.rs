//! The motion that causes make, and its derivatives by them.
//!
//! BDF2, whose damping of slow motion is of third order in the step: with x̄ = (4 xₙ − xₙ₋₁)/3, v̄ likewise and H = 2h/3,
//!
//!   x' = argmin ½ ‖x − x̄ − H v̄ − H² g‖²_M/H² + ½ γ/H ‖x − x̄‖²_M + ½ ‖x − target‖²_{M κ} + E(x),   v' = (x' − x̄)/H,
//!
//! an implicit Euler step from (x̄, v̄) with other masses. Its derivatives follow from the implicit function theorem.

use glam::DVec3;
use rayon::prelude::*;

use super::forces::{Causes, FIRST, GRAVITY, Knots};
use crate::error::Result;
use crate::math::factor::{Factor, Scratch};
use crate::mesh::Positions;
use crate::sim::implicit_euler::hessian;
use crate::sim::step::step;
use crate::sim::{Cloth, HessianKind, Integrator, State, StepSettings, Stiffness};

/// Newton's method ends when no coordinate moves by more than this `[m]`, or after so many iterations.
const TOLERANCE: f64 = 1e-7;
const NEWTON_LIMIT: usize = 12;

/// A cloth under way.
pub struct Drive<'a> {
    /// The cloth as cut.
    pub cloth: &'a Cloth,
    /// Length h of a step `[s]`.
    pub h: f64,
    /// Steps per frame.
    pub substeps: usize,
    /// Where the ties pull at every step, shape [steps + 1, V] `[m]`; it starts from the first, at rest.
    pub targets: &'a [Positions],
    /// Strength κ of every vertex's tie [1/s²].
    pub ties: Vec<f64>,
    /// Times of the wind's values.
    pub knots: Knots,
}

/// Positions of every frame [N, V], and their derivatives by every unknown [N, unknowns, V], where these are asked for.
pub struct Trajectory {
    pub frames: Vec<Positions>,
    pub tangents: Vec<Vec<Positions>>,
}

/// What one step is made of, for its derivatives.
struct Taken<'a> {
    bar: &'a State,
    after: &'a State,
    big: f64,
    time: f64,
    factor: &'a Factor,
    /// Springs of one kind alone.
    only: &'a [Stiffness; 3],
}

/// Start of a step: x̄, v̄.
fn combined(now: &State, before: Option<&State>) -> State {
    let Some(before) = before else { return now.clone() };
    let mix = |a: &Positions, b: &Positions| a.iter().zip(b).map(|(a, b)| (*a * 4.0 - *b) / 3.0).collect();
    State { x: mix(&now.x, &before.x), v: mix(&now.v, &before.v) }
}

impl Drive<'_> {
    /// Simulates under `causes`, with derivatives if they are asked for.
    ///
    /// # Errors
    /// [`crate::Error::Numerical`] from a step.
    pub fn run(&self, causes: &Causes, with_tangents: bool) -> Result<Trajectory> {
        let count = self.cloth.vertex_count();
        let k = causes.stiffness();
        let stiffness = Stiffness::uniform(self.cloth, k);
        let only = [0, 1, 2].map(|i| {
            let mut alone = [0.0; 3];
            alone[i] = k[i];
            Stiffness::uniform(self.cloth, alone)
        });
        let still = |x: Positions| State { v: vec![DVec3::ZERO; x.len()], x };
        let mut scratch = Scratch::default();
        let mut heavy = self.cloth.clone();
        let (mut now, mut before) = (still(self.targets[0].clone()), None);
        let unknowns = if with_tangents { causes.unknowns() } else { 0 };
        let mut tangents = vec![still(vec![DVec3::ZERO; count]); unknowns];
        let mut tangents_before: Option<Vec<State>> = None;
        let shapes = |tangents: &[State]| tangents.iter().map(|t| t.x.clone()).collect();
        let mut out = Trajectory { frames: vec![now.x.clone()], tangents: vec![shapes(&tangents)] };
        for n in 0..self.targets.len() - 1 {
            let big = if before.is_some() { 2.0 / 3.0 * self.h } else { self.h };
            let bar = combined(&now, before.as_ref());
            let time = (n + 1) as f64 * self.h;
            let after = self.step(
                causes,
                &stiffness,
                &bar,
                [big, time],
                &self.targets[n + 1],
                &mut heavy,
                &mut scratch,
            )?;
            if with_tangents {
                let matrix = hessian(&heavy, &stiffness, &after.x, big, HessianKind::Exact, &mut scratch);
                let factor = self.cloth.analysis.factorize(&self.cloth.pattern, &matrix, &mut scratch);
                scratch.recycle_matrix(matrix);
                let taken = Taken { bar: &bar, after: &after, big, time, factor: &factor, only: &only };
                let next = (0..unknowns)
                    .into_par_iter()
                    .map_init(Scratch::default, |scratch, p| {
                        let start = combined(&tangents[p], tangents_before.as_ref().map(|t| &t[p]));
                        self.tangent(causes, &taken, p, &start, scratch)
                    })
                    .collect();
                scratch.recycle(factor);
                tangents_before = Some(std::mem::replace(&mut tangents, next));
            }
            before = Some(std::mem::replace(&mut now, after));
            if (n + 1).is_multiple_of(self.substeps) {
                out.frames.push(now.x.clone());
                out.tangents.push(shapes(&tangents));
            }
        }
        Ok(out)
    }

    /// One step from `bar`; `heavy` gets the masses with drag and ties.
    #[expect(clippy::too_many_arguments, reason = "what a step depends on")]
    fn step(
        &self,
        causes: &Causes,
        stiffness: &Stiffness,
        bar: &State,
        [big, time]: [f64; 2],
        target: &[DVec3],
        heavy: &mut Cloth,
        scratch: &mut Scratch,
    ) -> Result<State> {
        let sq = big * big;
        let outer = causes.gravity() + causes.wind_at(&self.knots, time);
        let factors = self.ties.iter().map(|tie| 1.0 + sq * tie + big * causes.drag());
        heavy
            .masses
            .iter_mut()
            .zip(&self.cloth.masses)
            .zip(factors.clone())
            .for_each(|((h, m), f)| *h = m * f);
        let acceleration: Positions = factors
            .enumerate()
            .map(|(i, factor)| {
                let drift = bar.v[i] * big;
                let pull = (target[i] - bar.x[i]) * (sq * self.ties[i]);
                ((drift + outer * sq + pull) / factor - drift) / sq
            })
            .collect();
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: big,
            damping: 1.0,
            tolerance: TOLERANCE,
            newton_limit: NEWTON_LIMIT,
        };
        Ok(step(heavy, &settings, stiffness, bar.clone(), &acceleration, scratch)?.after)
    }

    /// Derivative of a step by unknown `p`, given that of its start.
    fn tangent(
        &self,
        causes: &Causes,
        taken: &Taken,
        p: usize,
        start: &State,
        scratch: &mut Scratch,
    ) -> State {
        let (cloth, big, drag) = (self.cloth, taken.big, causes.drag());
        let [a, b] = causes.across();
        let outer = match p {
            3 => a * GRAVITY,
            4 => b * GRAVITY,
            p if p >= FIRST => {
                let (knot, weight) = self.knots.around(taken.time);
                let own = match (p - FIRST) / 3 {
                    k if k == knot => 1.0 - weight,
                    k if k == knot + 1 => weight,
                    _ => 0.0,
                };
                DVec3::AXES[(p - FIRST) % 3] * own
            }
            _ => DVec3::ZERO,
        };
        let mut rhs: Positions = (0..cloth.vertex_count())
            .map(|i| {
                let m = cloth.masses[i];
                let mut force =
                    (start.x[i] * (1.0 + big * drag) + start.v[i] * big) * (m / (big * big)) + outer * m;
                if p == 5 {
                    force += (taken.bar.x[i] - taken.after.x[i]) * (m * drag / big);
                }
                force
            })
            .collect();
        if let Some(only) = taken.only.get(p) {
            cloth.add_gradient(only, &taken.after.x, -1.0, &mut rhs);
        }
        let x = cloth.analysis.solve(&cloth.pattern, taken.factor, &rhs, scratch);
        let v = x.iter().zip(&start.x).map(|(a, b)| (*a - *b) / big).collect();
        State { x, v }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;
    use crate::mesh::grid;
    use glam::DVec2;

    #[test]
    fn tangents_are_differences_of_trajectories() {
        let mut mesh = grid(6, 5, DVec2::new(0.2, 0.16), 1.0);
        let cloth = Cloth::flat(&mesh, 1.0);
        let mut rng = Rng::new(4, 0);
        mesh.positions
            .iter_mut()
            .for_each(|p| *p += DVec3::Z * (0.02 * (30.0 * p.x + 9.0 * p.y).sin()) + rng.vector() * 1e-4);
        let targets: Vec<Positions> = (0..9)
            .map(|n| {
                mesh.positions.iter().map(|p| *p + DVec3::new(2e-3, -1e-3, 3e-3) * f64::from(n)).collect()
            })
            .collect();
        let mut ties = vec![40.0; 30];
        ties[0] = 1e6;
        ties[5] = 1e6;
        let knots = Knots { count: 3, end: 0.08 };
        let drive = Drive { cloth: &cloth, h: 0.01, substeps: 2, targets: &targets, ties, knots };
        let causes = Causes {
            ln_stiffness: [100f64.ln(), 2e-3f64.ln(), 5e-4f64.ln()],
            down: DVec3::new(0.1, 1.0, -0.2).normalize(),
            ln_drag: 0.3,
            wind: (0..3).map(|_| rng.vector()).collect(),
        };
        let run = drive.run(&causes, true).unwrap();
        for _ in 0..3 {
            let direction: Vec<f64> = (0..causes.unknowns()).map(|_| rng.signed()).collect();
            let at = |s: f64| {
                drive.run(&causes.moved(&direction.iter().map(|d| d * s).collect::<Vec<_>>()), false).unwrap()
            };
            let (plus, minus) = (at(1e-4), at(-1e-4));
            for n in 1..run.frames.len() {
                let (mut off, mut size) = (0.0f64, 0.0f64);
                for i in 0..30 {
                    let tangent: DVec3 = run.tangents[n].iter().zip(&direction).map(|(t, d)| t[i] * *d).sum();
                    let difference = (plus.frames[n][i] - minus.frames[n][i]) / 2e-4;
                    off = off.max(tangent.distance(difference));
                    size = size.max(difference.length());
                }
                assert!(size > 1e-5 && off < 2e-3 * size, "frame {n}: {off} of {size}");
            }
        }
    }
}
