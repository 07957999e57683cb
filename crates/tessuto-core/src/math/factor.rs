//! Direct solution of symmetric block systems: one analysis per pattern, then numeric factorisations. The bits do
//! not depend on the number of threads.

use std::sync::OnceLock;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};
use glam::DVec3;

use super::block_matrix::{BlockMatrix, BlockPattern, ScalarColumns};
use super::multifrontal::Fronts;

/// Largest growth of the values, compared with the matrix, that elimination without pivoting may show: it costs as
/// many digits as this has, of sixteen.
const GROWTH_LIMIT: f64 = 1e6;

/// Symbolic analysis of a [`BlockPattern`]; shared by all factorisations of that pattern.
#[derive(Debug)]
pub struct Analysis {
    fronts: Fronts,
    /// For the rare matrices that need pivoting.
    pivoting: OnceLock<Pivoting>,
}

#[derive(Debug)]
struct Pivoting {
    symbolic: SymbolicCholesky<usize>,
    /// The lower triangle.
    columns: ScalarColumns,
}

/// Kept memory of factorisations and solves.
#[derive(Default)]
pub struct Scratch {
    memory: Option<(usize, MemBuffer)>,
    work: Vec<f64>,
    rhs: Vec<f64>,
    /// The same for rounded factors.
    single: [Vec<f32>; 2],
    spare: Option<Vec<f64>>,
    spare_single: Option<Vec<f32>>,
    matrices: Vec<BlockMatrix>,
}

impl Scratch {
    fn stack(&mut self, request: faer::dyn_stack::StackReq) -> &mut MemStack {
        let bytes = request.unaligned_bytes_required();
        if self.memory.as_ref().is_none_or(|(size, _)| *size < bytes) {
            self.memory = Some((bytes, MemBuffer::new(request)));
        }
        MemStack::new(&mut self.memory.as_mut().expect("just made").1)
    }

    /// Keeps the memory of a factor that is no longer needed for the next one.
    pub fn recycle(&mut self, factor: Factor) {
        match factor {
            Factor::Plain(values) => self.spare = Some(values),
            Factor::Rounded(values) => self.spare_single = Some(values),
            Factor::Pivoted { .. } => {}
        }
    }

    /// The factor to seven digits, for preconditioners: half of the memory, which is what solves are bound by. One
    /// with pivots stays as it is.
    pub fn round(&mut self, factor: Factor) -> Factor {
        let Factor::Plain(values) = factor else { return factor };
        let mut single = self.spare_single.take().unwrap_or_default();
        single.clear();
        single.extend(values.iter().map(|v| *v as f32));
        self.spare = Some(values);
        Factor::Rounded(single)
    }

    /// The zero matrix, in the memory of an earlier one if there is any: fresh memory costs more than its use.
    pub fn zero_matrix(&mut self, pattern: &BlockPattern) -> BlockMatrix {
        match self.matrices.pop().filter(|m| m.matches(pattern)) {
            Some(mut matrix) => {
                matrix.clear();
                matrix
            }
            None => BlockMatrix::zeros(pattern),
        }
    }

    /// Keeps the memory of a matrix that is no longer needed.
    pub fn recycle_matrix(&mut self, matrix: BlockMatrix) {
        self.matrices.push(matrix);
    }
}

/// Numeric factor.
#[derive(Debug, Clone)]
pub enum Factor {
    /// L D Lᵀ.
    Plain(Vec<f64>),
    /// L D Lᵀ rounded to single precision.
    Rounded(Vec<f32>),
    /// L B Lᵀ with pivoting inside the supernodes.
    Pivoted {
        /// Values of L.
        values: Vec<f64>,
        /// Sub-diagonal of B.
        subdiagonal: Vec<f64>,
        /// Pivot order and its inverse.
        order: (Vec<usize>, Vec<usize>),
    },
}

impl Analysis {
    /// Analyses `pattern`.
    pub fn new(pattern: &BlockPattern) -> Self {
        Self { fronts: Fronts::new(pattern), pivoting: OnceLock::new() }
    }

    /// Number of values of a factor.
    pub fn factor_len(&self) -> usize {
        self.fronts.len()
    }

    /// Multiplications and additions of one factorisation.
    pub fn flops(&self) -> f64 {
        self.fronts.flops()
    }

    /// Number of values of a factor's triangle, without the places above it that are stored as well.
    pub fn nonzeros(&self) -> usize {
        self.fronts.nonzeros()
    }

    /// Factor of a symmetric `matrix`, definite or not.
    pub fn factorize(&self, pattern: &BlockPattern, matrix: &BlockMatrix, scratch: &mut Scratch) -> Factor {
        match self.plain(matrix, scratch, false) {
            Ok(factor) => factor,
            Err(values) => {
                scratch.spare = Some(values);
                self.pivoted(pattern, matrix, scratch)
            }
        }
    }

    /// Factor of `matrix`; `None` if it is not positive definite or not finite.
    pub fn definite(
        &self,
        pattern: &BlockPattern,
        matrix: &BlockMatrix,
        scratch: &mut Scratch,
    ) -> Option<Factor> {
        if !matrix.has_definite_blocks(pattern) {
            return None;
        }
        match self.plain(matrix, scratch, true) {
            Ok(factor) => Some(factor),
            Err(values) => {
                scratch.spare = Some(values);
                None
            }
        }
    }

    /// Factor of `matrix` to seven digits, as a preconditioner: in half of the time and memory. `None` if it is
    /// not positive definite or not finite, as far as this many digits show.
    pub fn definite_rounded(
        &self,
        pattern: &BlockPattern,
        matrix: &BlockMatrix,
        scratch: &mut Scratch,
    ) -> Option<Factor> {
        if !matrix.has_definite_blocks(pattern) {
            return None;
        }
        let len = self.fronts.len();
        let mut values =
            scratch.spare_single.take().filter(|v| v.len() == len).unwrap_or_else(|| vec![0.0; len]);
        let work = &mut scratch.single[1];
        if work.len() < self.fronts.work_len() {
            work.resize(self.fronts.work_len(), 0.0);
        }
        let done = self.fronts.factorize(&matrix.values, &mut values, work, true);
        let factor = Factor::Rounded(values);
        if done.is_none() {
            scratch.recycle(factor);
            return None;
        }
        Some(factor)
    }

    /// L D Lᵀ without pivoting, or, if that was unsound or the matrix not as `definite` as it has to be, the memory.
    fn plain(&self, matrix: &BlockMatrix, scratch: &mut Scratch, definite: bool) -> Result<Factor, Vec<f64>> {
        let len = self.fronts.len();
        let mut values = scratch.spare.take().filter(|v| v.len() == len).unwrap_or_else(|| vec![0.0; len]);
        if scratch.work.len() < self.fronts.work_len() {
            scratch.work.resize(self.fronts.work_len(), 0.0);
        }
        let done = self.fronts.factorize(&matrix.values, &mut values, &mut scratch.work, definite);
        if done.is_none() {
            return Err(values);
        }
        let growth = self.fronts.growth(&values);
        let largest = matrix.values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        match growth <= GROWTH_LIMIT * largest {
            true => Ok(Factor::Plain(values)),
            false => Err(values),
        }
    }

    /// L B Lᵀ with pivoting: the plain twin of [`Self::factorize`], slower and safe for any matrix.
    pub fn pivoted(&self, pattern: &BlockPattern, matrix: &BlockMatrix, scratch: &mut Scratch) -> Factor {
        let Pivoting { symbolic, columns } = self.pivoting.get_or_init(|| Pivoting::new(pattern));
        let n = 3 * pattern.vertex_count();
        let of_matrix: Vec<f64> = columns.values.iter().map(|&k| matrix.values[k]).collect();
        let of_pattern = SymbolicSparseColMatRef::new_checked(n, n, &columns.starts, None, &columns.rows);
        let mut values = vec![0.0; symbolic.len_val()];
        let mut subdiagonal = vec![0.0; n];
        let mut order = (vec![0; n], vec![0; n]);
        let request = symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Spec::default());
        symbolic.factorize_numeric_intranode_lblt(
            &mut values,
            &mut subdiagonal,
            &mut order.0,
            &mut order.1,
            SparseColMatRef::new(of_pattern, &of_matrix),
            Side::Lower,
            Par::Seq,
            scratch.stack(request),
            Spec::default(),
        );
        Factor::Pivoted { values, subdiagonal, order }
    }

    /// Solves A x = `field` with a factor of A.
    pub fn solve(
        &self,
        pattern: &BlockPattern,
        factor: &Factor,
        field: &[DVec3],
        scratch: &mut Scratch,
    ) -> Vec<DVec3> {
        self.solve_many(pattern, factor, &[field], scratch).remove(0)
    }

    /// Solves A X = `fields` with a factor of A: all of them for little more than the time of one.
    pub fn solve_many<F: AsRef<[DVec3]>>(
        &self,
        pattern: &BlockPattern,
        factor: &Factor,
        fields: &[F],
        scratch: &mut Scratch,
    ) -> Vec<Vec<DVec3>> {
        let (n, columns) = (3 * pattern.vertex_count(), fields.len());
        let mut rhs = std::mem::take(&mut scratch.rhs);
        rhs.resize(n * columns, 0.0);
        for (k, field) in fields.iter().enumerate() {
            pattern.gather(field.as_ref(), &mut rhs[k..], columns);
        }
        let loads = self.fronts.loads_len() * columns;
        match factor {
            Factor::Plain(values) => {
                if scratch.work.len() < loads {
                    scratch.work.resize(loads, 0.0);
                }
                self.fronts.solve(values, &mut rhs, columns, &mut scratch.work);
            }
            Factor::Rounded(values) => {
                let [work, x] = &mut scratch.single;
                if work.len() < loads {
                    work.resize(loads, 0.0);
                }
                // Right-hand sides of any size are within the range of single precision once they are scaled.
                let size = rhs.iter().fold(0.0, |m: f64, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
                x.clear();
                x.extend(rhs.iter().map(|v| (v / size) as f32));
                self.fronts.solve(values, x, columns, work);
                rhs.iter_mut().zip(x).for_each(|(v, x)| *v = f64::from(*x) * size);
            }
            Factor::Pivoted { values, subdiagonal, order } => {
                let Pivoting { symbolic, .. } = self.pivoting.get_or_init(|| Pivoting::new(pattern));
                let x = MatMut::from_row_major_slice_mut(&mut rhs, n, columns);
                let stack = scratch.stack(symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
                let order = faer::perm::PermRef::new_checked(&order.0, &order.1, n);
                IntranodeLbltRef::new(symbolic, values, subdiagonal, order).solve_in_place_with_conj(
                    Conj::No,
                    x,
                    Par::Seq,
                    stack,
                );
            }
        }
        let scattered = (0..columns).map(|k| {
            let mut out = vec![DVec3::ZERO; pattern.vertex_count()];
            pattern.scatter(&rhs[k..], columns, &mut out);
            out
        });
        let out = scattered.collect();
        scratch.rhs = rhs;
        out
    }

    /// The product of a square root L D^½ of A with `field`, given a factor of A: a field of independent numbers
    /// of variance 1 becomes one of covariance A. `None` if A was not found positive definite.
    pub fn multiply_root(
        &self,
        pattern: &BlockPattern,
        factor: &Factor,
        field: &[DVec3],
    ) -> Option<Vec<DVec3>> {
        let Factor::Plain(values) = factor else { return None };
        let mut x = vec![0.0; 3 * pattern.vertex_count()];
        pattern.gather(field, &mut x, 1);
        self.fronts.multiply_root(values, &mut x)?;
        let mut out = vec![DVec3::ZERO; pattern.vertex_count()];
        pattern.scatter(&x, 1, &mut out);
        Some(out)
    }
}

impl Pivoting {
    fn new(pattern: &BlockPattern) -> Self {
        // Without a reordering the analysis reads the upper triangle. Supernodes throughout, since only they pivot.
        let upper = pattern.scalar_columns(true);
        let n = 3 * pattern.vertex_count();
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(n, n, &upper.starts, None, &upper.rows),
            Side::Upper,
            SymmetricOrdering::Identity,
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        )
        .expect("the factor's pattern fits in memory");
        Self { symbolic, columns: pattern.scalar_columns(false) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    /// A grid whose vertices are coupled up to two apart, with blocks as large as its diagonal if `dominance` is 1.
    fn system(side: usize, dominance: f64, seed: u64) -> (BlockPattern, BlockMatrix, Vec<DVec3>) {
        let mut rng = Rng::new(seed, 0);
        let at = |v: usize| DVec3::new((v % side) as f64, (v / side) as f64, 0.0);
        let positions: Vec<DVec3> = (0..side * side).map(at).collect();
        let mut pairs = Vec::new();
        for a in 0..side * side {
            pairs.extend((0..a).filter(|&b| at(a).distance(at(b)) < 2.1).map(|b| [a as u32, b as u32]));
        }
        let pattern = BlockPattern::new(&positions, &pairs);
        let mut matrix = BlockMatrix::zeros(&pattern);
        for pair in 0..pairs.len() {
            let block = glam::DMat3::from_cols(rng.vector(), rng.vector(), rng.vector());
            matrix.add_pair(&pattern, pair, &block);
        }
        let masses: Vec<f64> = positions.iter().map(|_| dominance * (1.0 + rng.uniform())).collect();
        matrix.add_masses(&pattern, &masses, 1.0);
        let rhs = positions.iter().map(|_| rng.vector()).collect();
        (pattern, matrix, rhs)
    }

    fn residual(pattern: &BlockPattern, matrix: &BlockMatrix, x: &[DVec3], b: &[DVec3]) -> f64 {
        let ax = matrix.multiply(pattern, x);
        let size = x.iter().map(|x| x.length()).fold(1.0, f64::max);
        ax.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max) / size
    }

    #[test]
    fn both_factorisations_solve_definite_and_indefinite_systems() {
        let mut scratch = Scratch::default();
        for (side, dominance) in [(1, 1.0), (4, 30.0), (19, 30.0), (19, 3.0), (31, -4.0)] {
            let (pattern, matrix, rhs) = system(side, dominance, 3);
            let analysis = Analysis::new(&pattern);
            let plain = analysis.factorize(&pattern, &matrix, &mut scratch);
            let pivoted = analysis.pivoted(&pattern, &matrix, &mut scratch);
            for factor in [plain, pivoted] {
                let x = analysis.solve(&pattern, &factor, &rhs, &mut scratch);
                let residual = residual(&pattern, &matrix, &x, &rhs);
                assert!(residual < 1e-9, "{side} {dominance}: {residual}");
            }
            let definite = analysis.definite(&pattern, &matrix, &mut scratch).is_some();
            assert_eq!(definite, dominance > 20.0 || side == 1, "{side} {dominance}");
            assert_eq!(analysis.definite_rounded(&pattern, &matrix, &mut scratch).is_some(), definite);
        }
    }

    #[test]
    fn many_right_hand_sides_are_solved_as_one_by_one() {
        let mut scratch = Scratch::default();
        let mut rng = Rng::new(9, 0);
        let (pattern, matrix, _) = system(19, 30.0, 3);
        let fields: Vec<Vec<DVec3>> =
            (0..5).map(|_| (0..pattern.vertex_count()).map(|_| rng.vector()).collect()).collect();
        let analysis = Analysis::new(&pattern);
        let plain = analysis.factorize(&pattern, &matrix, &mut scratch);
        let pivoted = analysis.pivoted(&pattern, &matrix, &mut scratch);
        let rounded = scratch.round(plain.clone());
        let made_rounded = analysis.definite_rounded(&pattern, &matrix, &mut scratch).unwrap();
        assert!([&rounded, &made_rounded].iter().all(|factor| matches!(factor, Factor::Rounded(_))));
        let factors = [(&plain, 1e-13), (&pivoted, 1e-13), (&rounded, 1e-5), (&made_rounded, 1e-5)];
        for (factor, limit) in factors {
            let many = analysis.solve_many(&pattern, factor, &fields, &mut scratch);
            let mut worst = 0.0;
            for (field, x) in fields.iter().zip(&many) {
                let one = analysis.solve(&pattern, &plain, field, &mut scratch);
                let size = one.iter().map(|x| x.length()).fold(0.0, f64::max);
                let distance = x.iter().zip(&one).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                worst = f64::max(worst, distance / size);
            }
            println!("{worst}");
            assert!(worst < limit, "{worst}");
        }
        // Seven digits, whatever the size of the right-hand side.
        let huge: Vec<DVec3> = fields[0].iter().map(|v| *v * 1e60).collect();
        let x = analysis.solve(&pattern, &rounded, &huge, &mut scratch);
        assert!(residual(&pattern, &matrix, &x, &huge) < 1e-3);
    }

    #[test]
    fn the_root_times_its_transpose_is_the_matrix() {
        // Its products with all unit vectors are its columns.
        let (pattern, matrix, _) = system(6, 30.0, 3);
        let analysis = Analysis::new(&pattern);
        let factor = analysis.definite(&pattern, &matrix, &mut Scratch::default()).unwrap();
        let unit = |k: usize| {
            let mut unit = vec![DVec3::ZERO; pattern.vertex_count()];
            unit[k / 3][k % 3] = 1.0;
            unit
        };
        let columns: Vec<Vec<DVec3>> = (0..3 * pattern.vertex_count())
            .map(|k| analysis.multiply_root(&pattern, &factor, &unit(k)).unwrap())
            .collect();
        for k in [0, 7, 40, 107] {
            let mut product = vec![DVec3::ZERO; pattern.vertex_count()];
            for column in &columns {
                let of_k = column[k / 3][k % 3];
                product.iter_mut().zip(column).for_each(|(p, c)| *p += *c * of_k);
            }
            let expected = matrix.multiply(&pattern, &unit(k));
            for (a, b) in product.iter().zip(&expected) {
                assert!((*a - *b).length() < 1e-12 * 30.0, "{a} {b}");
            }
        }
        // None for a matrix that is not definite.
        let (pattern, matrix, _) = system(6, -4.0, 3);
        let analysis = Analysis::new(&pattern);
        let factor = analysis.factorize(&pattern, &matrix, &mut Scratch::default());
        assert!(analysis.multiply_root(&pattern, &factor, &unit(0)).is_none());
    }

    #[test]
    fn bits_do_not_depend_on_threads() {
        for (dominance, rounded) in [(3.0, false), (30.0, true)] {
            let (pattern, matrix, rhs) = system(31, dominance, 5);
            let analysis = Analysis::new(&pattern);
            let solve = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| {
                    let mut scratch = Scratch::default();
                    let factor = match rounded {
                        true => analysis.definite_rounded(&pattern, &matrix, &mut scratch).unwrap(),
                        false => analysis.factorize(&pattern, &matrix, &mut scratch),
                    };
                    analysis.solve(&pattern, &factor, &rhs, &mut scratch)
                })
            };
            assert_eq!(solve(1), solve(4));
        }
    }

    #[test]
    fn a_zero_pivot_is_answered_by_pivoting() {
        let (pattern, mut matrix, rhs) = system(5, 0.0, 7);
        // Nothing on the diagonal at all.
        let analysis = Analysis::new(&pattern);
        let mut scratch = Scratch::default();
        let factor = analysis.factorize(&pattern, &matrix, &mut scratch);
        assert!(matches!(factor, Factor::Pivoted { .. }));
        let x = analysis.solve(&pattern, &factor, &rhs, &mut scratch);
        assert!(residual(&pattern, &matrix, &x, &rhs) < 1e-9);
        matrix.values.fill(f64::NAN);
        assert!(analysis.definite(&pattern, &matrix, &mut scratch).is_none());
        assert!(analysis.definite_rounded(&pattern, &matrix, &mut scratch).is_none());
    }
}
