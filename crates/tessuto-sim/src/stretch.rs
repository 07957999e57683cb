//! Stretch springs along the mesh edges.

use glam::{DMat3, DVec3};

use tessuto_core::math::hyper_dual::{HyperDual, lift, mixed};
use tessuto_core::math::scalar::{Matrix, Real, Scalar, Vector, diagonal, dot, outer, scale, scaled, sum};

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
    DVec3::from_array(stretched(e, stiffness, rest_length).gradient())
}

/// ∂²E/∂e² of [`value`].
#[inline]
pub fn hessian(e: DVec3, stiffness: f64, rest_length: f64) -> DMat3 {
    DMat3::from_cols_array_2d(&stretched(e, stiffness, rest_length).hessian())
}

/// [`Stretched::hessian_projected`].
#[inline]
pub fn hessian_projected(e: DVec3, stiffness: f64, rest_length: f64) -> DMat3 {
    DMat3::from_cols_array_2d(&stretched(e, stiffness, rest_length).hessian_projected())
}

/// ∂/∂e [ aᵀ (∂²E/∂e²) b ].
#[inline]
pub fn third(e: DVec3, stiffness: f64, rest_length: f64, a: DVec3, b: DVec3) -> DVec3 {
    DVec3::from_array(stretched(e, stiffness, rest_length).third(a.to_array(), b.to_array()))
}

fn stretched(e: DVec3, stiffness: f64, rest_length: f64) -> Stretched<f64> {
    Stretched { along: e.to_array(), stiffness, rest_length }
}

/// A stretch spring as it is now, or four of them.
#[derive(Debug, Clone, Copy)]
pub struct Stretched<T> {
    /// e `[m]`.
    pub along: Vector<T>,
    /// k [N/m].
    pub stiffness: T,
    /// l `[m]`.
    pub rest_length: T,
}

impl<T: Scalar> Stretched<T> {
    /// [`value`].
    #[inline(always)]
    pub fn value(&self) -> T {
        let longer = dot(self.along, self.along).sqrt() - self.rest_length;
        T::constant(0.5) * self.stiffness * (longer * longer)
    }

    /// ∂E/∂e.
    #[inline(always)]
    pub fn gradient(&self) -> Vector<T> {
        // k (1 − l/‖e‖) e
        scale(self.along, self.stiffness - self.stiffness * self.rest_length * self.inverse_length())
    }

    /// ∂²E/∂e².
    #[inline(always)]
    pub fn hessian(&self) -> Matrix<T> {
        self.hessian_with(|transverse| transverse)
    }

    /// ∂/∂e [ aᵀ (∂²E/∂e²) b ].
    #[inline(always)]
    pub fn third(&self, a: Vector<T>, b: Vector<T>) -> Vector<T> {
        let lifted = Stretched {
            along: lift(self.along, a, b),
            stiffness: HyperDual::fixed(self.stiffness),
            rest_length: HyperDual::fixed(self.rest_length),
        };
        mixed(lifted.gradient())
    }

    #[inline(always)]
    fn hessian_with(&self, transverse: impl Fn(T) -> T) -> Matrix<T> {
        // k [ t (I − ê êᵀ) + ê êᵀ ],  t = 1 − l/‖e‖
        let (inverse, one) = (self.inverse_length(), T::constant(1.0));
        let unit = scale(self.along, inverse);
        let t = transverse(one - self.rest_length * inverse);
        scaled(sum(diagonal(t), outer(unit, scale(unit, one - t))), self.stiffness)
    }

    #[inline(always)]
    fn inverse_length(&self) -> T {
        (dot(self.along, self.along) + T::constant(LENGTH_FLOOR * LENGTH_FLOOR)).sqrt().recip()
    }
}

impl<T: Real> Stretched<T> {
    /// Nearest positive semi-definite matrix to [`hessian`](Self::hessian): the transverse part of a compressed spring
    /// is dropped.
    #[inline(always)]
    pub fn hessian_projected(&self) -> Matrix<T> {
        self.hessian_with(T::positive)
    }
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
