//! The work of kernels: arithmetic operations, counted or estimated, and bytes.

use std::cell::Cell;
use std::mem::size_of;
use std::ops::{Add, Mul, Neg, Sub};

use tessuto::math::scalar::{Real, Scalar};
use tessuto::sim::Cloth;
use tessuto::sim::angle::Turned;
use tessuto::sim::cloth::{AngleSpring, Edge};
use tessuto::sim::stretch::Stretched;

/// Operations and bytes of one call.
#[derive(Debug, Clone, Copy, Default)]
pub struct Work {
    pub flops: f64,
    pub bytes: f64,
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { flops: self.flops + other.flops, bytes: self.bytes + other.bytes }
    }
}

/// Work of every pixel that is looked at and of every covered one, in operations and bytes.
///
/// Estimated. Forward, covered: plane of 1/z 2, z 1, texel coordinates 6, cell of the texture 10, bilinear mix of four
/// channels 4·9: 55. Bytes: triangle 4, 1/z 8 and colour 16 written for every pixel, one texel of 16 read per covered
/// one.
pub const FORWARD: [Work; 2] = [Work { flops: 0.0, bytes: 28.0 }, Work { flops: 55.0, bytes: 16.0 }];
/// Estimated. z and texel coordinates 7, cell 10, slopes of the mix 8 + 4·3 + 4·6, two products with the gradient 14,
/// plane's sums 18: 93. Bytes: triangle 4, 1/z 8, gradient 16 read, one texel 16.
pub const ADJOINT: [Work; 2] = [Work { flops: 0.0, bytes: 4.0 }, Work { flops: 93.0, bytes: 40.0 }];
/// Estimated. Texel coordinates and cell 17, weights 6, four texels of four channels 4·4·2: 55. Bytes: triangle 4, 1/z
/// 8, gradient 16, one texel's gradient read and written 32.
pub const TEXTURE_ADJOINT: [Work; 2] = [Work { flops: 0.0, bytes: 4.0 }, Work { flops: 55.0, bytes: 56.0 }];
/// A look-up by texel coordinates. Estimated as above: cell 10, mix 36. Bytes: coordinates 16, one texel 16, colour 16.
pub const LOOKUP: Work = Work { flops: 46.0, bytes: 48.0 };
/// A camera sample, which is a direction of the light and one of the BRDF, with derivatives. Estimated: draw from the
/// light 60, from the BRDF 60, two rotations 30, cell of a direction in the environment 60 (inverse functions 20 each),
/// two horizons 60; of either direction the BRDF 70, the weight 10, sums 45, adjoint 8. Bytes: of either direction a
/// texel's radiance and density 16 read, its gradient 12 read and written.
pub const SAMPLE: Work = Work { flops: 270.0 + 2.0 * 133.0, bytes: 2.0 * (16.0 + 24.0) };

/// Of so many pixels, of which some are covered.
pub fn of_pixels([every, covered]: [Work; 2], pixels: usize, of_them: usize) -> Work {
    let (n, m) = (pixels as f64, of_them as f64);
    Work { flops: n * every.flops + m * covered.flops, bytes: n * every.bytes + m * covered.bytes }
}

/// One factorisation: its operations by the sizes of its fronts; the matrix is read, the factor written, of `size`
/// bytes a number.
pub fn factor(cloth: &Cloth, size: f64) -> Work {
    let values = cloth.pattern.value_count() as f64;
    Work { flops: cloth.analysis.flops(), bytes: 8.0 * values + size * cloth.analysis.nonzeros() as f64 }
}

/// A multiplication and an addition for every number of the factor, upwards and downwards.
pub fn solve(cloth: &Cloth, size: f64) -> Work {
    let numbers = cloth.analysis.nonzeros() as f64;
    Work { flops: 4.0 * numbers, bytes: 2.0 * size * numbers }
}

/// Sums over the springs of a cloth. Operations: the formulas with numbers that count, and an addition for every number
/// that is added to a result. Bytes: springs and stiffnesses, fields read, results read and written.
pub struct Springs {
    pub gradient: Work,
    pub hessian: Work,
    pub third: Work,
    pub by_stiffness: Work,
}

impl Springs {
    pub fn of(cloth: &Cloth) -> Self {
        let angles = (cloth.bends.len() + cloth.shears.len()) as f64;
        let edges = cloth.edges.len() as f64;
        let read = angles * (size_of::<AngleSpring>() + 8) as f64 + edges * (size_of::<Edge>() + 8) as f64;
        let field = 24.0 * cloth.vertex_count() as f64;
        let c = Counted;
        let u = [c(0.02), c(0.001), c(0.002)];
        let w = [c(0.019), c(-0.001), c(0.001)];
        let angle = Turned { u, w, stiffness: c(1.0), rest_angle: c(0.1) };
        let edge = Stretched { along: u, stiffness: c(1.0), rest_length: c(0.02) };
        let work = |of_angle: f64, of_edge: f64, bytes: f64| Work {
            flops: angles * of_angle + edges * of_edge,
            bytes: read + bytes,
        };
        // Differences along arms 6, edges 3, are counted with every field that is read.
        let gradient = work(
            6.0 + count(|| keep(angle.value_and_gradient())) + 12.0,
            3.0 + count(|| keep((edge.value(), edge.gradient()))) + 6.0,
            3.0 * field,
        );
        let blocks = || angle.hessian().blocks(|_, block| keep(*block));
        let hessian = work(
            6.0 + count(blocks) + 45.0,
            3.0 + count(|| keep(edge.hessian())) + 30.0,
            field + 16.0 * cloth.pattern.value_count() as f64,
        );
        let third = work(
            18.0 + count(|| keep(angle.third([u, w], [w, u]))) + 12.0,
            9.0 + count(|| keep(edge.third(u, w))) + 6.0,
            5.0 * field,
        );
        // First and second derivatives by the stiffnesses.
        let of_angle = count(|| keep((angle.value_and_gradient(), angle.form([u, w], [w, u]))));
        let of_edge = count(|| keep((edge.gradient(), edge.hessian())));
        let by_stiffness =
            Work { bytes: 2.0 * read + 8.0 * field, ..work(24.0 + of_angle, 30.0 + of_edge, 0.0) };
        Self { gradient, hessian, third, by_stiffness }
    }

    /// A linearised step and its adjoint: all of these once, a factor, two solves.
    pub fn step(&self, cloth: &Cloth) -> Work {
        let solves = solve(cloth, 8.0) + solve(cloth, 8.0);
        self.gradient + self.hessian + self.third + self.by_stiffness + factor(cloth, 8.0) + solves
    }
}

thread_local! {
    static OPERATIONS: Cell<f64> = const { Cell::new(0.0) };
}

/// Keeps what is only counted from being left out.
fn keep<T>(value: T) {
    std::hint::black_box(value);
}

fn count(run: impl FnOnce()) -> f64 {
    OPERATIONS.set(0.0);
    run();
    OPERATIONS.get()
}

/// A number whose operations are counted: one each, also a root and a quotient; an inverse function is 25, as the
/// polynomials here have.
#[derive(Debug, Clone, Copy)]
struct Counted(f64);

impl Counted {
    fn after(operations: f64, value: f64) -> Self {
        OPERATIONS.set(OPERATIONS.get() + operations);
        Self(value)
    }
}

impl Add for Counted {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::after(1.0, self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::after(1.0, self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self::after(1.0, self.0 * other.0)
    }
}

/// A change of sign is part of the next operation.
impl Neg for Counted {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Scalar for Counted {
    fn constant(value: f64) -> Self {
        Self(value)
    }

    fn sqrt(self) -> Self {
        Self::after(1.0, self.0.sqrt())
    }

    fn recip(self) -> Self {
        Self::after(1.0, 1.0 / self.0)
    }

    fn acos(self) -> Self {
        Self::after(25.0, self.0.acos())
    }

    fn atan2(self, x: Self) -> Self {
        Self::after(25.0, self.0.atan2(x.0))
    }

    fn round(self) -> Self {
        Self::after(1.0, self.0.round())
    }
}

impl Real for Counted {
    fn abs(self) -> Self {
        Self(self.0.abs())
    }

    fn positive(self) -> Self {
        Self::after(1.0, self.0.max(0.0))
    }

    fn select_above(self, limit: f64, above: Self, other: Self) -> Self {
        Self::after(1.0, if self.0 > limit { above.0 } else { other.0 })
    }
}
