//! Numbers that a factor is made of, and registers of them.

use super::registers512::{Product, tall_tiles};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, Neg, Sub, SubAssign};

/// A number of single or double precision.
pub trait Scalar:
    Copy
    + Send
    + Sync
    + PartialOrd
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + Mul<Output = Self>
    + Div<Output = Self>
    + DivAssign
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Numbers in a register.
    const LANES: usize;
    /// A register of numbers.
    type Vector: Copy;

    /// The nearest number.
    fn from_f64(value: f64) -> Self;
    /// Neither infinite nor no number.
    fn is_finite(self) -> bool;
    /// `self` · `factor` + `term`, rounded once where the target can.
    fn multiply_add(self, factor: Self, term: Self) -> Self;
    /// The same number in all lanes.
    fn splat(value: Self) -> Self::Vector;
    /// The first two registers' numbers of `values`.
    fn load(values: &[Self]) -> [Self::Vector; 2];
    /// The first register's.
    fn load_one(values: &[Self]) -> Self::Vector;
    /// Replaces these.
    fn store_one(values: &mut [Self], vector: Self::Vector);
    /// Takes two registers from the first numbers of `values`, or from zero if these are FRESH.
    fn subtract<const FRESH: bool>(values: &mut [Self], vectors: [Self::Vector; 2]);
    /// Sets the first `count` numbers to zero.
    fn clear_first(vectors: &mut [Self::Vector; 2], count: usize);
    /// Part of [`subtract_product`](super::kernel::subtract_product), as far as large registers go; the first row left.
    fn tall_tiles<const N: usize, const FRESH: bool>(
        c: &mut [Self],
        ldc: usize,
        rows: [usize; 2],
        a: &[Self],
        lda: usize,
        b: &[[Self; N]],
    ) -> usize;
    /// a − b.
    fn difference(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a · b + c.
    fn fused(a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
}

macro_rules! scalar {
    ($number:ty, $vector:ty, $lanes:literal) => {
        impl Scalar for $number {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const LANES: usize = $lanes;
            type Vector = $vector;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn is_finite(self) -> bool {
                <$number>::is_finite(self)
            }

            #[inline(always)]
            fn multiply_add(self, factor: Self, term: Self) -> Self {
                // Without the instruction it would be a function of the library, many times slower.
                if cfg!(target_feature = "fma") || cfg!(target_arch = "aarch64") {
                    self.mul_add(factor, term)
                } else {
                    self * factor + term
                }
            }

            #[inline(always)]
            fn splat(value: Self) -> Self::Vector {
                <$vector>::splat(value)
            }

            #[inline(always)]
            fn load(values: &[Self]) -> [Self::Vector; 2] {
                let values: &[Self; 2 * $lanes] = values.first_chunk().expect("two registers");
                let [low, high] = [0, $lanes].map(|at| std::array::from_fn(|k| values[at + k]));
                [<$vector>::new(low), <$vector>::new(high)]
            }

            #[inline(always)]
            fn load_one(values: &[Self]) -> Self::Vector {
                <$vector>::new(*values.first_chunk().expect("a register"))
            }

            #[inline(always)]
            fn store_one(values: &mut [Self], vector: Self::Vector) {
                *values.first_chunk_mut().expect("a register") = vector.to_array();
            }

            #[inline(always)]
            fn subtract<const FRESH: bool>(values: &mut [Self], [low, high]: [Self::Vector; 2]) {
                let values: &mut [Self; 2 * $lanes] = values.first_chunk_mut().expect("two registers");
                let zero = [Self::splat(0.0); 2];
                let [before, after] = if FRESH { zero } else { Self::load(values) };
                values[..$lanes].copy_from_slice(&(before - low).to_array());
                values[$lanes..].copy_from_slice(&(after - high).to_array());
            }

            #[inline(always)]
            fn clear_first(vectors: &mut [Self::Vector; 2], count: usize) {
                for (half, vector) in vectors.iter_mut().enumerate() {
                    let mut values = vector.to_array();
                    values.iter_mut().enumerate().for_each(|(k, v)| {
                        if half * $lanes + k < count {
                            *v = 0.0;
                        }
                    });
                    *vector = <$vector>::new(values);
                }
            }

            fn tall_tiles<const N: usize, const FRESH: bool>(
                c: &mut [Self],
                ldc: usize,
                rows: [usize; 2],
                a: &[Self],
                lda: usize,
                b: &[[Self; N]],
            ) -> usize {
                tall_tiles(Product::<Self, N, FRESH> { c, ldc, rows, a, lda, b }, rows[0])
            }

            #[inline(always)]
            fn difference(a: Self::Vector, b: Self::Vector) -> Self::Vector {
                a - b
            }

            #[inline(always)]
            fn fused(a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
                a.mul_add(b, c)
            }
        }
    };
}

scalar!(f64, wide::f64x4, 4);
scalar!(f32, wide::f32x8, 8);
