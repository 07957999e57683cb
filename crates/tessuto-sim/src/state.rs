//! What the integrators share: the settings, the state, the record of one sub-step, its gradients.

use glam::DVec3;

use super::cloth::Cloth;
use super::stiffness::Stiffness;
use tessuto_core::error::{Error, Result};
use tessuto_core::math::factor::{Factor, Scratch};
use tessuto_core::mesh::Positions;

/// Time integrator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// One linear solve with the exact Hessian at the start of the step, [`super::linearized_euler`].
    LinearizedEuler,
    /// The minimum of the incremental potential, [`super::implicit_euler`].
    ImplicitEuler,
    /// A network's guess of that minimum, of springs on a regular grid, [`super::surrogate`].
    Surrogate,
}

impl Integrator {
    /// Their names.
    pub const NAMES: &[&str] = &["linearized_euler", "implicit_euler", "surrogate"];
}

/// How a sub-step is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSettings {
    /// The integrator.
    pub integrator: Integrator,
    /// Length h of the sub-step `[s]`.
    pub step: f64,
    /// Factor δ on the velocity before each sub-step.
    pub damping: f64,
    /// Newton's method ends when no coordinate moves by more than this `[m]`, or surely would not in its next
    /// iteration.
    pub tolerance: f64,
    /// Newton's method ends after this many iterations at the latest.
    pub newton_limit: usize,
}

/// Position `[m]` and velocity [m/s] of every vertex, shape `[V]` each.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Positions.
    pub x: Positions,
    /// Velocities.
    pub v: Positions,
}

/// One sub-step, as the adjoint needs it.
#[derive(Debug, Clone)]
pub struct StepTape {
    /// State before the step.
    pub before: State,
    /// State after the step.
    pub after: State,
    /// Factor of the step's linear system or, where that was solved for several times, of one near the last; if it
    /// was worth keeping.
    pub factor: Option<Factor>,
    /// Where the cloth would be without elastic forces `[m]`, if the adjoint needs it.
    pub inertial: Option<Positions>,
}

impl StepTape {
    /// Gives the factor's memory to the next one: for steps that are not gone back through, or many.
    pub fn forget_factor(&mut self, scratch: &mut Scratch) {
        self.factor.take().into_iter().for_each(|factor| scratch.recycle(factor));
    }

    /// The state after the step, alone.
    pub fn into_after(mut self, scratch: &mut Scratch) -> State {
        self.forget_factor(scratch);
        self.after
    }
}

/// ∂L/∂(inputs of a sub-step or rollout).
#[derive(Debug, Clone, PartialEq)]
pub struct StepGradients {
    /// By the positions before.
    pub x: Positions,
    /// By the velocities before.
    pub v: Positions,
    /// By the external accelerations of this step.
    pub acceleration: Positions,
    /// By every element's stiffness, accumulated.
    pub stiffness: Stiffness,
    /// By every edge's rest length, accumulated.
    pub rest_lengths: Vec<f64>,
    /// By every coefficient of friction, accumulated: [`super::contact::Contact::frictions`]; empty without contact.
    pub friction: Vec<f64>,
}

impl StepGradients {
    /// Zeros of the right shape; `x` and `v` are the gradients at the end of time.
    pub fn zeros(cloth: &Cloth) -> Self {
        let zeros = vec![DVec3::ZERO; cloth.vertex_count()];
        Self {
            x: zeros.clone(),
            v: zeros.clone(),
            acceleration: zeros,
            stiffness: Stiffness::uniform(cloth, [0.0; 3]),
            rest_lengths: vec![0.0; cloth.edges.len()],
            friction: cloth.contact.as_ref().map_or(Vec::new(), |c| vec![0.0; c.frictions().len()]),
        }
    }
}

/// Rejects NaN and infinite inputs of a step named `place`: they would spread over the whole cloth in one solve, and
/// nothing would show any more where they came from.
pub(super) fn check_finite(place: &str, before: &State, acceleration: &[DVec3]) -> Result<()> {
    let fields = [
        ("position", "m", &before.x[..]),
        ("velocity", "m/s", &before.v),
        ("acceleration", "m/s²", acceleration),
    ];
    for (what, unit, field) in fields {
        if let Some(vertex) = field.iter().position(|v| !v.is_finite()) {
            return Err(Error::numerical(
                format!("{place}, vertex {vertex}"),
                format!("{what} {} {unit}", field[vertex]),
                "check the forces and the first shape; smaller forces or more sub-steps may help",
            ));
        }
    }
    Ok(())
}
