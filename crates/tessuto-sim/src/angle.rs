//! Angle springs between two mesh edges that meet at a vertex: bending and shearing.

use glam::DVec3;

use tessuto_core::math::hyper_dual::{HyperDual, lift, mixed};
use tessuto_core::math::scalar::{
    Matrix, Real, Scalar, TINY, Vector, add, cross, diagonal, difference, dot, form, negated, negative,
    outer, scale, scaled, subtract, sum, transposed,
};

/// Keeps the derivative of arccos finite: angles run from arccos(1 − ε) = 8.1° to 171.9°.
const EPSILON: f64 = 0.01;
/// Square of a length `[m]` that is added to squared lengths, so that directions stay finite.
const SQ_LENGTH_FLOOR: f64 = 1e-18;

/// Deflection between two edges a → o → c: θ = arccos((1 − ε) û·ŵ), ε = 0.01; small where the path is straight.
///
/// - `u` = o − a, `w` = c − o `[m]`
/// - returns θ `[rad]`
///
/// Source: \[SAFT\] §1.2, ε from the published program.
#[inline]
pub fn angle(u: DVec3, w: DVec3) -> f64 {
    let cosine =
        u.dot(w) / ((u.length_squared() + SQ_LENGTH_FLOOR) * (w.length_squared() + SQ_LENGTH_FLOOR)).sqrt();
    ((1.0 - EPSILON) * cosine).acos()
}

/// Energy of one angle spring: E = ½ k (θ − θ0)², θ = [`angle`]`(u, w)`.
///
/// - `stiffness` k [J/rad²]; `rest_angle` θ0 `[rad]`
/// - returns E `[J]`
#[inline]
pub fn value(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> f64 {
    0.5 * stiffness * (angle(u, w) - rest_angle).powi(2)
}

/// (∂E/∂u, ∂E/∂w) of [`value`]: a gets −∂u, o gets ∂u − ∂w, c gets ∂w.
#[inline]
pub fn gradient(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> [DVec3; 2] {
    value_and_gradient(u, w, stiffness, rest_angle).1
}

/// [`value`] and [`gradient`].
#[inline]
pub fn value_and_gradient(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> (f64, [DVec3; 2]) {
    let (value, gradient) = spring(u, w, stiffness, rest_angle).value_and_gradient();
    (value, gradient.map(DVec3::from_array))
}

/// An angle spring as it is now, or four of them.
#[derive(Debug, Clone, Copy)]
pub struct Turned<T> {
    /// o − a `[m]`.
    pub u: Vector<T>,
    /// c − o `[m]`.
    pub w: Vector<T>,
    /// k [J/rad²].
    pub stiffness: T,
    /// θ0 `[rad]`.
    pub rest_angle: T,
}

/// Second derivatives of an angle spring in (u, w), or of four.
#[derive(Debug, Clone, Copy)]
pub struct Hessian<T = f64> {
    /// ∂²E/∂u².
    pub uu: Matrix<T>,
    /// ∂²E/∂u∂w.
    pub uw: Matrix<T>,
    /// ∂²E/∂w².
    pub ww: Matrix<T>,
}

fn spring(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Turned<f64> {
    Turned { u: u.to_array(), w: w.to_array(), stiffness, rest_angle }
}

/// Second derivatives of [`value`].
pub fn hessian(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Hessian {
    spring(u, w, stiffness, rest_angle).hessian()
}

/// The part k ∇θ ∇θᵀ of [`hessian`] (Gauss-Newton).
#[inline]
pub fn hessian_gauss_newton(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Hessian {
    spring(u, w, stiffness, rest_angle).hessian_gauss_newton()
}

/// [`Turned::hessian_projected`].
pub fn hessian_projected(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Hessian {
    spring(u, w, stiffness, rest_angle).hessian_projected()
}

impl<T: Scalar> Turned<T> {
    /// [`value`] and (∂E/∂u, ∂E/∂w).
    #[inline(always)]
    pub fn value_and_gradient(&self) -> (T, [Vector<T>; 2]) {
        let (deflection, gradient) = self.gradient();
        (T::constant(0.5) * self.stiffness * deflection * deflection, gradient)
    }

    /// θ − θ0 and the gradient.
    #[inline(always)]
    fn gradient(&self) -> (T, [Vector<T>; 2]) {
        let (u, w, q) = (self.u, self.w, T::constant(1.0 - EPSILON));
        let inverse_u = (dot(u, u) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
        let inverse_w = (dot(w, w) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
        let (e1, e2) = (scale(u, inverse_u), scale(w, inverse_w));
        let c = dot(e1, e2);
        let s = q * c;
        // dE/dc = −k (θ − θ0) q / √(1 − s²)
        let sine = (T::constant(1.0) - s * s).sqrt();
        let deflection = s.acos() - self.rest_angle;
        let slope = deflection * -self.stiffness * q * sine.recip();
        let grad_u = scale(subtract(e2, scale(e1, c)), slope * inverse_u);
        let grad_w = scale(subtract(e1, scale(e2, c)), slope * inverse_w);
        (deflection, [grad_u, grad_w])
    }

    /// (∂/∂u, ∂/∂w) of aᵀ (∂²E) b, where `a` and `b` are directions in (u, w).
    #[inline(always)]
    pub fn third(&self, [au, aw]: [Vector<T>; 2], [bu, bw]: [Vector<T>; 2]) -> [Vector<T>; 2] {
        let lifted = Turned {
            u: lift(self.u, au, bu),
            w: lift(self.w, aw, bw),
            stiffness: HyperDual::fixed(self.stiffness),
            rest_angle: HyperDual::fixed(self.rest_angle),
        };
        lifted.gradient().1.map(mixed)
    }

    /// Second derivatives of [`value`].
    #[inline(always)]
    pub fn hessian(&self) -> Hessian<T> {
        let f = Frame::new(self);
        let mut h = f.gauss_newton(self.stiffness);
        // The rest: (∂E/∂θ) ∂²θ/∂(u,w)² with θ = θ(c), θ' = −q/√(1−s²), θ'' = −q² s/(1−s²)^{3/2}.
        let slope = self.stiffness * (f.theta - self.rest_angle);
        let (first, second) = (slope * f.d_theta, slope * f.dd_theta);
        let c = f.cosine;
        let transverse = |e: Vector<T>| difference(diagonal(T::constant(1.0)), outer(e, e));
        let of_arm = |e: Vector<T>, by: Vector<T>, inverse: T| {
            let turned = sum(outer(e, by), outer(by, e));
            scaled(sum(turned, scaled(transverse(e), c * inverse)), -inverse)
        };
        let (uu, ww) = (of_arm(f.e1, f.cu, f.inverse_u), of_arm(f.e2, f.cw, f.inverse_w));
        let across = difference(scaled(transverse(f.e2), f.inverse_w), outer(f.e1, f.cw));
        let uw = scaled(across, f.inverse_u);
        let (cu, cw) = (scale(f.cu, second), scale(f.cw, second));
        h.uu = sum(h.uu, sum(scaled(uu, first), outer(f.cu, cu)));
        h.uw = sum(h.uw, sum(scaled(uw, first), outer(f.cu, cw)));
        h.ww = sum(h.ww, sum(scaled(ww, first), outer(f.cw, cw)));
        h
    }

    /// The part k ∇θ ∇θᵀ of [`hessian`](Self::hessian).
    #[inline(always)]
    pub fn hessian_gauss_newton(&self) -> Hessian<T> {
        Frame::new(self).gauss_newton(self.stiffness)
    }

    /// aᵀ (∂²E) b.
    #[inline(always)]
    pub fn form(&self, [au, aw]: [Vector<T>; 2], [bu, bw]: [Vector<T>; 2]) -> T {
        let h = self.hessian();
        form(au, h.uu, bu) + form(au, h.uw, bw) + (form(bu, h.uw, aw) + form(aw, h.ww, bw))
    }
}

impl<T: Real> Turned<T> {
    /// A positive semi-definite matrix P ≥ [`hessian`](Self::hessian): a Newton step with it does not overshoot in
    /// any direction.
    ///
    /// The Hessian is a sum of squares along the turns of the arms in their plane (by α and β), the arms' way out
    /// of the plane (a, b), and products of an arm's stretching ρ with its turning; P leaves out the negative ones.
    /// With E(φ), φ = β − α:
    ///
    ///   E_φφ (δβ − δα)² + E_c (1 − c)/2 (a + b)² − E_c (1 + c)/2 (a − b)² + 2 E_c sin φ (ρ_w δβ − ρ_u δα).
    ///
    /// Equal to both others where θ = θ0. Source: own.
    #[inline(always)]
    pub fn hessian_projected(&self) -> Hessian<T> {
        let f = Frame::new(self);
        let (c, one, half) = (f.cosine, T::constant(1.0), T::constant(0.5));
        let out_of_plane = cross(f.e1, f.e2);
        let sine = dot(out_of_plane, out_of_plane).sqrt();
        // Straight arms have no plane; there every plane gives the same sum.
        let (inverse, any) = ((sine + T::constant(TINY)).recip(), any_normal(f.e1));
        let normal = |k: usize| sine.select_above(1e-8, out_of_plane[k] * inverse, any[k]);
        let n = [normal(0), normal(1), normal(2)];
        let (turn_u, turn_w) = (cross(n, f.e1), cross(n, f.e2));
        let slope = self.stiffness * (f.theta - self.rest_angle);
        let by_c = slope * f.d_theta;
        let by_cc = self.stiffness * f.d_theta * f.d_theta + slope * f.dd_theta;
        // k (a·δu/‖u‖ + b·δw/‖w‖)².
        let square = |k: T, a: Vector<T>, b: Vector<T>| {
            let (a, b) = (scale(a, f.inverse_u), scale(b, f.inverse_w));
            let (ka, kb) = (scale(a, k), scale(b, k));
            Hessian { uu: outer(a, ka), uw: outer(a, kb), ww: outer(b, kb) }
        };
        let in_plane = square((by_cc * sine * sine - c * by_c).positive(), negative(turn_u), turn_w);
        let alike = square((half * by_c * (one - c)).positive(), n, n);
        let unlike = square((-half * by_c * (one + c)).positive(), negative(n), n);
        // 2 x ρ τ = ½ x ((ρ + τ)² − (ρ − τ)²)
        let mixed = by_c * sine;
        let (sign, zero) = (mixed.select_above(0.0, one, -one), [T::constant(0.0); 3]);
        let size = half * mixed.abs();
        let of_u = square(size, subtract(f.e1, scale(turn_u, sign)), zero);
        let of_w = square(size, zero, add(f.e2, scale(turn_w, sign)));
        Hessian {
            uu: sum(sum(sum(in_plane.uu, alike.uu), unlike.uu), of_u.uu),
            uw: sum(sum(in_plane.uw, alike.uw), unlike.uw),
            ww: sum(sum(sum(in_plane.ww, alike.ww), unlike.ww), of_w.ww),
        }
    }
}

impl<T: Scalar> Hessian<T> {
    /// Gives the blocks by the positions to `put`: the diagonal ones of a, o, c, then those of the spring's pairs.
    #[inline(always)]
    pub fn blocks(&self, mut put: impl FnMut(usize, &Matrix<T>)) {
        let Self { uu, uw, ww } = *self;
        put(0, &uu);
        put(1, &difference(difference(sum(uu, ww), uw), transposed(uw)));
        put(2, &ww);
        put(3, &difference(uw, uu));
        put(4, &negated(uw));
        put(5, &difference(uw, ww));
    }
}

/// (∂/∂u, ∂/∂w) of aᵀ (∂²E) b, where `a` and `b` are directions in (u, w).
pub fn third(
    [u, w]: [DVec3; 2],
    stiffness: f64,
    rest_angle: f64,
    a: [DVec3; 2],
    b: [DVec3; 2],
) -> [DVec3; 2] {
    let [a, b] = [a, b].map(|d| d.map(|d| d.to_array()));
    spring(u, w, stiffness, rest_angle).third(a, b).map(DVec3::from_array)
}

/// What the Hessians share: unit edges, the cosine and its gradients, the angle and its derivatives.
struct Frame<T> {
    e1: Vector<T>,
    e2: Vector<T>,
    inverse_u: T,
    inverse_w: T,
    cosine: T,
    /// ∂cosine/∂u.
    cu: Vector<T>,
    /// ∂cosine/∂w.
    cw: Vector<T>,
    theta: T,
    /// dθ/dcosine.
    d_theta: T,
    /// d²θ/dcosine².
    dd_theta: T,
}

impl<T: Scalar> Frame<T> {
    #[inline(always)]
    fn new(spring: &Turned<T>) -> Self {
        let (u, w) = (spring.u, spring.w);
        let inverse_u = (dot(u, u) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
        let inverse_w = (dot(w, w) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
        let (e1, e2) = (scale(u, inverse_u), scale(w, inverse_w));
        let cosine = dot(e1, e2);
        let q = 1.0 - EPSILON;
        let s = T::constant(q) * cosine;
        let r = (T::constant(1.0) - s * s).sqrt().recip();
        Self {
            e1,
            e2,
            inverse_u,
            inverse_w,
            cosine,
            cu: scale(subtract(e2, scale(e1, cosine)), inverse_u),
            cw: scale(subtract(e1, scale(e2, cosine)), inverse_w),
            theta: s.acos(),
            d_theta: T::constant(-q) * r,
            dd_theta: T::constant(-q * q) * s * r * r * r,
        }
    }

    #[inline(always)]
    fn gauss_newton(&self, stiffness: T) -> Hessian<T> {
        let k = stiffness * self.d_theta * self.d_theta;
        let (cu, cw) = (scale(self.cu, k), scale(self.cw, k));
        Hessian { uu: outer(self.cu, cu), uw: outer(self.cu, cw), ww: outer(self.cw, cw) }
    }
}

/// Some direction at a right angle to the `unit` vector. Source: Duff et al. 2017, "Building an Orthonormal Basis,
/// Revisited".
#[inline(always)]
fn any_normal<T: Real>([x, y, z]: Vector<T>) -> Vector<T> {
    let one = T::constant(1.0);
    let sign = z.select_above(0.0, one, -one);
    let a = -(sign + z).recip();
    [x * y * a, sign + y * y * a, -y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    /// dᵀ H d for d = (du, dw).
    fn form(h: &Hessian, du: DVec3, dw: DVec3) -> f64 {
        let (du, dw) = (du.to_array(), dw.to_array());
        super::form(du, h.uu, du) + 2.0 * super::form(du, h.uw, dw) + super::form(dw, h.ww, dw)
    }

    #[test]
    fn the_projected_hessian_bounds_the_exact_one_and_its_positive_squares_are_exact() {
        let mut rng = Rng::new(4, 0);
        for case in 0..300 {
            let u = rng.vector() + DVec3::X * 1.5;
            // Bent any way, straight on, and folded back.
            let w = match case % 10 {
                0 => u * 0.7,
                1 => u * -0.7,
                _ => rng.vector() * 1.4 + DVec3::Y * 0.3,
            };
            let rest = [angle(u, u), 0.8, 1.6][case % 3];
            let (exact, bound) = (hessian(u, w, 2.0, rest), hessian_projected(u, w, 2.0, rest));
            for _ in 0..200 {
                let (du, dw) = (rng.vector(), rng.vector());
                let (h, p) = (form(&exact, du, dw), form(&bound, du, dw));
                let size = p.abs() + h.abs() + 1e-9;
                assert!(p >= -1e-12 * size && p >= h - 1e-9 * size, "{u} {w} {rest}: {p} {h}");
            }
            // Both arms out of the plane alike or unlike: one of the two is positive, and exact.
            let n = u.cross(w);
            if n.length() > 1e-3 {
                let (a, b) = (n * u.length(), n * w.length());
                let [h, p] = [exact, bound].map(|m| [form(&m, a, b), form(&m, a, -b)]);
                let size = h[0].abs() + h[1].abs();
                for k in 0..2 {
                    assert!((p[k] - h[k].max(0.0)).abs() < 1e-9 * size, "{u} {w} {rest}: {p:?} {h:?}");
                }
            }
        }
    }
}
