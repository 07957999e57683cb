//! Products with a square root of the matrix that a factor is of.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, MatMut, MatRef, Par};

use super::Fronts;

impl Fronts {
    /// Replaces `x`, in elimination order, by L D^½ x: the covariance of that is L D Lᵀ if that of `x` is 1.
    /// `None` at a negative pivot.
    pub(in crate::math) fn multiply_root(&self, values: &[f64], x: &mut [f64]) -> Option<()> {
        let mut scaled = Vec::new();
        let mut load = Vec::new();
        // Fronts in reverse: what a front adds to is done already.
        for front in self.fronts.iter().rev() {
            let own = 3 * front.first..3 * (front.first + front.own);
            let pivots = values[front.values[1]..].iter().step_by(front.height() + 1);
            scaled.clear();
            for (x, d) in x[own.clone()].iter().zip(pivots) {
                scaled.push(if *d >= 0.0 { x * d.sqrt() } else { return None });
            }
            let (top, bottom) = front.columns(values).split_at_row(front.width());
            let scaled = MatRef::from_column_major_slice(&scaled, front.width(), 1);
            triangular::matmul(
                MatMut::from_column_major_slice_mut(&mut x[own], front.width(), 1),
                BlockStructure::Rectangular,
                Accum::Replace,
                top,
                BlockStructure::UnitTriangularLower,
                scaled,
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
            load.clear();
            load.resize(front.update(), 0.0);
            let target = MatMut::from_column_major_slice_mut(&mut load, front.update(), 1);
            matmul(target, Accum::Replace, bottom, scaled, 1.0, Par::Seq);
            for (v, load) in front.boundary.iter().zip(load.chunks_exact(3)) {
                x[3 * *v as usize..][..3].iter_mut().zip(load).for_each(|(x, l)| *x += l);
            }
        }
        Some(())
    }
}
