//! The inner loops of elimination: products of tall matrices, columns first, a few columns of the result at a time.
//!
//! A tile of the result, two registers high and [`WIDTH`] columns wide, stays in registers while its sum is made; every
//! element is the same sum in the same order wherever in a tile it lies. Fused multiply-add where the target has it.
//!
//! Source: Goto and van de Geijn, *Anatomy of high-performance matrix multiplication*, 2008; without its copies of the
//! tall factor, which made nothing faster.

use super::Scalar;

/// Columns of the result at a time: 2·6 sums, two loads and a factor fill sixteen registers.
pub(super) const WIDTH: usize = 6;

/// Fewer rows are left to the smaller tiles.
const TALL: usize = 16;

/// Takes the product of `a` (columns of `lda`) and `b` (a row for each of these columns) from the rows `first..end` of
/// `c` (N columns of `ldc`, of which more may follow); from zero if these are FRESH. Row 0 of `a` is that of `c`.
pub(super) fn subtract_product<T: Scalar, const N: usize, const FRESH: bool>(
    c: &mut [T],
    ldc: usize,
    [first, end]: [usize; 2],
    a: &[T],
    lda: usize,
    b: &[[T; N]],
) {
    // The first columns of a panel have none before them.
    if b.is_empty() && !FRESH {
        return;
    }
    let first = match end - first < TALL {
        true => first,
        false => T::tall_tiles::<N, FRESH>(&mut *c, ldc, [first, end], a, lda, b),
    };
    let high = 2 * T::LANES;
    for at in (first..end).step_by(high) {
        if at + high <= end {
            let sums = products(&a[at..], lda, b);
            for (column, sum) in c.chunks_mut(ldc).zip(sums) {
                T::subtract::<FRESH>(&mut column[at..], sum);
            }
        } else if end >= high {
            // The last rows with some before them, which have what they need.
            let from = end - high;
            let sums = products(&a[from..], lda, b);
            for (column, mut sum) in c.chunks_mut(ldc).zip(sums) {
                if FRESH {
                    column[at..end].fill(T::ZERO);
                }
                T::clear_first(&mut sum, at - from);
                T::subtract::<false>(&mut column[from..], sum);
            }
        } else {
            for row in at..end {
                let mut sums = [T::ZERO; N];
                for (a, b) in a[row..].iter().step_by(lda).zip(b) {
                    (0..N).for_each(|k| sums[k] = a.multiply_add(b[k], sums[k]));
                }
                for (column, sum) in c.chunks_mut(ldc).zip(sums) {
                    column[row] = if FRESH { -sum } else { column[row] - sum };
                }
            }
        }
    }
}

/// The sums of one tile: of the first rows of `a`.
#[inline(always)]
fn products<T: Scalar, const N: usize>(a: &[T], lda: usize, b: &[[T; N]]) -> [[T::Vector; 2]; N] {
    let mut sums = [[T::splat(T::ZERO); 2]; N];
    for (column, b) in a.chunks(lda).zip(b) {
        let [low, high] = T::load(column);
        for (sum, b) in sums.iter_mut().zip(b) {
            let b = T::splat(*b);
            *sum = [T::fused(low, b, sum[0]), T::fused(high, b, sum[1])];
        }
    }
    sums
}

/// Eliminates the N columns that `columns` (of `height`) begins with, whose first diagonal element is in row `first`,
/// among themselves: L below the diagonal, D on it. `None` at a pivot that is zero, not finite or, if it has to be
/// `definite`, negative.
pub(super) fn eliminate_columns<T: Scalar, const N: usize>(
    columns: &mut [T],
    height: usize,
    first: usize,
    definite: bool,
) -> Option<()> {
    let mut pivots = [T::ONE; N];
    // L of the block on the diagonal.
    let mut block = [[T::ZERO; N]; N];
    for c in 0..N {
        // L times D of this row.
        let mut row: [T; N] = std::array::from_fn(|q| columns[q * height + first + c]);
        let mut pivot = row[c];
        for q in 0..c {
            for p in 0..q {
                row[q] -= row[p] * block[q][p];
            }
            block[c][q] = row[q] / pivots[q];
            columns[q * height + first + c] = block[c][q];
            pivot -= row[q] * block[c][q];
        }
        if !pivot.is_finite() || pivot == T::ZERO || definite && pivot < T::ZERO {
            return None;
        }
        pivots[c] = pivot;
        columns[c * height + first + c] = pivot;
    }
    let inverses = pivots.map(|pivot| T::ONE / pivot);
    let mut columns = columns.chunks_exact_mut(height);
    let columns: [&mut [T]; N] =
        std::array::from_fn(|_| &mut columns.next().expect("a whole block")[first + N..]);
    let (rows, lanes) = (height - first - N, T::LANES);
    let whole = rows - rows % lanes;
    for at in (0..whole).step_by(lanes) {
        let mut y = [T::splat(T::ZERO); N];
        for c in 0..N {
            y[c] = T::load_one(&columns[c][at..]);
            for q in 0..c {
                y[c] = T::fused(y[q], T::splat(-block[c][q]), y[c]);
            }
        }
        for c in 0..N {
            T::store_one(&mut columns[c][at..], T::fused(y[c], T::splat(inverses[c]), T::splat(T::ZERO)));
        }
    }
    for at in whole..rows {
        let mut y = [T::ZERO; N];
        for c in 0..N {
            y[c] = columns[c][at];
            for q in 0..c {
                y[c] = y[q].multiply_add(-block[c][q], y[c]);
            }
        }
        for c in 0..N {
            columns[c][at] = y[c] * inverses[c];
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    fn same_bits<T: Scalar + std::fmt::Debug, const N: usize, const FRESH: bool>() {
        let mut rng = Rng::new(3, 0);
        for (rows, depth) in [(1, 1), (3, 4), (7, 2), (8, 3), (15, 5), (16, 1), (33, 9), (64, 20), (101, 33)]
        {
            let mut numbers = |count| -> Vec<T> { (0..count).map(|_| T::from_f64(rng.normal())).collect() };
            let (a, b, before) = (numbers(rows * depth), numbers(N * depth), numbers(rows * (N + 1)));
            let b = b.as_chunks::<N>().0;
            for first in [0, rows / 2, rows - 1] {
                let mut c = before.clone();
                subtract_product::<T, N, FRESH>(&mut c, rows, [first, rows], &a, rows, b);
                for (column, (found, before)) in c.chunks(rows).zip(before.chunks(rows)).enumerate() {
                    for row in 0..rows {
                        let products = b.iter().enumerate().map(|(p, b)| (a[p * rows + row], b));
                        let start = if FRESH { T::ZERO } else { before[row] };
                        let expected = match row >= first && column < N {
                            true => {
                                start - products.fold(T::ZERO, |sum, (a, b)| a.multiply_add(b[column], sum))
                            }
                            false => before[row],
                        };
                        assert_eq!(found[row], expected, "{rows} rows from {first}, {depth} deep");
                    }
                }
            }
        }
    }

    #[test]
    fn tiles_of_every_height_have_the_bits_of_a_plain_sum() {
        same_bits::<f64, WIDTH, false>();
        same_bits::<f64, WIDTH, true>();
        same_bits::<f64, 3, false>();
        same_bits::<f32, WIDTH, false>();
        same_bits::<f32, 3, true>();
    }
}
