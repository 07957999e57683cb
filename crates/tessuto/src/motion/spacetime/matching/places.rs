//! Points of the sheet drawn to where the image shows them:
//!
//!   E = Σ_i w ρ(‖π(x_i) − q_i‖/σ; τ),
//!
//! with places q_i and the projection π of points x_i `[px]` and Geman and McClure's ρ of spread σ and tail τ: what is farther off than
//! σ τ lets go.

use glam::{DMat3, DVec2, DVec3};

use crate::camera::Viewpoint;
use crate::motion::observed::samples::{SurfaceSample, SurfaceSamples};
use crate::motion::terms::robust::Noise;
use crate::motion::terms::{FrameSystem, Term, outer};
use crate::sim::Cloth;

/// See the module.
pub struct Places<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// The triangles of the mesh.
    pub samples: &'a SurfaceSamples,
    /// The points, and where they are seen `[px]`.
    pub matches: &'a [(SurfaceSample, DVec2)],
    /// How the frame is seen, in these pixels.
    pub view: &'a Viewpoint,
    /// σ `[px]` and τ.
    pub noise: Noise,
    /// Weight w of a match.
    pub weight: f64,
}

impl Places<'_> {
    /// Difference `[px]` of a point at `p` to where it is seen; `None` behind the camera.
    fn residual(&self, p: DVec3, seen: DVec2) -> Option<DVec2> {
        Some(self.view.project_in_front(p)? - seen)
    }
}

impl Term for Places<'_> {
    fn name(&self) -> &'static str {
        "places"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let of_match = |(point, seen): &(SurfaceSample, DVec2)| {
            let residual = self.residual(self.samples.position(point, x), *seen);
            residual.map_or(0.0, |r| self.weight * self.noise.geman_mcclure(r.length_squared()).0)
        };
        self.matches.iter().map(of_match).sum()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let mut value = 0.0;
        for (point, seen) in self.matches {
            let p = self.samples.position(point, x);
            let Some(r) = self.residual(p, *seen) else { continue };
            let (rho, ratio) = self.noise.geman_mcclure(r.length_squared());
            let [ru, rv] = self.view.projection_rows(p);
            let (s, w) = (self.weight * ratio, point.weights);
            let gradient = (ru * r.x + rv * r.y) * s;
            let block: DMat3 = (outer(ru, ru) + outer(rv, rv)) * s;
            value += self.weight * rho;
            let corners = self.samples.triangles[point.triangle as usize].map(|v| v as usize);
            let pairs = self.cloth.triangle_pairs[point.triangle as usize];
            for (k, [i, j]) in [[1, 0], [2, 0], [2, 1]].into_iter().enumerate() {
                system.gradient[corners[k]] += gradient * w[k];
                system.matrix.add_diagonal(pattern, corners[k], &(block * (w[k] * w[k])));
                system.matrix.add_pair(pattern, pairs[k], &(block * (w[i] * w[j])));
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Pose};
    use crate::math::gradient_check::check;
    use crate::math::rng::Rng;
    use crate::math::{dot, flat, vectors};
    use crate::mesh::{Mesh, Positions, grid};

    #[test]
    fn the_gradient_agrees_with_central_differences() {
        let mesh = grid(6, 5, DVec2::new(0.2, 0.16), 1.0);
        let cloth = Cloth::new(&mesh);
        let camera = Camera { fx: 200.0, fy: 190.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let mut rng = Rng::new(4, 0);
        let pose = Pose::random(&mut rng);
        let view = Viewpoint { camera, camera_from_world: Some(pose) };
        let mesh = Mesh { positions: mesh.positions.iter().map(|p| pose.in_world(*p)).collect(), ..mesh };
        let samples = SurfaceSamples::new(&mesh, &mesh.positions, &view, 1.0);
        let matches: Vec<(SurfaceSample, DVec2)> = (samples.points.iter().step_by(9))
            .map(|p| {
                let seen = view.project(samples.position(p, &mesh.positions));
                (*p, seen + DVec2::new(rng.signed(), rng.signed()) * 6.0)
            })
            .collect();
        let places = Places {
            cloth: &cloth,
            samples: &samples,
            matches: &matches,
            view: &view,
            noise: Noise { sigma: 2.0, tail: 2.0 },
            weight: 3.0,
        };
        let x: Positions = mesh.positions.iter().map(|p| *p + rng.vector() * 5e-3).collect();
        let mut system = FrameSystem::zeros(&cloth);
        let value = places.add_system(&x, &mut system);
        assert!(value > 1.0 && (value / places.value(&x) - 1.0).abs() < 1e-12);
        let worst = check(flat(&x), flat(&system.gradient), 1e-6, 20, 1, |x| places.value(&vectors(x)));
        println!("{worst:?}");
        assert!(worst.relative_error < 1e-6, "{worst:?}");
        let d: Positions = x.iter().map(|_| rng.vector()).collect();
        assert!(dot(&d, &system.multiply(&cloth, &d)) > 0.0);
    }
}
