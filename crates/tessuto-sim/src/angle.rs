//! Angle springs between two mesh edges that meet at a vertex: bending and shearing.

use glam::{DMat3, DVec3};

use tessuto_core::math::scalar::{Scalar, Vector, dot, scale, subtract};
use tessuto_core::math::{hyper_dual, outer};

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
    let (deflection, gradient) = gradient_of(u.to_array(), w.to_array(), stiffness, rest_angle);
    (0.5 * stiffness * deflection * deflection, gradient.map(DVec3::from_array))
}

/// θ − θ0 and the gradient.
fn gradient_of<T: Scalar>(
    u: Vector<T>,
    w: Vector<T>,
    stiffness: f64,
    rest_angle: f64,
) -> (T, [Vector<T>; 2]) {
    let q = T::constant(1.0 - EPSILON);
    let inverse_u = (dot(u, u) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
    let inverse_w = (dot(w, w) + T::constant(SQ_LENGTH_FLOOR)).sqrt().recip();
    let (e1, e2) = (scale(u, inverse_u), scale(w, inverse_w));
    let c = dot(e1, e2);
    let s = q * c;
    // dE/dc = −k (θ − θ0) q / √(1 − s²)
    let sine = (T::constant(1.0) - s * s).sqrt();
    let deflection = s.acos() - T::constant(rest_angle);
    let slope = deflection * T::constant(-stiffness) * q * sine.recip();
    let grad_u = scale(subtract(e2, scale(e1, c)), slope * inverse_u);
    let grad_w = scale(subtract(e1, scale(e2, c)), slope * inverse_w);
    (deflection, [grad_u, grad_w])
}

/// Second derivatives of an angle spring in (u, w).
#[derive(Debug, Clone, Copy)]
pub struct Hessian {
    /// ∂²E/∂u².
    pub uu: DMat3,
    /// ∂²E/∂u∂w.
    pub uw: DMat3,
    /// ∂²E/∂w².
    pub ww: DMat3,
}

/// Second derivatives of [`value`].
pub fn hessian(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Hessian {
    let f = Frame::new(u, w);
    let mut h = gauss_newton(&f, stiffness);
    // The rest: (∂E/∂θ) ∂²θ/∂(u,w)² with θ = θ(c), θ' = −q/√(1−s²), θ'' = −q² s/(1−s²)^{3/2}.
    let slope = stiffness * (f.theta - rest_angle);
    let (first, second) = (slope * f.d_theta, slope * f.dd_theta);
    let c = f.cosine;
    let transverse = |e: DVec3| DMat3::IDENTITY - outer(e, e);
    let uu = (outer(f.e1, f.cu) + outer(f.cu, f.e1) + transverse(f.e1) * (c * f.inverse_u)) * -f.inverse_u;
    let ww = (outer(f.e2, f.cw) + outer(f.cw, f.e2) + transverse(f.e2) * (c * f.inverse_w)) * -f.inverse_w;
    let uw = (transverse(f.e2) * f.inverse_w - outer(f.e1, f.cw)) * f.inverse_u;
    h.uu += uu * first + outer(f.cu, f.cu * second);
    h.uw += uw * first + outer(f.cu, f.cw * second);
    h.ww += ww * first + outer(f.cw, f.cw * second);
    h
}

/// The part k ∇θ ∇θᵀ of [`hessian`] (Gauss-Newton).
#[inline]
pub fn hessian_gauss_newton(u: DVec3, w: DVec3, stiffness: f64, _rest_angle: f64) -> Hessian {
    gauss_newton(&Frame::new(u, w), stiffness)
}

/// A positive semi-definite matrix P ≥ [`hessian`]: a Newton step with it does not overshoot in any direction.
///
/// The Hessian is a sum of squares along the turns of the arms in their plane (by α and β), the arms' way out of
/// the plane (a, b), and products of an arm's stretching ρ with its turning; P leaves out the negative ones. With
/// E(φ), φ = β − α:
///
///   E_φφ (δβ − δα)² + E_c (1 − c)/2 (a + b)² − E_c (1 + c)/2 (a − b)² + 2 E_c sin φ (ρ_w δβ − ρ_u δα).
///
/// Equal to both others where θ = θ0. Source: own.
pub fn hessian_projected(u: DVec3, w: DVec3, stiffness: f64, rest_angle: f64) -> Hessian {
    let f = Frame::new(u, w);
    let c = f.cosine;
    let out_of_plane = f.e1.cross(f.e2);
    let sine = out_of_plane.length();
    // Straight arms have no plane; there every plane gives the same sum.
    let n = if sine > 1e-8 { out_of_plane / sine } else { f.e1.any_orthonormal_vector() };
    let (turn_u, turn_w) = (n.cross(f.e1), n.cross(f.e2));
    let slope = stiffness * (f.theta - rest_angle);
    let by_c = slope * f.d_theta;
    let by_cc = stiffness * f.d_theta * f.d_theta + slope * f.dd_theta;
    let mut h = Hessian { uu: DMat3::ZERO, uw: DMat3::ZERO, ww: DMat3::ZERO };
    // Adds k (a·δu/‖u‖ + b·δw/‖w‖)².
    let mut square = |k: f64, a: DVec3, b: DVec3| {
        let (a, b) = (a * f.inverse_u, b * f.inverse_w);
        h.uu += outer(a, a * k);
        h.uw += outer(a, b * k);
        h.ww += outer(b, b * k);
    };
    square((by_cc * sine * sine - c * by_c).max(0.0), -turn_u, turn_w);
    square((0.5 * by_c * (1.0 - c)).max(0.0), n, n);
    square((-0.5 * by_c * (1.0 + c)).max(0.0), -n, n);
    // 2 x ρ τ = ½ x ((ρ + τ)² − (ρ − τ)²)
    let mixed = by_c * sine;
    square(0.5 * mixed.abs(), f.e1 - turn_u * mixed.signum(), DVec3::ZERO);
    square(0.5 * mixed.abs(), DVec3::ZERO, f.e2 + turn_w * mixed.signum());
    h
}

/// (∂/∂u, ∂/∂w) of aᵀ (∂²E) b, where `a` and `b` are directions in (u, w).
pub fn third(
    [u, w]: [DVec3; 2],
    stiffness: f64,
    rest_angle: f64,
    [au, aw]: [DVec3; 2],
    [bu, bw]: [DVec3; 2],
) -> [DVec3; 2] {
    gradient_of(hyper_dual::lift(u, au, bu), hyper_dual::lift(w, aw, bw), stiffness, rest_angle)
        .1
        .map(hyper_dual::mixed)
}

/// What the Hessians share: unit edges, the cosine and its gradients, the angle and its derivatives.
struct Frame {
    e1: DVec3,
    e2: DVec3,
    inverse_u: f64,
    inverse_w: f64,
    cosine: f64,
    /// ∂cosine/∂u.
    cu: DVec3,
    /// ∂cosine/∂w.
    cw: DVec3,
    theta: f64,
    /// dθ/dcosine.
    d_theta: f64,
    /// d²θ/dcosine².
    dd_theta: f64,
}

impl Frame {
    fn new(u: DVec3, w: DVec3) -> Self {
        let inverse_u = 1.0 / (u.length_squared() + SQ_LENGTH_FLOOR).sqrt();
        let inverse_w = 1.0 / (w.length_squared() + SQ_LENGTH_FLOOR).sqrt();
        let (e1, e2) = (u * inverse_u, w * inverse_w);
        let cosine = e1.dot(e2);
        let q = 1.0 - EPSILON;
        let s = q * cosine;
        let r = 1.0 / (1.0 - s * s).sqrt();
        Self {
            e1,
            e2,
            inverse_u,
            inverse_w,
            cosine,
            cu: (e2 - e1 * cosine) * inverse_u,
            cw: (e1 - e2 * cosine) * inverse_w,
            theta: s.acos(),
            d_theta: -q * r,
            dd_theta: -q * q * s * r * r * r,
        }
    }
}

fn gauss_newton(f: &Frame, stiffness: f64) -> Hessian {
    let k = stiffness * f.d_theta * f.d_theta;
    Hessian { uu: outer(f.cu, f.cu * k), uw: outer(f.cu, f.cw * k), ww: outer(f.cw, f.cw * k) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    /// dᵀ H d for d = (du, dw).
    fn form(h: &Hessian, du: DVec3, dw: DVec3) -> f64 {
        du.dot(h.uu * du) + 2.0 * du.dot(h.uw * dw) + dw.dot(h.ww * dw)
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
