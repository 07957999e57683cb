//! In-plane elasticity of one triangle: a continuum with the Green strain, stiffer along one direction of the weave than along
//! the other.
//!
//! With the deformation gradient F = (f₁ f₂), f₁ along the warp and f₂ along the weft, the strain is E = ½ (FᵀF − I) and the
//! energy of a triangle of area A
//!
//!   A (½ c₁₁ E₁₁² + ½ c₂₂ E₂₂² + c₁₂ E₁₁ E₂₂ + 2 g E₁₂²).
//!
//! It is linear in the coefficients (c₁₁, c₂₂, c₁₂, g) [N/m]; how they follow from a fabric's stiffnesses tells
//! [`super::fabric::Fabric`].
//! Source: Wang, O'Brien, Ramamoorthi 2011, "Data-Driven Elastic Models for Cloth", §4, with constant coefficients.

use glam::{DMat2, DMat3, DVec2, DVec3};

use crate::math::hyper_dual::{self, Scalar, Vector, dot, scale};
use crate::math::outer;

/// c₁₁, c₂₂, c₁₂ and g [N/m].
pub type Coefficients = [f64; 4];

/// A triangle of the cloth and its shape without load.
#[derive(Debug, Clone, Copy)]
pub struct Membrane {
    /// Corners.
    pub vertices: [u32; 3],
    /// Area without load `[m²]`.
    pub area: f64,
    /// f_k = Σ over the corners of `weights[corner][k]` x [1/m].
    pub weights: [DVec2; 3],
    /// Pattern's pairs (corner 1, 0), (2, 0), (2, 1).
    pub pairs: [usize; 3],
}

/// ∂²E by (f₁, f₂).
#[derive(Debug, Clone, Copy)]
pub struct Hessian([DMat3; 3]);

impl Membrane {
    /// The triangle with corners at `x` `[m]` and `uvs` as they are without load. The warp runs along growing u, or along the
    /// first side where the texture coordinates have no direction. `None` for a triangle without area.
    pub fn new(vertices: [u32; 3], x: [DVec3; 3], uvs: [DVec2; 3], pairs: [usize; 3]) -> Option<Self> {
        let (p, q) = (x[1] - x[0], x[2] - x[0]);
        let normal = p.cross(q);
        let area = 0.5 * normal.length();
        let unit = normal.try_normalize()?;
        // Gradient of u on the triangle: g·p = du_p, g·q = du_q.
        let (du_p, du_q) = (uvs[1].x - uvs[0].x, uvs[2].x - uvs[0].x);
        let by_u = (q * du_p - p * du_q).cross(unit);
        let warp = by_u.try_normalize().or_else(|| p.try_normalize())?;
        let weft = unit.cross(warp);
        let flat = |side: DVec3| DVec2::new(side.dot(warp), side.dot(weft));
        // Columns of the inverse's transpose are its rows.
        let rows = DMat2::from_cols(flat(p), flat(q)).inverse().transpose();
        let weights = [-rows.x_axis - rows.y_axis, rows.x_axis, rows.y_axis];
        weights.iter().all(|w| w.is_finite()).then_some(Self { vertices, area, weights, pairs })
    }

    /// (f₁, f₂) of a field `[V]`.
    pub fn gradients(&self, field: &[DVec3]) -> [DVec3; 2] {
        // From differences, which keep the digits that sums of large positions would lose.
        let [a, b, c] = self.vertices.map(|v| field[v as usize]);
        let (p, q, [_, r, s]) = (b - a, c - a, self.weights);
        [p * r.x + q * s.x, p * r.y + q * s.y]
    }

    /// Energy `[J]` given (f₁, f₂).
    pub fn value(&self, f: [DVec3; 2], [c11, c22, c12, g]: Coefficients) -> [f64; 2] {
        let [e11, e22, e12] = strain(f);
        let stretch = 0.5 * c11 * e11 * e11 + 0.5 * c22 * e22 * e22 + c12 * e11 * e22;
        [self.area * stretch, self.area * 2.0 * g * e12 * e12]
    }

    /// ∂E by (f₁, f₂).
    pub fn gradient(&self, f: [DVec3; 2], c: Coefficients) -> [DVec3; 2] {
        gradient_of(f.map(|f| f.to_array()), c.map(|c| c * self.area)).map(DVec3::from_array)
    }

    /// ∂²E by (f₁, f₂).
    pub fn hessian(&self, f: [DVec3; 2], c: Coefficients) -> Hessian {
        self.hessian_with(f, c, |stress| stress)
    }

    /// A positive semi-definite upper bound of [`hessian`](Self::hessian): pressure is left out.
    pub fn hessian_projected(&self, f: [DVec3; 2], c: Coefficients) -> Hessian {
        self.hessian_with(f, c, tension)
    }

    /// The part of [`hessian`](Self::hessian) that is there without stress.
    pub fn hessian_gauss_newton(&self, f: [DVec3; 2], c: Coefficients) -> Hessian {
        self.hessian_with(f, c, |_| [0.0; 3])
    }

    fn hessian_with(
        &self,
        f: [DVec3; 2],
        [c11, c22, c12, g]: Coefficients,
        stress: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Hessian {
        let [e11, e22, e12] = strain(f);
        let [s11, s22, s12] = stress([c11 * e11 + c12 * e22, c22 * e22 + c12 * e11, 2.0 * g * e12]);
        let (identity, [f1, f2]) = (DMat3::IDENTITY, f);
        let (by_11, by_22) = (outer(f1, f1), outer(f2, f2));
        Hessian([
            (identity * s11 + by_11 * c11 + by_22 * g) * self.area,
            (identity * s12 + outer(f1, f2) * c12 + outer(f2, f1) * g) * self.area,
            (identity * s22 + by_22 * c22 + by_11 * g) * self.area,
        ])
    }

    /// ∂ by (f₁, f₂) of aᵀ (∂²E) b, with `a` and `b` directions in (f₁, f₂).
    pub fn third(&self, f: [DVec3; 2], c: Coefficients, a: [DVec3; 2], b: [DVec3; 2]) -> [DVec3; 2] {
        let lifted = [0, 1].map(|k| hyper_dual::lift(f[k], a[k], b[k]));
        gradient_of(lifted, c.map(|c| c * self.area)).map(hyper_dual::mixed)
    }

    /// λᵀ ∂(∂E)/∂c for each coefficient c.
    pub fn gradient_by_coefficients(&self, f: [DVec3; 2], lambda: [DVec3; 2]) -> Coefficients {
        let ([e11, e22, e12], [d11, d22, d12]) = (strain(f), change(f, lambda));
        [e11 * d11, e22 * d22, e11 * d22 + e22 * d11, 4.0 * e12 * d12].map(|d| d * self.area)
    }

    /// aᵀ ∂(∂²E)/∂c b for each coefficient c.
    pub fn hessian_by_coefficients(&self, f: [DVec3; 2], a: [DVec3; 2], b: [DVec3; 2]) -> Coefficients {
        let [e11, e22, e12] = strain(f);
        let ([a11, a22, a12], [b11, b22, b12]) = (change(f, a), change(f, b));
        let (m11, m22) = (a[0].dot(b[0]), a[1].dot(b[1]));
        let m12 = 0.5 * (a[0].dot(b[1]) + a[1].dot(b[0]));
        [
            a11 * b11 + e11 * m11,
            a22 * b22 + e22 * m22,
            a11 * b22 + a22 * b11 + e11 * m22 + e22 * m11,
            4.0 * (a12 * b12 + e12 * m12),
        ]
        .map(|d| d * self.area)
    }

    /// Adds a derivative by (f₁, f₂), as one by the positions.
    pub fn scatter(&self, [g1, g2]: [DVec3; 2], out: &mut [DVec3]) {
        for (v, w) in self.vertices.iter().zip(self.weights) {
            out[*v as usize] += g1 * w.x + g2 * w.y;
        }
    }

    /// The blocks of a Hessian by the positions: diagonal ones of the corners, and those of [`pairs`](Self::pairs).
    pub fn blocks(&self, Hessian([h11, h12, h22]): &Hessian) -> ([DMat3; 3], [DMat3; 3]) {
        let block = |i: usize, j: usize| {
            let (a, b) = (self.weights[i], self.weights[j]);
            *h11 * (a.x * b.x) + *h12 * (a.x * b.y) + h12.transpose() * (a.y * b.x) + *h22 * (a.y * b.y)
        };
        let (of_1, of_21, of_2) = (block(1, 1), block(2, 1), block(2, 2));
        // The rows of the first corner are minus the sums of those of the others.
        let (of_10, of_20) = (-(of_1 + of_21.transpose()), -(of_21 + of_2));
        ([-(of_10 + of_20), of_1, of_2], [of_10, of_20, of_21])
    }
}

/// E₁₁, E₂₂, E₁₂.
fn strain([f1, f2]: [DVec3; 2]) -> [f64; 3] {
    [0.5 * (f1.length_squared() - 1.0), 0.5 * (f2.length_squared() - 1.0), 0.5 * f1.dot(f2)]
}

/// First-order change of [`strain`] along `d`.
fn change([f1, f2]: [DVec3; 2], [d1, d2]: [DVec3; 2]) -> [f64; 3] {
    [f1.dot(d1), f2.dot(d2), 0.5 * (f1.dot(d2) + f2.dot(d1))]
}

fn gradient_of<T: Scalar>([f1, f2]: [Vector<T>; 2], [c11, c22, c12, g]: Coefficients) -> [Vector<T>; 2] {
    let k = T::constant;
    let e11 = k(0.5) * (dot(f1, f1) - k(1.0));
    let e22 = k(0.5) * (dot(f2, f2) - k(1.0));
    let s11 = k(c11) * e11 + k(c12) * e22;
    let s22 = k(c22) * e22 + k(c12) * e11;
    let s12 = k(g) * dot(f1, f2);
    let sum = |a: Vector<T>, b: Vector<T>| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    [sum(scale(f1, s11), scale(f2, s12)), sum(scale(f1, s12), scale(f2, s22))]
}

/// The symmetric matrix (s₁₁, s₂₂, s₁₂) without its negative eigenvalues.
fn tension([s11, s22, s12]: [f64; 3]) -> [f64; 3] {
    let (mean, half) = (0.5 * (s11 + s22), 0.5 * (s11 - s22));
    let radius = half.hypot(s12);
    let (high, low) = ((mean + radius).max(0.0), (mean - radius).max(0.0));
    if radius == 0.0 {
        return [high, high, 0.0];
    }
    let (middle, slope) = (0.5 * (high + low), 0.5 * (high - low) / radius);
    [middle + slope * half, middle - slope * half, slope * s12]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn tension_is_the_nearest_matrix_without_pressure() {
        let mut rng = Rng::new(1, 0);
        for _ in 0..1000 {
            let s = [rng.signed(), rng.signed(), rng.signed()];
            let t = tension(s);
            let (determinant, trace) = (t[0] * t[1] - t[2] * t[2], t[0] + t[1]);
            assert!(trace >= 0.0 && determinant >= -1e-12, "{s:?} {t:?}");
            // What was taken away is negative, and nothing is taken from tension alone.
            let d = [t[0] - s[0], t[1] - s[1], t[2] - s[2]];
            assert!(d[0] + d[1] >= -1e-12 && d[0] * d[1] - d[2] * d[2] >= -1e-12, "{s:?} {t:?}");
        }
        for s in [[2.0, 1.0, 0.5], [3.0, 3.0, 0.0]] {
            assert!(s.iter().zip(tension(s)).all(|(a, b)| (a - b).abs() < 1e-15));
        }
    }
}
