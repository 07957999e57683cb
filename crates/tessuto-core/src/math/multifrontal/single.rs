//! Substitution in one front for a single right-hand side: kernels made for many are slow at one. Several columns
//! are taken at a time, so that what they meet is read once.

use std::ops::Range;

use super::{LANES, Scalar, each_of_few};

/// Columns of a front's boundary that are taken at a time.
const MANY: usize = 6;

/// `x` becomes L⁻¹ x, with L in `columns` of `height`; `load` loses what the boundary's rows make of it.
pub(super) fn up<T: Scalar>(columns: &[T], height: usize, x: &mut [T], load: &mut [T]) {
    let width = x.len();
    for (vertex, columns) in columns.chunks_exact((3 * height).max(1)).enumerate() {
        let (done, later) = x.split_at_mut(3 * vertex + 3);
        let own = &mut done[3 * vertex..];
        let [a, b, c] = rows(columns, height, 3 * vertex..width);
        own[1] -= a[1] * own[0];
        own[2] -= a[2] * own[0] + b[2] * own[1];
        subtract(later, [&a[3..], &b[3..], &c[3..]], [own[0], own[1], own[2]]);
    }
    // Nothing waits for the boundary: more columns at a time, which read and write it less often.
    let (pairs, last) = x.as_chunks::<MANY>();
    for (columns, x) in columns.chunks_exact((MANY * height).max(1)).zip(pairs) {
        subtract(load, rows(columns, height, width..height), *x);
    }
    if let [p, q, r] = *last {
        let columns = &columns[(width - 3) * height..];
        subtract(load, rows(columns, height, width..height), [p, q, r]);
    }
}

/// `x` becomes L⁻ᵀ x, given the solution at the `boundary`.
pub(super) fn down<T: Scalar>(columns: &[T], height: usize, x: &mut [T], boundary: &[T]) {
    let width = x.len();
    let (pairs, last) = x.as_chunks_mut::<MANY>();
    for (columns, x) in columns.chunks_exact((MANY * height).max(1)).zip(pairs) {
        let products = products::<T, MANY>(rows(columns, height, width..height), boundary);
        x.iter_mut().zip(products).for_each(|(x, product)| *x -= product);
    }
    if !last.is_empty() {
        let columns = &columns[(width - 3) * height..];
        let products = products::<T, 3>(rows(columns, height, width..height), boundary);
        last.iter_mut().zip(products).for_each(|(x, product)| *x -= product);
    }
    for (vertex, columns) in columns.chunks_exact((3 * height).max(1)).enumerate().rev() {
        let (own, later) = x[3 * vertex..].split_at_mut(3);
        let [a, b, c] = rows(columns, height, 3 * vertex..width);
        let [sum_a, sum_b, sum_c] = products([&a[3..], &b[3..], &c[3..]], later);
        own[2] -= sum_c;
        own[1] -= sum_b + b[2] * own[2];
        own[0] -= sum_a + a[1] * own[1] + a[2] * own[2];
    }
}

/// Some rows of the first columns.
#[inline(always)]
fn rows<T, const N: usize>(columns: &[T], height: usize, rows: Range<usize>) -> [&[T]; N] {
    std::array::from_fn(|k| &columns[k * height..][rows.clone()])
}

/// `to` −= Σ `columns`·`factors`.
#[inline]
pub(super) fn subtract<T: Scalar, const N: usize>(to: &mut [T], columns: [&[T]; N], factors: [T; N]) {
    let (to, to_rest) = to.as_chunks_mut::<LANES>();
    let split = columns.map(|column| column.as_chunks::<LANES>());
    let whole = split.map(|(whole, _)| &whole[..to.len()]);
    let of_lanes = factors.map(|factor| T::lanes([factor; LANES]));
    for (i, to) in to.iter_mut().enumerate() {
        let mut left = T::lanes(*to);
        for n in 0..N {
            left = T::minus(T::lanes(whole[n][i]), of_lanes[n], left);
        }
        *to = T::each(left);
    }
    each_of_few(to_rest, split.map(|(_, rest)| rest), |to, row| {
        let products = row.into_iter().zip(factors).map(|(l, factor)| l * factor);
        products.fold(to, |to, product| to - product)
    });
}

/// Products of the `columns` with `x`.
#[inline]
fn products<T: Scalar, const N: usize>(columns: [&[T]; N], x: &[T]) -> [T; N] {
    let (x, x_rest) = x.as_chunks::<LANES>();
    let split = columns.map(|column| column.as_chunks::<LANES>());
    let whole = split.map(|(whole, _)| &whole[..x.len()]);
    let mut sums = [T::lanes([T::zero_impl(); LANES]); N];
    for (i, x) in x.iter().enumerate() {
        let x = T::lanes(*x);
        for n in 0..N {
            sums[n] = T::plus(T::lanes(whole[n][i]), x, sums[n]);
        }
    }
    let rest = split.map(|(_, rest)| &rest[..x_rest.len()]);
    let mut sums = sums.map(|lanes| sum(T::each(lanes)));
    for (i, x) in x_rest.iter().enumerate() {
        for n in 0..N {
            sums[n] += rest[n][i] * *x;
        }
    }
    sums
}

/// In halves.
#[inline(always)]
fn sum<T: Scalar>(lanes: [T; LANES]) -> T {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
