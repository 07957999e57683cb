//! Solves with a factor. Bound by memory: every value is read twice.
//!
//! *Loads*: for every front one number per scalar of its boundary. On the way up they are what the subtree's
//! unknowns add to the boundary's right-hand sides, on the way down the boundary's solution.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par};

use super::{Front, Fronts};

/// Halves with fewer values than this are solved one after the other.
const PARALLEL_VALUES: usize = 50_000;

impl Fronts {
    /// Numbers of working memory of [`Self::solve`].
    pub(in crate::math) fn loads_len(&self) -> usize {
        let root = &self.fronts[self.root()];
        root.loads[1] + root.update()
    }

    /// Solves L D Lᵀ x = b in place; `x` in elimination order.
    pub(in crate::math) fn solve(&self, values: &[f64], x: &mut [f64], work: &mut [f64]) {
        let loads = &mut work[..self.loads_len()];
        self.up(self.root(), values, x, loads);
        self.down(self.root(), values, x, loads);
    }

    /// D⁻¹ L⁻¹ of a subtree's unknowns.
    fn up(&self, index: usize, values: &[f64], x: &mut [f64], loads: &mut [f64]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = front.split(x, front.subtree() - front.width());
        let [loads_below, load] = front.split(loads, front.loads[1] - front.loads[0]);
        self.halves(front, x_below, loads_below, |half, x, loads| self.up(half, values, x, loads));
        load.fill(0.0);
        for child in &front.children {
            let child_load = self.load(child.front, front, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let target = match k < child.own_runs {
                    true => &mut x_own[run.to..][..run.len],
                    false => &mut load[run.to - front.width()..][..run.len],
                };
                target.iter_mut().zip(&child_load[run.from..]).for_each(|(t, l)| *t += l);
            }
        }
        let (top, bottom) = front.columns(values).split_at_row(front.width());
        let mut x = MatMut::from_column_major_slice_mut(x_own, front.width(), 1);
        solve_unit_lower_triangular_in_place(top, x.as_mut(), Par::Seq);
        let load = MatMut::from_column_major_slice_mut(load, front.update(), 1);
        matmul(load, Accum::Add, bottom, x.as_ref(), -1.0, Par::Seq);
        let pivots = values[front.values[1]..].iter().step_by(front.height() + 1);
        x_own.iter_mut().zip(pivots).for_each(|(x, d)| *x /= d);
    }

    /// L⁻ᵀ of a subtree's unknowns.
    fn down(&self, index: usize, values: &[f64], x: &mut [f64], loads: &mut [f64]) {
        let front = &self.fronts[index];
        let [x_below, x_own] = front.split(x, front.subtree() - front.width());
        let [loads_below, load] = front.split(loads, front.loads[1] - front.loads[0]);
        let (top, bottom) = front.columns(values).split_at_row(front.width());
        let mut x = MatMut::from_column_major_slice_mut(x_own, front.width(), 1);
        let later = MatRef::from_column_major_slice(load, front.update(), 1);
        matmul(x.as_mut(), Accum::Add, bottom.transpose(), later, -1.0, Par::Seq);
        solve_unit_upper_triangular_in_place(top.transpose(), x, Par::Seq);
        for child in &front.children {
            let child_load = self.load(child.front, front, loads_below);
            for (k, run) in child.runs.iter().enumerate() {
                let source = match k < child.own_runs {
                    true => &x_own[run.to..][..run.len],
                    false => &load[run.to - front.width()..][..run.len],
                };
                child_load[run.from..][..run.len].copy_from_slice(source);
            }
        }
        self.halves(front, x_below, loads_below, |half, x, loads| self.down(half, values, x, loads));
    }

    /// The load of a child within those of its parent's halves.
    fn load<'a>(&self, child: usize, parent: &Front, below: &'a mut [f64]) -> &'a mut [f64] {
        let child = &self.fronts[child];
        &mut below[child.loads[1] - parent.loads[0]..][..child.update()]
    }

    /// Calls `f` for the halves, in parallel where that pays.
    fn halves(
        &self,
        front: &Front,
        x: &mut [f64],
        loads: &mut [f64],
        f: impl Fn(usize, &mut [f64], &mut [f64]) + Sync,
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

impl Front {
    fn split<'a>(&self, array: &'a mut [f64], at: usize) -> [&'a mut [f64]; 2] {
        array.split_at_mut(at).into()
    }
}
