//! Prior on the lengths of edges, with heavy tails.
//!
//! Fabric hardly stretches, but where it folds between two vertices of the mesh their distance shrinks by a
//! tenth or more, and grows as much where a fold of the template opens. Most edges keep their length, a few
//! change it freely: Cauchy's kernel on the strain ε = ‖e‖/l − 1,
//!
//!   E = Σ ½ τ² ln(1 + (ε/(σ τ))²).

use glam::DVec3;

use super::robust::cauchy;
use super::{FrameSystem, Term};
use tessuto_sim::cloth::Edge;
use tessuto_sim::{Cloth, stretch};

/// See the module.
#[derive(Clone)]
pub struct Strain<'a> {
    /// The cloth, whose template has no strain.
    pub cloth: &'a Cloth,
    /// Spread σ of the strain.
    pub sigma: f64,
    /// Number τ of spreads beyond which strain is treated as a fold.
    pub tail: f64,
}

impl Strain<'_> {
    /// Value and weight of one edge.
    fn of_edge(&self, edge: &Edge, x: &[DVec3]) -> (f64, f64) {
        cauchy((edge.along(x).length() / edge.rest_length - 1.0) / self.sigma, self.tail)
    }
}

impl Term for Strain<'_> {
    fn name(&self) -> &'static str {
        "strain"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.cloth.edges.iter().map(|edge| self.of_edge(edge, x).0).sum()
    }

    /// The matrix is the kernel's weight times the projected Hessian of a spring.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let mut value = 0.0;
        for edge in &self.cloth.edges {
            let (e, l) = (edge.along(x), edge.rest_length);
            let (rho, weight) = self.of_edge(edge, x);
            value += rho;
            let stiffness = weight / (l * self.sigma).powi(2);
            let g = stretch::gradient(e, stiffness, l);
            let h = stretch::hessian_projected(e, stiffness, l);
            let [a, b] = edge.vertices.map(|v| v as usize);
            system.gradient[a] -= g;
            system.gradient[b] += g;
            system.matrix.add_diagonal(pattern, a, &h);
            system.matrix.add_diagonal(pattern, b, &h);
            system.matrix.add_pair(pattern, edge.pair, &-h);
        }
        value
    }
}
