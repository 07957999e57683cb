//! What the energies' formulas need of a number, so that each is written once: for one element, for several at a time
//! ([`super::lanes`]), and with derivatives ([`super::hyper_dual`]).

use std::ops::{Add, Mul, Neg, Sub};

/// Added to what is divided by and can be nothing: far below any other number.
pub const TINY: f64 = 1e-300;

/// A number of the energies' gradients.
pub trait Scalar:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// 1/self.
    fn recip(self) -> Self;
    /// Inverse cosine.
    fn acos(self) -> Self;
    /// Angle of the point (`x`, self) from the first axis.
    fn atan2(self, x: Self) -> Self;
    /// Nearest whole number, the even one of two; a constant.
    fn round(self) -> Self;
}

/// A number without derivatives: what upper bounds need besides.
pub trait Real: Scalar {
    /// |self|.
    fn abs(self) -> Self;
    /// self or 0, the larger one.
    fn positive(self) -> Self;
    /// `above` where self is more than `limit`, else `other`.
    fn select_above(self, limit: f64, above: Self, other: Self) -> Self;
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    fn recip(self) -> Self {
        1.0 / self
    }

    fn acos(self) -> Self {
        f64::acos(self)
    }

    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }

    fn round(self) -> Self {
        self.round_ties_even()
    }
}

impl Real for f64 {
    fn abs(self) -> Self {
        f64::abs(self)
    }

    fn positive(self) -> Self {
        self.max(0.0)
    }

    fn select_above(self, limit: f64, above: Self, other: Self) -> Self {
        if self > limit { above } else { other }
    }
}

/// Three numbers.
pub type Vector<T> = [T; 3];

/// Three columns.
pub type Matrix<T> = [Vector<T>; 3];

/// a·b.
#[inline(always)]
pub fn dot<T: Scalar>(a: Vector<T>, b: Vector<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// s·a.
#[inline(always)]
pub fn scale<T: Scalar>(a: Vector<T>, s: T) -> Vector<T> {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + b.
#[inline(always)]
pub fn add<T: Scalar>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[inline(always)]
pub fn subtract<T: Scalar>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// −a.
#[inline(always)]
pub fn negative<T: Scalar>(a: Vector<T>) -> Vector<T> {
    [-a[0], -a[1], -a[2]]
}

/// a × b.
#[inline(always)]
pub fn cross<T: Scalar>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a bᵀ.
#[inline(always)]
pub fn outer<T: Scalar>(a: Vector<T>, b: Vector<T>) -> Matrix<T> {
    [scale(a, b[0]), scale(a, b[1]), scale(a, b[2])]
}

/// A + B.
#[inline(always)]
pub fn sum<T: Scalar>(a: Matrix<T>, b: Matrix<T>) -> Matrix<T> {
    [add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])]
}

/// A − B.
#[inline(always)]
pub fn difference<T: Scalar>(a: Matrix<T>, b: Matrix<T>) -> Matrix<T> {
    [subtract(a[0], b[0]), subtract(a[1], b[1]), subtract(a[2], b[2])]
}

/// s·A.
#[inline(always)]
pub fn scaled<T: Scalar>(a: Matrix<T>, s: T) -> Matrix<T> {
    [scale(a[0], s), scale(a[1], s), scale(a[2], s)]
}

/// −A.
#[inline(always)]
pub fn negated<T: Scalar>(a: Matrix<T>) -> Matrix<T> {
    [negative(a[0]), negative(a[1]), negative(a[2])]
}

/// Aᵀ.
#[inline(always)]
pub fn transposed<T: Scalar>(a: Matrix<T>) -> Matrix<T> {
    [[a[0][0], a[1][0], a[2][0]], [a[0][1], a[1][1], a[2][1]], [a[0][2], a[1][2], a[2][2]]]
}

/// The diagonal matrix of `s` three times.
#[inline(always)]
pub fn diagonal<T: Scalar>(s: T) -> Matrix<T> {
    let o = T::constant(0.0);
    [[s, o, o], [o, s, o], [o, o, s]]
}

/// aᵀ M b.
#[inline(always)]
pub fn form<T: Scalar>(a: Vector<T>, m: Matrix<T>, b: Vector<T>) -> T {
    dot(m.map(|column| dot(a, column)), b)
}
