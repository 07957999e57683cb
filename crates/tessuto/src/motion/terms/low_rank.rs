//! A correction of low rank to a sparse matrix, and how to solve with it.

use glam::{DMat4, DVec3, DVec4};

use crate::math::dot;
use crate::math::factor::{Factor, Scratch};
use crate::mesh::Positions;
use crate::sim::Cloth;

use super::FrameSystem;

/// The matrix −U C⁻¹ Uᵀ, to be added to a sparse one.
pub struct LowRank {
    /// Columns of U, shape [4, V].
    pub columns: [Positions; 4],
    /// C⁻¹.
    pub inverse: DMat4,
}

fn products(columns: &[Positions; 4], p: &[DVec3]) -> DVec4 {
    DVec4::from_array([0, 1, 2, 3].map(|k| dot(&columns[k], p)))
}

fn add_combination(columns: &[Positions; 4], c: DVec4, out: &mut [DVec3]) {
    for (i, out) in out.iter_mut().enumerate() {
        *out += columns[0][i] * c.x + columns[1][i] * c.y + columns[2][i] * c.z + columns[3][i] * c.w;
    }
}

impl LowRank {
    /// Adds the product with `p` to `out`.
    pub fn add_product(&self, p: &[DVec3], out: &mut [DVec3]) {
        add_combination(&self.columns, -(self.inverse * products(&self.columns, p)), out);
    }
}

/// Factor of a frame's whole matrix A − U C⁻¹ Uᵀ with a multiple of 1 added to A.
pub struct FrameFactor {
    factor: Factor,
    /// A⁻¹ U and (C − Uᵀ A⁻¹ U)⁻¹.
    correction: Option<([Positions; 4], DMat4)>,
}

impl FrameFactor {
    /// Of the matrix of `system` and `diagonal` times 1.
    pub fn new(cloth: &Cloth, system: &FrameSystem, diagonal: f64, scratch: &mut Scratch) -> Self {
        let mut matrix = system.matrix.clone();
        matrix.add_masses(&cloth.pattern, &vec![1.0; cloth.vertex_count()], diagonal);
        let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
        let correction = system.low_rank.as_ref().map(|low| {
            let solved =
                [0, 1, 2, 3].map(|k| cloth.analysis.solve(&cloth.pattern, &factor, &low.columns[k], scratch));
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| products(&low.columns, &solved[k]));
            (solved, (low.inverse.inverse() - DMat4::from_cols(a, b, c, d)).inverse())
        });
        Self { factor, correction }
    }

    /// The solution for `rhs`, by the formula of Sherman, Morrison and Woodbury.
    pub fn solve(&self, cloth: &Cloth, rhs: &[DVec3], scratch: &mut Scratch) -> Positions {
        let mut out = cloth.analysis.solve(&cloth.pattern, &self.factor, rhs, scratch);
        if let Some((solved, inverse)) = &self.correction {
            add_combination(solved, *inverse * products(solved, rhs), &mut out);
        }
        out
    }

    /// A random vector whose covariance is the factor's whole matrix, given independent numbers of mean 0 and variance 1:
    /// `noise` of every vertex and `modes` of the correction. `None` if the sparse part is not positive definite.
    ///
    /// The whole matrix is what remains of the larger one [A, −U; −Uᵀ, C] when the correction's own unknowns are eliminated. So
    /// a vector (b, c) of the larger one's covariance is drawn, b = L ξ and c = −Uᵀ A⁻¹ b + R η with L Lᵀ = A and
    /// R Rᵀ = C − Uᵀ A⁻¹ U, and its c is eliminated as well: b + U C⁻¹ c.
    pub fn sample(
        &self,
        cloth: &Cloth,
        low_rank: Option<&LowRank>,
        noise: &[DVec3],
        modes: DVec4,
    ) -> Option<Positions> {
        let mut out = cloth.analysis.multiply_root(&cloth.pattern, &self.factor, noise)?;
        if let (Some(low), Some((solved, inverse))) = (low_rank, &self.correction) {
            let c = lower_root(&inverse.inverse()) * modes - products(solved, &out);
            add_combination(&low.columns, low.inverse * c, &mut out);
        }
        Some(out)
    }

    /// Gives the factor's memory back.
    pub fn recycle(self, scratch: &mut Scratch) {
        scratch.recycle(self.factor);
    }
}

/// The lower triangular R with R Rᵀ = `matrix`; a column is zero where rounding has left nothing of the matrix.
fn lower_root(matrix: &DMat4) -> DMat4 {
    let mut root = DMat4::ZERO;
    for j in 0..4 {
        for i in j..4 {
            let left = matrix.col(j)[i] - (0..j).map(|k| root.col(k)[i] * root.col(k)[j]).sum::<f64>();
            let pivot = root.col(j)[j];
            root.col_mut(j)[i] = match i == j {
                true => left.max(0.0).sqrt(),
                false if pivot > 0.0 => left / pivot,
                false => 0.0,
            };
        }
    }
    root
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::math::rng::Rng;
    use crate::mesh::grid;
    use crate::motion::terms::Term;
    use crate::motion::terms::shear::Shear;

    #[test]
    fn the_factor_solves_the_matrix_with_its_correction() {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(5, 0);
        let x: Positions = mesh.positions.iter().map(|p| *p + rng.vector() * 2e-3).collect();
        let mut system = FrameSystem::zeros(&cloth);
        Shear::new(&cloth, &mesh, [0.01, 1.0, 0.005]).add_system(&x, &mut system);
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
        // What is left of the matrix is positive semi-definite.
        assert!(dot(&solution, &product) > 0.0);
    }
}
