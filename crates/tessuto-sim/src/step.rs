//! One sub-step and its adjoint, by the integrator of the settings.

use glam::DVec3;

use super::cloth::Cloth;
use super::state::{Integrator, State, StepGradients, StepSettings, StepTape};
use super::stiffness::Stiffness;
use super::{implicit_euler, linearized_euler, surrogate};
use tessuto_core::error::{Error, Result};
use tessuto_core::math::factor::Scratch;

/// Takes one sub-step under external `acceleration` [m/s²], shape `[V]`.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] if the result is not finite; [`tessuto_core::Error::Input`] if the
/// integrator cannot take the cloth or, with contact, the cloth passes through something already.
pub fn step(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
    scratch: &mut Scratch,
) -> Result<StepTape> {
    if cloth.contact.is_some() && settings.integrator != Integrator::ImplicitEuler {
        return Err(Error::input("simulation", "the integrator knows no contact", "choose implicit_euler"));
    }
    in_pool(|| match settings.integrator {
        Integrator::LinearizedEuler => {
            linearized_euler::step(cloth, settings, stiffness, before, acceleration, scratch)
        }
        Integrator::ImplicitEuler => {
            implicit_euler::step(cloth, settings, stiffness, before, acceleration, scratch)
        }
        Integrator::Surrogate => surrogate::step(cloth, settings, stiffness, before, acceleration),
    })
}

/// Adjoint of [`step`]: on entry `gradients.x` and `.v` are ∂L/∂(state after), on return ∂L/∂(state before);
/// `.acceleration` is set, `.stiffness` and `.rest_lengths` are added to.
pub fn step_vjp(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    tape: &StepTape,
    gradients: &mut StepGradients,
    scratch: &mut Scratch,
) {
    in_pool(|| match settings.integrator {
        Integrator::LinearizedEuler => {
            linearized_euler::step_vjp(cloth, settings, stiffness, tape, gradients, scratch);
        }
        Integrator::ImplicitEuler => {
            implicit_euler::step_vjp(cloth, settings, stiffness, tape, gradients, scratch);
        }
        Integrator::Surrogate => {
            surrogate::step_vjp(cloth, settings, stiffness, tape, gradients, scratch);
        }
    });
}

/// Runs on one of the pool's threads, from which its many short parallel parts start at once: from outside each
/// would have to wake one.
pub fn in_pool<T: Send>(run: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| run())
}
