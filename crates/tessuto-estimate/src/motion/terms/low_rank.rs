//! A correction of low rank to a sparse matrix, and how to solve with it.

use glam::DVec3;

use tessuto_core::math::dot;
use tessuto_core::math::factor::{Factor, Scratch};
use tessuto_core::math::root::Root;
use tessuto_core::mesh::Positions;
use tessuto_sim::Cloth;

use super::FrameSystem;

/// The matrix −U C⁻¹ Uᵀ, to be added to a sparse one.
pub struct LowRank {
    /// Columns of U, shape [R, V].
    pub columns: Vec<Positions>,
    /// C, shape [R, R].
    pub matrix: Vec<f64>,
    /// Its root.
    pub root: Root,
}

fn products(columns: &[Positions], p: &[DVec3]) -> Vec<f64> {
    columns.iter().map(|column| dot(column, p)).collect()
}

fn add_combination(columns: &[Positions], c: &[f64], out: &mut [DVec3]) {
    for (column, c) in columns.iter().zip(c) {
        out.iter_mut().zip(column).for_each(|(out, v)| *out += *v * *c);
    }
}

impl LowRank {
    /// Of the columns of U and C, shape [R, R].
    pub fn new(columns: Vec<Positions>, matrix: Vec<f64>) -> Self {
        let root = Root::of(&matrix, columns.len());
        Self { columns, matrix, root }
    }

    /// Adds the product with `p` to `out`.
    pub fn add_product(&self, p: &[DVec3], out: &mut [DVec3]) {
        let c = self.root.solve(&products(&self.columns, p));
        add_combination(&self.columns, &c.iter().map(|c| -c).collect::<Vec<_>>(), out);
    }
}

/// Factor of a frame's whole matrix A − U C⁻¹ Uᵀ with a multiple of 1 added to A.
pub struct FrameFactor {
    factor: Factor,
    /// A⁻¹ U and the root of C − Uᵀ A⁻¹ U.
    correction: Option<(Vec<Positions>, Root)>,
}

impl FrameFactor {
    /// Of the matrix of `system` and `diagonal` times 1.
    pub fn new(cloth: &Cloth, system: &FrameSystem, diagonal: f64, scratch: &mut Scratch) -> Self {
        let mut matrix = system.matrix.clone();
        matrix.add_masses(&cloth.pattern, &vec![1.0; cloth.vertex_count()], diagonal);
        let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
        let correction = system.low_rank.as_ref().map(|low| {
            let solved = cloth.analysis.solve_many(&cloth.pattern, &factor, &low.columns, scratch);
            let taken = solved.iter().flat_map(|s| products(&low.columns, s));
            let left: Vec<f64> = low.matrix.iter().zip(taken).map(|(c, taken)| c - taken).collect();
            let root = Root::of(&left, solved.len());
            (solved, root)
        });
        Self { factor, correction }
    }

    /// The factor to seven digits, for preconditioners.
    pub fn rounded(self, scratch: &mut Scratch) -> Self {
        Self { factor: scratch.round(self.factor), ..self }
    }

    /// The solution for `rhs`, by the formula of Sherman, Morrison and Woodbury.
    pub fn solve(&self, cloth: &Cloth, rhs: &[DVec3], scratch: &mut Scratch) -> Positions {
        let mut out = cloth.analysis.solve(&cloth.pattern, &self.factor, rhs, scratch);
        if let Some((solved, root)) = &self.correction {
            add_combination(solved, &root.solve(&products(solved, rhs)), &mut out);
        }
        out
    }

    /// A random vector whose covariance is the factor's whole matrix, given independent numbers of mean 0 and
    /// variance 1: `noise` of every vertex, and as many as `modes` is called for of the correction. `None` if the
    /// sparse part is not positive definite.
    ///
    /// The whole matrix is what remains of the larger one [A, −U; −Uᵀ, C] when the correction's own unknowns are
    /// eliminated. So a vector (b, c) of the larger one's covariance is drawn, b = L ξ and c = −Uᵀ A⁻¹ b + R η
    /// with L Lᵀ = A and R Rᵀ = C − Uᵀ A⁻¹ U, and its c is eliminated as well: b + U C⁻¹ c.
    pub fn sample(
        &self,
        cloth: &Cloth,
        low_rank: Option<&LowRank>,
        noise: &[DVec3],
        mut modes: impl FnMut() -> f64,
    ) -> Option<Positions> {
        let mut out = cloth.analysis.multiply_root(&cloth.pattern, &self.factor, noise)?;
        if let (Some(low), Some((solved, root))) = (low_rank, &self.correction) {
            let eta: Vec<f64> = solved.iter().map(|_| modes()).collect();
            let taken = products(solved, &out);
            let c: Vec<f64> = root.multiply(&eta).iter().zip(taken).map(|(c, taken)| c - taken).collect();
            add_combination(&low.columns, &low.root.solve(&c), &mut out);
        }
        Some(out)
    }

    /// Gives the factor's memory back.
    pub fn recycle(self, scratch: &mut Scratch) {
        scratch.recycle(self.factor);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::motion::terms::Term;
    use crate::motion::terms::shear::{MANY, Shear};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn the_factor_solves_the_matrix_with_its_correction() {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(5, 0);
        let x: Positions = mesh.positions.iter().map(|p| *p + rng.vector() * 2e-3).collect();
        let mut system = FrameSystem::zeros(&cloth);
        let mut shear = Shear::new(&cloth, &mesh, [0.01, 1.0, 0.005]);
        shear.rank = MANY;
        shear.add_system(&x, &mut system);
        let rhs: Positions = x.iter().map(|_| rng.vector()).collect();
        let mut scratch = Scratch::default();
        let diagonal = 1e4;
        let solution =
            FrameFactor::new(&cloth, &system, diagonal, &mut scratch).solve(&cloth, &rhs, &mut scratch);
        let sparse = system.matrix.multiply(&cloth.pattern, &solution);
        let mut product = system.multiply(&cloth, &solution);
        product.iter_mut().zip(&solution).for_each(|(p, s)| *p += *s * diagonal);
        let distance = |a: &[DVec3], b: &[DVec3]| {
            a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>().sqrt()
        };
        assert!(distance(&product, &rhs) < 1e-7 * dot(&rhs, &rhs).sqrt(), "{}", distance(&product, &rhs));
        assert!(distance(&sparse, &rhs) > 1e-3 * dot(&rhs, &rhs).sqrt(), "the correction matters");
        // The rest of the matrix is positive semi-definite.
        assert!(dot(&solution, &product) > 0.0);
    }
}
