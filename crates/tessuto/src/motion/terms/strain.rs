//! Prior on the lengths of edges, with heavy tails.
//!
//! Fabric hardly stretches, but where it folds between two vertices of the mesh their distance shrinks by a
//! tenth or more, and grows as much where a fold of the template opens. Most edges keep their length, a few
//! change it freely: Cauchy's kernel on the strain ε = ‖e‖/l − 1,
//!
//!   E = Σ ½ τ² ln(1 + (ε/(σ τ))²).

use glam::DVec3;

use crate::math::block_matrix::BlockMatrix;
use crate::sim::{Cloth, stretch};

/// Spread σ of the strain, and the number τ of spreads beyond which strain is taken for a fold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrainPrior {
    /// σ.
    pub sigma: f64,
    /// τ.
    pub tail: f64,
}

/// ½ τ² ln(1 + r²/τ²) and its weight 2 ∂/∂r².
pub(super) fn cauchy(residual: f64, tail: f64) -> (f64, f64) {
    let s = (residual / tail).powi(2);
    (0.5 * tail * tail * s.ln_1p(), 1.0 / (1.0 + s))
}

impl StrainPrior {
    /// E at shape `x`.
    pub fn value(&self, cloth: &Cloth, x: &[DVec3]) -> f64 {
        let of = |e: &crate::sim::cloth::Edge| {
            cauchy((e.along(x).length() / e.rest_length - 1.0) / self.sigma, self.tail).0
        };
        cloth.edges.iter().map(of).sum()
    }

    /// Adds the gradient of [`value`](Self::value) and a positive semi-definite Hessian: the kernel's weight
    /// times the projected Hessian of the spring.
    pub fn add_system(&self, cloth: &Cloth, x: &[DVec3], gradient: &mut [DVec3], matrix: &mut BlockMatrix) {
        for edge in &cloth.edges {
            let (e, l) = (edge.along(x), edge.rest_length);
            let weight = cauchy((e.length() / l - 1.0) / self.sigma, self.tail).1;
            let stiffness = weight / (l * self.sigma).powi(2);
            let g = stretch::gradient(e, stiffness, l);
            let h = stretch::hessian_projected(e, stiffness, l);
            let [a, b] = edge.vertices.map(|v| v as usize);
            gradient[a] -= g;
            gradient[b] += g;
            matrix.add_diagonal(&cloth.pattern, a, &h);
            matrix.add_diagonal(&cloth.pattern, b, &h);
            matrix.add_pair(&cloth.pattern, edge.pair, &-h);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;
    use crate::math::{flat, gradient_check, vectors};
    use crate::mesh::grid;
    use glam::DVec2;

    #[test]
    fn gradient_agrees_with_differences() {
        let mesh = grid(5, 4, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(6, 0);
        let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p + rng.vector() * 1e-3).collect();
        let prior = StrainPrior { sigma: 0.005, tail: 2.0 };
        let mut gradient = vec![DVec3::ZERO; x.len()];
        prior.add_system(&cloth, &x, &mut gradient, &mut BlockMatrix::zeros(&cloth.pattern));
        let value = |x: &[f64]| prior.value(&cloth, &vectors(x));
        let worst = gradient_check::check(flat(&x), flat(&gradient), 1e-7, 20, 1, value);
        println!("{worst:?}");
        assert!(worst.relative_error < 1e-6, "{worst:?}");
    }
}
