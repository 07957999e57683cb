//! Symmetric sparse matrices of 3×3 blocks, one block row per vertex, with a fixed pattern.

use glam::{DMat3, DVec3};

use super::dissection::{Part, dissect};
use super::lanes::{LANES, Lanes, each_matrix, transpose_where};
use super::scalar::Matrix;

/// Where a 3×3 block off the diagonal lives in [`BlockMatrix::values`].
#[derive(Debug, Clone, Copy)]
struct Slot {
    /// Index of the first of its nine values.
    start: u32,
    /// The pair was named as (i, j) but is stored as (j, i).
    transposed: bool,
}

/// Row and column of a diagonal block's values.
const DIAGONAL: [[usize; 2]; 6] = [[0, 0], [1, 0], [2, 0], [1, 1], [2, 1], [2, 2]];

/// Pattern of a symmetric matrix of 3×3 blocks: its lower triangle in compressed columns of blocks, with the
/// vertices renumbered to keep the Cholesky factor sparse.
///
/// The values of a vertex's columns: six of its diagonal block's lower triangle, then nine of every block below,
/// each column by column.
#[derive(Debug, Clone)]
pub struct BlockPattern {
    vertex_count: usize,
    /// Tree of the elimination order.
    pub(super) dissection: Part,
    /// New number of each vertex.
    rank: Vec<u32>,
    /// For every vertex, in the new numbering, where its columns' blocks begin in `below`; then the end.
    starts: Vec<usize>,
    /// Block rows of the blocks below the diagonal, column by column, ascending.
    below: Vec<u32>,
    /// Index of the first value of every vertex's diagonal block.
    diagonal: Vec<u32>,
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
        let mut starts = vec![0];
        for rows in &mut below {
            rows.sort_unstable();
            rows.dedup();
            starts.push(starts[starts.len() - 1] + rows.len());
        }
        let first_value = |j: usize| 6 * j + 9 * starts[j];
        let diagonal = rank.iter().map(|&j| first_value(j as usize) as u32).collect();
        let slots = pairs
            .iter()
            .map(|pair| {
                let [i, j] = renumbered(pair);
                let k = below[j as usize].binary_search(&i).expect("the pair was inserted above");
                Slot {
                    start: (first_value(j as usize) + 6 + 9 * k) as u32,
                    transposed: rank[pair[0] as usize] < rank[pair[1] as usize],
                }
            })
            .collect();
        Self { vertex_count, dissection, rank, starts, below: below.concat(), diagonal, pairs: slots }
    }

    /// Number of block rows.
    #[inline]
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Number of values of a matrix.
    pub(super) fn len(&self) -> usize {
        self.first_value(self.vertex_count)
    }

    /// Index of the first value of a vertex's columns, the vertex in the new numbering.
    pub(super) fn first_value(&self, vertex: usize) -> usize {
        6 * vertex + 9 * self.starts[vertex]
    }

    /// Block rows below the diagonal in a vertex's columns, both in the new numbering.
    pub(super) fn rows_below(&self, vertex: usize) -> &[u32] {
        &self.below[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// Scalar row and column of every value of a vertex's columns, in the new numbering.
    pub(super) fn entries(&self, vertex: usize) -> impl Iterator<Item = [usize; 2]> {
        let own = DIAGONAL.into_iter().map(move |[r, c]| [3 * vertex + r, 3 * vertex + c]);
        own.chain(
            self.rows_below(vertex)
                .iter()
                .flat_map(move |&row| (0..9).map(move |k| [3 * row as usize + k % 3, 3 * vertex + k / 3])),
        )
    }

    /// The lower triangle, or the `upper` one, in scalar compressed columns.
    pub(super) fn scalar_columns(&self, upper: bool) -> ScalarColumns {
        let entries = (0..self.vertex_count).flat_map(|vertex| self.entries(vertex)).enumerate();
        let mut sorted: Vec<([usize; 2], usize)> = entries
            .map(|(value, [row, column])| (if upper { [row, column] } else { [column, row] }, value))
            .collect();
        sorted.sort_unstable();
        let starts =
            (0..=3 * self.vertex_count).map(|c| sorted.partition_point(|(at, _)| at[0] < c)).collect();
        let rows = sorted.iter().map(|(at, _)| at[1]).collect();
        ScalarColumns { starts, rows, values: sorted.iter().map(|(_, value)| *value).collect() }
    }

    /// Number of values of a matrix.
    pub fn value_count(&self) -> usize {
        self.len()
    }

    /// Sorts elements by the halves that the blocks of their vertices lie in, see [`BlockMatrix::halves`].
    pub fn sides<'a>(&self, elements: impl Iterator<Item = &'a [u32]>) -> Sides {
        let end = self.first_value(self.first_half());
        let mut sides = Sides::default();
        for (k, vertices) in elements.enumerate() {
            let in_first = |v: &u32| (self.diagonal[*v as usize] as usize) < end;
            let [some, all] = [vertices.iter().any(in_first), vertices.iter().all(in_first)];
            let side = if all {
                0
            } else if some {
                2
            } else {
                1
            };
            sides[side].push(k as u32);
        }
        sides
    }

    /// Number of vertices in the first half of the elimination order, about.
    fn first_half(&self) -> usize {
        self.dissection.halves.first().map_or(0, Part::vertex_count)
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

/// A pattern's scalar columns: where each begins, then the end; rows; and which of a [`BlockMatrix`]'s values they are.
#[derive(Debug)]
pub(super) struct ScalarColumns {
    pub starts: Vec<usize>,
    pub rows: Vec<usize>,
    pub values: Vec<usize>,
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

/// Elements by which of the two halves of a matrix's columns they are added to: the first alone, the second alone,
/// both. Ascending.
pub type Sides = [Vec<u32>; 3];

/// Some of a matrix's columns. What is added elsewhere is left out.
#[derive(Debug)]
pub struct Columns<'a> {
    /// Index of the first value.
    start: usize,
    values: &'a mut [f64],
}

impl Columns<'_> {
    /// [`BlockMatrix::add_diagonal`].
    #[inline]
    pub fn add_diagonal(&mut self, pattern: &BlockPattern, vertex: usize, block: &DMat3) {
        let [a, b, c] = block.to_cols_array_2d();
        self.add(pattern.diagonal[vertex], [a[0], a[1], a[2], b[1], b[2], c[2]]);
    }

    /// [`BlockMatrix::add_pair`].
    #[inline]
    pub fn add_pair(&mut self, pattern: &BlockPattern, pair: usize, block: &DMat3) {
        let slot = &pattern.pairs[pair];
        let block = if slot.transposed { &block.transpose() } else { block };
        self.add(slot.start, block.to_cols_array());
    }

    /// [`BlockMatrix::add_diagonal`] of the first `count` of four elements, each at its own one of the `vertices`.
    #[inline(always)]
    pub fn add_diagonals(
        &mut self,
        pattern: &BlockPattern,
        vertices: [u32; LANES],
        count: usize,
        block: &Matrix<Lanes>,
    ) {
        for (vertex, block) in vertices.iter().zip(&each_matrix(block)).take(count) {
            let [a, b, c, _, d, e, _, _, f] = *block;
            self.add(pattern.diagonal[*vertex as usize], [a, b, c, d, e, f]);
        }
    }

    /// [`BlockMatrix::add_pair`] of the first `count` of four elements, each at its own one of the `pairs`.
    #[inline(always)]
    pub fn add_pairs(
        &mut self,
        pattern: &BlockPattern,
        pairs: [usize; LANES],
        count: usize,
        block: &Matrix<Lanes>,
    ) {
        let slots = pairs.map(|pair| pattern.pairs[pair]);
        let blocks = each_matrix(&transpose_where(slots.map(|slot| slot.transposed), block));
        for (slot, block) in slots.iter().zip(blocks).take(count) {
            self.add(slot.start, block);
        }
    }

    /// Adds to the values from `index` on, where these are among the columns.
    #[inline(always)]
    fn add<const N: usize>(&mut self, index: u32, terms: [f64; N]) {
        let values = (index as usize).checked_sub(self.start).and_then(|at| self.values.get_mut(at..at + N));
        if let Some(values) = values {
            values.iter_mut().zip(terms).for_each(|(value, term)| *value += term);
        }
    }
}

/// Values of a symmetric matrix with a [`BlockPattern`].
#[derive(Debug, Clone)]
pub struct BlockMatrix {
    /// See [`BlockPattern`].
    pub(super) values: Vec<f64>,
}

impl BlockMatrix {
    /// The zero matrix.
    pub fn zeros(pattern: &BlockPattern) -> Self {
        Self { values: vec![0.0; pattern.len()] }
    }

    /// Whether it is of this pattern's size.
    pub(super) fn matches(&self, pattern: &BlockPattern) -> bool {
        self.values.len() == pattern.len()
    }

    /// Sets every value to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// All of its columns.
    #[inline]
    pub fn whole(&mut self) -> Columns<'_> {
        Columns { start: 0, values: &mut self.values }
    }

    /// The columns of the first half of the elimination order, about, and the others: sums into both may run at a time.
    pub fn halves(&mut self, pattern: &BlockPattern) -> [Columns<'_>; 2] {
        let start = pattern.first_value(pattern.first_half());
        let (first, second) = self.values.split_at_mut(start);
        [Columns { start: 0, values: first }, Columns { start, values: second }]
    }

    /// Adds the symmetric `block` to the diagonal block of `vertex`.
    #[inline]
    pub fn add_diagonal(&mut self, pattern: &BlockPattern, vertex: usize, block: &DMat3) {
        self.whole().add_diagonal(pattern, vertex, block);
    }

    /// Adds `block` at (i, j), and its transpose at (j, i), where (i, j) is the pattern's pair `pair`.
    #[inline]
    pub fn add_pair(&mut self, pattern: &BlockPattern, pair: usize, block: &DMat3) {
        self.whole().add_pair(pattern, pair, block);
    }

    /// Adds `scale`·diag(masses), three times each.
    pub fn add_masses(&mut self, pattern: &BlockPattern, masses: &[f64], scale: f64) {
        for (block, m) in pattern.diagonal.iter().zip(masses) {
            [0, 3, 5].iter().for_each(|k| self.values[*block as usize + k] += m * scale);
        }
    }

    /// Whether every diagonal block is positive definite: cheap to test, and where it is not, neither is the matrix.
    pub(super) fn has_definite_blocks(&self, pattern: &BlockPattern) -> bool {
        pattern.diagonal.iter().all(|start| {
            let [a, b, c, d, e, f] = self.values[*start as usize..][..6] else { unreachable!() };
            // Pivots, as an elimination has them: a determinant would lose the digits of blocks that are stiff one
            // way only.
            let (first, second, below) = (a, d - b * b / a, e - b * c / a);
            let third = f - c * c / a - below * below / second;
            first > 0.0 && second > 0.0 && third > 0.0
        })
    }

    /// Product with a field of vectors.
    pub fn multiply(&self, pattern: &BlockPattern, field: &[DVec3]) -> Vec<DVec3> {
        let n = 3 * pattern.vertex_count;
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
        pattern.gather(field, &mut x, 1);
        for (vertex, &[a, b, c]) in x.as_chunks::<3>().0.iter().enumerate() {
            let values = &self.values[pattern.first_value(vertex)..pattern.first_value(vertex + 1)];
            let (own, below) = values.split_at(6);
            let mut sum = [
                own[0] * a + own[1] * b + own[2] * c,
                own[1] * a + own[3] * b + own[4] * c,
                own[2] * a + own[4] * b + own[5] * c,
            ];
            let blocks = below.as_chunks::<9>().0;
            for (row, v) in pattern.rows_below(vertex).iter().zip(blocks) {
                let row = 3 * *row as usize;
                let (from, to) = (&x[row..][..3], &mut y[row..][..3]);
                for k in 0..3 {
                    to[k] += v[k] * a + v[3 + k] * b + v[6 + k] * c;
                    sum[0] += v[k] * from[k];
                    sum[1] += v[3 + k] * from[k];
                    sum[2] += v[6 + k] * from[k];
                }
            }
            y[3 * vertex..][..3].iter_mut().zip(sum).for_each(|(y, sum)| *y += sum);
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
    fn multiply_agrees_with_a_dense_sum_over_blocks_that_halves_share() {
        let mut rng = Rng::new(1, 0);
        let count = 40;
        let pairs: Vec<[u32; 2]> =
            (0..count).flat_map(|i| [[i, (i + 1) % count], [(i + 3) % count, i]]).collect();
        let field: Vec<DVec3> = (0..count).map(|_| rng.vector()).collect();
        // On a ring.
        let at = |i: u32| f64::from(i) * std::f64::consts::TAU / f64::from(count);
        let positions: Vec<DVec3> = (0..count).map(|i| DVec3::new(at(i).cos(), at(i).sin(), 0.0)).collect();
        let pattern = BlockPattern::new(&positions, &pairs);
        let mut matrix = BlockMatrix::zeros(&pattern);
        let mut in_halves = BlockMatrix::zeros(&pattern);
        let mut expected = vec![DVec3::ZERO; count as usize];
        let sides = pattern.sides(pairs.iter().map(|pair| &pair[..]));
        for (k, [i, j]) in pairs.iter().map(|pair| pair.map(|v| v as usize)).enumerate() {
            let block = DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_pair(&pattern, k, &block);
            let [mut first, mut second] = in_halves.halves(&pattern);
            match sides.iter().position(|side| side.contains(&(k as u32))) {
                Some(0) => first.add_pair(&pattern, k, &block),
                Some(1) => second.add_pair(&pattern, k, &block),
                _ => [first, second].iter_mut().for_each(|half| half.add_pair(&pattern, k, &block)),
            }
            expected[i] += block * field[j];
            expected[j] += block.transpose() * field[i];
        }
        for v in 0..count as usize {
            let b = DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_diagonal(&pattern, v, &(b + b.transpose()));
            for columns in &mut in_halves.halves(&pattern) {
                columns.add_diagonal(&pattern, v, &(b + b.transpose()));
            }
            expected[v] += (b + b.transpose()) * field[v];
        }
        for (a, b) in matrix.multiply(&pattern, &field).iter().zip(&expected) {
            assert!((*a - *b).length() < 1e-14, "{a} {b}");
        }
        assert_eq!(matrix.values, in_halves.values);
        // Few are in both.
        let [first, second, both] = sides.map(|side| side.len());
        assert!(
            first > 20 && second > 20 && both < 30 && first + second + both == 80,
            "{first} {second} {both}"
        );
    }
}
