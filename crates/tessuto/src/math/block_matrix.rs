//! Symmetric sparse matrices of 3×3 blocks, one block row per vertex, with a fixed pattern.

use glam::{DMat3, DVec3};

use super::dissection::{Part, dissect};

/// Where a 3×3 block off the diagonal lives in [`BlockMatrix::values`].
#[derive(Debug, Clone, Copy)]
struct Slot {
    /// Index of the value at (row 0, column c) of the block.
    column: [u32; 3],
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
    /// Of every vertex's diagonal block the indices of the values at (row c, column c).
    diagonal: Vec<[u32; 3]>,
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
        let diagonal =
            rank.iter().map(|&j| [0, 1, 2].map(|c| column_start[3 * j as usize + c] as u32)).collect();
        let slots = pairs
            .iter()
            .map(|pair| {
                let [i, j] = renumbered(pair);
                let k = below[j as usize].binary_search(&i).expect("the pair was inserted above");
                Slot {
                    column: [0, 1, 2].map(|c| (column_start[3 * j as usize + c] + (3 - c) + 3 * k) as u32),
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

/// Where a block lies.
#[derive(Debug, Clone, Copy)]
pub enum Place {
    /// At a vertex, on the diagonal.
    Vertex(u32),
    /// At a pair of the pattern.
    Pair(usize),
}

/// Which of a matrix's columns, by the indices of their values.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    start: usize,
    end: usize,
}

impl Span {
    /// Whether anything that couples just these vertices can be in these columns.
    pub fn holds_any(&self, pattern: &BlockPattern, vertices: &[u32]) -> bool {
        vertices.iter().any(|&v| (self.start..self.end).contains(&(pattern.diagonal[v as usize][0] as usize)))
    }
}

/// Some of a matrix's columns. What is added elsewhere is left out.
#[derive(Debug)]
pub struct Columns<'a> {
    /// Index of the first value.
    start: usize,
    values: &'a mut [f64],
}

impl Columns<'_> {
    /// Which they are.
    pub fn span(&self) -> Span {
        Span { start: self.start, end: self.start + self.values.len() }
    }

    /// [`BlockMatrix::add_diagonal`].
    pub fn add_diagonal(&mut self, pattern: &BlockPattern, vertex: usize, block: &DMat3) {
        let places = pattern.diagonal[vertex];
        let [first, second, third] = block.to_cols_array_2d();
        if self.place(places[0]).is_some() {
            self.add(places[0], first);
            self.add(places[1], [second[1], second[2]]);
            self.add(places[2], [third[2]]);
        }
    }

    /// [`BlockMatrix::add_pair`].
    pub fn add_pair(&mut self, pattern: &BlockPattern, pair: usize, block: &DMat3) {
        let slot = &pattern.pairs[pair];
        if self.place(slot.column[0]).is_some() {
            let block = if slot.transposed { block.transpose() } else { *block };
            for (place, column) in slot.column.into_iter().zip(block.to_cols_array_2d()) {
                self.add(place, column);
            }
        }
    }

    /// Adds `block` at `place`.
    pub fn add_block(&mut self, pattern: &BlockPattern, place: Place, block: &DMat3) {
        match place {
            Place::Vertex(vertex) => self.add_diagonal(pattern, vertex as usize, block),
            Place::Pair(pair) => self.add_pair(pattern, pair, block),
        }
    }

    fn place(&self, index: u32) -> Option<usize> {
        (index as usize).checked_sub(self.start).filter(|place| *place < self.values.len())
    }

    fn add<const N: usize>(&mut self, index: u32, terms: [f64; N]) {
        let values = &mut self.values[index as usize - self.start..][..N];
        values.iter_mut().zip(terms).for_each(|(value, term)| *value += term);
    }
}

/// A column's values in threes, one for each block.
fn blocks<T>(values: &[T]) -> &[[T; 3]] {
    values.as_chunks().0
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

    /// All of its columns.
    pub fn whole(&mut self) -> Columns<'_> {
        Columns { start: 0, values: &mut self.values }
    }

    /// The columns of the first half of the elimination order, about, and the others: sums into both may run at a time.
    pub fn halves(&mut self, pattern: &BlockPattern) -> [Columns<'_>; 2] {
        let first = pattern.dissection.halves.first().map_or(0, Part::vertex_count);
        let start = pattern.column_start[3 * first];
        let (first, second) = self.values.split_at_mut(start);
        [Columns { start: 0, values: first }, Columns { start, values: second }]
    }

    /// Adds the symmetric `block` to the diagonal block of `vertex`.
    pub fn add_diagonal(&mut self, pattern: &BlockPattern, vertex: usize, block: &DMat3) {
        self.whole().add_diagonal(pattern, vertex, block);
    }

    /// Adds `block` at (i, j), and its transpose at (j, i), where (i, j) is the pattern's pair `pair`.
    pub fn add_pair(&mut self, pattern: &BlockPattern, pair: usize, block: &DMat3) {
        self.whole().add_pair(pattern, pair, block);
    }

    /// Adds `scale`·diag(masses), three times each.
    pub fn add_masses(&mut self, pattern: &BlockPattern, masses: &[f64], scale: f64) {
        for (block, m) in pattern.diagonal.iter().zip(masses) {
            block.iter().for_each(|&c| self.values[c as usize] += m * scale);
        }
    }

    /// Whether every diagonal block is positive definite: cheaply told, and where it is not, neither is the matrix.
    pub(super) fn has_definite_blocks(&self, pattern: &BlockPattern) -> bool {
        pattern.diagonal.iter().all(|starts| {
            let [a, b, c] = starts.map(|start| &self.values[start as usize..]);
            // Pivots, as an elimination has them: a determinant would lose the digits of blocks that are stiff one way only.
            let (first, second) = (a[0], b[0] - a[1] * a[1] / a[0]);
            let below = b[1] - a[1] * a[2] / a[0];
            let third = c[0] - a[2] * a[2] / a[0] - below * below / second;
            first > 0.0 && second > 0.0 && third > 0.0
        })
    }

    /// Product with a field of vectors.
    pub fn multiply(&self, pattern: &BlockPattern, field: &[DVec3]) -> Vec<DVec3> {
        let n = 3 * pattern.vertex_count;
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
        pattern.gather(field, &mut x, 1);
        for (vertex, &[a, b, c]) in x.as_chunks::<3>().0.iter().enumerate() {
            let start = |k: usize| pattern.column_start[3 * vertex + k];
            // The diagonal block's lower triangle, then the blocks below it, in three columns.
            let [own_a, own_b, own_c] = [0, 1, 2].map(|k| &self.values[start(k)..start(k + 1)]);
            let (rows, [below_a, below_b, below_c]) =
                (&pattern.row[start(0) + 3..start(1)], [&own_a[3..], &own_b[2..], &own_c[1..]].map(blocks));
            let mut sum = [
                own_a[0] * a + own_a[1] * b + own_a[2] * c,
                own_a[1] * a + own_b[0] * b + own_b[1] * c,
                own_a[2] * a + own_b[1] * b + own_c[0] * c,
            ];
            for (((rows, va), vb), vc) in blocks(rows).iter().zip(below_a).zip(below_b).zip(below_c) {
                let (from, to) = (&x[rows[0]..][..3], &mut y[rows[0]..][..3]);
                for k in 0..3 {
                    to[k] += va[k] * a + vb[k] * b + vc[k] * c;
                    sum[0] += va[k] * from[k];
                    sum[1] += vb[k] * from[k];
                    sum[2] += vc[k] * from[k];
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
        let mut shares = [0; 2];
        for (k, [i, j]) in pairs.iter().map(|pair| pair.map(|v| v as usize)).enumerate() {
            let block = DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_pair(&pattern, k, &block);
            for (columns, share) in in_halves.halves(&pattern).iter_mut().zip(&mut shares) {
                *share += usize::from(columns.span().holds_any(&pattern, &pairs[k]));
                columns.add_pair(&pattern, k, &block);
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
        assert!(shares.iter().all(|&share| share > 20) && shares[0] + shares[1] < 120, "{shares:?}");
    }
}
