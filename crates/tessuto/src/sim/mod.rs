//! Differentiable cloth simulation: springs, two implicit integrators, their adjoints.

pub mod angle;
pub mod cloth;
pub mod implicit_euler;
pub mod linearized_euler;
pub mod rollout;
pub mod step;
pub mod stretch;

pub use cloth::{Cloth, HessianKind, Energy, Stiffness};
pub use rollout::{RolloutInputs, RolloutGradients, Accelerations, Rollout, rollout, rollout_vjp};
pub use step::{Integrator, State, StepSettings};
