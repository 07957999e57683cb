//! Signed bending prior: keeps a curvature, with its sign: the template's, or that which the sheet has in the mean
//! of a clip.
//!
//! The angle springs of the simulation do not distinguish a fold from its mirror image, and neither do lengths seen
//! from the front. The height of a vertex over its two opposite neighbours, along the surface normal, does:
//!
//!   E = Σ ½ τ² ln(1 + (r/τ)²),  r = (η − η0)/(l λ σ),  η = (x_a − 2 x_o + x_c)·n_o,
//!
//! with the mean arm length l of the template, `[m]`, and λ, the same in arms that the spread is given for
//! ([`super::bend`]). The tail beyond τ spreads lets sharp folds form. The derivatives hold the normals n_o fixed:
//! their change multiplies the in-surface part of x_a − 2 x_o + x_c, which is small.

use glam::DVec3;

use super::bend::arm_lengths;
use super::robust::cauchy;
use super::{FrameSystem, Term, outer};
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_sim::Cloth;
use tessuto_sim::cloth::AngleSpring;

/// See the module.
#[derive(Clone)]
pub struct SignedBend<'a> {
    cloth: &'a Cloth,
    triangles: Vec<[u32; 3]>,
    /// η0 `[m]` per bending pair.
    rest: Vec<f64>,
    /// l λ `[m]` per bending pair: a height over that is an angle of nominal arms.
    arms: Vec<f64>,
    /// 1/(l λ σ) per bending pair.
    scale: Vec<f64>,
    /// τ.
    pub tail: f64,
}

impl<'a> SignedBend<'a> {
    /// At rest in the shape of `template`; `sigma` is the spread σ of the bending angle of nominal arms `[rad]`,
    /// `tail` is τ.
    pub fn new(cloth: &'a Cloth, template: &Mesh, sigma: f64, tail: f64) -> Self {
        let x = &template.positions;
        let (rest, arms, scale) = (Vec::new(), Vec::new(), Vec::new());
        let mut prior = Self { cloth, triangles: template.triangles(), rest, arms, scale, tail };
        let normals = prior.normals(x);
        for (spring, relative) in cloth.bends.iter().zip(arm_lengths(cloth, template)) {
            let [a, o, c] = spring.vertices.map(|v| x[v as usize]);
            let length = 0.5 * (a.distance(o) + o.distance(c));
            prior.rest.push(height(spring, x, &normals));
            prior.arms.push(length * relative);
            prior.scale.push(1.0 / (length * relative * sigma));
        }
        prior
    }

    /// Makes the spread σ larger by `factor`.
    pub fn loosen(&mut self, factor: f64) {
        self.scale.iter_mut().for_each(|scale| *scale /= factor);
    }

    /// Bending angle of every pair at `x` less that at rest, of nominal arms `[rad]`.
    pub fn angles(&self, x: &[DVec3]) -> Vec<f64> {
        let normals = self.normals(x);
        let springs = self.cloth.bends.iter().zip(&self.rest).zip(&self.arms);
        springs.map(|((spring, rest), arms)| (height(spring, x, &normals) - rest) / arms).collect()
    }

    /// Bends the shape at rest by `angles`, of nominal arms `[rad]`, one for each pair.
    pub fn bend_rest(&mut self, angles: &[f64]) {
        for ((rest, arms), angle) in self.rest.iter_mut().zip(&self.arms).zip(angles) {
            *rest += arms * angle;
        }
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

    /// E with given normals.
    fn value_with(&self, normals: &[DVec3], x: &[DVec3]) -> f64 {
        let springs = self.cloth.bends.iter().zip(&self.rest).zip(&self.scale);
        springs.map(|((spring, rest), s)| cauchy((height(spring, x, normals) - rest) * s, self.tail).0).sum()
    }
}

impl Term for SignedBend<'_> {
    fn name(&self) -> &'static str {
        "signed_bend"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.value_with(&self.normals(x), x)
    }

    /// The matrix is that of Gauss and Newton.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let normals = self.normals(x);
        let mut value = 0.0;
        for ((spring, rest), scale) in self.cloth.bends.iter().zip(&self.rest).zip(&self.scale) {
            let residual = height(spring, x, &normals) - rest;
            let (rho, weight) = cauchy(residual * scale, self.tail);
            value += rho;
            let w = weight * scale * scale;
            let [a, o, c] = spring.vertices.map(|v| v as usize);
            let n = normals[o];
            let nn = outer(n, n) * w;
            for (v, s) in [(a, 1.0), (o, -2.0), (c, 1.0)] {
                system.gradient[v] += n * (w * residual * s);
                system.matrix.add_diagonal(pattern, v, &(nn * (s * s)));
            }
            let [ao, ac, oc] = spring.pairs;
            for (pair, s) in [(ao, -2.0), (ac, 1.0), (oc, -2.0)] {
                system.matrix.add_pair(pattern, pair, &(nn * s));
            }
        }
        value
    }

    #[cfg(test)]
    fn held<'s>(&'s self, x: &[DVec3]) -> Option<super::Function<'s>> {
        let normals = self.normals(x);
        Some(Box::new(move |x| self.value_with(&normals, x)))
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
    use glam::DVec2;
    use tessuto_core::math::dot;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    fn bent(sign: f64) -> Positions {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        mesh.positions.iter().map(|p| *p + DVec3::Z * (sign * 2.0 * p.x * p.x)).collect()
    }

    #[test]
    fn a_fold_and_its_mirror_image_differ() {
        let mut mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        mesh.positions = bent(1.0);
        let cloth = Cloth::new(&mesh);
        let prior = SignedBend::new(&cloth, &mesh, 0.05, 3.0);
        assert!(prior.value(&bent(1.0)) < 1e-20);
        assert!(prior.value(&bent(-1.0)) > 1.0);
        let k = tessuto_sim::Stiffness::uniform(&cloth, [1.0; 3]);
        assert!(cloth.energy(&k, &bent(-1.0)).total() < 1e-20, "the springs do not see it");
    }

    #[test]
    fn what_bends_at_rest_costs_nothing() {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut prior = SignedBend::new(&cloth, &mesh, 0.05, 3.0);
        let (up, down) = (bent(1.0), bent(-1.0));
        let angles = prior.angles(&up);
        assert!(angles.iter().any(|angle| angle.abs() > 0.01));
        prior.bend_rest(&angles);
        assert!(prior.value(&up) < 1e-20 && prior.angles(&up).iter().all(|angle| angle.abs() < 1e-12));
        assert!(prior.value(&down) > 1.0);
    }

    /// A cylinder costs the same by pair on a coarse mesh and on a fine one.
    #[test]
    fn spreads_are_those_of_the_curvature() {
        let cost = |columns: usize| {
            let mesh = grid(columns, 3, DVec2::splat(0.4), 1.0);
            let cloth = Cloth::new(&mesh);
            let bent: Positions = mesh.positions.iter().map(|p| *p + DVec3::Z * (0.25 * p.x * p.x)).collect();
            // Three rows of pairs are bent.
            SignedBend::new(&cloth, &mesh, 0.02, 1e9).value(&bent) / (3 * (columns - 2)) as f64
        };
        let [coarse, fine] = [5, 17].map(cost);
        println!("{coarse} {fine}");
        assert!(fine > 1e-2 && (coarse / fine - 1.0).abs() < 0.05);
    }

    #[test]
    fn without_tail_the_matrix_is_the_second_derivative_at_fixed_normals() {
        let mesh = grid(6, 5, DVec2::new(0.1, 0.08), 1.0);
        let cloth = Cloth::new(&mesh);
        let prior = SignedBend::new(&cloth, &mesh, 0.05, 1e9);
        let mut rng = Rng::new(2, 0);
        let x: Positions = bent(1.0).iter().map(|p| *p + rng.vector() * 1e-3).collect();
        let mut system = FrameSystem::zeros(&cloth);
        let value = prior.add_system(&x, &mut system);
        let held = prior.held(&x).unwrap();
        let d: Positions = x.iter().map(|_| rng.vector() * 1e-3).collect();
        let moved: Positions = x.iter().zip(&d).map(|(x, d)| *x + *d).collect();
        let curved = dot(&d, &system.matrix.multiply(&cloth.pattern, &d));
        let predicted = value + dot(&system.gradient, &d) + 0.5 * curved;
        assert!((held(&moved) - predicted).abs() < 1e-6 * predicted, "{} {predicted}", held(&moved));
    }
}
