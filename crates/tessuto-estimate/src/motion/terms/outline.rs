//! The mesh's outlines, its boundary and its folds, against the outline of the mask:
//!
//!   E = Σ_q k L_q ρ(d(π(x_q))/σ; τ),
//!
//! over points q of boundary and folds, with the signed distance d `[px]` to the outline, the projection π, the
//! length L_q that q stands for, in pixels of which each counts as k independent ones, and Geman and McClure's ρ
//! of the noise σ of one pixel of outline and its tail τ.

use glam::DVec3;

use super::robust::Noise;
use super::{FrameSystem, Term, outer};
use crate::motion::observed::outline_distance::OutlineDistance;
use crate::motion::observed::samples::EdgePoint;
use crate::motion::observed::silhouette::FoldPoint;
use tessuto_core::camera::Viewpoint;
use tessuto_sim::Cloth;

/// See the module.
pub struct Outline<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Points of the mesh's boundary.
    pub boundary: &'a [EdgePoint],
    /// Whether a point of the boundary is not on the outline; empty if all are. Held fixed.
    pub inner: &'a [bool],
    /// Points of folds that are on the outline. Held fixed.
    pub folds: &'a [FoldPoint],
    /// Outline of the frame's mask, at level 0.
    pub distance: &'a OutlineDistance,
    /// Whether a point of the boundary that is not on that outline is one between back and front, empty if none is,
    /// and where the frame shows these. The first is held fixed.
    pub laid: &'a [bool],
    pub seam: Option<&'a OutlineDistance>,
    /// How the frame is seen, in pixels of level 0.
    pub view: &'a Viewpoint,
    /// σ of one pixel of outline `[px]`, and τ.
    pub noise: Noise,
    /// k: number of independent pixels of outline that one of level 0 counts as.
    pub weight: f64,
}

impl Outline<'_> {
    /// The points that may be on an outline, each with the pair of its end points in the pattern of the systems, and
    /// that outline.
    fn points(&self) -> impl Iterator<Item = (&EdgePoint, usize, &OutlineDistance)> {
        let boundary = self.boundary.iter().enumerate().filter_map(|(index, point)| {
            let outline = match self.inner.get(index) == Some(&true) {
                false => Some(self.distance),
                true => self.seam.filter(|_| self.laid.get(index) == Some(&true)),
            };
            outline.map(|outline| (point, self.cloth.edge_pair(point.vertices), outline))
        });
        boundary.chain(self.folds.iter().map(|fold| (&fold.point, fold.pair, self.distance)))
    }

    /// Mean squared distance to the outline of what may be on it, as the robust term counts it `[px²]`; 0 if
    /// nothing may.
    pub fn mean_square(&self, x: &[DVec3]) -> f64 {
        let length: f64 = self.points().map(|(point, ..)| point.length).sum();
        let value = if length > 0.0 { self.value(x) / (self.weight * length) } else { 0.0 };
        2.0 * value * self.noise.sigma.powi(2)
    }

    /// What a point costs.
    fn of_point(&self, point: &EdgePoint, outline: &OutlineDistance, x: &[DVec3]) -> f64 {
        match self.residual(point, outline, x) {
            Some((r, _)) => self.weight * point.length * self.noise.geman_mcclure(r * r).0,
            None => 0.0,
        }
    }

    /// Adds what of the value every vertex bears, shape `[V]`: the ends of an edge, by how near a point is to them.
    pub fn add_shares(&self, x: &[DVec3], shares: &mut [f64]) {
        for (point, _, outline) in self.points() {
            let value = self.of_point(point, outline, x);
            (0..2).for_each(|k| shares[point.vertices[k] as usize] += point.weights[k] * value);
        }
    }

    /// Distance `[px]` of a point to an outline and its derivative by the point; `None` where it does not count.
    fn residual(&self, point: &EdgePoint, outline: &OutlineDistance, x: &[DVec3]) -> Option<(f64, DVec3)> {
        let p = point.position(x);
        let (distance, slope) = outline.sample(self.view.project_in_front(p)?)?;
        let [ru, rv] = self.view.projection_rows(p);
        Some((distance, ru * slope.x + rv * slope.y))
    }
}

impl Term for Outline<'_> {
    fn name(&self) -> &'static str {
        "outline"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.points().map(|(point, _, outline)| self.of_point(point, outline, x)).sum()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let mut value = 0.0;
        for (point, pair, outline) in self.points() {
            let Some((r, slope)) = self.residual(point, outline, x) else { continue };
            let (rho, ratio) = self.noise.geman_mcclure(r * r);
            let weight = self.weight * point.length;
            let (s, w, q) = (weight * ratio, point.weights, outer(slope, slope));
            value += weight * rho;
            for k in 0..2 {
                let vertex = point.vertices[k] as usize;
                system.gradient[vertex] += slope * (s * r * w[k]);
                system.matrix.add_diagonal(pattern, vertex, &(q * (s * w[k] * w[k])));
            }
            system.matrix.add_pair(pattern, pair, &(q * (s * w[0] * w[1])));
        }
        value
    }
}
