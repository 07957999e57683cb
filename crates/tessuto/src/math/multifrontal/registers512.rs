//! Tiles of twice the height, for processors with registers of 512 bits (AVX-512): found out when the program runs.
//! Every element is the same sum in the same order as without.

use pulp::{Simd, WithSimd};

/// What [`subtract_product`](super::kernel::subtract_product) is asked for.
pub(super) struct Product<'a, T, const N: usize, const FRESH: bool> {
    pub c: &'a mut [T],
    pub ldc: usize,
    pub rows: [usize; 2],
    pub a: &'a [T],
    pub lda: usize,
    pub b: &'a [[T; N]],
}

macro_rules! tall {
    ($number:ty, $lanes:ident, $load:ident, $load_mut:ident, $splat:ident, $fused:ident, $sub:ident) => {
        impl<const N: usize, const FRESH: bool> WithSimd for Product<'_, $number, N, FRESH> {
            /// The first row that was left.
            type Output = usize;

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> usize {
                let Self { c, ldc, rows: [first, end], a, lda, b } = self;
                let high = 2 * S::$lanes;
                let mut at = first;
                while at + high <= end {
                    let mut sums = [[simd.$splat(0.0); 2]; N];
                    for (column, b) in a[at..].chunks(lda).zip(b) {
                        let (column, _) = S::$load(&column[..high]);
                        for k in 0..N {
                            let b = simd.$splat(b[k]);
                            sums[k] = [
                                simd.$fused(column[0], b, sums[k][0]),
                                simd.$fused(column[1], b, sums[k][1]),
                            ];
                        }
                    }
                    for (column, sum) in c.chunks_mut(ldc).zip(sums) {
                        let (column, _) = S::$load_mut(&mut column[at..at + high]);
                        for (column, sum) in column.iter_mut().zip(sum) {
                            let before = if FRESH { simd.$splat(0.0) } else { *column };
                            *column = simd.$sub(before, sum);
                        }
                    }
                    at += high;
                }
                at
            }
        }
    };
}

tall!(f64, F64_LANES, as_simd_f64s, as_mut_simd_f64s, splat_f64s, mul_add_f64s, sub_f64s);
tall!(f32, F32_LANES, as_simd_f32s, as_mut_simd_f32s, splat_f32s, mul_add_f32s, sub_f32s);

/// Tiles of this product as far as whole ones go, where the processor has such registers; the first row that was left.
pub(super) fn tall_tiles<P: WithSimd<Output = usize>>(product: P, first: usize) -> usize {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V4::try_new() {
        return Simd::vectorize(simd, product);
    }
    let _ = product;
    first
}
