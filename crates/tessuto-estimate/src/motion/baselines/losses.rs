//! The losses of the rollout fit and their gradients.

use glam::DVec3;

use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::Positions;
use tessuto_core::settings::settings;
use tessuto_sim::Accelerations;

settings! {
    /// Weights of the losses.
    #[derive(Copy)]
    pub struct LossWeights {
        /// Weight of the mean squared colour difference.
        colour: f64 = 1.0, number(0.0..=1e6, "");
        /// Weight of the mean squared difference between the masks and the drawn silhouette.
        silhouette: f64 = 0.2, number(0.0..=1e6, "");
        /// Weight of the elastic energy of the shapes.
        energy: f64 = 2.0, number(0.0..=1e6, "1/J");
        /// Weight of the acceleration across the view ray.
        force: f64 = 2e-4, number(0.0..=1e6, "s²/m");
        /// Weight of the change of the dynamic acceleration from one entry to the next.
        force_smoothness: f64 = 0.0, number(0.0..=1e6, "s²/m");
    }
}

/// Losses by name, unweighted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Losses {
    /// Mean squared colour difference.
    pub colour: f64,
    /// Mean squared mask difference.
    pub silhouette: f64,
    /// Mean elastic energy `[J]`.
    pub energy: f64,
    /// Mean acceleration across the view ray, see `force_across_rays` `[m/s²]`.
    pub force: f64,
    /// Mean change of the dynamic acceleration [m/s²].
    pub force_smoothness: f64,
}

impl Losses {
    /// Weighted sum.
    pub fn total(&self, w: &LossWeights) -> f64 {
        w.colour * self.colour
            + w.silhouette * self.silhouette
            + w.energy * self.energy
            + w.force * self.force
            + w.force_smoothness * self.force_smoothness
    }
}

/// Unit vectors from the eye of `view` to the vertices.
pub fn view_rays(view: &Viewpoint, shape: &[DVec3]) -> Positions {
    shape.iter().map(|x| view.direction(*x)).collect()
}

/// Mean over vertices and frames, the first one counted with no force, of ‖g − (g·d) d‖ with g = C + D and the
/// unit view rays d, taken as constants. Adds `scale`·its gradient to `grad_constant` and `grad_dynamic`; only the
/// first `entries` of D count. `rays[k]` belongs to entry k.
pub fn force_across_rays(
    accelerations: &Accelerations,
    entries: usize,
    rays: &[&Positions],
    scale: f64,
    grad_constant: &mut DVec3,
    grad_dynamic: &mut [Positions],
) -> f64 {
    let vertex_count = accelerations.dynamic.first().map_or(1, Vec::len);
    let share = 1.0 / ((entries + accelerations.entries_per_frame) * vertex_count) as f64;
    let mut sum = 0.0;
    for k in 0..entries {
        for (i, d) in rays[k].iter().enumerate() {
            let g = accelerations.constant + accelerations.dynamic[k][i];
            let across = g - *d * g.dot(*d);
            // The length of a vector has no gradient at zero.
            let length = (across.length_squared() + 1e-16).sqrt();
            sum += length;
            let gradient = across * (scale * share / length);
            *grad_constant += gradient;
            grad_dynamic[k][i] += gradient;
        }
    }
    sum * share
}

/// Mean over entries and vertices of ‖D_{k+1} − D_k‖; adds `scale`·its gradient to `grad_dynamic`.
pub fn force_changes(
    accelerations: &Accelerations,
    entries: usize,
    scale: f64,
    grad_dynamic: &mut [Positions],
) -> f64 {
    if entries < 2 {
        return 0.0;
    }
    let vertex_count = accelerations.dynamic[0].len();
    let share = 1.0 / ((entries - 1) * vertex_count) as f64;
    let mut sum = 0.0;
    for k in 0..entries - 1 {
        for i in 0..vertex_count {
            let change = accelerations.dynamic[k + 1][i] - accelerations.dynamic[k][i];
            let length = (change.length_squared() + 1e-16).sqrt();
            sum += length;
            let gradient = change * (scale * share / length);
            grad_dynamic[k + 1][i] += gradient;
            grad_dynamic[k][i] -= gradient;
        }
    }
    sum * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_counts_as_one_without_force() {
        let mut accelerations = Accelerations::zeros(4, 1, 5);
        accelerations.constant = DVec3::new(3.0, 4.0, 100.0);
        let rays = vec![DVec3::Z; 5];
        let (mut constant, mut dynamic) = (DVec3::ZERO, accelerations.dynamic.clone());
        let force = force_across_rays(&accelerations, 2, &[&rays, &rays], 1.0, &mut constant, &mut dynamic);
        // Three frames are looked at, two of which follow a force of 5 m/s² across the rays.
        assert!((force - 5.0 * 2.0 / 3.0).abs() < 1e-9, "{force}");
        assert!((constant - DVec3::new(0.6, 0.8, 0.0) * (2.0 / 3.0)).length() < 1e-9, "{constant}");
        assert_eq!(dynamic[2], [DVec3::ZERO; 5]);
    }
}
