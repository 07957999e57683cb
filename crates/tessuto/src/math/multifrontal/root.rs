//! Products with a square root of the matrix that a factor is of.

use super::Fronts;

impl Fronts {
    /// Replaces `x`, in elimination order, by L D^½ x: the covariance of that is L D Lᵀ if that of `x` is 1. `None` at a
    /// negative pivot.
    pub(in crate::math) fn multiply_root(&self, values: &[f64], x: &mut [f64]) -> Option<()> {
        let mut load = Vec::new();
        // Fronts in reverse: what a front adds to is done already.
        for front in self.fronts.iter().rev() {
            let (own, k) = (&mut x[3 * front.first..], front.width());
            let own = &mut own[..k];
            load.clear();
            load.resize(front.update(), 0.0);
            let columns = front.own_values(values).chunks_exact(front.height().max(1)).enumerate();
            // Later columns first: a row is replaced when its own comes.
            for (j, column) in columns.rev() {
                if column[j] < 0.0 || column[j].is_nan() {
                    return None;
                }
                let scaled = own[j] * column[j].sqrt();
                own[j] = scaled;
                let rows = own[j + 1..].iter_mut().chain(&mut load);
                rows.zip(&column[j + 1..]).for_each(|(x, l)| *x += l * scaled);
            }
            for (v, load) in front.boundary.iter().zip(load.chunks_exact(3)) {
                x[3 * *v as usize..][..3].iter_mut().zip(load).for_each(|(x, l)| *x += l);
            }
        }
        Some(())
    }
}
