//! Vertices against the planes that the fabric lies on.
//!
//!   E = Σ_i c(h_i),   h the height of vertex i above a plane,
//!
//! c = ½ (h/σ)² below the plane, which nothing passes; above it Geman and McClure's kernel of tail τ: what is within a
//! few spreads most likely lies there, and what is farther is lifted and costs the same anywhere.

use glam::DVec3;

use super::robust::Noise;
use super::{FrameSystem, Term, outer};
use tessuto_core::scene::Plane;
use tessuto_sim::Cloth;

/// See the module.
pub struct Planes<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// The planes.
    pub planes: &'a [Plane],
    /// σ `[m]` and τ.
    pub noise: Noise,
}

impl Planes<'_> {
    /// The value at height `h` `[m]`, and the weight of its square: c'(h)/h.
    fn at(&self, h: f64) -> (f64, f64) {
        if h < 0.0 {
            let precision = self.noise.sigma.powi(-2);
            return (0.5 * h * h * precision, precision);
        }
        self.noise.geman_mcclure(h * h)
    }
}

impl Term for Planes<'_> {
    fn name(&self) -> &'static str {
        "planes"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        // Not `sum`, which is −0 of no planes.
        self.planes
            .iter()
            .flat_map(|plane| x.iter().map(|x| self.at(plane.above(*x)).0))
            .fold(0.0, |a, b| a + b)
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        for plane in self.planes {
            let square = outer(plane.normal, plane.normal);
            for (v, x) in x.iter().enumerate() {
                let h = plane.above(*x);
                let weight = self.at(h).1;
                system.gradient[v] += plane.normal * (weight * h);
                system.matrix.add_diagonal(&self.cloth.pattern, v, &(square * weight));
            }
        }
        self.value(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_passes_and_what_is_lifted_costs_the_same_anywhere() {
        let mesh = tessuto_core::mesh::grid(2, 2, glam::DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let planes = [Plane { normal: -DVec3::Z, height: -1.0 }];
        let term = Planes { cloth: &cloth, planes: &planes, noise: Noise { sigma: 1e-3, tail: 3.0 } };
        let at = |h: f64| term.value(&[DVec3::new(0.0, 0.0, 1.0 - h); 4]);
        assert!((at(-5e-3) - 4.0 * 12.5).abs() < 1e-9 && at(0.0) == 0.0);
        assert!((at(1e-3) - 4.0 * 0.45).abs() < 1e-9 && (at(0.1) / at(0.2) - 1.0).abs() < 1e-3);
        assert_eq!(Planes { planes: &[], ..term }.value(&mesh.positions).to_bits(), 0);
    }
}
