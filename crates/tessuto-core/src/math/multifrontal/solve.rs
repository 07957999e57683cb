//! Solves with a factor. Bound by memory: every value is read twice, for however many right-hand sides at a time.
//!
//! *Loads*: for every front one row per scalar of its boundary. On the way up they are what the subtree's
//! unknowns add to the boundary's right-hand sides, on the way down the boundary's solution.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par};

use super::{Front, Fronts, Scalar, single};

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
        work: &mut [T],
    ) {
        let loads = &mut work[..self.loads_len() * columns];
        self.up(self.root(), values, x, columns, loads);
        self.down(self.root(), values, x, columns, loads);
    }

    /// D⁻¹ L⁻¹ of a subtree's unknowns.
    fn up<T: Scalar>(&self, index: usize, values: &[T], x: &mut [T], columns: usize, loads: &mut [T]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = split(x, (front.subtree() - front.width()) * columns);
        let [loads_below, load] = split(loads, (front.loads[1] - front.loads[0]) * columns);
        self.halves(front, x_below, columns, loads_below, |half, x, loads| {
            self.up(half, values, x, columns, loads);
        });
        load.fill(T::zero_impl());
        for child in &front.children {
            let child_load = self.load(child.front, front, columns, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let target = match k < child.own_runs {
                    true => &mut x_own[run.to * columns..],
                    false => &mut load[(run.to - front.width()) * columns..],
                };
                let source = &child_load[run.from * columns..][..run.len * columns];
                target.iter_mut().zip(source).for_each(|(t, l)| *t += *l);
            }
        }
        if columns == 1 {
            single::up(front.own_values(values), front.height(), x_own, load);
        } else {
            let (top, bottom) = front.columns(values).split_at_row(front.width());
            let mut x = MatMut::from_row_major_slice_mut(&mut *x_own, front.width(), columns);
            solve_unit_lower_triangular_in_place(top, x.as_mut(), Par::Seq);
            let load = MatMut::from_row_major_slice_mut(load, front.update(), columns);
            matmul(load, Accum::Add, bottom, x.as_ref(), -T::one_impl(), Par::Seq);
        }
        let pivots = values[front.values[1]..].iter().step_by(front.height() + 1);
        for (x, d) in x_own.chunks_exact_mut(columns).zip(pivots) {
            x.iter_mut().for_each(|x| *x /= *d);
        }
    }

    /// L⁻ᵀ of a subtree's unknowns.
    fn down<T: Scalar>(&self, index: usize, values: &[T], x: &mut [T], columns: usize, loads: &mut [T]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = split(x, (front.subtree() - front.width()) * columns);
        let [loads_below, load] = split(loads, (front.loads[1] - front.loads[0]) * columns);
        if columns == 1 {
            single::down(front.own_values(values), front.height(), x_own, load);
        } else {
            let (top, bottom) = front.columns(values).split_at_row(front.width());
            let mut x = MatMut::from_row_major_slice_mut(&mut *x_own, front.width(), columns);
            let later = MatRef::from_row_major_slice(load, front.update(), columns);
            matmul(x.as_mut(), Accum::Add, bottom.transpose(), later, -T::one_impl(), Par::Seq);
            solve_unit_upper_triangular_in_place(top.transpose(), x, Par::Seq);
        }
        for child in &front.children {
            let child_load = self.load(child.front, front, columns, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let source = match k < child.own_runs {
                    true => &x_own[run.to * columns..],
                    false => &load[(run.to - front.width()) * columns..],
                };
                child_load[run.from * columns..][..run.len * columns]
                    .copy_from_slice(&source[..run.len * columns]);
            }
        }
        self.halves(front, x_below, columns, loads_below, |half, x, loads| {
            self.down(half, values, x, columns, loads);
        });
    }

    /// The load of a child within those of its parent's halves.
    fn load<'a, T>(&self, child: usize, parent: &Front, columns: usize, below: &'a mut [T]) -> &'a mut [T] {
        let child = &self.fronts[child];
        &mut below[(child.loads[1] - parent.loads[0]) * columns..][..child.update() * columns]
    }

    /// Calls `f` for the halves, in parallel where that pays.
    fn halves<T: Scalar>(
        &self,
        front: &Front,
        x: &mut [T],
        columns: usize,
        loads: &mut [T],
        f: impl Fn(usize, &mut [T], &mut [T]) + Sync,
    ) {
        match &front.children[..] {
            [] => {}
            [a] => f(a.front, x, loads),
            children => {
                let [a, b] = [children[0].front, children[1].front];
                let (fa, fb) = (&self.fronts[a], &self.fronts[b]);
                let (x_a, x_b) = x.split_at_mut(fa.subtree() * columns);
                let (loads_a, loads_b) = loads.split_at_mut((fb.loads[0] - fa.loads[0]) * columns);
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
