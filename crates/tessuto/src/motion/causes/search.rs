//! The search: Gauss-Newton with damping.

use super::drive::{Drive, Trajectory};
use super::forces::{Causes, Spread};
use super::objective::{Data, Prior, System};
use crate::error::Result;
use crate::mesh::Positions;

/// Bounds of the drag coefficient, and of the internal friction [J·s/rad²].
const DRAGS: [f64; 2] = [0.05, 20.0];
const FRICTIONS: [f64; 2] = [1e-8, 3e-4];
/// Largest change of an unknown logarithm, and a fifth of it of gravity's direction, in one iteration.
const LARGEST_STEP: f64 = 1.5;
/// The search ends when an iteration gains less than so much of the objective, or less than this: what half a standard deviation of one
/// unknown changes.
const LEAST_PART: f64 = 3e-3;
const LEAST_GAIN: f64 = 0.125;
const ATTEMPTS: usize = 3;
/// Damping after a step that failed, at least: with less the next one would be the same.
const LEAST_DAMPING: f64 = 0.1;

/// What a search ends with.
#[derive(Debug, Clone)]
pub struct Fit {
    pub causes: Causes,
    /// Standard deviations.
    pub spread: Spread,
    /// [`Data::misfit`].
    pub misfit: f64,
}

/// What a few iterations lead to.
#[derive(Debug, Clone)]
pub struct Attempt {
    pub causes: Causes,
    /// The objective.
    pub value: f64,
    /// [`Data::misfit`].
    pub misfit: f64,
    /// [`Trajectory::steps`].
    pub steps: Vec<Positions>,
}

/// Causes under way.
pub struct Search<'a> {
    drive: &'a Drive<'a>,
    data: &'a Data<'a>,
    prior: &'a Prior,
    causes: Causes,
    trajectory: Trajectory,
    value: f64,
    /// Of ln stiffnesses.
    bounds: [[f64; 2]; 3],
}

impl<'a> Search<'a> {
    /// Begins from `causes`; `near` are the positions after every step of a similar run.
    ///
    /// # Errors
    /// [`crate::Error::Numerical`] where the cloth cannot be simulated with these.
    pub fn new(
        drive: &'a Drive<'a>,
        data: &'a Data<'a>,
        prior: &'a Prior,
        causes: Causes,
        near: &[Positions],
        bounds: [[f64; 2]; 3],
    ) -> Result<Self> {
        let trajectory = drive.run(&causes, true, near)?;
        let value = data.value(&trajectory.frames) + prior.value(&causes, None);
        Ok(Self { drive, data, prior, causes, trajectory, value, bounds })
    }

    fn at(&self, causes: Causes, with_derivatives: bool) -> Result<Self> {
        let trajectory = self.drive.run(&causes, with_derivatives, &self.trajectory.steps)?;
        let value = self.data.value(&trajectory.frames) + self.prior.value(&causes, None);
        Ok(Self { causes, trajectory, value, ..*self })
    }

    fn system(&self) -> System {
        let mut system = System::zeros(self.causes.unknowns());
        self.data.add_system(&self.trajectory, &mut system);
        self.prior.value(&self.causes, Some(&mut system));
        system
    }

    /// After so many iterations at most.
    pub fn run(mut self, iterations: usize) -> Fit {
        self.iterate(iterations, true);
        let spread = spread(&self.system().matrix);
        let misfit = self.data.misfit(&self.trajectory.frames);
        Fit { causes: self.causes, spread, misfit }
    }

    /// The same without standard deviations.
    pub fn attempt(mut self, iterations: usize) -> Attempt {
        self.iterate(iterations, false);
        let misfit = self.data.misfit(&self.trajectory.frames);
        Attempt { causes: self.causes, value: self.value, misfit, steps: self.trajectory.steps }
    }

    /// `goes_on`: derivatives are asked for after the last iteration, too.
    fn iterate(&mut self, iterations: usize, goes_on: bool) {
        let mut lambda = 1e-3;
        for n in 0..iterations {
            let before = self.value;
            let gained = self.step(&mut lambda, goes_on || n + 1 < iterations);
            if !gained || before - self.value < LEAST_GAIN.max(LEAST_PART * before) {
                break;
            }
        }
    }

    /// A step that lowers the objective, if one is found; with derivatives where the search goes on.
    fn step(&mut self, lambda: &mut f64, goes_on: bool) -> bool {
        let system = self.system();
        for _ in 0..ATTEMPTS {
            let mut matrix = system.matrix.clone();
            (0..matrix.len()).for_each(|p| matrix[p][p] *= 1.0 + *lambda);
            let mut step = solve(&matrix, &system.gradient);
            let logarithms = [step[0], step[1], step[2], step[5], step[6], 5.0 * step[3], 5.0 * step[4]];
            let largest = logarithms.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            let scale = -f64::min(1.0, LARGEST_STEP / largest.max(f64::MIN_POSITIVE));
            step.iter_mut().for_each(|s| *s *= scale);
            let mut causes = self.causes.moved(&step);
            for (k, [low, high]) in causes.ln_stiffness.iter_mut().zip(self.bounds) {
                *k = k.clamp(low, high);
            }
            causes.ln_drag = causes.ln_drag.clamp(DRAGS[0].ln(), DRAGS[1].ln());
            causes.ln_friction = causes.ln_friction.clamp(FRICTIONS[0].ln(), FRICTIONS[1].ln());
            if let Ok(next) = self.at(causes, goes_on)
                && next.value < self.value
            {
                *self = next;
                *lambda = (*lambda * 0.1).max(1e-6);
                return true;
            }
            *lambda = (10.0 * *lambda).max(LEAST_DAMPING);
        }
        false
    }
}

/// Roots of the diagonal of the inverse.
fn spread(matrix: &[Vec<f64>]) -> Spread {
    let variance = |p: usize| {
        let unit: Vec<f64> = (0..matrix.len()).map(|q| f64::from(u8::from(p == q))).collect();
        solve(matrix, &unit)[p]
    };
    let ln_stiffness = [0, 1, 2].map(|p| variance(p).sqrt());
    let down = (variance(3) + variance(4)).sqrt();
    Spread { ln_stiffness, down, ln_drag: variance(5).sqrt(), ln_friction: variance(6).sqrt() }
}

/// Solution of a small positive definite system, by Cholesky's method.
fn solve(matrix: &[Vec<f64>], rhs: &[f64]) -> Vec<f64> {
    let n = rhs.len();
    let mut l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            l[i][j] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / l[j][j] };
        }
    }
    let mut x = rhs.to_vec();
    for i in 0..n {
        x[i] = (x[i] - (0..i).map(|k| l[i][k] * x[k]).sum::<f64>()) / l[i][i];
    }
    for i in (0..n).rev() {
        x[i] = (x[i] - (i + 1..n).map(|k| l[k][i] * x[k]).sum::<f64>()) / l[i][i];
    }
    x
}
