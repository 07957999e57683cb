//! Hyper-dual numbers: exact mixed second derivatives along two directions.
//!
//! Evaluating a gradient at x + ε₁ a + ε₂ b and reading the ε₁ε₂ part gives the third derivative of
//! the energy contracted with a and b (Fike and Alonso 2011, "The Development of Hyper-Dual
//! Numbers for Exact Second-Derivative Calculations").

use std::ops::{Add, Mul, Neg, Sub};

use super::scalar::{Scalar, Vector};

/// value + a·ε₁ + b·ε₂ + ab·ε₁ε₂ with ε₁² = ε₂² = 0.
#[derive(Debug, Clone, Copy)]
pub struct HyperDual {
    /// Real part.
    pub value: f64,
    /// ε₁ part.
    pub a: f64,
    /// ε₂ part.
    pub b: f64,
    /// ε₁ε₂ part.
    pub ab: f64,
}

impl HyperDual {
    /// f(self), given f and its first two derivatives at the real part.
    fn chain(self, f: f64, d: f64, dd: f64) -> Self {
        Self { value: f, a: d * self.a, b: d * self.b, ab: d * self.ab + dd * self.a * self.b }
    }
}

impl Add for HyperDual {
    type Output = Self;

    #[inline]
    fn add(self, o: Self) -> Self {
        Self { value: self.value + o.value, a: self.a + o.a, b: self.b + o.b, ab: self.ab + o.ab }
    }
}

impl Sub for HyperDual {
    type Output = Self;

    #[inline]
    fn sub(self, o: Self) -> Self {
        Self { value: self.value - o.value, a: self.a - o.a, b: self.b - o.b, ab: self.ab - o.ab }
    }
}

impl Neg for HyperDual {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, a: -self.a, b: -self.b, ab: -self.ab }
    }
}

impl Mul for HyperDual {
    type Output = Self;

    #[inline]
    fn mul(self, o: Self) -> Self {
        Self {
            value: self.value * o.value,
            a: self.a * o.value + self.value * o.a,
            b: self.b * o.value + self.value * o.b,
            ab: self.ab * o.value + self.a * o.b + self.b * o.a + self.value * o.ab,
        }
    }
}

impl Scalar for HyperDual {
    #[inline]
    fn constant(value: f64) -> Self {
        Self { value, a: 0.0, b: 0.0, ab: 0.0 }
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root, -0.25 / (root * self.value))
    }

    #[inline]
    fn recip(self) -> Self {
        let r = 1.0 / self.value;
        self.chain(r, -r * r, 2.0 * r * r * r)
    }

    #[inline]
    fn acos(self) -> Self {
        let q = 1.0 / (1.0 - self.value * self.value);
        let root = q.sqrt();
        self.chain(self.value.acos(), -root, -self.value * q * root)
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        // d atan2 = (x dy − y dx)/(x² + y²), and once more along the other direction.
        let y = self;
        let square = x.value * x.value + y.value * y.value;
        let turned = |dx: f64, dy: f64| (x.value * dy - y.value * dx) / square;
        let grown = |dx: f64, dy: f64| (x.value * dx + y.value * dy) / square;
        let (a, b) = (turned(x.a, y.a), turned(x.b, y.b));
        let bent = a * grown(x.b, y.b) + b * grown(x.a, y.a);
        Self { value: y.value.atan2(x.value), a, b, ab: turned(x.ab, y.ab) - bent }
    }

    fn round(self) -> Self {
        Self::constant(self.value.round_ties_even())
    }
}

/// x + ε₁ a + ε₂ b.
#[inline]
pub fn lift(x: glam::DVec3, a: glam::DVec3, b: glam::DVec3) -> Vector<HyperDual> {
    [0, 1, 2].map(|i| HyperDual { value: x[i], a: a[i], b: b[i], ab: 0.0 })
}

/// The ε₁ε₂ part.
#[inline]
pub fn mixed(x: Vector<HyperDual>) -> glam::DVec3 {
    glam::DVec3::new(x[0].ab, x[1].ab, x[2].ab)
}
