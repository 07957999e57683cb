//! Symmetric sparse matrices of 3×3 blocks, one block row per vertex, with a fixed pattern.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::dissection::{Part, dissect};

/// Values that are added at a time.
const PART: usize = 1 << 14;

/// Where a 3×3 block lives in [`BlockMatrix::values`].
#[derive(Debug, Clone, Copy)]
struct Slot {
    /// Index of the value at (row 0, column c) of the block; for diagonal blocks at (row c, column c).
    column: [u32; 3],
    diagonal: bool,
    /// The pair was named as (i, j) but is stored as (j, i).
    transposed: bool,
}

/// Pattern of a symmetric matrix of 3×3 blocks: its lower triangle in compressed columns, with the
/// vertices renumbered to keep the Cholesky factor sparse.
#[derive(Debug, Clone)]
pub struct BlockPattern {
    vertex_count: usize,
    /// Tree of the elimination order.
    pub(super) dissection: Part,
    /// New number of each vertex.
    rank: Vec<u32>,
    /// Scalar compressed columns of the lower triangle, in the new numbering.
    pub(super) column_start: Vec<usize>,
    /// Row of each value.
    pub(super) row: Vec<usize>,
    /// Slots of the diagonal blocks, by vertex.
    diagonal: Vec<Slot>,
    /// Off-diagonal slots, in the order of the pairs given to [`BlockPattern::new`].
    pairs: Vec<Slot>,
}

impl BlockPattern {
    /// The pattern with every diagonal block and the blocks of `pairs` (repetitions allowed; the
    /// k-th pair is addressed as k in [`BlockMatrix::add_pair`]). `positions` `[V]` say which vertices are near
    /// each other; only the speed depends on them.
    pub fn new(positions: &[DVec3], pairs: &[[u32; 2]]) -> Self {
        let vertex_count = positions.len();
        let dissection = dissect(positions, &adjacency(vertex_count, pairs));
        let mut rank = vec![0; vertex_count];
        number(&dissection, &mut rank, &mut 0);
        let renumbered = |&[a, b]: &[u32; 2]| {
            let (a, b) = (rank[a as usize], rank[b as usize]);
            [a.max(b), a.min(b)]
        };
        // Block columns: rows below the diagonal, ascending.
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); vertex_count];
        for pair in pairs {
            let [row, column] = renumbered(pair);
            below[column as usize].push(row);
        }
        let (mut column_start, mut row) = (vec![0], Vec::new());
        for (j, rows) in below.iter_mut().enumerate() {
            rows.sort_unstable();
            rows.dedup();
            for c in 0..3 {
                row.extend((c..3).map(|r| 3 * j + r));
                row.extend(rows.iter().flat_map(|&i| (0..3).map(move |r| 3 * i as usize + r)));
                column_start.push(row.len());
            }
        }
        let diagonal = rank
            .iter()
            .map(|&j| Slot {
                column: [0, 1, 2].map(|c| column_start[3 * j as usize + c] as u32),
                diagonal: true,
                transposed: false,
            })
            .collect();
        let slots = pairs
            .iter()
            .map(|pair| {
                let [i, j] = renumbered(pair);
                let k = below[j as usize].binary_search(&i).expect("the pair was inserted above");
                Slot {
                    column: [0, 1, 2].map(|c| (column_start[3 * j as usize + c] + (3 - c) + 3 * k) as u32),
                    diagonal: false,
                    transposed: rank[pair[0] as usize] < rank[pair[1] as usize],
                }
            })
            .collect();
        Self { vertex_count, dissection, rank, column_start, row, diagonal, pairs: slots }
    }

    /// Number of block rows.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Compressed columns (starts and rows) of the upper triangle.
    pub(super) fn upper_triangle(&self) -> (Vec<usize>, Vec<usize>) {
        let n = 3 * self.vertex_count;
        let mut columns = vec![Vec::new(); n];
        for column in 0..n {
            for &row in &self.row[self.column_start[column]..self.column_start[column + 1]] {
                columns[row].push(column);
            }
        }
        let mut start = vec![0];
        start.extend(columns.iter().scan(0, |sum, column| {
            *sum += column.len();
            Some(*sum)
        }));
        (start, columns.concat())
    }

    /// Copies a field of vectors into the order of the matrix, to every `stride`-th place.
    pub(super) fn gather(&self, field: &[DVec3], out: &mut [f64], stride: usize) {
        for (value, &rank) in field.iter().zip(&self.rank) {
            let start = 3 * rank as usize;
            value.to_array().iter().enumerate().for_each(|(k, v)| out[(start + k) * stride] = *v);
        }
    }

    /// Inverse of [`gather`](Self::gather).
    pub(super) fn scatter(&self, values: &[f64], stride: usize, field: &mut [DVec3]) {
        for (value, &rank) in field.iter_mut().zip(&self.rank) {
            let start = 3 * rank as usize;
            *value = DVec3::from_array([0, 1, 2].map(|k| values[(start + k) * stride]));
        }
    }
}

/// Symmetric adjacency lists without repetitions.
fn adjacency(vertex_count: usize, pairs: &[[u32; 2]]) -> Vec<Vec<usize>> {
    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); vertex_count];
    for &[a, b] in pairs {
        neighbours[a as usize].push(b as usize);
        neighbours[b as usize].push(a as usize);
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    neighbours
}

fn number(part: &Part, rank: &mut [u32], next: &mut u32) {
    part.halves.iter().for_each(|half| number(half, rank, next));
    for &v in &part.vertices {
        rank[v as usize] = *next;
        *next += 1;
    }
}

/// Values of a symmetric matrix with a [`BlockPattern`].
#[derive(Debug, Clone)]
pub struct BlockMatrix {
    /// Lower triangle, scalar compressed columns.
    pub(super) values: Vec<f64>,
}

impl BlockMatrix {
    /// The zero matrix.
    pub fn zeros(pattern: &BlockPattern) -> Self {
        Self { values: vec![0.0; pattern.row.len()] }
    }

    /// Whether it is of this pattern's size.
    pub(super) fn matches(&self, pattern: &BlockPattern) -> bool {
        self.values.len() == pattern.row.len()
    }

    /// Sets every value to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds the symmetric `block` to the diagonal block of `vertex`.
    pub fn add_diagonal(&mut self, pattern: &BlockPattern, vertex: usize, block: &DMat3) {
        self.add_block(&pattern.diagonal[vertex], block);
    }

    /// Adds `block` at (i, j), and its transpose at (j, i), where (i, j) is the pattern's pair `pair`.
    pub fn add_pair(&mut self, pattern: &BlockPattern, pair: usize, block: &DMat3) {
        self.add_block(&pattern.pairs[pair], block);
    }

    fn add_block(&mut self, slot: &Slot, block: &DMat3) {
        let block = if slot.transposed { block.transpose() } else { *block };
        for (c, column) in block.to_cols_array_2d().iter().enumerate() {
            let first = if slot.diagonal { c } else { 0 };
            let start = slot.column[c] as usize;
            for (value, entry) in self.values[start..start + 3 - first].iter_mut().zip(&column[first..]) {
                *value += entry;
            }
        }
    }

    /// Adds a matrix of the same pattern.
    pub fn add(&mut self, other: &Self) {
        let parts = self.values.par_chunks_mut(PART).zip(other.values.par_chunks(PART));
        parts.for_each(|(own, other)| own.iter_mut().zip(other).for_each(|(a, b)| *a += b));
    }

    /// Adds `scale`·diag(masses), three times each.
    pub fn add_masses(&mut self, pattern: &BlockPattern, masses: &[f64], scale: f64) {
        for (slot, m) in pattern.diagonal.iter().zip(masses) {
            slot.column.iter().for_each(|&c| self.values[c as usize] += m * scale);
        }
    }

    /// Product with a field of vectors.
    pub fn multiply(&self, pattern: &BlockPattern, field: &[DVec3]) -> Vec<DVec3> {
        let n = 3 * pattern.vertex_count;
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
        pattern.gather(field, &mut x, 1);
        for column in 0..n {
            let mut sum = 0.0;
            for k in pattern.column_start[column]..pattern.column_start[column + 1] {
                let (row, value) = (pattern.row[k], self.values[k]);
                y[row] += value * x[column];
                if row != column {
                    sum += value * x[row];
                }
            }
            y[column] += sum;
        }
        let mut out = vec![DVec3::ZERO; pattern.vertex_count];
        pattern.scatter(&y, 1, &mut out);
        out
    }

    /// Largest |value − other value| with `other` of the same pattern, and the largest |value|.
    pub fn difference(&self, other: &Self) -> (f64, f64) {
        self.values
            .iter()
            .zip(&other.values)
            .fold((0.0, 0.0), |(d, m), (a, b)| (f64::max(d, (a - b).abs()), f64::max(m, a.abs())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn multiply_agrees_with_a_dense_sum_over_blocks() {
        let mut rng = Rng::new(1, 0);
        let pairs = [[0, 1], [3, 1], [2, 4], [1, 3], [4, 0]];
        let field: Vec<DVec3> = (0..5).map(|_| rng.vector()).collect();
        let pattern = BlockPattern::new(&field, &pairs);
        let mut matrix = BlockMatrix::zeros(&pattern);
        let mut expected = vec![DVec3::ZERO; 5];
        for (k, &[i, j]) in pairs.iter().enumerate() {
            let block = DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_pair(&pattern, k, &block);
            expected[i as usize] += block * field[j as usize];
            expected[j as usize] += block.transpose() * field[i as usize];
        }
        for v in 0..5 {
            let b = DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_diagonal(&pattern, v, &(b + b.transpose()));
            expected[v] += (b + b.transpose()) * field[v];
        }
        for (a, b) in matrix.multiply(&pattern, &field).iter().zip(&expected) {
            assert!((*a - *b).length() < 1e-14, "{a} {b}");
        }
    }
}
