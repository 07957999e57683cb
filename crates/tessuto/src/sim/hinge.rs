//! Bending between two triangles that share an edge: an energy of their dihedral angle.
//!
//!   E = ½ k (θ − θ0)²,   k = B ‖e‖²/A  with the edge e and the area A of both triangles, without load:
//!
//! a sheet of bending stiffness B `[J]` has the curvature (θ − θ0) ‖e‖/A all over A. A grid that is rolled up along its lines has
//! exactly its energy; one of equilateral triangles has an eighth more. θ is counted around e from the first triangle's normal to the
//! second's.
//!
//! Moving the apex of a triangle along its normal n by δ turns it by δ/h around the edge. From this follow, with the unit edge ê and
//! the direction t = n × ê of the height h = ‖t·u‖, for the apex u = c ê + h t seen from the edge's first end, with
//! p = L δu − c δe and L = ‖e‖, of every triangle
//!
//!   δθ  = n·p/(L h),    δ²θ = −1/(L h) { 2/(L h) (n·p)(t·p) + (n·δe) [2/L (ê·p) + h/L (t·δe)] },
//!
//! negative for the first and positive for the second. Both Hessians here are made of these products.
//! Source: Grinspun, Hirani, Desbrun, Schröder 2003, "Discrete Shells", §3, with a weight of our own; so are the derivatives.

use glam::{DMat3, DVec3};

use crate::math::hyper_dual::{self, Scalar, Vector, dot, scale, subtract};
use crate::math::outer;

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

/// Second derivatives by [`Arms`]: ee, eu, ew, uu, uw, ww.
#[derive(Debug, Clone, Copy)]
pub struct Hessian([DMat3; 6]);

impl Hinge {
    /// The hinge at rest with its vertices at `x` `[m]`.
    pub fn new(vertices: [u32; 4], x: &[DVec3], pairs: [usize; 6]) -> Self {
        let mut hinge = Self { vertices, weight: 0.0, rest_angle: 0.0, pairs };
        let arms @ [e, u, w] = hinge.arms(x);
        let area = 0.5 * (e.cross(u).length() + e.cross(w).length());
        hinge.weight = e.length_squared() / area;
        hinge.rest_angle = angle(arms);
        hinge
    }

    /// The arms of a field `[V]`.
    pub fn arms(&self, field: &[DVec3]) -> Arms {
        let [a, b, c, d] = self.vertices.map(|v| field[v as usize]);
        [b - a, c - a, d - a]
    }

    /// Energy `[J]`, for the `stiffness` B `[J]`.
    pub fn value(&self, arms: Arms, stiffness: f64) -> f64 {
        0.5 * self.weight * stiffness * self.deflection(angle(arms)).powi(2)
    }

    /// ∂E by the arms.
    pub fn gradient(&self, arms: Arms, stiffness: f64) -> Arms {
        self.value_and_gradient(arms, stiffness).1
    }

    /// [`value`](Self::value) and [`gradient`](Self::gradient).
    pub fn value_and_gradient(&self, arms: Arms, stiffness: f64) -> (f64, Arms) {
        let k = stiffness * self.weight;
        let (deflection, gradient) = gradient_of(arms.map(|a| a.to_array()), self.rest_angle, k);
        (0.5 * k * deflection * deflection, gradient.map(DVec3::from_array))
    }

    /// ∂²E by the arms.
    pub fn hessian(&self, arms: Arms, stiffness: f64) -> Hessian {
        let (mut h, slope, sides) = self.square_of_turn(arms, stiffness);
        for (k, sign, side) in &sides {
            h.add_products(*k, -slope * sign / side.area, side);
        }
        h
    }

    /// A positive semi-definite upper bound of [`hessian`](Self::hessian): of every product's two squares the positive one.
    pub fn hessian_projected(&self, arms: Arms, stiffness: f64) -> Hessian {
        let (mut h, slope, sides) = self.square_of_turn(arms, stiffness);
        for (k, sign, side) in &sides {
            let factor = -slope * sign / side.area;
            h.add_positive_part(*k, factor * 2.0 / side.area, side.of_p(side.n), side.of_p(side.t));
            h.add_positive_part(*k, factor, [side.n, DVec3::ZERO], side.slide());
        }
        h
    }

    /// The part k ∇θ ∇θᵀ of [`hessian`](Self::hessian).
    pub fn hessian_gauss_newton(&self, arms: Arms, stiffness: f64) -> Hessian {
        self.square_of_turn(arms, stiffness).0
    }

    /// k ∇θ ∇θᵀ, the slope k (θ − θ0), and the triangles with the sign that they turn with.
    fn square_of_turn(
        &self,
        arms @ [e, u, w]: Arms,
        stiffness: f64,
    ) -> (Hessian, f64, [(usize, f64, Side); 2]) {
        let k = stiffness * self.weight;
        let slope = k * self.deflection(angle(arms));
        let sides = [(1, -1.0, Side::new(e, u)), (2, 1.0, Side::new(e, w))];
        let turn = |(_, sign, s): &(usize, f64, Side)| s.of_p(s.n * (sign / s.area));
        let [first, second] = [turn(&sides[0]), turn(&sides[1])];
        let mut h = Hessian([DMat3::ZERO; 6]);
        h.add_square(k, [first[0] + second[0], first[1], second[1]]);
        (h, slope, sides)
    }

    /// ∂ by the arms of aᵀ (∂²E) b, with `a` and `b` directions of the arms.
    pub fn third(&self, arms: Arms, stiffness: f64, a: Arms, b: Arms) -> Arms {
        let lifted = [0, 1, 2].map(|k| hyper_dual::lift(arms[k], a[k], b[k]));
        gradient_of(lifted, self.rest_angle, stiffness * self.weight).1.map(hyper_dual::mixed)
    }

    fn deflection(&self, angle: f64) -> f64 {
        wrapped(angle - self.rest_angle)
    }

    /// Adds a derivative by the arms, as one by the positions.
    pub fn scatter(&self, [ge, gu, gw]: Arms, out: &mut [DVec3]) {
        let [a, b, c, d] = self.vertices.map(|v| v as usize);
        out[a] -= ge + gu + gw;
        out[b] += ge;
        out[c] += gu;
        out[d] += gw;
    }

    /// The blocks of a Hessian by the positions: diagonal ones of the vertices, and those of [`pairs`](Self::pairs).
    pub fn blocks(&self, Hessian([ee, eu, ew, uu, uw, ww]): &Hessian) -> ([DMat3; 4], [DMat3; 6]) {
        let by_e = *ee + eu.transpose() + ew.transpose();
        let by_u = *eu + *uu + uw.transpose();
        let by_w = *ew + *uw + *ww;
        // Row of the first end: minus the sum of the rows of the others; column j of that sum is by_j.
        let diagonal = [by_e + by_u + by_w, *ee, *uu, *ww];
        let with_first = [by_e, by_u, by_w].map(|b| -b.transpose());
        let [e0, u0, w0] = with_first;
        (diagonal, [e0, u0, w0, eu.transpose(), ew.transpose(), uw.transpose()])
    }
}

impl Hessian {
    /// aᵀ H b.
    pub fn form(&self, a: Arms, b: Arms) -> f64 {
        let Self([ee, eu, ew, uu, uw, ww]) = self;
        a[0].dot(*ee * b[0] + *eu * b[1] + *ew * b[2])
            + a[1].dot(eu.transpose() * b[0] + *uu * b[1] + *uw * b[2])
            + a[2].dot(ew.transpose() * b[0] + uw.transpose() * b[1] + *ww * b[2])
    }

    /// Blocks (ee, e·side, side·side).
    fn of_side(side: usize) -> [usize; 3] {
        [0, side, if side == 1 { 3 } else { 5 }]
    }

    /// `factor` { 2/(L h) (n·p)(t·p) + (n·δe) [2/L (ê·p) + h/L (t·δe)] } as a quadratic form in δe and δ of the apex of `side`.
    fn add_products(&mut self, side: usize, factor: f64, s: &Side) {
        let [ee, es, ss] = Self::of_side(side);
        let n = s.n * (0.5 * factor);
        let [slide_e, slide_u] = s.slide();
        let symmetric = |a: DVec3, b: DVec3| outer(a, b) + outer(b, a);
        // Both forms of p differ from one direction by the same two factors, −c and L.
        let both = symmetric(n * (2.0 / s.area), s.t);
        self.0[ee] += both * (s.along * s.along) + symmetric(n, slide_e);
        self.0[es] += both * (-s.along * s.length) + outer(n, slide_u);
        self.0[ss] += both * (s.length * s.length);
    }

    /// 4 a b = (a + b)² − (a − b)², with a and b made equally long; one of the squares is positive.
    fn add_positive_part(&mut self, side: usize, factor: f64, a: [DVec3; 2], b: [DVec3; 2]) {
        let length = |v: [DVec3; 2]| (v[0].length_squared() + v[1].length_squared()).sqrt();
        let [la, lb] = [length(a), length(b)];
        if la == 0.0 || lb == 0.0 {
            return;
        }
        let ratio = (lb / la).sqrt();
        let sum = [0, 1].map(|k| a[k] * ratio + b[k] * (factor.signum() / ratio));
        let [ee, es, ss] = Self::of_side(side);
        let scaled = sum.map(|s| s * (0.25 * factor.abs()));
        self.0[ee] += outer(sum[0], scaled[0]);
        self.0[es] += outer(sum[0], scaled[1]);
        self.0[ss] += outer(sum[1], scaled[1]);
    }

    fn add_square(&mut self, factor: f64, v: Arms) {
        let scaled = v.map(|v| v * factor);
        for (block, [i, j]) in self.0.iter_mut().zip([[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]]) {
            *block += outer(v[i], scaled[j]);
        }
    }
}

/// One of the two triangles, named as in the module.
struct Side {
    /// L h, twice the area `[m²]`.
    area: f64,
    /// L `[m]`.
    length: f64,
    /// c `[m]`.
    along: f64,
    n: DVec3,
    edge: DVec3,
    t: DVec3,
}

impl Side {
    fn new(e: DVec3, u: DVec3) -> Self {
        let normal = e.cross(u);
        let area = (normal.length_squared() + SQ_AREA_FLOOR).sqrt();
        let length = (e.length_squared() + SQ_LENGTH_FLOOR).sqrt();
        let (n, edge) = (normal / area, e / length);
        Self { area, length, along: u.dot(edge), n, edge, t: n.cross(edge) }
    }

    /// v·p as a linear form in (δe, δu).
    fn of_p(&self, v: DVec3) -> [DVec3; 2] {
        [v * -self.along, v * self.length]
    }

    /// 2/L (ê·p) + h/L (t·δe), likewise.
    fn slide(&self) -> [DVec3; 2] {
        let [by_e, by_u] = self.of_p(self.edge * (2.0 / self.length));
        [by_e + self.t * (self.area / (self.length * self.length)), by_u]
    }
}

/// θ `[rad]` in (−π, π]; 0 for a flat sheet.
pub fn angle([e, u, w]: Arms) -> f64 {
    let (first, second) = (e.cross(u), w.cross(e));
    (-e.length() * first.dot(w)).atan2(first.dot(second))
}

/// An angle's difference within half a turn.
fn wrapped(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

/// θ − θ0 and the gradient.
fn gradient_of<T: Scalar>([e, u, w]: [Vector<T>; 3], rest_angle: f64, k: f64) -> (T, [Vector<T>; 3]) {
    let (first, second) = (cross(e, u), cross(w, e));
    let length = (dot(e, e) + T::constant(SQ_LENGTH_FLOOR)).sqrt();
    let angle = (T::constant(0.0) - length * dot(first, w)).atan2(dot(first, second));
    let turns = angle.value() - rest_angle - wrapped(angle.value() - rest_angle);
    let deflection = angle - T::constant(rest_angle + turns);
    let slope = deflection * T::constant(k);
    let inverse_length = length.recip();
    // n/(L h) of either triangle; both normals turn the same way where the sheet is flat.
    let turn = |n: Vector<T>| scale(n, slope * (dot(n, n) + T::constant(SQ_AREA_FLOOR)).recip());
    let (a, b) = (turn(first), turn(second));
    let (cu, cw) = (dot(u, e) * inverse_length, dot(w, e) * inverse_length);
    let zero = [T::constant(0.0); 3];
    let sum = subtract(scale(a, cu), subtract(zero, scale(b, cw)));
    (deflection, [sum, subtract(zero, scale(a, length)), subtract(zero, scale(b, length))])
}

fn cross<T: Scalar>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
