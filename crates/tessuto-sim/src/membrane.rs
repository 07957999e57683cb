//! In-plane elasticity of one triangle: a continuum with the Green strain, stiffer along one direction of the
//! weave than along the other.
//!
//! With the deformation gradient F = (f₁ f₂), f₁ along the warp and f₂ along the weft, the strain is E = ½ (FᵀF −
//! I) and the energy of a triangle of area A
//!
//!   A (½ c₁₁ E₁₁² + ½ c₂₂ E₂₂² + c₁₂ E₁₁ E₂₂ + 2 g E₁₂²).
//!
//! It is linear in the coefficients (c₁₁, c₂₂, c₁₂, g) [N/m]; how they follow from a fabric's stiffnesses says
//! [`super::fabric::Fabric`].
//! Source: Wang, O'Brien, Ramamoorthi 2011, "Data-Driven Elastic Models for Cloth", §4, with constant coefficients.

use std::ops::AddAssign;

use glam::{DMat2, DVec2, DVec3};

use tessuto_core::math::hyper_dual::{HyperDual, lift, mixed};
use tessuto_core::math::lanes::{LANES, Lanes, gather, vectors};
use tessuto_core::math::scalar::{
    Matrix, Real, Scalar, TINY, Vector, add, diagonal, dot, negated, negative, outer, scale, scaled,
    subtract, sum, transposed,
};

/// c₁₁, c₂₂, c₁₂ and g [N/m].
pub type Coefficients = [f64; 4];

/// A triangle of the cloth and its shape without load.
#[derive(Debug, Clone, Copy)]
pub struct Membrane {
    /// Corners.
    pub vertices: [u32; 3],
    /// Area without load `[m²]`.
    pub area: f64,
    /// f_k = Σ over both sides from the first corner of `weights[side][k]` times the side [1/m].
    pub weights: Weights<f64>,
    /// Pattern's pairs (corner 1, 0), (2, 0), (2, 1).
    pub pairs: [usize; 3],
}

/// A membrane as it is now, or four of them.
#[derive(Debug, Clone, Copy)]
pub struct Strained<T> {
    /// (f₁, f₂).
    f: [Vector<T>; 2],
    /// [`Coefficients`] times the area `[J]`.
    c: [T; 4],
}

/// ∂²E by (f₁, f₂): 11, 12, 22.
#[derive(Debug, Clone, Copy)]
pub struct Hessian<T>([Matrix<T>; 3]);

/// [`Membrane::weights`], of one membrane or of four.
pub type Weights<T> = [[T; 2]; 2];

impl Membrane {
    /// The triangle with corners at `x` `[m]` and `uvs` as they are without load. The warp runs along growing u,
    /// or along the first side where the texture coordinates have no direction. `None` for a triangle without
    /// area.
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
        let weights = [rows.x_axis, rows.y_axis].map(|w| w.to_array());
        rows.is_finite().then_some(Self { vertices, area, weights, pairs })
    }

    /// (f₁, f₂) of a field `[V]`.
    pub fn gradients(&self, field: &[DVec3]) -> [DVec3; 2] {
        // From differences, which keep the digits that sums of large positions would lose.
        let [a, b, c] = self.vertices.map(|v| field[v as usize]);
        let (p, q, [r, s]) = (b - a, c - a, self.weights);
        [p * r[0] + q * s[0], p * r[1] + q * s[1]]
    }

    /// The membrane with these (f₁, f₂) and coefficients.
    pub fn strained(&self, f: [DVec3; 2], c: Coefficients) -> Strained<f64> {
        Strained { f: f.map(|f| f.to_array()), c: c.map(|c| c * self.area) }
    }

    /// Four membranes with their vertices at the rows `x` `[m]` and `coefficients`, and their weights.
    #[inline(always)]
    pub fn strained_lanes(
        membranes: [&Self; LANES],
        x: &[Lanes],
        coefficients: [Lanes; 4],
    ) -> (Strained<Lanes>, Weights<Lanes>) {
        let weights = |side: usize| {
            [gather(|k| membranes[k].weights[side][0]), gather(|k| membranes[k].weights[side][1])]
        };
        let weights = [weights(0), weights(1)];
        let area = gather(|k| membranes[k].area);
        let [c11, c22, c12, g] = coefficients;
        let c = [c11 * area, c22 * area, c12 * area, g * area];
        (Strained { f: Self::gradients_lanes(membranes, weights, x), c }, weights)
    }

    /// (f₁, f₂) of a field's rows `[V]` on four membranes with these weights.
    #[inline(always)]
    pub fn gradients_lanes(
        membranes: [&Self; LANES],
        [r, s]: Weights<Lanes>,
        field: &[Lanes],
    ) -> [Vector<Lanes>; 2] {
        let corners = |c: usize| vectors(field, membranes.map(|m| m.vertices[c]));
        let a = corners(0);
        let (p, q) = (subtract(corners(1), a), subtract(corners(2), a));
        [0, 1].map(|axis| add(scale(p, r[axis]), scale(q, s[axis])))
    }

    /// λᵀ ∂(∂E)/∂c for each coefficient c.
    pub fn gradient_by_coefficients(&self, f: [DVec3; 2], lambda: [DVec3; 2]) -> Coefficients {
        let ([e11, e22, e12], [d11, d22, d12]) = (strain(f.map(|f| f.to_array())), change(f, lambda));
        [e11 * d11, e22 * d22, e11 * d22 + e22 * d11, 4.0 * e12 * d12].map(|d| d * self.area)
    }

    /// aᵀ ∂(∂²E)/∂c b for each coefficient c.
    pub fn hessian_by_coefficients(&self, f: [DVec3; 2], a: [DVec3; 2], b: [DVec3; 2]) -> Coefficients {
        let [e11, e22, e12] = strain(f.map(|f| f.to_array()));
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

    /// Adds a derivative by the corners.
    #[inline(always)]
    pub fn scatter<V: AddAssign>(&self, gradient: [V; 3], out: &mut [V]) {
        self.vertices.iter().zip(gradient).for_each(|(v, g)| out[*v as usize] += g);
    }
}

/// A derivative by the corners, given that by (f₁, f₂).
#[inline(always)]
pub fn by_corners<T: Scalar>([g1, g2]: [Vector<T>; 2], weights: Weights<T>) -> [Vector<T>; 3] {
    let of = |w: [T; 2]| add(scale(g1, w[0]), scale(g2, w[1]));
    let (b, c) = (of(weights[0]), of(weights[1]));
    [negative(add(b, c)), b, c]
}

impl<T: Scalar> Strained<T> {
    /// Energy `[J]`: of stretching and of shearing.
    #[inline(always)]
    pub fn value(&self) -> [T; 2] {
        let ([e11, e22, e12], [c11, c22, c12, g]) = (strain(self.f), self.c);
        let stretch = T::constant(0.5) * (c11 * e11 * e11 + c22 * e22 * e22) + c12 * e11 * e22;
        [stretch, T::constant(2.0) * g * e12 * e12]
    }

    /// ∂E by (f₁, f₂).
    #[inline(always)]
    pub fn gradient(&self) -> [Vector<T>; 2] {
        let ([f1, f2], [s11, s22, s12]) = (self.f, self.stress());
        [add(scale(f1, s11), scale(f2, s12)), add(scale(f1, s12), scale(f2, s22))]
    }

    /// ∂ by (f₁, f₂) of aᵀ (∂²E) b, with `a` and `b` directions in (f₁, f₂).
    #[inline(always)]
    pub fn third(&self, a: [Vector<T>; 2], b: [Vector<T>; 2]) -> [Vector<T>; 2] {
        let lifted = Strained {
            f: [lift(self.f[0], a[0], b[0]), lift(self.f[1], a[1], b[1])],
            c: self.c.map(HyperDual::fixed),
        };
        lifted.gradient().map(mixed)
    }

    /// ∂²E by (f₁, f₂).
    #[inline(always)]
    pub fn hessian(&self) -> Hessian<T> {
        self.hessian_with(self.stress())
    }

    /// The part of [`hessian`](Self::hessian) that is there without stress.
    #[inline(always)]
    pub fn hessian_gauss_newton(&self) -> Hessian<T> {
        self.hessian_with([T::constant(0.0); 3])
    }

    #[inline(always)]
    fn hessian_with(&self, [s11, s22, s12]: [T; 3]) -> Hessian<T> {
        let ([f1, f2], [c11, c22, c12, g]) = (self.f, self.c);
        let (by_11, by_22, by_12) = (outer(f1, f1), outer(f2, f2), outer(f1, f2));
        let with = |stress: T, [a, p]: [T; 2], by_a: Matrix<T>, by_p: Matrix<T>| {
            sum(diagonal(stress), sum(scaled(by_a, a), scaled(by_p, p)))
        };
        Hessian([
            with(s11, [c11, g], by_11, by_22),
            with(s12, [c12, g], by_12, transposed(by_12)),
            with(s22, [c22, g], by_22, by_11),
        ])
    }

    /// A s, with the stress s.
    #[inline(always)]
    fn stress(&self) -> [T; 3] {
        let ([e11, e22, e12], [c11, c22, c12, g]) = (strain(self.f), self.c);
        [c11 * e11 + c12 * e22, c22 * e22 + c12 * e11, T::constant(2.0) * g * e12]
    }
}

impl<T: Real> Strained<T> {
    /// A positive semi-definite upper bound of [`hessian`](Self::hessian): pressure is left out.
    #[inline(always)]
    pub fn hessian_projected(&self) -> Hessian<T> {
        self.hessian_with(tension(self.stress()))
    }
}

impl<T: Scalar> Hessian<T> {
    /// Gives the blocks by the positions to `put`: the diagonal ones of the corners, then those of the membrane's
    /// pairs.
    #[inline(always)]
    pub fn blocks(&self, [r, s]: Weights<T>, mut put: impl FnMut(usize, &Matrix<T>)) {
        let Self([h11, h12, h22]) = *self;
        let h21 = transposed(h12);
        let block = |a: [T; 2], b: [T; 2]| {
            let squares = sum(scaled(h11, a[0] * b[0]), scaled(h22, a[1] * b[1]));
            sum(squares, sum(scaled(h12, a[0] * b[1]), scaled(h21, a[1] * b[0])))
        };
        let (of_1, of_21, of_2) = (block(r, r), block(s, r), block(s, s));
        // The rows of the first corner are minus the sums of those of the others.
        let (of_10, of_20) = (negated(sum(of_1, transposed(of_21))), negated(sum(of_21, of_2)));
        put(0, &negated(sum(of_10, of_20)));
        put(1, &of_1);
        put(2, &of_2);
        put(3, &of_10);
        put(4, &of_20);
        put(5, &of_21);
    }
}

/// E₁₁, E₂₂, E₁₂.
#[inline(always)]
fn strain<T: Scalar>([f1, f2]: [Vector<T>; 2]) -> [T; 3] {
    let half = T::constant(0.5);
    let along = |f: Vector<T>| half * (dot(f, f) - T::constant(1.0));
    [along(f1), along(f2), half * dot(f1, f2)]
}

/// First-order change of [`strain`] along `d`.
fn change([f1, f2]: [DVec3; 2], [d1, d2]: [DVec3; 2]) -> [f64; 3] {
    [f1.dot(d1), f2.dot(d2), 0.5 * (f1.dot(d2) + f2.dot(d1))]
}

/// The symmetric matrix (s₁₁, s₂₂, s₁₂) without its negative eigenvalues.
#[inline(always)]
fn tension<T: Real>([s11, s22, s12]: [T; 3]) -> [T; 3] {
    let half = T::constant(0.5);
    let (mean, off) = (half * (s11 + s22), half * (s11 - s22));
    let radius = (off * off + s12 * s12).sqrt();
    let (high, low) = ((mean + radius).positive(), (mean - radius).positive());
    let middle = half * (high + low);
    let slope = half * (high - low) * (radius + T::constant(TINY)).recip();
    [middle + slope * off, middle - slope * off, slope * s12]
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

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
