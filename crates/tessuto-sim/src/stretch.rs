//! Stretch springs along the mesh edges.

use glam::{DMat3, DVec3};

use tessuto_core::math::scalar::{Scalar, Vector, dot, scale};
use tessuto_core::math::{hyper_dual, outer};

/// Lengths below this `[m]` are taken as this, so that directions stay finite.
const LENGTH_FLOOR: f64 = 1e-9;

/// Stretch energy of one spring: E = ½ k (‖e‖ − l)².
///
/// - `e` = x1 − x0 `[m]`; `stiffness` k [N/m]; `rest_length` l `[m]`, > 0
/// - returns E `[J]`
///
/// Source: \[SAFT\] §1.2.
#[inline]
pub fn value(e: DVec3, stiffness: f64, rest_length: f64) -> f64 {
    0.5 * stiffness * (e.length() - rest_length).powi(2)
}

/// ∂E/∂e of [`value`]; it acts on x1, its negative on x0.
#[inline]
pub fn gradient(e: DVec3, stiffness: f64, rest_length: f64) -> DVec3 {
    DVec3::from_array(gradient_of(e.to_array(), stiffness, rest_length))
}

fn gradient_of<T: Scalar>(e: Vector<T>, stiffness: f64, rest_length: f64) -> Vector<T> {
    // k (1 − l/‖e‖) e
    let inverse = (dot(e, e) + T::constant(LENGTH_FLOOR * LENGTH_FLOOR)).sqrt().recip();
    scale(e, T::constant(stiffness) - T::constant(stiffness * rest_length) * inverse)
}

/// ∂²E/∂e² of [`value`].
#[inline]
pub fn hessian(e: DVec3, stiffness: f64, rest_length: f64) -> DMat3 {
    hessian_with(e, stiffness, |ratio| 1.0 - ratio, rest_length)
}

/// Nearest positive semi-definite matrix to [`hessian`]: the transverse part of a compressed spring is dropped.
#[inline]
pub fn hessian_projected(e: DVec3, stiffness: f64, rest_length: f64) -> DMat3 {
    hessian_with(e, stiffness, |ratio| (1.0 - ratio).max(0.0), rest_length)
}

fn hessian_with(e: DVec3, stiffness: f64, transverse: impl Fn(f64) -> f64, rest_length: f64) -> DMat3 {
    // k [ t (I − ê êᵀ) + ê êᵀ ],  t = 1 − l/‖e‖
    let inverse = 1.0 / (e.length_squared() + LENGTH_FLOOR * LENGTH_FLOOR).sqrt();
    let unit = e * inverse;
    let t = transverse(rest_length * inverse);
    (DMat3::IDENTITY * t + outer(unit, unit * (1.0 - t))) * stiffness
}

/// ∂/∂e [ aᵀ (∂²E/∂e²) b ].
#[inline]
pub fn third(e: DVec3, stiffness: f64, rest_length: f64, a: DVec3, b: DVec3) -> DVec3 {
    hyper_dual::mixed(gradient_of(hyper_dual::lift(e, a, b), stiffness, rest_length))
}

/// ∂/∂l of [`gradient`].
#[inline]
pub fn gradient_by_rest_length(e: DVec3, stiffness: f64) -> DVec3 {
    e * (-stiffness / (e.length_squared() + LENGTH_FLOOR * LENGTH_FLOOR).sqrt())
}

/// aᵀ (∂/∂l of [`hessian`]) b.
#[inline]
pub fn hessian_by_rest_length(e: DVec3, stiffness: f64, a: DVec3, b: DVec3) -> f64 {
    let inverse = 1.0 / (e.length_squared() + LENGTH_FLOOR * LENGTH_FLOOR).sqrt();
    let unit = e * inverse;
    -stiffness * inverse * (a.dot(b) - a.dot(unit) * unit.dot(b))
}
