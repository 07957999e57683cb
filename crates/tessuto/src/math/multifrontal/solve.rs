//! Solves with a factor. Bound by memory: every value is read twice, for however many right-hand sides at a time.
//!
//! *Loads*: for every front one row per scalar of its boundary. On the way up they are what the subtree's
//! unknowns add to the boundary's right-hand sides, on the way down the boundary's solution.

use super::many::Row;
use super::{Front, Fronts, Scalar};

/// Halves with fewer values than this are solved one after the other.
const PARALLEL_VALUES: usize = 50_000;

impl Fronts {
    /// Rows of working memory of [`Self::solve`].
    pub(in crate::math) fn loads_len(&self) -> usize {
        let root = &self.fronts[self.root()];
        root.loads[1] + root.update()
    }

    /// Solves L D Lᵀ X = B in place; `x` of shape [rows in elimination order, `columns`].
    pub(in crate::math) fn solve<T: Scalar>(
        &self,
        values: &[T],
        x: &mut [T],
        columns: usize,
        work: &mut Vec<T>,
    ) {
        match columns {
            0 => {}
            1 => {
                work.resize(work.len().max(self.loads_len()), T::ZERO);
                self.solve_rows(values, x, work);
            }
            // Whole registers, up to four.
            _ => match (columns.div_ceil(T::LANES).min(4), T::LANES) {
                (1, 4) => self.solve_some::<T, 4>(values, x, columns, work),
                (2, 4) | (1, 8) => self.solve_some::<T, 8>(values, x, columns, work),
                (3, 4) => self.solve_some::<T, 12>(values, x, columns, work),
                (4, 4) | (2, 8) => self.solve_some::<T, 16>(values, x, columns, work),
                (3, _) => self.solve_some::<T, 24>(values, x, columns, work),
                _ => self.solve_some::<T, 32>(values, x, columns, work),
            },
        }
    }

    /// Solves for N columns at a time; what they lack is filled with zeros.
    fn solve_some<T: Scalar, const N: usize>(
        &self,
        values: &[T],
        x: &mut [T],
        columns: usize,
        work: &mut Vec<T>,
    ) {
        let (rows, loads) = (x.len() / columns, self.loads_len());
        work.resize(work.len().max((rows + loads) * N), T::ZERO);
        let (some, loads) = work.as_chunks_mut::<N>().0.split_at_mut(rows);
        for first in (0..columns).step_by(N) {
            let count = N.min(columns - first);
            for (some, row) in some.iter_mut().zip(x.chunks_exact(columns)) {
                *some = [T::ZERO; N];
                some[..count].copy_from_slice(&row[first..][..count]);
            }
            self.solve_rows(values, some, loads);
            for (row, some) in x.chunks_exact_mut(columns).zip(&*some) {
                row[first..][..count].copy_from_slice(&some[..count]);
            }
        }
    }

    fn solve_rows<T: Scalar, R: Row<T>>(&self, values: &[T], x: &mut [R], work: &mut [R]) {
        let loads = &mut work[..self.loads_len()];
        self.up(self.root(), values, x, loads);
        self.down(self.root(), values, x, loads);
    }

    /// D⁻¹ L⁻¹ of a subtree's unknowns.
    fn up<T: Scalar, R: Row<T>>(&self, index: usize, values: &[T], x: &mut [R], loads: &mut [R]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = split(x, front.subtree() - front.width());
        let [loads_below, load] = split(loads, front.loads[1] - front.loads[0]);
        self.halves(front, x_below, loads_below, |half, x, loads| self.up(half, values, x, loads));
        load.fill(R::ZERO);
        for child in &front.children {
            let child_load = self.load(child.front, front, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let target = match k < child.own_runs {
                    true => &mut x_own[run.to..],
                    false => &mut load[run.to - front.width()..],
                };
                target.iter_mut().zip(&child_load[run.from..][..run.len]).for_each(|(t, l)| t.add(*l));
            }
        }
        R::up(front.own_values(values), front.height(), x_own, load);
        let pivots = values[front.values[1]..].iter().step_by(front.height() + 1);
        x_own.iter_mut().zip(pivots).for_each(|(x, d)| x.divide(*d));
    }

    /// L⁻ᵀ of a subtree's unknowns.
    fn down<T: Scalar, R: Row<T>>(&self, index: usize, values: &[T], x: &mut [R], loads: &mut [R]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = split(x, front.subtree() - front.width());
        let [loads_below, load] = split(loads, front.loads[1] - front.loads[0]);
        R::down(front.own_values(values), front.height(), x_own, load);
        for child in &front.children {
            let child_load = self.load(child.front, front, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let source = match k < child.own_runs {
                    true => &x_own[run.to..],
                    false => &load[run.to - front.width()..],
                };
                child_load[run.from..][..run.len].copy_from_slice(&source[..run.len]);
            }
        }
        self.halves(front, x_below, loads_below, |half, x, loads| self.down(half, values, x, loads));
    }

    /// The load of a child within those of its parent's halves.
    fn load<'a, R>(&self, child: usize, parent: &Front, below: &'a mut [R]) -> &'a mut [R] {
        let child = &self.fronts[child];
        &mut below[child.loads[1] - parent.loads[0]..][..child.update()]
    }

    /// Calls `f` for the halves, in parallel where that pays.
    fn halves<R: Send>(
        &self,
        front: &Front,
        x: &mut [R],
        loads: &mut [R],
        f: impl Fn(usize, &mut [R], &mut [R]) + Sync,
    ) {
        match &front.children[..] {
            [] => {}
            [a] => f(a.front, x, loads),
            children => {
                let [a, b] = [children[0].front, children[1].front];
                let (fa, fb) = (&self.fronts[a], &self.fronts[b]);
                let (x_a, x_b) = x.split_at_mut(fa.subtree());
                let (loads_a, loads_b) = loads.split_at_mut(fb.loads[0] - fa.loads[0]);
                let values = |front: &Front| front.values[1] + front.len() - front.values[0];
                if values(fa).min(values(fb)) > PARALLEL_VALUES {
                    rayon::join(|| f(a, x_a, loads_a), || f(b, x_b, loads_b));
                } else {
                    f(a, x_a, loads_a);
                    f(b, x_b, loads_b);
                }
            }
        }
    }
}

fn split<T>(array: &mut [T], at: usize) -> [&mut [T]; 2] {
    array.split_at_mut(at).into()
}
