//! Bending between two triangles that share an edge: an energy of their dihedral angle.
//!
//!   E = ½ k (θ − θ0)²,   k = B ‖e‖²/A  with the edge e and the area A of both triangles, without load:
//!
//! a sheet of bending stiffness B `[J]` has the curvature (θ − θ0) ‖e‖/A all over A. A grid that is rolled up
//! along its lines has exactly its energy; one of equilateral triangles has an eighth more. θ is counted around e
//! from the first triangle's normal to the second's.
//!
//! Moving the apex of a triangle along its normal n by δ turns it by δ/h around the edge. From this follow, with
//! the unit edge ê and the direction t = n × ê of the height h = ‖t·u‖, for the apex u = c ê + h t seen from the
//! edge's first end, with p = L δu − c δe and L = ‖e‖, of every triangle
//!
//!   δθ  = n·p/(L h),    δ²θ = −1/(L h) { 2/(L h) (n·p)(t·p) + (n·δe) [2/L (ê·p) + h/L (t·δe)] },
//!
//! negative for the first and positive for the second. Both Hessians here are made of these products. Source:
//! Grinspun, Hirani, Desbrun, Schröder 2003, "Discrete Shells", §3, with a weight of our own; so are the
//! derivatives.

use std::f64::consts::TAU;
use std::ops::{Add, AddAssign, SubAssign};

use glam::DVec3;

use tessuto_core::math::hyper_dual::{HyperDual, lift, mixed};
use tessuto_core::math::lanes::{LANES, Lanes, gather, vectors};
use tessuto_core::math::scalar::{
    Matrix, Real, Scalar, TINY, Vector, add, cross, dot, form, negated, negative, outer, scale, scaled,
    subtract, sum, transposed,
};

/// Square of a length `[m]` that is added to squared lengths, so that directions stay finite.
const SQ_LENGTH_FLOOR: f64 = 1e-18;
/// Square of a doubled area `[m²]`, likewise.
const SQ_AREA_FLOOR: f64 = 1e-30;

/// An inner edge of the cloth.
#[derive(Debug, Clone, Copy)]
pub struct Hinge {
    /// Ends of the edge, apex of the triangle that runs along it from the first to the second, the other apex.
    pub vertices: [u32; 4],
    /// ‖e‖²/A: energy per B and squared angle.
    pub weight: f64,
    /// θ0 `[rad]`.
    pub rest_angle: f64,
    /// Pattern's pairs of the vertices (1, 0), (2, 0), (3, 0), (2, 1), (3, 1), (3, 2).
    pub pairs: [usize; 6],
}

/// The edge, and both apexes from its first end `[m]`.
pub type Arms = [DVec3; 3];

/// A hinge as it is now, or four of them.
#[derive(Debug, Clone, Copy)]
pub struct Bent<T> {
    /// [`Arms`].
    arms: [Vector<T>; 3],
    /// θ0 `[rad]`.
    rest_angle: T,
    /// k `[J]`.
    k: T,
}

/// Second derivatives by [`Arms`]: ee, eu, ew, uu, uw, ww.
#[derive(Debug, Clone, Copy)]
pub struct Hessian<T>([Matrix<T>; 6]);

impl Hinge {
    /// The hinge at rest with its vertices at `x` `[m]`.
    pub fn new(vertices: [u32; 4], x: &[DVec3], pairs: [usize; 6]) -> Self {
        let mut hinge = Self { vertices, weight: 0.0, rest_angle: 0.0, pairs };
        let arms @ [e, u, w] = hinge.arms(x);
        let area = 0.5 * (e.cross(u).length() + e.cross(w).length());
        hinge.weight = e.length_squared() / area;
        hinge.rest_angle = hinge.bent(arms, 0.0).deflection();
        hinge
    }

    /// The arms of a field `[V]`.
    pub fn arms(&self, field: &[DVec3]) -> Arms {
        let [a, b, c, d] = self.vertices.map(|v| field[v as usize]);
        [b - a, c - a, d - a]
    }

    /// The hinge with these arms, for the `stiffness` B `[J]`.
    pub fn bent(&self, arms: Arms, stiffness: f64) -> Bent<f64> {
        Bent { arms: arms.map(|a| a.to_array()), rest_angle: self.rest_angle, k: stiffness * self.weight }
    }

    /// Four hinges with their vertices at the rows `x` `[m]`, for their stiffnesses B `[J]`.
    #[inline(always)]
    pub fn bent_lanes(hinges: [&Self; LANES], x: &[Lanes], stiffness: Lanes) -> Bent<Lanes> {
        Bent {
            arms: Self::arms_lanes(hinges, x),
            rest_angle: gather(|k| hinges[k].rest_angle),
            k: stiffness * gather(|k| hinges[k].weight),
        }
    }

    /// The arms of a field's rows `[V]` at four hinges.
    #[inline(always)]
    pub fn arms_lanes(hinges: [&Self; LANES], field: &[Lanes]) -> [Vector<Lanes>; 3] {
        let corners = |c: usize| vectors(field, hinges.map(|h| h.vertices[c]));
        let (a, b, c, d) = (corners(0), corners(1), corners(2), corners(3));
        [subtract(b, a), subtract(c, a), subtract(d, a)]
    }

    /// Adds a derivative by the arms, as one by the positions.
    #[inline(always)]
    pub fn scatter<V: Copy + Add<Output = V> + AddAssign + SubAssign>(
        &self,
        [ge, gu, gw]: [V; 3],
        out: &mut [V],
    ) {
        let [a, b, c, d] = self.vertices.map(|v| v as usize);
        out[a] -= ge + gu + gw;
        out[b] += ge;
        out[c] += gu;
        out[d] += gw;
    }
}

impl<T: Scalar> Bent<T> {
    /// Energy `[J]`.
    pub fn value(&self) -> T {
        let deflection = self.deflection();
        T::constant(0.5) * self.k * deflection * deflection
    }

    /// [`value`](Self::value) and ∂E by the arms.
    #[inline(always)]
    pub fn value_and_gradient(&self) -> (T, [Vector<T>; 3]) {
        let [e, u, w] = self.arms;
        let (first, second, length) = (cross(e, u), cross(w, e), length(e));
        let deflection = self.deflection_with(length, first, second);
        let slope = deflection * self.k;
        let inverse_length = length.recip();
        // n/(L h) of either triangle; both normals turn the same way where the sheet is flat.
        let turn = |n: Vector<T>| scale(n, slope * (dot(n, n) + T::constant(SQ_AREA_FLOOR)).recip());
        let (a, b) = (turn(first), turn(second));
        let (cu, cw) = (dot(u, e) * inverse_length, dot(w, e) * inverse_length);
        let by_e = add(scale(a, cu), scale(b, cw));
        let value = T::constant(0.5) * slope * deflection;
        (value, [by_e, negative(scale(a, length)), negative(scale(b, length))])
    }

    /// ∂ by the arms of aᵀ (∂²E) b, with `a` and `b` directions of the arms.
    #[inline(always)]
    pub fn third(&self, a: [Vector<T>; 3], b: [Vector<T>; 3]) -> [Vector<T>; 3] {
        let arm = |k: usize| lift(self.arms[k], a[k], b[k]);
        let lifted = Bent {
            arms: [arm(0), arm(1), arm(2)],
            rest_angle: HyperDual::fixed(self.rest_angle),
            k: HyperDual::fixed(self.k),
        };
        lifted.value_and_gradient().1.map(mixed)
    }

    /// θ − θ0 `[rad]`, within half a turn; θ is 0 for a flat sheet.
    pub fn deflection(&self) -> T {
        let [e, u, w] = self.arms;
        self.deflection_with(length(e), cross(e, u), cross(w, e))
    }

    /// The same, given the edge's length and both triangles' normals times their doubled areas.
    #[inline(always)]
    fn deflection_with(&self, length: T, first: Vector<T>, second: Vector<T>) -> T {
        let sine = -length * dot(first, self.arms[2]);
        let angle = sine.atan2(dot(first, second)) - self.rest_angle;
        angle - (angle * T::constant(1.0 / TAU)).round() * T::constant(TAU)
    }
}

impl<T: Real> Bent<T> {
    /// ∂²E by the arms.
    #[inline(always)]
    pub fn hessian(&self) -> Hessian<T> {
        let (mut h, slope, [first, second]) = self.square_of_turn();
        h.add_products(1, slope * first.area.recip(), &first);
        h.add_products(2, -slope * second.area.recip(), &second);
        h
    }

    /// A positive semi-definite upper bound of [`hessian`](Self::hessian): of every product's two squares the
    /// positive one.
    #[inline(always)]
    pub fn hessian_projected(&self) -> Hessian<T> {
        let (mut h, slope, [first, second]) = self.square_of_turn();
        h.add_positive_parts(1, slope, &first);
        h.add_positive_parts(2, -slope, &second);
        h
    }

    /// The part k ∇θ ∇θᵀ of [`hessian`](Self::hessian).
    #[inline(always)]
    pub fn hessian_gauss_newton(&self) -> Hessian<T> {
        self.square_of_turn().0
    }

    /// k ∇θ ∇θᵀ, the slope k (θ − θ0), and both triangles. The second turns the other way than the first.
    #[inline(always)]
    fn square_of_turn(&self) -> (Hessian<T>, T, [Side<T>; 2]) {
        let [e, u, w] = self.arms;
        let (normal_u, normal_w, length) = (cross(e, u), cross(e, w), length(e));
        let slope = self.k * self.deflection_with(length, normal_u, negative(normal_w));
        let edge = scale(e, length.recip());
        let [first, second] = [Side::new(length, edge, u, normal_u), Side::new(length, edge, w, normal_w)];
        let by_u = first.of_p(scale(first.n, first.area.recip()));
        let by_w = second.of_p(scale(second.n, second.area.recip()));
        let (e, u, w) = (subtract(by_w[0], by_u[0]), negative(by_u[1]), by_w[1]);
        let (ge, gu, gw) = (scale(e, self.k), scale(u, self.k), scale(w, self.k));
        let squares = [outer(e, ge), outer(e, gu), outer(e, gw), outer(u, gu), outer(u, gw), outer(w, gw)];
        (Hessian(squares), slope, [first, second])
    }
}

impl<T: Scalar> Hessian<T> {
    /// Gives the blocks by the positions to `put`: the diagonal ones of the hinge's vertices, then those of its pairs.
    #[inline(always)]
    pub fn blocks(&self, mut put: impl FnMut(usize, &Matrix<T>)) {
        let Self([ee, eu, ew, uu, uw, ww]) = self;
        let (ue, we, wu) = (transposed(*eu), transposed(*ew), transposed(*uw));
        // The rows of the first end are minus the sums of the rows of the others; column j of such a sum is by_j.
        let by_e = sum(sum(*ee, ue), we);
        let by_u = sum(sum(*eu, *uu), wu);
        let by_w = sum(sum(*ew, *uw), *ww);
        put(0, &sum(sum(by_e, by_u), by_w));
        put(1, ee);
        put(2, uu);
        put(3, ww);
        put(4, &negated(transposed(by_e)));
        put(5, &negated(transposed(by_u)));
        put(6, &negated(transposed(by_w)));
        put(7, &ue);
        put(8, &we);
        put(9, &wu);
    }

    /// Blocks (ee, e·side, side·side).
    const fn of_side(side: usize) -> [usize; 3] {
        [0, side, if side == 1 { 3 } else { 5 }]
    }

    /// `factor` { 2/(L h) (n·p)(t·p) + (n·δe) [2/L (ê·p) + h/L (t·δe)] } as a quadratic form in δe and δ of the
    /// apex of `side`.
    #[inline(always)]
    fn add_products(&mut self, side: usize, factor: T, s: &Side<T>) {
        let [ee, es, ss] = Self::of_side(side);
        let n = scale(s.n, T::constant(0.5) * factor);
        let [slide_e, slide_u] = s.slide();
        let symmetric = |a: Vector<T>, b: Vector<T>| sum(outer(a, b), outer(b, a));
        // Both forms of p differ from one direction by the same two factors, −c and L.
        let both = symmetric(scale(n, T::constant(2.0) * s.area.recip()), s.t);
        let of_e = sum(scaled(both, s.along * s.along), symmetric(n, slide_e));
        let mixed = sum(outer(n, slide_u), scaled(both, -(s.along * s.length)));
        self.0[ee] = sum(self.0[ee], of_e);
        self.0[es] = sum(self.0[es], mixed);
        self.0[ss] = sum(self.0[ss], scaled(both, s.length * s.length));
    }
}

impl<T: Real> Hessian<T> {
    /// Of [`Self::add_products`] of a triangle that turns with `slope`.
    #[inline(always)]
    fn add_positive_parts(&mut self, side: usize, slope: T, s: &Side<T>) {
        let inverse = s.area.recip();
        let factor = slope * inverse;
        let turns = factor * inverse * T::constant(2.0);
        self.add_positive_part(side, turns, s.of_p(s.n), s.of_p(s.t));
        self.add_positive_part(side, factor, [s.n, [T::constant(0.0); 3]], s.slide());
    }

    /// 4 a b = (a + b)² − (a − b)², with a and b made equally long; one of the squares is positive.
    #[inline(always)]
    fn add_positive_part(&mut self, side: usize, factor: T, a: [Vector<T>; 2], b: [Vector<T>; 2]) {
        let tiny = T::constant(TINY);
        let square = |v: [Vector<T>; 2]| dot(v[0], v[0]) + dot(v[1], v[1]) + tiny;
        let ratio = (square(b) * square(a).recip()).sqrt().sqrt();
        let other = factor * (factor.abs() + tiny).recip() * ratio.recip();
        let by_e = add(scale(a[0], ratio), scale(b[0], other));
        let by_apex = add(scale(a[1], ratio), scale(b[1], other));
        let weight = T::constant(0.25) * factor.abs();
        let (weighted_e, weighted_apex) = (scale(by_e, weight), scale(by_apex, weight));
        let [ee, es, ss] = Self::of_side(side);
        self.0[ee] = sum(self.0[ee], outer(by_e, weighted_e));
        self.0[es] = sum(self.0[es], outer(by_e, weighted_apex));
        self.0[ss] = sum(self.0[ss], outer(by_apex, weighted_apex));
    }
}

impl<T: Scalar> Hessian<T> {
    /// aᵀ H b.
    #[inline(always)]
    pub fn form(&self, a: [Vector<T>; 3], b: [Vector<T>; 3]) -> T {
        let Self([ee, eu, ew, uu, uw, ww]) = *self;
        let rows = [[ee, eu, ew], [transposed(eu), uu, uw], [transposed(ew), transposed(uw), ww]];
        let of_row = |k: usize| {
            form(a[k], rows[k][0], b[0]) + form(a[k], rows[k][1], b[1]) + form(a[k], rows[k][2], b[2])
        };
        of_row(0) + of_row(1) + of_row(2)
    }
}

/// One of the two triangles, named as in the module.
struct Side<T> {
    /// L h, twice the area `[m²]`.
    area: T,
    /// L `[m]`.
    length: T,
    /// c `[m]`.
    along: T,
    n: Vector<T>,
    edge: Vector<T>,
    t: Vector<T>,
}

impl<T: Scalar> Side<T> {
    /// The triangle of an `edge` of length one, the edge's `length`, the apex `u` and the `normal` e × u.
    #[inline(always)]
    fn new(length: T, edge: Vector<T>, u: Vector<T>, normal: Vector<T>) -> Self {
        let area = (dot(normal, normal) + T::constant(SQ_AREA_FLOOR)).sqrt();
        let n = scale(normal, area.recip());
        Self { area, length, along: dot(u, edge), n, edge, t: cross(n, edge) }
    }

    /// v·p as a linear form in (δe, δu).
    #[inline(always)]
    fn of_p(&self, v: Vector<T>) -> [Vector<T>; 2] {
        [scale(v, -self.along), scale(v, self.length)]
    }

    /// 2/L (ê·p) + h/L (t·δe), likewise.
    #[inline(always)]
    fn slide(&self) -> [Vector<T>; 2] {
        let inverse = self.length.recip();
        let [by_e, by_u] = self.of_p(scale(self.edge, T::constant(2.0) * inverse));
        [add(by_e, scale(self.t, self.area * inverse * inverse)), by_u]
    }
}

/// L `[m]`.
#[inline(always)]
fn length<T: Scalar>(edge: Vector<T>) -> T {
    (dot(edge, edge) + T::constant(SQ_LENGTH_FLOOR)).sqrt()
}
