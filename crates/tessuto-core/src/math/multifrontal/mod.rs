//! Multifrontal L D Lᵀ of symmetric block matrices: dense eliminations along a dissection tree.
//!
//! Every part of the tree owns a dense *front*: its own vertices and the later ones they are coupled to (its boundary).
//! Eliminating the own vertices leaves an update of the boundary, which is added into the parent's front. Halves are
//! independent and run in parallel; every number is computed by the same operations in the same order on
//! any number of threads. Source: Duff and Reid, "The multifrontal solution of indefinite sparse symmetric
//! linear equations", 1983; the dense kernels are faer's.

mod eliminate;
mod root;
mod single;
mod solve;

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, SubAssign};

use faer::MatRef;
use faer::traits::RealField;

use super::block_matrix::BlockPattern;
use super::dissection::Part;

/// Numbers that a factor is made of.
pub trait Scalar:
    RealField
    + Copy
    + Add<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Mul<Output = Self>
    + Div<Output = Self>
{
}

impl Scalar for f32 {}
impl Scalar for f64 {}

/// Positions of one front. Vertices are counted in elimination order; sizes in scalars are three times those in
/// vertices.
///
/// What a subtree owns of any array ends with what its topmost front owns, so that halves split it.
#[derive(Debug)]
struct Front {
    /// First own vertex.
    first: usize,
    /// Number of own vertices.
    own: usize,
    /// Later vertices coupled to the subtree, ascending.
    boundary: Vec<u32>,
    children: Vec<Child>,
    /// First vertex of the subtree.
    first_of_subtree: usize,
    /// Start and end of the own columns' values in the matrix.
    matrix: [usize; 2],
    /// Start of the subtree's values and of the own ones.
    values: [usize; 2],
    /// Start of the subtree's loads (see [`solve`]) and of the own ones.
    loads: [usize; 2],
    /// Numbers of working memory that the subtree's elimination takes.
    work: usize,
    /// Multiplications of the subtree.
    flops: f64,
}

/// A half, and where its boundary lies in its parent's front.
#[derive(Debug)]
struct Child {
    front: usize,
    /// Ascending, each wholly among the parent's own vertices or wholly in its boundary.
    runs: Vec<Run>,
    /// Number of runs among the own vertices.
    own_runs: usize,
}

/// Neighbouring scalars of a child's boundary that are neighbours in the parent's front too.
#[derive(Debug, Clone, Copy)]
struct Run {
    from: usize,
    to: usize,
    len: usize,
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

    /// Scalars of the whole subtree's vertices.
    fn subtree(&self) -> usize {
        3 * (self.first + self.own - self.first_of_subtree)
    }

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

    /// The front's columns.
    fn columns<'a, T>(&self, values: &'a [T]) -> MatRef<'a, T> {
        MatRef::from_column_major_slice(self.own_values(values), self.height(), self.width())
    }

    /// The values of the front's columns.
    fn own_values<'a, T>(&self, values: &'a [T]) -> &'a [T] {
        &values[self.values[1]..][..self.len()]
    }

    fn child(&self, front: usize, boundary: &[u32]) -> Child {
        let mut runs: Vec<Run> = Vec::new();
        for (k, &v) in boundary.iter().enumerate() {
            let (from, to) = (3 * k, 3 * self.local(v as usize));
            match runs.last_mut() {
                Some(run) if run.to + run.len == to && to != self.width() => run.len += 3,
                _ => runs.push(Run { from, to, len: 3 }),
            }
        }
        let own_runs = runs.partition_point(|run| run.to < self.width());
        Child { front, runs, own_runs }
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

impl Fronts {
    /// Fronts of the matrices of a pattern.
    pub(super) fn new(pattern: &BlockPattern) -> Self {
        let mut fronts = Vec::new();
        add_front(&pattern.dissection, pattern, &mut fronts);
        let mut places = Vec::with_capacity(pattern.len());
        // Fronts in elimination order own the columns in theirs.
        for f in &fronts {
            for entry in (f.first..f.first + f.own).flat_map(|vertex| pattern.entries(vertex)) {
                let [row, column] = entry;
                let local = f.local(row / 3) * 3 + row % 3;
                places.push(((column - 3 * f.first) * f.height() + local) as u32);
            }
        }
        Self { fronts, places }
    }

    /// Number of values of a factor.
    pub(super) fn len(&self) -> usize {
        self.fronts.iter().map(Front::len).sum()
    }

    /// Multiplications and additions of one elimination.
    pub(super) fn flops(&self) -> f64 {
        2.0 * self.fronts[self.root()].flops
    }

    /// Values of a factor on and below the diagonal.
    pub(super) fn nonzeros(&self) -> usize {
        self.fronts.iter().map(|f| f.len() - f.width() * f.width().saturating_sub(1) / 2).sum()
    }

    fn root(&self) -> usize {
        self.fronts.len() - 1
    }
}

/// Adds the fronts of `part`, halves first; returns its index.
fn add_front(part: &Part, pattern: &BlockPattern, fronts: &mut Vec<Front>) -> usize {
    let end = |fronts: &[Front]| {
        let last = fronts.last();
        let vertex = last.map_or(0, |f| f.first + f.own);
        (vertex, last.map_or(0, |f| f.values[1] + f.len()), last.map_or(0, |f| f.loads[1] + f.update()))
    };
    let subtree = end(fronts);
    let halves: Vec<usize> = part.halves.iter().map(|half| add_front(half, pattern, fronts)).collect();
    let start = end(fronts);
    let (first, own) = (start.0, part.vertices.len());
    let mut boundary: Vec<u32> = (first..first + own)
        .flat_map(|vertex| pattern.rows_below(vertex).iter().copied())
        .chain(halves.iter().flat_map(|&h| fronts[h].boundary.iter().copied()))
        .filter(|&v| v as usize >= first + own)
        .collect();
    boundary.sort_unstable();
    boundary.dedup();
    let (k, n) = (3.0 * own as f64, 3.0 * boundary.len() as f64);
    let mut front = Front {
        first,
        own,
        boundary,
        children: Vec::new(),
        first_of_subtree: subtree.0,
        matrix: [pattern.first_value(first), pattern.first_value(first + own)],
        values: [subtree.1, start.1],
        loads: [subtree.2, start.2],
        work: 0,
        flops: k * (k * k / 6.0 + k * n / 2.0 + n * n / 2.0)
            + halves.iter().map(|&h| fronts[h].flops).sum::<f64>(),
    };
    front.children = halves.iter().map(|&h| front.child(h, &fronts[h].boundary)).collect();
    front.work = eliminate::work_len(&front, &halves.iter().map(|&h| &fronts[h]).collect::<Vec<_>>());
    fronts.push(front);
    fronts.len() - 1
}
