//! Differentiable cloth simulation: springs, two implicit integrators, their adjoints.

pub mod angle;
pub mod cloth;
pub mod implicit_euler;
pub mod linearized_euler;
pub mod rollout;
pub mod state;
pub mod step;
pub mod stretch;
pub mod ties;

pub use cloth::{Cloth, Energy, HessianKind, Stiffness};
pub use rollout::{Accelerations, Rollout, RolloutGradients, RolloutInputs, rollout, rollout_vjp};
pub use state::{Integrator, State, StepSettings};
pub use ties::TiedCloth;
