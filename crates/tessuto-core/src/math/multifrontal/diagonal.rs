//! L D Lᵀ of small dense blocks, a vertex's three columns at a time: the blocked twin, faer's, is made for large ones.

use super::{Scalar, single::subtract};

/// Widest blocks that are eliminated here.
pub(super) const WIDEST: usize = 96;

/// Eliminates the first `width` rows of `width` columns of `height`: L below the diagonal, D on it. `None` at a pivot
/// that is zero.
pub(super) fn factorize<T: Scalar>(columns: &mut [T], height: usize, width: usize) -> Option<()> {
    for j in (0..width).step_by(3) {
        let (done, later) = columns.split_at_mut((j + 3) * height);
        let (a, rest) = done[j * height..].split_at_mut(height);
        let (b, c) = rest.split_at_mut(height);
        let [a, b, c] = [a, b, c].map(|column| &mut column[j..width]);
        let first = inverse(a[0])?;
        let [p, q] = [a[1] * first, a[2] * first];
        b[1..].iter_mut().zip(&a[1..]).for_each(|(b, a)| *b -= *a * p);
        let second = inverse(b[1])?;
        let r = b[2] * second;
        c[2..].iter_mut().zip(&a[2..]).zip(&b[2..]).for_each(|((c, a), b)| *c -= *a * q + *b * r);
        let third = inverse(c[2])?;
        let columns = later.chunks_exact_mut(height).take(width - j - 3);
        for (row, column) in (3..).zip(columns) {
            let factors = [a[row] * first, b[row] * second, c[row] * third];
            subtract(&mut column[j + row..width], [&a[row..], &b[row..], &c[row..]], factors);
        }
        a[1..].iter_mut().for_each(|l| *l *= first);
        b[2..].iter_mut().for_each(|l| *l *= second);
        c[3..].iter_mut().for_each(|l| *l *= third);
    }
    Some(())
}

fn inverse<T: Scalar>(pivot: T) -> Option<T> {
    (pivot != T::zero_impl()).then(|| T::one_impl() / pivot)
}

#[cfg(test)]
mod tests {
    use faer::dyn_stack::{MemBuffer, MemStack};
    use faer::linalg::cholesky::ldlt::factor::{cholesky_in_place, cholesky_in_place_scratch};
    use faer::{MatMut, Par, Spec};

    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn it_is_as_the_library_s() {
        let mut rng = Rng::new(8, 0);
        for (height, width) in [(3, 3), (20, 9), (50, 36), (200, 78)] {
            let mut plain: Vec<f64> = (0..height * width).map(|_| rng.signed()).collect();
            // Indefinite, and far from singular.
            (0..width).for_each(|j| plain[j * height + j] = if j % 5 == 3 { -60.0 } else { 50.0 });
            let mut fast = plain.clone();
            factorize(&mut fast, height, width).unwrap();
            let mut memory =
                MemBuffer::new(cholesky_in_place_scratch::<f64>(width, Par::Seq, Spec::default()));
            let whole = MatMut::from_column_major_slice_mut(&mut plain, height, width);
            let top = whole.split_at_row_mut(width).0;
            let stack = MemStack::new(&mut memory);
            cholesky_in_place(top, Default::default(), Par::Seq, stack, Spec::default()).unwrap();
            for column in 0..width {
                let rows = column * height + column..column * height + width;
                let off = fast[rows.clone()].iter().zip(&plain[rows]).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-12, "{height}×{width}, column {column}");
            }
        }
        assert_eq!(factorize(&mut [0.0f32; 9], 3, 3), None);
    }
}
