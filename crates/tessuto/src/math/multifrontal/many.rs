//! Substitution in one front for several right-hand sides at a time, side by side in a row for each unknown.

use super::Scalar;

/// What a solve has of every unknown: one number, or one for each of several right-hand sides.
pub(super) trait Row<T>: Copy + Send + Sync {
    /// Zero.
    const ZERO: Self;

    /// Adds another row.
    fn add(&mut self, other: Self);
    /// Divides by a pivot.
    fn divide(&mut self, pivot: T);
    /// `x` becomes L⁻¹ x, with L in `columns` of `height`; `load` loses what the boundary's rows make of it.
    fn up(columns: &[T], height: usize, x: &mut [Self], load: &mut [Self]);
    /// `x` becomes L⁻ᵀ x, given the solution at the `boundary`.
    fn down(columns: &[T], height: usize, x: &mut [Self], boundary: &[Self]);
}

impl<T: Scalar> Row<T> for T {
    const ZERO: Self = T::ZERO;

    fn add(&mut self, other: Self) {
        *self += other;
    }

    fn divide(&mut self, pivot: T) {
        *self /= pivot;
    }

    fn up(columns: &[T], height: usize, x: &mut [Self], load: &mut [Self]) {
        super::single::up(columns, height, x, load);
    }

    fn down(columns: &[T], height: usize, x: &mut [Self], boundary: &[Self]) {
        super::single::down(columns, height, x, boundary);
    }
}

/// N are the numbers of one to four registers.
impl<T: Scalar, const N: usize> Row<T> for [T; N] {
    const ZERO: Self = [T::ZERO; N];

    fn add(&mut self, other: Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| *a += b);
    }

    fn divide(&mut self, pivot: T) {
        self.iter_mut().for_each(|a| *a /= pivot);
    }

    fn up(columns: &[T], height: usize, x: &mut [Self], load: &mut [Self]) {
        match N / T::LANES {
            1 => up::<T, N, 1, 6>(columns, height, x, load),
            2 => up::<T, N, 2, 6>(columns, height, x, load),
            3 => up::<T, N, 3, 3>(columns, height, x, load),
            _ => up::<T, N, 4, 3>(columns, height, x, load),
        }
    }

    fn down(columns: &[T], height: usize, x: &mut [Self], boundary: &[Self]) {
        match N / T::LANES {
            1 => down::<T, N, 1, 6>(columns, height, x, boundary),
            2 => down::<T, N, 2, 6>(columns, height, x, boundary),
            3 => down::<T, N, 3, 3>(columns, height, x, boundary),
            _ => down::<T, N, 4, 3>(columns, height, x, boundary),
        }
    }
}

/// [`Row::up`] for rows of R registers, M of them at a time: as many sums as there are registers for.
fn up<T: Scalar, const N: usize, const R: usize, const M: usize>(
    columns: &[T],
    height: usize,
    x: &mut [[T; N]],
    load: &mut [[T; N]],
) {
    let count = x.len();
    for first in (0..count).step_by(M) {
        let width = M.min(count - first);
        let (own, later) = x[first..].split_at_mut(width);
        let columns = &columns[first * height..];
        for j in 0..width {
            for i in j + 1..width {
                own[i] = minus(own[i], own[j], columns[j * height + first + i]);
            }
        }
        let (from, rows) = (first + width, [later, &mut *load]);
        match width == M {
            true => take_from_rows::<T, N, R, M>(rows, columns, height, from, own),
            false => take_from_rows::<T, N, R, 3>(rows, columns, height, from, own),
        }
    }
}

/// [`Row::down`], the same.
fn down<T: Scalar, const N: usize, const R: usize, const M: usize>(
    columns: &[T],
    height: usize,
    x: &mut [[T; N]],
    boundary: &[[T; N]],
) {
    for first in (0..x.len()).step_by(M).rev() {
        let width = M.min(x.len() - first);
        let (own, later) = x[first..].split_at_mut(width);
        let (from, columns) = (first + width, &columns[first * height..]);
        match width == M {
            true => take_columns::<T, N, R, M>(own, columns, height, from, [later, boundary]),
            false => take_columns::<T, N, R, 3>(own, columns, height, from, [later, boundary]),
        }
        for j in (0..width).rev() {
            for i in j + 1..width {
                own[j] = minus(own[j], own[i], columns[j * height + first + i]);
            }
        }
    }
}

/// Takes L · `own` of M columns from `rows`, of two parts, which are L's rows from `from` on.
fn take_from_rows<T: Scalar, const N: usize, const R: usize, const M: usize>(
    rows: [&mut [[T; N]]; 2],
    columns: &[T],
    height: usize,
    from: usize,
    own: &[[T; N]],
) {
    let own: [[T::Vector; R]; M] = std::array::from_fn(|c| registers(&own[c]));
    let mut columns: [&[T]; M] = std::array::from_fn(|c| &columns[c * height..][from..height]);
    for rows in rows {
        let parts = columns.map(|column| column.split_at(rows.len()));
        for (i, row) in rows.iter_mut().enumerate() {
            let mut left = registers::<T, R>(row);
            for (own, (column, _)) in own.iter().zip(&parts) {
                add_products(&mut left, *own, -column[i]);
            }
            row.chunks_exact_mut(T::LANES).zip(left).for_each(|(part, left)| T::store_one(part, left));
        }
        columns = parts.map(|(_, rest)| rest);
    }
}

/// Takes Lᵀ · `x` of M columns from `own`; L's rows are those from `from` on, of which `x` has two parts.
fn take_columns<T: Scalar, const N: usize, const R: usize, const M: usize>(
    own: &mut [[T; N]],
    columns: &[T],
    height: usize,
    from: usize,
    x: [&[[T; N]]; 2],
) {
    let mut sums = [[T::splat(T::ZERO); R]; M];
    let mut columns: [&[T]; M] = std::array::from_fn(|c| &columns[c * height..][from..height]);
    for x in x {
        let parts = columns.map(|column| column.split_at(x.len()));
        for (i, x) in x.iter().enumerate() {
            let x = registers::<T, R>(x);
            sums.iter_mut().zip(&parts).for_each(|(sums, (column, _))| add_products(sums, x, column[i]));
        }
        columns = parts.map(|(_, rest)| rest);
    }
    own.iter_mut().zip(sums).for_each(|(row, sums)| subtract(row, sums));
}

/// The sums with the products of a row and a number.
#[inline(always)]
fn add_products<T: Scalar, const R: usize>(sums: &mut [T::Vector; R], x: [T::Vector; R], l: T) {
    let l = T::splat(l);
    sums.iter_mut().zip(x).for_each(|(sum, x)| *sum = T::fused(x, l, *sum));
}

/// Takes `sums` from a row.
#[inline(always)]
fn subtract<T: Scalar, const R: usize>(row: &mut [T], sums: [T::Vector; R]) {
    for (part, sum) in row.chunks_exact_mut(T::LANES).zip(sums) {
        let left = T::difference(T::load_one(part), sum);
        T::store_one(part, left);
    }
}

/// The registers of a row.
#[inline(always)]
fn registers<T: Scalar, const R: usize>(row: &[T]) -> [T::Vector; R] {
    std::array::from_fn(|r| T::load_one(&row[r * T::LANES..]))
}

/// a − b · factor.
#[inline(always)]
fn minus<T: Scalar, const N: usize>(a: [T; N], b: [T; N], factor: T) -> [T; N] {
    std::array::from_fn(|k| b[k].multiply_add(-factor, a[k]))
}
