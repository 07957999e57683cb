//! The factorisation: fronts are filled, eliminated, and leave an update to their parents.

use rayon::prelude::*;

use super::kernel::{WIDTH, eliminate_columns, subtract_product};
use super::{Child, Front, Fronts, Scalar};

/// Columns that are eliminated before what they leave is taken from the others: as many as stay in a cache.
const PANEL: usize = 16 * WIDTH;
/// Scalars of a vertex: what is left of a front's columns is a multiple of these.
const VERTEX: usize = 3;
/// Halves with fewer flops than this are eliminated one after the other: handing one over would cost more.
const PARALLEL_FLOPS: f64 = 1e6;

/// Numbers of working memory of a subtree: its update, then what the halves take or, when they are done, their
/// updates and a few rows.
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
    update + halves_work.max(halves_end + WIDTH * front.width().min(PANEL))
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
        own.fill(T::ZERO);
        let columns = front.matrix[0]..front.matrix[1];
        for (place, value) in self.places[columns.clone()].iter().zip(&matrix[columns]) {
            own[*place as usize] = T::from_f64(*value);
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
        front.factorize(own, update, rest, definite)?;
        for (child, at) in front.children.iter().zip([0, second]) {
            child.add_to_update(&updates[at..], side(child), update, front);
        }
        Some(())
    }

    /// Largest |d| max(1, |l|)² over all columns: rounding errors of the factor are of its size times those of a number.
    /// Infinite if a value is not finite.
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
    pub(super) fn add_to_own<T: Scalar>(&self, update: &[T], side: usize, own: &mut [T], height: usize) {
        for first in 0..self.own_runs {
            let run = self.runs[first];
            for c in 0..run.len {
                let target = &mut own[(run.to + c) * height..][..height];
                self.add_column(&update[(run.from + c) * side..], first, c, 0, target);
            }
        }
    }

    /// Adds the other columns.
    pub(super) fn add_to_update<T: Scalar>(
        &self,
        update: &[T],
        side: usize,
        target: &mut [T],
        parent: &Front,
    ) {
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
            target.zip(&column[from..][..len]).for_each(|(t, v)| *t += *v);
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
        work: &mut [T],
        definite: bool,
    ) -> Option<()> {
        let (k, n, height) = (self.width(), self.update(), self.height());
        if k == 0 {
            update.fill(T::ZERO);
        }
        for first in (0..k).step_by(PANEL) {
            let end = (first + PANEL).min(k);
            for at in (first..end).step_by(WIDTH) {
                let (columns, later) = own[first * height..].split_at_mut((at - first) * height);
                Panel { columns, height, first }.take::<false>([later, work], height, 0, [at, end]);
                match end - at {
                    WIDTH.. => eliminate_columns::<T, WIDTH>(later, height, at, definite)?,
                    _ => eliminate_columns::<T, VERTEX>(later, height, at, definite)?,
                }
            }
            let (columns, later) = own[first * height..].split_at_mut((end - first) * height);
            let panel = Panel { columns, height, first };
            for at in (end..k).step_by(WIDTH) {
                panel.take::<false>([&mut later[(at - end) * height..], work], height, 0, [at, k]);
            }
            for at in (0..n).step_by(WIDTH) {
                let to = [&mut update[at * n..], &mut *work];
                match first {
                    0 => panel.take::<true>(to, n, k, [at, n]),
                    _ => panel.take::<false>(to, n, k, [at, n]),
                }
            }
        }
        Some(())
    }
}

/// Columns that are done.
struct Panel<'a, T> {
    columns: &'a [T],
    height: usize,
    /// Row of the first pivot.
    first: usize,
}

impl<T: Scalar> Panel<'_, T> {
    /// Takes L D Lᵀ of these columns from the next ones of a matrix of `rows`, whose row 0 is row `skip` here: columns
    /// `at` and later ones, which end with `end`, from row `at` on; from zeros if they are FRESH.
    fn take<const FRESH: bool>(
        &self,
        [to, work]: [&mut [T]; 2],
        rows: usize,
        skip: usize,
        [at, end]: [usize; 2],
    ) {
        match end - at {
            WIDTH.. => self.take_columns::<WIDTH, FRESH>(to, work, rows, skip, at),
            _ => self.take_columns::<VERTEX, FRESH>(to, work, rows, skip, at),
        }
    }

    fn take_columns<const N: usize, const FRESH: bool>(
        &self,
        to: &mut [T],
        work: &mut [T],
        rows: usize,
        skip: usize,
        at: usize,
    ) {
        let height = self.height;
        let factor = &mut work.as_chunks_mut::<N>().0[..self.columns.len() / height];
        for (p, (factor, column)) in factor.iter_mut().zip(self.columns.chunks_exact(height)).enumerate() {
            let pivot = column[self.first + p];
            *factor = std::array::from_fn(|c| pivot * column[skip + at + c]);
        }
        let a = self.columns.get(skip..).unwrap_or(&[]);
        subtract_product::<T, N, FRESH>(to, rows, [at, rows], a, height, factor);
    }
}
