//! The mesh's boundary against the outline of the mask:
//!
//!   E = Σ_q w_q ρ(d(π(x_q))),  w_q = L_q/(σ² l),
//!
//! over points q of the boundary, with the signed distance d `[px]` to the outline, the projection π, the length L_q
//! of boundary that q stands for `[px]`, the length l whose errors vary together, and Geman and McClure's ρ of spread σ.

use glam::DVec3;

use super::robust::geman_mcclure;
use super::{FrameSystem, Term, outer};
use crate::camera::Camera;
use crate::motion::observed::outline_distance::OutlineDistance;
use crate::motion::observed::samples::EdgePoint;
use crate::sim::Cloth;

/// See the module.
pub struct Outline<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Points of the mesh's boundary.
    pub boundary: &'a [EdgePoint],
    /// Whether a point lies in front of or behind more of the sheet and so is not on the outline; empty if none does. Held fixed.
    pub inner: &'a [bool],
    /// Outline of the frame's mask, at level 0.
    pub distance: &'a OutlineDistance,
    /// Camera of level 0.
    pub camera: &'a Camera,
    /// Distances beyond this count less and less `[px]`.
    pub sigma: f64,
    /// Weight of one pixel of boundary, 1/(σ² l).
    pub weight: f64,
}

impl Outline<'_> {
    /// Whether the boundary point of that index may be on the outline.
    pub fn counts(&self, index: usize) -> bool {
        self.inner.get(index) != Some(&true)
    }

    /// Distance `[px]` of a boundary point and its derivative by the point; `None` where it does not count.
    fn residual(&self, index: usize, point: &EdgePoint, x: &[DVec3]) -> Option<(f64, DVec3)> {
        if !self.counts(index) {
            return None;
        }
        let [a, b] = point.vertices.map(|v| x[v as usize]);
        let p = a * point.weights[0] + b * point.weights[1];
        if p.z <= 0.0 {
            return None;
        }
        let (distance, slope) = self.distance.sample(self.camera.project(p))?;
        let [ru, rv] = self.camera.projection_rows(p);
        Some((distance, ru * slope.x + rv * slope.y))
    }
}

impl Term for Outline<'_> {
    fn name(&self) -> &'static str {
        "outline"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let of_point = |(index, point): (usize, &EdgePoint)| match self.residual(index, point, x) {
            Some((r, _)) => self.weight * point.length * geman_mcclure(r * r, self.sigma).0,
            None => 0.0,
        };
        self.boundary.iter().enumerate().map(of_point).sum()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let mut value = 0.0;
        for (index, point) in self.boundary.iter().enumerate() {
            let Some((r, slope)) = self.residual(index, point, x) else { continue };
            let (rho, ratio) = geman_mcclure(r * r, self.sigma);
            let weight = self.weight * point.length;
            let (s, w, q) = (weight * ratio, point.weights, outer(slope, slope));
            value += weight * rho;
            for k in 0..2 {
                let vertex = point.vertices[k] as usize;
                system.gradient[vertex] += slope * (s * r * w[k]);
                system.matrix.add_diagonal(pattern, vertex, &(q * (s * w[k] * w[k])));
            }
            let pair = self.cloth.edge_pair(point.vertices);
            system.matrix.add_pair(pattern, pair, &(q * (s * w[0] * w[1])));
        }
        value
    }
}
