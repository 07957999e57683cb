//! Vertices of a fixed edge, which stand still.
//!
//!   E = Σ_i ½ ‖x_i − x̄_i‖²/σ²
//!
//! over the vertices i of edges that do not move in the image, with their positions x̄ in the first frame. What
//! stands still in the image most likely stands still in space, and depth, which images constrain least, follows
//! from there along the sheet.

use glam::{DMat3, DVec3};

use super::{FrameSystem, Term};
use tessuto_sim::Cloth;

/// See the module.
pub struct Still<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// The positions x̄ in the first frame `[m]`, shape `[V]`.
    pub first: &'a [DVec3],
    /// The vertices that stand still.
    pub vertices: &'a [u32],
    /// Spread σ `[m]`.
    pub sigma: f64,
}

impl Term for Still<'_> {
    fn name(&self) -> &'static str {
        "still"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let moved = |&v: &u32| x[v as usize].distance_squared(self.first[v as usize]);
        // Not `sum`, which is −0 of no vertices and would be written so into the history.
        0.5 * self.vertices.iter().map(moved).fold(0.0, |sum, moved| sum + moved) / self.sigma.powi(2)
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let weight = 1.0 / self.sigma.powi(2);
        let matrix = DMat3::from_diagonal(DVec3::splat(weight));
        for v in self.vertices.iter().map(|&v| v as usize) {
            system.gradient[v] += (x[v] - self.first[v]) * weight;
            system.matrix.add_diagonal(&self.cloth.pattern, v, &matrix);
        }
        self.value(x)
    }
}
