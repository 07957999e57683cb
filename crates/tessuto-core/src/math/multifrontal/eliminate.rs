//! The factorisation: fronts are filled, eliminated, and leave an update to their parents.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::{
    LdltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::{Accum, MatMut, Par, Spec};
use rayon::prelude::*;

use super::{Child, Front, Fronts, Scalar};

/// Halves with fewer flops than this are eliminated one after the other: handing one over would cost more.
const PARALLEL_FLOPS: f64 = 1e6;

/// Numbers of working memory of a subtree: its update, then what the halves take or, when they are done, their
/// updates and a copy of the own columns.
pub(super) fn work_len(front: &Front, halves: &[&Front]) -> usize {
    let update = front.update().pow(2);
    let (halves_work, halves_end) = match halves {
        [] => (0, 0),
        [a] => (a.work, a.update().pow(2)),
        [a, b, ..] => {
            let second = second_offset(a, b);
            (a.work.max(second + b.work), second + b.update().pow(2))
        }
    };
    update + halves_work.max(halves_end + front.update() * front.width())
}

/// Where the second half's working memory begins: behind all of the first's if both run at a time, else behind the
/// first's update.
fn second_offset(a: &Front, b: &Front) -> usize {
    match in_parallel(a, b) {
        true => a.work,
        false => a.update().pow(2),
    }
}

fn in_parallel(a: &Front, b: &Front) -> bool {
    a.flops.min(b.flops) > PARALLEL_FLOPS
}

impl Fronts {
    /// Numbers of working memory of [`Self::factorize`].
    pub(in crate::math) fn work_len(&self) -> usize {
        self.fronts[self.root()].work
    }

    /// Eliminates the matrix with the given values; `None` at a pivot that is zero or, if it has to be `definite`,
    /// negative.
    ///
    /// `values` receives the columns of every front: L below the diagonal, D on it. Without pivoting: see
    /// [`Self::growth`] for whether that was sound.
    pub(in crate::math) fn factorize<T: Scalar>(
        &self,
        matrix: &[f64],
        values: &mut [T],
        work: &mut [T],
        definite: bool,
    ) -> Option<()> {
        self.eliminate(self.root(), matrix, values, work, definite)
    }

    /// Eliminates a subtree; its update of the boundary is left at the start of `work`.
    fn eliminate<T: Scalar>(
        &self,
        index: usize,
        matrix: &[f64],
        values: &mut [T],
        work: &mut [T],
        definite: bool,
    ) -> Option<()> {
        let front = &self.fronts[index];
        let (subtrees, own) = values.split_at_mut(front.values[1] - front.values[0]);
        own.fill(T::zero_impl());
        let columns = front.matrix[0]..front.matrix[1];
        for (place, value) in self.places[columns.clone()].iter().zip(&matrix[columns]) {
            own[*place as usize] = T::from_f64_impl(*value);
        }
        let (update, work) = work.split_at_mut(front.update().pow(2));
        let mut second = 0;
        match &front.children[..] {
            [] => {}
            [a] => self.eliminate(a.front, matrix, subtrees, work, definite)?,
            children => {
                let [a, b] = [children[0].front, children[1].front];
                let (fa, fb) = (&self.fronts[a], &self.fronts[b]);
                let (values_a, values_b) = subtrees.split_at_mut(fb.values[0] - fa.values[0]);
                second = second_offset(fa, fb);
                if in_parallel(fa, fb) {
                    let (work_a, work_b) = work.split_at_mut(second);
                    let (done_a, done_b) = rayon::join(
                        || self.eliminate(a, matrix, values_a, work_a, definite),
                        || self.eliminate(b, matrix, values_b, work_b, definite),
                    );
                    done_a.and(done_b)?;
                } else {
                    self.eliminate(a, matrix, values_a, work, definite)?;
                    self.eliminate(b, matrix, values_b, &mut work[second..], definite)?;
                }
            }
        }
        let side = |child: &Child| self.fronts[child.front].update();
        let end = front.children.iter().zip([0, second]).map(|(c, at)| at + side(c).pow(2)).max();
        let (updates, rest) = work.split_at_mut(end.unwrap_or(0));
        for (child, at) in front.children.iter().zip([0, second]) {
            child.add_to_own(&updates[at..], side(child), own, front.height());
        }
        front.factorize(own, update, &mut rest[..front.update() * front.width()], definite)?;
        for (child, at) in front.children.iter().zip([0, second]) {
            child.add_to_update(&updates[at..], side(child), update, front);
        }
        Some(())
    }

    /// Largest |d| max(1, |l|)² over all columns: rounding errors of the factor are of its size times those of a
    /// number. Infinite if a value is not finite.
    pub(in crate::math) fn growth(&self, values: &[f64]) -> f64 {
        let front_growth = |front: &Front| {
            let mut growth = 0.0;
            let columns = values[front.values[1]..][..front.len()].chunks_exact(front.height().max(1));
            for (j, column) in columns.enumerate() {
                let (pivot, below) = (column[j], &column[j + 1..]);
                // Eight running maxima, so that the comparisons need not wait for each other.
                let mut largest = [1.0f64; 8];
                let octets = below.chunks_exact(8);
                octets.remainder().iter().zip(&mut largest).for_each(|(l, m)| *m = m.max(l.abs()));
                for octet in octets {
                    octet
                        .iter()
                        .zip(&mut largest)
                        .for_each(|(l, m)| *m = if l.abs() > *m { l.abs() } else { *m });
                }
                let largest = largest.into_iter().fold(1.0, f64::max);
                let size = pivot.abs() * largest * largest;
                growth = if size.is_finite() { f64::max(growth, size) } else { f64::INFINITY };
            }
            growth
        };
        self.fronts.par_iter().with_min_len(16).map(front_growth).reduce(|| 0.0, f64::max)
    }
}

impl Child {
    /// Adds the columns of this child's `update` (lower triangle) that are own vertices of the parent.
    fn add_to_own<T: Scalar>(&self, update: &[T], side: usize, own: &mut [T], height: usize) {
        for first in 0..self.own_runs {
            let run = self.runs[first];
            for c in 0..run.len {
                let target = &mut own[(run.to + c) * height..][..height];
                self.add_column(&update[(run.from + c) * side..], first, c, 0, target);
            }
        }
    }

    /// Adds the other columns.
    fn add_to_update<T: Scalar>(&self, update: &[T], side: usize, target: &mut [T], parent: &Front) {
        let (skip, height) = (parent.width(), parent.update());
        for first in self.own_runs..self.runs.len() {
            let run = self.runs[first];
            for c in 0..run.len {
                let target = &mut target[(run.to - skip + c) * height..][..height];
                self.add_column(&update[(run.from + c) * side..], first, c, skip, target);
            }
        }
    }

    /// Adds the rows from the diagonal on of the `c`-th column of run `first`; `target` begins at row `skip`.
    fn add_column<T: Scalar>(&self, column: &[T], first: usize, c: usize, skip: usize, target: &mut [T]) {
        let mut add = |from: usize, to: usize, len: usize| {
            let target = target[to - skip..][..len].iter_mut();
            target.zip(&column[from..][..len]).for_each(|(t, v)| *t += v);
        };
        let run = self.runs[first];
        add(run.from + c, run.to + c, run.len - c);
        self.runs[first + 1..].iter().for_each(|run| add(run.from, run.to, run.len));
    }
}

impl Front {
    /// Eliminates the own columns; `update` is set to what they leave (lower triangle).
    fn factorize<T: Scalar>(
        &self,
        own: &mut [T],
        update: &mut [T],
        scaled: &mut [T],
        definite: bool,
    ) -> Option<()> {
        let (k, n) = (self.width(), self.update());
        let l = MatMut::from_column_major_slice_mut(own, self.height(), k);
        let (mut top, mut bottom) = l.split_at_row_mut(k);
        // A few kilobytes, beside dense work of the third power.
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<T>(k, Par::Seq, Spec::default()));
        let stack = MemStack::new(&mut memory);
        let plain = LdltRegularization::default();
        cholesky_in_place(top.as_mut(), plain, Par::Seq, stack, Spec::default()).ok()?;
        if definite && !(0..k).all(|j| top[(j, j)] > T::zero_impl()) {
            return None;
        }
        solve_unit_lower_triangular_in_place(top.as_ref(), bottom.as_mut().transpose_mut(), Par::Seq);
        let mut scaled = MatMut::from_column_major_slice_mut(scaled, n, k);
        scaled.copy_from(bottom.as_ref());
        for j in 0..k {
            let inverse = T::one_impl() / top[(j, j)];
            bottom.as_mut().col_mut(j).iter_mut().for_each(|l| *l *= inverse);
        }
        triangular::matmul(
            MatMut::from_column_major_slice_mut(update, n, n),
            BlockStructure::TriangularLower,
            Accum::Replace,
            scaled.as_ref(),
            BlockStructure::Rectangular,
            bottom.as_ref().transpose(),
            BlockStructure::Rectangular,
            -T::one_impl(),
            Par::Seq,
        );
        Some(())
    }
}
