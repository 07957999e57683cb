//! Backward Euler with the force linearised at the start of the step.
//!
//! v̂ = δ v;  A = M + h² ∂²E(x);  A v' = M v̂ + h (M g − ∂E(x));  x' = x + h v'.
//!
//! A is symmetric but not always positive definite: the exact Hessian of compressed cloth is not.
//! Source: \[SAFT\] §1.1 (eq. 5); the force has no velocity part here.

use glam::DVec3;

use super::cloth::Cloth;
use super::state::{State, StepGradients, StepSettings, StepTape, check_finite};
use super::stiffness::{HessianKind, Stiffness};
use tessuto_core::error::{Error, Result};
use tessuto_core::math::factor::{Factor, Scratch};

/// One step; see the module for the formulas and [`super::step::step`] for the arguments.
pub fn step(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
    scratch: &mut Scratch,
) -> Result<StepTape> {
    let h = settings.step;
    check_finite("linearised Euler step", &before, acceleration)?;
    let mut rhs = vec![DVec3::ZERO; cloth.vertex_count()];
    cloth.add_gradient(stiffness, &before.x, -h, &mut rhs);
    for (i, rhs) in rhs.iter_mut().enumerate() {
        *rhs += (before.v[i] * settings.damping + acceleration[i] * h) * cloth.masses[i];
    }
    let factor = factor(cloth, settings, stiffness, &before, scratch);
    let v = cloth.analysis.solve(&cloth.pattern, &factor, &rhs, scratch);
    if let Some(vertex) = v.iter().position(|v| !v.is_finite()) {
        return Err(Error::numerical(
            format!("linearised Euler step, vertex {vertex}"),
            format!("velocity {} m/s", v[vertex]),
            "use the implicit_euler integrator, more sub-steps or smaller forces",
        ));
    }
    let x: Vec<DVec3> = before.x.iter().zip(&v).map(|(x, v)| *x + *v * h).collect();
    Ok(StepTape { before, after: State { x, v }, factor: Some(factor), inertial: None })
}

fn factor(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: &State,
    scratch: &mut Scratch,
) -> Factor {
    let h = settings.step;
    let mut matrix = scratch.zero_matrix(&cloth.pattern);
    cloth.add_hessian(stiffness, &before.x, HessianKind::Exact, h * h, &mut matrix);
    matrix.add_masses(&cloth.pattern, &cloth.masses, 1.0);
    let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
    scratch.recycle_matrix(matrix);
    factor
}

/// Adjoint of [`step`]; see [`super::step::step_vjp`].
///
/// λ = A⁻¹ (v̄ + h x̄);  x̄ₙ = x̄ − h ∂²E λ − h² ∂/∂x [λᵀ ∂²E v'];  v̄ₙ = δ M λ;  ḡ = h M λ;
/// p̄ = −h λᵀ ∂(∂E)/∂p − h² λᵀ ∂(∂²E)/∂p v' for a parameter p of E.
pub fn step_vjp(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    tape: &StepTape,
    gradients: &mut StepGradients,
    scratch: &mut Scratch,
) {
    let h = settings.step;
    let (x, v_next) = (&tape.before.x, &tape.after.v);
    let rhs: Vec<DVec3> = gradients.v.iter().zip(&gradients.x).map(|(v, x)| *v + *x * h).collect();
    let lambda = match &tape.factor {
        Some(factor) => cloth.analysis.solve(&cloth.pattern, factor, &rhs, scratch),
        None => {
            let factor = factor(cloth, settings, stiffness, &tape.before, scratch);
            let lambda = cloth.analysis.solve(&cloth.pattern, &factor, &rhs, scratch);
            scratch.recycle(factor);
            lambda
        }
    };
    // A λ = M λ + h² ∂²E λ = v̄ + h x̄, so −h ∂²E λ = (M λ − v̄)/h − x̄: x̄ cancels.
    for i in 0..x.len() {
        let m_lambda = lambda[i] * cloth.masses[i];
        gradients.x[i] = (m_lambda - gradients.v[i]) / h;
        gradients.v[i] = m_lambda * settings.damping;
        gradients.acceleration[i] = m_lambda * h;
    }
    cloth.add_third(stiffness, x, [&lambda, v_next], -h * h, &mut gradients.x);
    cloth.add_gradient_by_stiffness(x, &lambda, -h, &mut gradients.stiffness);
    cloth.add_hessian_by_stiffness(x, [&lambda, v_next], -h * h, &mut gradients.stiffness);
    for ((edge, &k), out) in cloth.edges.iter().zip(&stiffness.stretch).zip(&mut gradients.rest_lengths) {
        let (e, k) = (edge.along(x), edge.stiffness(k, x));
        let (l, v) = (edge.along(&lambda), edge.along(v_next));
        *out -= h * super::stretch::gradient_by_rest_length(e, k).dot(l);
        *out -= h * h * super::stretch::hessian_by_rest_length(e, k, l, v);
    }
}
