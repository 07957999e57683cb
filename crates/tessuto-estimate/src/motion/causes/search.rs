//! The search: Gauss-Newton with damping.

use super::constraint::Profile;
use super::drive::{Drive, Trajectory};
use super::forces::{Causes, Spread};
use super::objective::{Data, Prior, System};
use super::profile::Optimum;
use tessuto_core::error::Result;
use tessuto_core::math::minimise::{Model, Policy};
use tessuto_core::math::root::Root;
use tessuto_core::mesh::Positions;

/// Bounds of the drag coefficient, and of the internal friction [J·s/rad²].
const DRAGS: [f64; 2] = [0.05, 20.0];
const FRICTIONS: [f64; 2] = [1e-8, 3e-4];
/// Largest change of an unknown logarithm, and a fifth of it of gravity's direction, in one iteration.
const LARGEST_STEP: f64 = 1.5;
/// After a step that failed damping is at least a tenth: with less the next one would be the same. The search ends
/// where none helps, or one gains less than half a standard deviation of one unknown changes, or less than so much
/// of the objective.
const POLICY: Policy = Policy {
    lambda: 1e-3,
    accepted: [0.1, 1e-6],
    rejected: [10.0, 0.1],
    attempts: 3,
    strictly: true,
    least_gain: [0.125, 3e-3],
    most: 0.0,
};

/// What a search ends with.
#[derive(Debug, Clone)]
pub struct Fit {
    pub causes: Causes,
    /// Standard deviations.
    pub spread: Spread,
    /// [`Data::misfit`].
    pub misfit: f64,
    /// [`Optimum::profiles`].
    pub profiles: [Profile; 5],
    /// The Gauss-Newton matrix, shape [unknowns, unknowns].
    pub matrix: Vec<Vec<f64>>,
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
    objective: Objective<'a>,
    state: State,
}

/// What is minimised.
struct Objective<'a> {
    drive: &'a Drive<'a>,
    data: &'a Data<'a>,
    prior: &'a Prior,
    /// Of ln stiffnesses.
    bounds: [[f64; 2]; 3],
    /// Number of points to come whose derivatives are asked for: that of the last one may be of no use.
    linearised: usize,
}

/// Causes and what they make.
struct State {
    causes: Causes,
    trajectory: Trajectory,
    value: f64,
}

impl<'a> Search<'a> {
    /// Begins from `causes`; `near` are the positions after every step of a similar run.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Numerical`] where the cloth cannot be simulated with these.
    pub fn new(
        drive: &'a Drive<'a>,
        data: &'a Data<'a>,
        prior: &'a Prior,
        causes: Causes,
        near: &[Positions],
        bounds: [[f64; 2]; 3],
    ) -> Result<Self> {
        let objective = Objective { drive, data, prior, bounds, linearised: 1 };
        let state = objective.at(causes, near)?;
        Ok(Self { objective, state })
    }

    /// After this many iterations at most.
    pub fn run(mut self, iterations: usize) -> Fit {
        self.objective.linearised = iterations + 1;
        POLICY.minimise(&mut self.objective, &mut self.state, iterations);
        let system = self.objective.system(&self.state);
        let spread = spread(&system);
        let Objective { drive, data, prior, .. } = self.objective;
        let State { causes, trajectory, .. } = &self.state;
        let misfit = data.misfit(&trajectory.frames);
        let profiles = Optimum { drive, data, prior, causes, trajectory, system: &system }.profiles();
        Fit { causes: self.state.causes, spread, misfit, profiles, matrix: system.matrix }
    }

    /// The same without standard deviations.
    pub fn attempt(mut self, iterations: usize) -> Attempt {
        self.objective.linearised = iterations;
        POLICY.minimise(&mut self.objective, &mut self.state, iterations);
        let State { causes, trajectory, value } = self.state;
        let misfit = self.objective.data.misfit(&trajectory.frames);
        Attempt { causes, value, misfit, steps: trajectory.steps }
    }
}

impl Objective<'_> {
    fn at(&self, causes: Causes, near: &[Positions]) -> Result<State> {
        let trajectory = self.drive.run(&causes, self.linearised > 0, near)?;
        let value = self.data.value(&trajectory.frames) + self.prior.value(&causes, None);
        Ok(State { causes, trajectory, value })
    }

    fn system(&self, state: &State) -> System {
        let mut system = System::zeros(state.causes.unknowns());
        self.data.add_system(&state.trajectory, &mut system);
        self.prior.value(&state.causes, Some(&mut system));
        system
    }
}

impl Model for Objective<'_> {
    type Point = State;
    type System = System;

    fn refresh(&mut self, _state: &State) {
        self.linearised -= 1;
    }

    fn linearise(&mut self, state: &State) -> (f64, System) {
        (state.value, self.system(state))
    }

    fn step(&mut self, state: &State, system: &System, lambda: f64) -> Option<(State, f64)> {
        let (n, mut matrix) = (system.gradient.len(), system.matrix.concat());
        (0..n).for_each(|p| matrix[p * n + p] *= 1.0 + lambda);
        let mut step = Root::of(&matrix, n).solve(&system.gradient);
        let logarithms = [step[0], step[1], step[2], step[5], step[6], 5.0 * step[3], 5.0 * step[4]];
        let largest = logarithms.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        let scale = -f64::min(1.0, LARGEST_STEP / largest.max(f64::MIN_POSITIVE));
        step.iter_mut().for_each(|s| *s *= scale);
        let mut causes = state.causes.moved(&step);
        for (k, [low, high]) in causes.ln_stiffness.iter_mut().zip(self.bounds) {
            *k = k.clamp(low, high);
        }
        causes.ln_drag = causes.ln_drag.clamp(DRAGS[0].ln(), DRAGS[1].ln());
        causes.ln_friction = causes.ln_friction.clamp(FRICTIONS[0].ln(), FRICTIONS[1].ln());
        let next = self.at(causes, &state.trajectory.steps).ok()?;
        let value = next.value;
        Some((next, value))
    }
}

/// Roots of the diagonal of the inverse.
fn spread(System { matrix, gradient }: &System) -> Spread {
    let root = Root::of(&matrix.concat(), gradient.len());
    let variance = |p: usize| {
        let unit: Vec<f64> = (0..gradient.len()).map(|q| f64::from(u8::from(p == q))).collect();
        root.solve(&unit)[p]
    };
    let ln_stiffness = [0, 1, 2].map(|p| variance(p).sqrt());
    let down = (variance(3) + variance(4)).sqrt();
    Spread { ln_stiffness, down, ln_drag: variance(5).sqrt(), ln_friction: variance(6).sqrt() }
}
