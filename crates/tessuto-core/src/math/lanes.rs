//! Four elements at a time: the formulas of one with a vector register for every number, the same bits as one by one
//! except after inverse functions, see `arcs.rs`.

use glam::DVec3;

use super::arcs;
use super::scalar::{Matrix, Real, Scalar, Vector};

/// A number of four elements.
pub type Lanes = wide::f64x4;

/// Elements at a time.
pub const LANES: usize = 4;

impl Scalar for Lanes {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::splat(value)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self::ONE / self
    }

    #[inline(always)]
    fn acos(self) -> Self {
        arcs::acos(self)
    }

    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        arcs::atan2(self, x)
    }

    #[inline(always)]
    fn round(self) -> Self {
        self.round_ties_even()
    }
}

impl Real for Lanes {
    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn positive(self) -> Self {
        self.max(Self::ZERO)
    }

    #[inline(always)]
    fn select_above(self, limit: f64, above: Self, other: Self) -> Self {
        self.simd_gt(Self::splat(limit)).select(above, other)
    }
}

/// One number of each of four elements.
#[inline(always)]
pub fn gather(of: impl Fn(usize) -> f64) -> Lanes {
    Lanes::new([of(0), of(1), of(2), of(3)])
}

/// A field's vectors, each filled up to four numbers: so they are read and written in one piece.
pub fn rows(field: &[DVec3]) -> Vec<Lanes> {
    field.iter().map(|v| Lanes::new([v.x, v.y, v.z, 0.0])).collect()
}

/// Adds [`rows`] to a field.
pub fn add_rows(rows: &[Lanes], field: &mut [DVec3]) {
    for (to, row) in field.iter_mut().zip(rows) {
        let [x, y, z, _] = row.to_array();
        *to += DVec3::new(x, y, z);
    }
}

/// Values of a field's rows at four vertices.
#[inline(always)]
pub fn vectors(rows: &[Lanes], vertices: [u32; LANES]) -> Vector<Lanes> {
    let row = |k: usize| rows[vertices[k] as usize];
    let [x, y, z, _] = Lanes::transpose([row(0), row(1), row(2), row(3)]);
    [x, y, z]
}

/// The vectors of the four elements as rows.
#[inline(always)]
pub fn each_row([x, y, z]: Vector<Lanes>) -> [Lanes; LANES] {
    Lanes::transpose([x, y, z, Lanes::ZERO])
}

/// The matrices of the four elements, column by column.
#[inline(always)]
pub fn each_matrix([a, b, c]: &Matrix<Lanes>) -> [[f64; 9]; LANES] {
    let first = Lanes::transpose([a[0], a[1], a[2], b[0]]);
    let second = Lanes::transpose([b[1], b[2], c[0], c[1]]);
    let last = c[2].to_array();
    let matrix = |k: usize| {
        let ([a, b, c, d], [e, f, g, h]) = (first[k].to_array(), second[k].to_array());
        [a, b, c, d, e, f, g, h, last[k]]
    };
    [matrix(0), matrix(1), matrix(2), matrix(3)]
}

/// Of every element the matrix or, where it `is` said so, its transpose.
#[inline(always)]
pub fn transpose_where(is: [bool; LANES], [a, b, c]: &Matrix<Lanes>) -> Matrix<Lanes> {
    // Chosen without branches: which elements are transposed has no order that a processor could guess.
    let mask = Lanes::new(is.map(|is| f64::from_bits(u64::from(is).wrapping_neg())));
    let swap = |p: Lanes, q: Lanes| (mask.select(q, p), mask.select(p, q));
    let ((a1, b0), (a2, c0), (b2, c1)) = (swap(a[1], b[0]), swap(a[2], c[0]), swap(b[2], c[1]));
    [[a[0], a1, a2], [b0, b[1], b2], [c0, c1, c[2]]]
}

/// Calls `f` with four `items` at a time and how many of them are new: the last ones may be fewer, filled up with
/// the last of all.
#[inline(always)]
pub fn in_lanes(mut items: impl Iterator<Item = usize>, mut f: impl FnMut([usize; LANES], usize)) {
    while let Some(first) = items.next() {
        let (mut group, mut count) = ([first; LANES], 1);
        while count < LANES
            && let Some(next) = items.next()
        {
            group[count..].fill(next);
            count += 1;
        }
        f(group, count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_taken_once_and_what_fills_up_is_told() {
        for n in 0..10 {
            let mut taken = Vec::new();
            in_lanes(0..n, |group, count| {
                assert!(group[count..].iter().all(|&k| k == group[count - 1]));
                taken.extend_from_slice(&group[..count]);
            });
            assert!(taken.into_iter().eq(0..n));
        }
    }

    #[test]
    fn what_is_gathered_comes_out_again() {
        let field: Vec<DVec3> = (0..6).map(|k| DVec3::new(0.1, 1.0, -3.0) * f64::from(k)).collect();
        let vertices = [5, 0, 3, 3];
        let rows = rows(&field);
        let gathered = vectors(&rows, vertices);
        assert_eq!(each_row(gathered), vertices.map(|v| rows[v as usize]));
        let mut sum = field.clone();
        add_rows(&rows, &mut sum);
        assert!(sum.iter().zip(&field).all(|(sum, v)| *sum == *v * 2.0));
        let number = |column: usize, row: usize| gather(|k| (100 * k + 10 * column + row) as f64);
        let matrix = [0, 1, 2].map(|column| [0, 1, 2].map(|row| number(column, row)));
        for (k, matrix) in each_matrix(&matrix).iter().enumerate() {
            let expected = [0., 1., 2., 10., 11., 12., 20., 21., 22.];
            assert_eq!(*matrix, expected.map(|value| value + 100.0 * k as f64));
        }
        let turned = transpose_where([false, true, true, false], &matrix);
        for (k, found) in each_matrix(&turned).iter().enumerate() {
            let [a, b, c, d, e, f, g, h, i] = each_matrix(&matrix)[k];
            let is_turned = k == 1 || k == 2;
            assert_eq!(*found, if is_turned { [a, d, g, b, e, h, c, f, i] } else { each_matrix(&matrix)[k] });
        }
    }
}
