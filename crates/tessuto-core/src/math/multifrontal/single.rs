//! Substitution in one front for a single right-hand side: kernels made for many are slow at one. A vertex's three
//! columns are taken at a time, so that what they meet is read once.

use super::Scalar;

/// Sums that are made side by side, so that additions need not wait for each other.
const LANES: usize = 8;

/// `x` becomes L⁻¹ x, with L in `columns` of `height`; `load` loses what the boundary's rows make of it.
pub(super) fn up<T: Scalar>(columns: &[T], height: usize, x: &mut [T], load: &mut [T]) {
    for (vertex, columns) in columns.chunks_exact((3 * height).max(1)).enumerate() {
        let (done, later) = x.split_at_mut(3 * vertex + 3);
        let own = &mut done[3 * vertex..];
        let [a, b, c] = below(columns, height, 3 * vertex);
        own[1] -= a[1] * own[0];
        own[2] -= a[2] * own[0] + b[2] * own[1];
        let own = [own[0], own[1], own[2]];
        let rows = later.len();
        subtract(later, [a, b, c].map(|column| &column[3..][..rows]), own);
        subtract(load, [a, b, c].map(|column| &column[3 + rows..]), own);
    }
}

/// `x` becomes L⁻ᵀ x, given the solution at the `boundary`.
pub(super) fn down<T: Scalar>(columns: &[T], height: usize, x: &mut [T], boundary: &[T]) {
    for (vertex, columns) in columns.chunks_exact((3 * height).max(1)).enumerate().rev() {
        let (own, later) = x[3 * vertex..].split_at_mut(3);
        let [a, b, c] = below(columns, height, 3 * vertex);
        let rows = later.len();
        let mut sums = [[T::zero_impl(); LANES]; 3];
        add_products(&mut sums, [a, b, c].map(|column| &column[3..][..rows]), later);
        add_products(&mut sums, [a, b, c].map(|column| &column[3 + rows..]), boundary);
        let [sum_a, sum_b, sum_c] = sums.map(sum);
        own[2] -= sum_c;
        own[1] -= sum_b + b[2] * own[2];
        own[0] -= sum_a + a[1] * own[1] + a[2] * own[2];
    }
}

/// A vertex's columns from row `row`, its first own one, on.
fn below<T>(columns: &[T], height: usize, row: usize) -> [&[T]; 3] {
    [0, 1, 2].map(|k| &columns[k * height..][row..height])
}

fn subtract<T: Scalar>(to: &mut [T], [a, b, c]: [&[T]; 3], [p, q, r]: [T; 3]) {
    for (((to, a), b), c) in to.iter_mut().zip(a).zip(b).zip(c) {
        *to -= *a * p + *b * q + *c * r;
    }
}

fn add_products<T: Scalar>([sum_a, sum_b, sum_c]: &mut [[T; LANES]; 3], columns: [&[T]; 3], x: &[T]) {
    let [(a, a_rest), (b, b_rest), (c, c_rest)] = columns.map(|column| column.as_chunks::<LANES>());
    let (x, x_rest) = x.as_chunks::<LANES>();
    for (((a, b), c), x) in a.iter().zip(b).zip(c).zip(x) {
        add_lanes(sum_a, a, x);
        add_lanes(sum_b, b, x);
        add_lanes(sum_c, c, x);
    }
    for (k, x) in x_rest.iter().enumerate() {
        sum_a[k] += a_rest[k] * *x;
        sum_b[k] += b_rest[k] * *x;
        sum_c[k] += c_rest[k] * *x;
    }
}

/// One expression of all lanes: the compiler makes vectors of it, which it does not of three columns' sums mixed.
#[inline(always)]
fn add_lanes<T: Scalar>(sum: &mut [T; LANES], a: &[T; LANES], x: &[T; LANES]) {
    *sum = std::array::from_fn(|k| sum[k] + a[k] * x[k]);
}

/// In halves.
fn sum<T: Scalar>(lanes: [T; LANES]) -> T {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
