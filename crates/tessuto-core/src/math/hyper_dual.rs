//! Hyper-dual numbers: exact mixed second derivatives along two directions.
//!
//! Evaluating a gradient at x + ε₁ a + ε₂ b and reading the ε₁ε₂ part gives the third derivative of
//! the energy contracted with a and b (Fike and Alonso 2011, "The Development of Hyper-Dual
//! Numbers for Exact Second-Derivative Calculations").

use std::ops::{Add, Mul, Neg, Sub};

use super::scalar::{Scalar, Vector};

/// value + a·ε₁ + b·ε₂ + ab·ε₁ε₂ with ε₁² = ε₂² = 0, of one element or of several.
#[derive(Debug, Clone, Copy)]
pub struct HyperDual<T = f64> {
    /// Real part.
    pub value: T,
    /// ε₁ part.
    pub a: T,
    /// ε₂ part.
    pub b: T,
    /// ε₁ε₂ part.
    pub ab: T,
}

impl<T: Scalar> HyperDual<T> {
    /// f(self), given f and its first two derivatives at the real part.
    #[inline(always)]
    fn chain(self, f: T, d: T, dd: T) -> Self {
        Self { value: f, a: d * self.a, b: d * self.b, ab: d * self.ab + dd * self.a * self.b }
    }

    /// The same in every direction.
    #[inline(always)]
    pub fn fixed(value: T) -> Self {
        let zero = T::constant(0.0);
        Self { value, a: zero, b: zero, ab: zero }
    }
}

impl<T: Scalar> Add for HyperDual<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { value: self.value + o.value, a: self.a + o.a, b: self.b + o.b, ab: self.ab + o.ab }
    }
}

impl<T: Scalar> Sub for HyperDual<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { value: self.value - o.value, a: self.a - o.a, b: self.b - o.b, ab: self.ab - o.ab }
    }
}

impl<T: Scalar> Neg for HyperDual<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, a: -self.a, b: -self.b, ab: -self.ab }
    }
}

impl<T: Scalar> Mul for HyperDual<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self {
            value: self.value * o.value,
            a: self.a * o.value + self.value * o.a,
            b: self.b * o.value + self.value * o.b,
            ab: self.ab * o.value + self.a * o.b + self.b * o.a + self.value * o.ab,
        }
    }
}

impl<T: Scalar> Scalar for HyperDual<T> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::fixed(T::constant(value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let inverse = root.recip();
        let second = T::constant(-0.25) * (root * self.value).recip();
        self.chain(root, T::constant(0.5) * inverse, second)
    }

    #[inline(always)]
    fn recip(self) -> Self {
        let r = self.value.recip();
        self.chain(r, -r * r, T::constant(2.0) * r * r * r)
    }

    #[inline(always)]
    fn acos(self) -> Self {
        let q = (T::constant(1.0) - self.value * self.value).recip();
        let root = q.sqrt();
        self.chain(self.value.acos(), -root, -self.value * q * root)
    }

    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // d atan2 = (x dy − y dx)/(x² + y²), and once more along the other direction.
        let y = self;
        let inverse = (x.value * x.value + y.value * y.value).recip();
        let turned = |dx: T, dy: T| (x.value * dy - y.value * dx) * inverse;
        let grown = |dx: T, dy: T| (x.value * dx + y.value * dy) * inverse;
        let (a, b) = (turned(x.a, y.a), turned(x.b, y.b));
        let bent = a * grown(x.b, y.b) + b * grown(x.a, y.a);
        Self { value: y.value.atan2(x.value), a, b, ab: turned(x.ab, y.ab) - bent }
    }

    #[inline(always)]
    fn round(self) -> Self {
        Self::fixed(self.value.round())
    }
}

/// x + ε₁ a + ε₂ b.
#[inline(always)]
pub fn lift<T: Scalar>(x: Vector<T>, a: Vector<T>, b: Vector<T>) -> Vector<HyperDual<T>> {
    [0, 1, 2].map(|i| HyperDual { value: x[i], a: a[i], b: b[i], ab: T::constant(0.0) })
}

/// The ε₁ε₂ part.
#[inline(always)]
pub fn mixed<T: Scalar>([x, y, z]: Vector<HyperDual<T>>) -> Vector<T> {
    [x.ab, y.ab, z.ab]
}
