//! Direct solution of symmetric block systems: symbolic analysis once per pattern, then numeric
//! factorisations. Always on one thread, so that the bits do not depend on the number of threads.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};
use glam::DVec3;

use super::block_matrix::{BlockMatrix, BlockPattern};

/// Symbolic analysis of a [`BlockPattern`]; shared by all factorisations of that pattern.
#[derive(Debug)]
pub struct Analysis {
    symbolic: SymbolicCholesky<usize>,
}

/// Kept memory of factorisations and solves.
#[derive(Default)]
pub struct Scratch {
    memory: Option<(usize, MemBuffer)>,
    rhs: Vec<f64>,
}

impl Scratch {
    fn stack(&mut self, request: faer::dyn_stack::StackReq) -> &mut MemStack {
        let bytes = request.unaligned_bytes_required();
        if self.memory.as_ref().is_none_or(|(size, _)| *size < bytes) {
            self.memory = Some((bytes, MemBuffer::new(request)));
        }
        MemStack::new(&mut self.memory.as_mut().expect("just made").1)
    }
}

/// Numeric factor.
#[derive(Debug, Clone)]
pub enum Factor {
    /// L Lᵀ of a positive definite matrix.
    Definite(Vec<f64>),
    /// L B Lᵀ with pivoting inside the supernodes, for matrices that may be indefinite.
    Indefinite {
        /// Values of L.
        values: Vec<f64>,
        /// Sub-diagonal of B.
        subdiagonal: Vec<f64>,
        /// Pivot order and its inverse.
        order: (Vec<usize>, Vec<usize>),
    },
}

impl Analysis {
    /// Analyses `pattern` (already in fill-reducing order).
    pub fn new(pattern: &BlockPattern) -> Self {
        // Without a reordering the analysis reads the upper triangle. Supernodes throughout, since
        // only they pivot when the matrix is indefinite.
        let (column_start, row) = pattern.upper_triangle();
        let n = 3 * pattern.vertex_count();
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &row),
            Side::Upper,
            SymmetricOrdering::Identity,
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        )
        .expect("the factor's pattern fits in memory");
        Self { symbolic }
    }

    /// Number of values of a factor.
    pub fn factor_len(&self) -> usize {
        self.symbolic.len_val()
    }

    /// Cholesky factor of `matrix`; `None` if it is not positive definite or not finite. `recycled`
    /// is an old factor whose memory may be used again.
    pub fn definite(
        &self,
        pattern: &BlockPattern,
        matrix: &BlockMatrix,
        recycled: Option<Factor>,
        scratch: &mut Scratch,
    ) -> Option<Factor> {
        let mut values = match recycled {
            Some(Factor::Definite(values)) => values,
            _ => vec![0.0; self.symbolic.len_val()],
        };
        let request = self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        self.symbolic
            .factorize_numeric_llt(
                &mut values,
                SparseColMatRef::new(symbolic_matrix(pattern), &matrix.values),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                scratch.stack(request),
                Spec::default(),
            )
            .ok()?;
        Some(Factor::Definite(values))
    }

    /// Factor of a symmetric `matrix` that may be indefinite.
    pub fn indefinite(&self, pattern: &BlockPattern, matrix: &BlockMatrix, scratch: &mut Scratch) -> Factor {
        let n = 3 * pattern.vertex_count();
        let mut values = vec![0.0; self.symbolic.len_val()];
        let mut subdiagonal = vec![0.0; n];
        let mut order = (vec![0; n], vec![0; n]);
        let request =
            self.symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Spec::default());
        self.symbolic.factorize_numeric_intranode_lblt(
            &mut values,
            &mut subdiagonal,
            &mut order.0,
            &mut order.1,
            SparseColMatRef::new(symbolic_matrix(pattern), &matrix.values),
            Side::Lower,
            Par::Seq,
            scratch.stack(request),
            Spec::default(),
        );
        Factor::Indefinite { values, subdiagonal, order }
    }

    /// Solves A x = `field` with a factor of A.
    pub fn solve(
        &self,
        pattern: &BlockPattern,
        factor: &Factor,
        field: &[DVec3],
        scratch: &mut Scratch,
    ) -> Vec<DVec3> {
        let n = 3 * pattern.vertex_count();
        let mut rhs = std::mem::take(&mut scratch.rhs);
        rhs.resize(n, 0.0);
        pattern.gather(field, &mut rhs);
        let x = MatMut::from_column_major_slice_mut(&mut rhs, n, 1);
        let stack = scratch.stack(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        match factor {
            Factor::Definite(values) => {
                LltRef::new(&self.symbolic, values).solve_in_place_with_conj(Conj::No, x, Par::Seq, stack);
            }
            Factor::Indefinite { values, subdiagonal, order } => {
                let order = faer::perm::PermRef::new_checked(&order.0, &order.1, n);
                IntranodeLbltRef::new(&self.symbolic, values, subdiagonal, order).solve_in_place_with_conj(
                    Conj::No,
                    x,
                    Par::Seq,
                    stack,
                );
            }
        }
        let mut out = vec![DVec3::ZERO; pattern.vertex_count()];
        pattern.scatter(&rhs, &mut out);
        scratch.rhs = rhs;
        out
    }
}

fn symbolic_matrix(pattern: &BlockPattern) -> SymbolicSparseColMatRef<'_, usize> {
    let n = 3 * pattern.vertex_count();
    SymbolicSparseColMatRef::new_checked(n, n, &pattern.column_start, None, &pattern.row)
}
