//! Signed bending prior: keeps the curvature of the template, with its sign.
//!
//! The angle springs of the simulation do not tell a fold from its mirror image, and neither do lengths seen
//! from the front. The height of a vertex over its two opposite neighbours, along the surface normal, does:
//!
//!   E = Σ ½ τ² ln(1 + r²/τ²),  r = (η − η0)/(l σ),  η = (x_a − 2 x_o + x_c)·n_o,
//!
//! with the mean arm length l of the template. The tail beyond τ spreads lets sharp folds form. The normal n_o of each evaluation is held fixed in the
//! derivatives: its own change multiplies the in-surface part of x_a − 2 x_o + x_c, which is small.

use glam::{DMat3, DVec3};

use super::strain::cauchy;
use crate::math::block_matrix::BlockMatrix;
use crate::mesh::Positions;
use crate::sim::Cloth;
use crate::sim::cloth::AngleSpring;

/// Rest heights of the bending pairs of a cloth.
#[derive(Debug, Clone)]
pub struct SignedBendPrior {
    triangles: Vec<[u32; 3]>,
    /// η0 [m] per bending pair.
    rest: Vec<f64>,
    /// 1/(l σ) per bending pair.
    scale: Vec<f64>,
    tail: f64,
}

impl SignedBendPrior {
    /// At rest in the shape `x`; `sigma` is the spread σ of the bending angle [rad], `tail` is τ.
    pub fn new(cloth: &Cloth, triangles: &[[u32; 3]], x: &[DVec3], sigma: f64, tail: f64) -> Self {
        let mut prior = Self { triangles: triangles.to_vec(), rest: Vec::new(), scale: Vec::new(), tail };
        let normals = prior.normals(x);
        for spring in &cloth.bends {
            let [a, o, c] = spring.vertices.map(|v| x[v as usize]);
            let length = 0.5 * (a.distance(o) + o.distance(c));
            prior.rest.push(height(spring, x, &normals));
            prior.scale.push(1.0 / (length * sigma));
        }
        prior
    }

    /// Unit normals, weighted by area.
    fn normals(&self, x: &[DVec3]) -> Positions {
        let mut normals = vec![DVec3::ZERO; x.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| x[v as usize]);
            let normal = (b - a).cross(c - a);
            t.iter().for_each(|&v| normals[v as usize] += normal);
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// E at shape `x`.
    pub fn value(&self, cloth: &Cloth, x: &[DVec3]) -> f64 {
        let normals = self.normals(x);
        let of = |((spring, rest), scale): ((&AngleSpring, &f64), &f64)| {
            cauchy((height(spring, x, &normals) - rest) * scale, self.tail).0
        };
        cloth.bends.iter().zip(&self.rest).zip(&self.scale).map(of).sum()
    }

    /// Adds the gradient and the Gauss-Newton Hessian of [`value`](Self::value).
    pub fn add_system(&self, cloth: &Cloth, x: &[DVec3], gradient: &mut [DVec3], matrix: &mut BlockMatrix) {
        let normals = self.normals(x);
        for ((spring, rest), scale) in cloth.bends.iter().zip(&self.rest).zip(&self.scale) {
            let residual = height(spring, x, &normals) - rest;
            let w = cauchy(residual * scale, self.tail).1 * scale * scale;
            let [a, o, c] = spring.vertices.map(|v| v as usize);
            let n = normals[o];
            let nn = DMat3::from_cols(n * n.x, n * n.y, n * n.z) * w;
            for (v, s) in [(a, 1.0), (o, -2.0), (c, 1.0)] {
                gradient[v] += n * (w * residual * s);
                matrix.add_diagonal(&cloth.pattern, v, &(nn * (s * s)));
            }
            let [ao, ac, oc] = spring.pairs;
            for (pair, s) in [(ao, -2.0), (ac, 1.0), (oc, -2.0)] {
                matrix.add_pair(&cloth.pattern, pair, &(nn * s));
            }
        }
    }
}

/// η of one bending pair.
fn height(spring: &AngleSpring, x: &[DVec3], normals: &[DVec3]) -> f64 {
    let [a, o, c] = spring.vertices.map(|v| v as usize);
    (x[a] - x[o] * 2.0 + x[c]).dot(normals[o])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;
    use crate::math::{dot, flat, gradient_check, vectors};
    use crate::mesh::grid;
    use glam::DVec2;

    fn bent(sign: f64) -> Positions {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        mesh.positions.iter().map(|p| *p + DVec3::Z * (sign * 2.0 * p.x * p.x)).collect()
    }

    #[test]
    fn a_fold_and_its_mirror_image_differ() {
        let mut mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        mesh.positions = bent(1.0);
        let cloth = Cloth::new(&mesh);
        let prior = SignedBendPrior::new(&cloth, &mesh.triangles(), &mesh.positions, 0.05, 3.0);
        assert!(prior.value(&cloth, &bent(1.0)) < 1e-20);
        assert!(prior.value(&cloth, &bent(-1.0)) > 1.0);
        let k = crate::sim::Stiffness::uniform(&cloth, [1.0; 3]);
        assert!(cloth.energy(&k, &bent(-1.0)).total() < 1e-20, "the springs do not see it");
    }

    #[test]
    fn gradient_is_that_of_the_value_with_fixed_normals() {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let prior = SignedBendPrior::new(&cloth, &mesh.triangles(), &mesh.positions, 0.05, 3.0);
        let mut rng = Rng::new(2, 0);
        let x: Positions = bent(1.0).iter().map(|p| *p + rng.vector() * 1e-3).collect();
        let normals = prior.normals(&x);
        let mut gradient = vec![DVec3::ZERO; x.len()];
        let mut matrix = BlockMatrix::zeros(&cloth.pattern);
        prior.add_system(&cloth, &x, &mut gradient, &mut matrix);
        let value = |x: &[DVec3]| -> f64 {
            let of = |(k, h): (usize, &AngleSpring)| {
                cauchy((height(h, x, &normals) - prior.rest[k]) * prior.scale[k], prior.tail).0
            };
            cloth.bends.iter().enumerate().map(of).sum()
        };
        let worst = gradient_check::check(flat(&x), flat(&gradient), 1e-5, 10, 1, |x| value(&vectors(x)));
        assert!(worst.relative_error < 1e-7, "{worst:?}");
        // Without tail and with fixed normals the value is quadratic: the matrix is its second derivative.
        let plain = SignedBendPrior { tail: 1e9, ..prior.clone() };
        let (mut gradient, mut matrix) = (vec![DVec3::ZERO; x.len()], BlockMatrix::zeros(&cloth.pattern));
        plain.add_system(&cloth, &x, &mut gradient, &mut matrix);
        let value = |x: &[DVec3]| -> f64 {
            let of = |(k, h): (usize, &AngleSpring)| {
                ((height(h, x, &normals) - plain.rest[k]) * plain.scale[k]).powi(2)
            };
            0.5 * cloth.bends.iter().enumerate().map(of).sum::<f64>()
        };
        let d: Positions = x.iter().map(|_| rng.vector() * 1e-3).collect();
        let moved: Positions = x.iter().zip(&d).map(|(x, d)| *x + *d).collect();
        let predicted = value(&x) + dot(&gradient, &d) + 0.5 * dot(&d, &matrix.multiply(&cloth.pattern, &d));
        assert!((value(&moved) - predicted).abs() < 1e-6 * predicted, "{} {predicted}", value(&moved));
    }
}
