//! Multifrontal L D Lᵀ of symmetric block matrices: dense eliminations along a dissection tree.
//!
//! Every part of the tree owns a dense *front*: its own vertices and the later ones they are coupled to (its boundary).
//! Eliminating the own vertices leaves an update of the boundary, which is added into the parent's front. Halves are
//! independent and run in parallel; every number is computed by the same operations in the same order on
//! any number of threads. Source: Duff and Reid, "The multifrontal solution of indefinite sparse symmetric
//! linear equations", 1983; the dense kernels are faer's.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::{
    LdltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{
    solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par, Spec};
use rayon::prelude::*;

use super::dissection::Part;

/// Halves with fewer flops than this are eliminated one after the other: handing one over would cost more.
const PARALLEL_FLOPS: f64 = 1e6;

/// Shape of one front. Vertices are counted in elimination order; sizes in scalars are three times those in vertices.
#[derive(Debug)]
struct Front {
    /// First own vertex.
    first: usize,
    /// Number of own vertices.
    own: usize,
    /// Later vertices coupled to the subtree, ascending.
    boundary: Vec<u32>,
    /// Children (fronts), and for each vertex of a child's boundary its place in this front.
    children: Vec<(usize, Vec<u32>)>,
    /// Start of the subtree's values and of the own ones, which end the subtree's.
    values: [usize; 2],
    /// Numbers of working memory that the subtree's elimination takes.
    work: usize,
    /// Multiplications of the subtree.
    flops: f64,
}

impl Front {
    fn height(&self) -> usize {
        3 * (self.own + self.boundary.len())
    }

    fn width(&self) -> usize {
        3 * self.own
    }

    fn len(&self) -> usize {
        self.height() * self.width()
    }

    /// Side of the update matrix.
    fn update(&self) -> usize {
        3 * self.boundary.len()
    }
}

/// The fronts of a pattern.
#[derive(Debug)]
pub(super) struct Fronts {
    /// In elimination order; the root is the last.
    fronts: Vec<Front>,
    /// For every value of the matrix its place in its front.
    places: Vec<u32>,
}

/// Lower triangle in compressed columns: starts and rows.
pub(super) type Columns<'a> = (&'a [usize], &'a [usize]);

impl Fronts {
    /// Fronts of the matrix whose vertices are numbered in the elimination order of `part`.
    pub(super) fn new(part: &Part, columns: Columns) -> Self {
        let mut fronts = Vec::new();
        let (mut first, mut start) = (0, 0);
        add_front(part, columns, &mut fronts, &mut first, &mut start);
        let mut places = vec![0; columns.1.len()];
        for f in &fronts {
            for column in 3 * f.first..3 * (f.first + f.own) {
                for p in columns.0[column]..columns.0[column + 1] {
                    let local = f.local(columns.1[p] / 3) * 3 + columns.1[p] % 3;
                    places[p] = ((column - 3 * f.first) * f.height() + local) as u32;
                }
            }
        }
        Self { fronts, places }
    }

    /// Number of values of a factor.
    pub(super) fn len(&self) -> usize {
        self.fronts.iter().map(Front::len).sum()
    }

    /// Numbers of working memory of [`Self::factorize`].
    pub(super) fn work_len(&self) -> usize {
        self.fronts.last().map_or(0, |root| root.work)
    }

    /// Eliminates the matrix with the given values; `None` at a pivot that is zero.
    ///
    /// `values` receives the columns of every front: L below the diagonal, D on it. Without pivoting: see
    /// [`Self::growth`] for whether that was sound.
    pub(super) fn factorize(
        &self,
        columns: Columns,
        matrix: &[f64],
        values: &mut [f64],
        work: &mut [f64],
    ) -> Option<()> {
        self.eliminate(self.fronts.len() - 1, columns, matrix, values, work)
    }

    /// Eliminates a subtree; its update of the boundary is left at the start of `work`.
    fn eliminate(
        &self,
        index: usize,
        columns: Columns,
        matrix: &[f64],
        values: &mut [f64],
        work: &mut [f64],
    ) -> Option<()> {
        let front = &self.fronts[index];
        let (subtrees, own) = values.split_at_mut(front.values[1] - front.values[0]);
        own.fill(0.0);
        for p in columns.0[3 * front.first]..columns.0[3 * (front.first + front.own)] {
            own[self.places[p] as usize] = matrix[p];
        }
        let end = match &front.children[..] {
            [] => 0,
            [(a, _)] => {
                self.eliminate(*a, columns, matrix, subtrees, work)?;
                self.fronts[*a].update().pow(2)
            }
            children => {
                let [a, b] = [children[0].0, children[1].0];
                let (fa, fb) = (&self.fronts[a], &self.fronts[b]);
                let (values_a, values_b) = subtrees.split_at_mut(fb.values[0] - fa.values[0]);
                let second = self.second_offset(a, b);
                if fa.flops.min(fb.flops) > PARALLEL_FLOPS {
                    let (work_a, work_b) = work.split_at_mut(second);
                    let (done_a, done_b) = rayon::join(
                        || self.eliminate(a, columns, matrix, values_a, work_a),
                        || self.eliminate(b, columns, matrix, values_b, work_b),
                    );
                    done_a.and(done_b)?;
                } else {
                    self.eliminate(a, columns, matrix, values_a, work)?;
                    self.eliminate(b, columns, matrix, values_b, &mut work[second..])?;
                }
                second + fb.update().pow(2)
            }
        };
        let (updates, rest) = work.split_at_mut(end);
        let n = front.update();
        let (update, rest) = rest.split_at_mut(n * n);
        let mut offset = 0;
        let mut updates_of_children = Vec::with_capacity(2);
        for (k, (child, places)) in front.children.iter().enumerate() {
            if k == 1 {
                offset = self.second_offset(front.children[0].0, *child);
            }
            let size = self.fronts[*child].update().pow(2);
            updates_of_children.push((&places[..], &updates[offset..offset + size]));
        }
        for (places, child) in &updates_of_children {
            front.add_to_own(places, child, own);
        }
        front.factorize(own, update, &mut rest[..n * front.width()])?;
        for (places, child) in &updates_of_children {
            front.add_to_update(places, child, update);
        }
        work.copy_within(end..end + n * n, 0);
        Some(())
    }

    /// Where the second half's working memory begins: behind all of the first's if both run at a time, else behind
    /// the first's update.
    fn second_offset(&self, a: usize, b: usize) -> usize {
        second_offset(&self.fronts[a], &self.fronts[b])
    }

    /// (largest |d| max(1, |l|)², number of negative pivots) over all columns: rounding errors of the factor
    /// are of the size of the first times 10⁻¹⁶. Infinite if a value is not finite.
    pub(super) fn growth(&self, values: &[f64]) -> (f64, usize) {
        let of_front = |front: &Front| {
            let (mut growth, mut negative) = (0.0, 0);
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
                negative += usize::from(pivot < 0.0);
            }
            (growth, negative)
        };
        let worse = |a: (f64, usize), b: (f64, usize)| (a.0.max(b.0), a.1 + b.1);
        self.fronts.par_iter().with_min_len(16).map(of_front).reduce(|| (0.0, 0), worse)
    }

    /// Solves L D Lᵀ x = b in place; `x` in elimination order, `work` of at least as many numbers.
    pub(super) fn solve(&self, values: &[f64], x: &mut [f64], work: &mut [f64]) {
        for front in &self.fronts {
            let (l, own) = front.split(values, x);
            let (top, bottom) = l.split_at_row(front.width());
            let mut own = MatMut::from_column_major_slice_mut(own, front.width(), 1);
            solve_unit_lower_triangular_in_place(top, own.as_mut(), Par::Seq);
            let update = &mut work[..front.update()];
            let into = MatMut::from_column_major_slice_mut(update, front.update(), 1);
            matmul(into, Accum::Replace, bottom, own.as_ref(), -1.0, Par::Seq);
            for (&v, u) in front.boundary.iter().zip(update.chunks_exact(3)) {
                x[3 * v as usize..][..3].iter_mut().zip(u).for_each(|(x, u)| *x += u);
            }
            let pivots = values[front.values[1]..].iter().step_by(front.height() + 1);
            x[3 * front.first..][..front.width()].iter_mut().zip(pivots).for_each(|(x, d)| *x /= d);
        }
        for front in self.fronts.iter().rev() {
            let later = &mut work[..front.update()];
            for (&v, u) in front.boundary.iter().zip(later.chunks_exact_mut(3)) {
                u.copy_from_slice(&x[3 * v as usize..][..3]);
            }
            let (l, own) = front.split(values, x);
            let (top, bottom) = l.split_at_row(front.width());
            let mut own = MatMut::from_column_major_slice_mut(own, front.width(), 1);
            let later = MatRef::from_column_major_slice(later, front.update(), 1);
            matmul(own.as_mut(), Accum::Add, bottom.transpose(), later, -1.0, Par::Seq);
            solve_unit_upper_triangular_in_place(top.transpose(), own, Par::Seq);
        }
    }
}

impl Front {
    /// Place of a vertex in the front.
    fn local(&self, vertex: usize) -> usize {
        match vertex < self.first + self.own {
            true => vertex - self.first,
            false => {
                let at = self.boundary.binary_search(&(vertex as u32));
                self.own + at.expect("coupled vertices are in the boundary")
            }
        }
    }

    /// The front's columns and the own part of a vector.
    fn split<'a, 'x>(&self, values: &'a [f64], x: &'x mut [f64]) -> (MatRef<'a, f64>, &'x mut [f64]) {
        let l = &values[self.values[1]..][..self.len()];
        let l = MatRef::from_column_major_slice(l, self.height(), self.width());
        (l, &mut x[3 * self.first..][..self.width()])
    }

    /// Adds the columns of a child's update (lower triangle) that are own vertices here.
    fn add_to_own(&self, places: &[u32], child: &[f64], own: &mut [f64]) {
        let mine = places.partition_point(|&p| (p as usize) < self.own);
        let height = self.height();
        for vertex in 0..mine {
            for c in 0..3 {
                let target = &mut own[(3 * places[vertex] as usize + c) * height..][..height];
                add_scattered(
                    &places[vertex..],
                    0,
                    &child[(3 * vertex + c) * 3 * places.len()..],
                    vertex,
                    target,
                );
            }
        }
    }

    /// Adds the other columns of a child's update.
    fn add_to_update(&self, places: &[u32], child: &[f64], update: &mut [f64]) {
        let mine = places.partition_point(|&p| (p as usize) < self.own);
        let side = self.update();
        for vertex in mine..places.len() {
            for c in 0..3 {
                let column = 3 * (places[vertex] as usize - self.own) + c;
                let target = &mut update[column * side..][..side];
                let child = &child[(3 * vertex + c) * 3 * places.len()..];
                add_scattered(&places[vertex..], self.own, child, vertex, target);
            }
        }
    }

    /// Eliminates the own columns; `update` is set to what they leave (lower triangle).
    fn factorize(&self, own: &mut [f64], update: &mut [f64], scaled: &mut [f64]) -> Option<()> {
        let (k, n) = (self.width(), self.update());
        let l = MatMut::from_column_major_slice_mut(own, self.height(), k);
        let (mut top, mut bottom) = l.split_at_row_mut(k);
        // A few kilobytes, beside dense work of the third power.
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(k, Par::Seq, Spec::default()));
        let stack = MemStack::new(&mut memory);
        let plain = LdltRegularization::default();
        cholesky_in_place(top.as_mut(), plain, Par::Seq, stack, Spec::default()).ok()?;
        solve_unit_lower_triangular_in_place(top.as_ref(), bottom.as_mut().transpose_mut(), Par::Seq);
        let mut scaled = MatMut::from_column_major_slice_mut(scaled, n, k);
        scaled.copy_from(bottom.as_ref());
        for j in 0..k {
            let inverse = 1.0 / top[(j, j)];
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
            -1.0,
            Par::Seq,
        );
        Some(())
    }
}

/// Adds the rows from `vertex` on of one column of a child's update at the `places` less `skip`.
fn add_scattered(places: &[u32], skip: usize, column: &[f64], vertex: usize, target: &mut [f64]) {
    for (&place, value) in places.iter().zip(column[3 * vertex..].chunks_exact(3)) {
        let target = &mut target[3 * (place as usize - skip)..][..3];
        target.iter_mut().zip(value).for_each(|(t, v)| *t += v);
    }
}

/// Adds the fronts of `part`, halves first; returns its index.
fn add_front(
    part: &Part,
    columns: Columns,
    fronts: &mut Vec<Front>,
    first: &mut usize,
    start: &mut usize,
) -> usize {
    let subtree = *start;
    let halves: Vec<usize> =
        part.halves.iter().map(|half| add_front(half, columns, fronts, first, start)).collect();
    let (begin, own) = (*first, part.vertices.len());
    *first += own;
    let mut boundary: Vec<u32> = (3 * begin..3 * (begin + own))
        .step_by(3)
        .flat_map(|c| columns.1[columns.0[c]..columns.0[c + 1]].iter().map(|row| (row / 3) as u32))
        .chain(halves.iter().flat_map(|&h| fronts[h].boundary.iter().copied()))
        .filter(|&v| v as usize >= begin + own)
        .collect();
    boundary.sort_unstable();
    boundary.dedup();
    let (k, n) = (3.0 * own as f64, 3.0 * boundary.len() as f64);
    let mut front = Front {
        first: begin,
        own,
        boundary,
        children: Vec::new(),
        values: [subtree, *start],
        work: 0,
        flops: k * (k * k / 6.0 + k * n / 2.0 + n * n / 2.0),
    };
    front.children = halves
        .iter()
        .map(|&h| (h, fronts[h].boundary.iter().map(|&v| front.local(v as usize) as u32).collect()))
        .collect();
    *start += front.len();
    let (children_work, end) = match halves[..] {
        [] => (0, 0),
        [a] => (fronts[a].work, fronts[a].update().pow(2)),
        _ => {
            let (a, b) = (&fronts[halves[0]], &fronts[halves[1]]);
            let second = second_offset(a, b);
            (a.work.max(second + b.work), second + b.update().pow(2))
        }
    };
    front.work = children_work.max(end + front.update() * (front.update() + front.width()));
    front.flops += halves.iter().map(|&h| fronts[h].flops).sum::<f64>();
    fronts.push(front);
    fronts.len() - 1
}

fn second_offset(a: &Front, b: &Front) -> usize {
    match a.flops.min(b.flops) > PARALLEL_FLOPS {
        true => a.work,
        false => a.update().pow(2),
    }
}
