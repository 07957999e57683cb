//! All errors of one frame.

use glam::DVec3;

use tessuto_core::mesh::surface;

use super::{Inputs, Metrics, chamfer, depth, published, tracked};
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Positions;

/// Errors of `positions` `[m]`, shape `[V]`, against frame `index` of the truth, and those of its tracked points `[m]`.
pub(super) fn measure(
    inputs: &Inputs,
    triangles: &[[u32; 3]],
    positions: &Positions,
    index: usize,
    seed: u64,
) -> (Metrics, Vec<f64>) {
    let mut metrics = Metrics::default();
    if let Some(vertices) = &inputs.truth.vertices {
        metrics.vertex = Some(mean(positions.iter().zip(&vertices[index]).map(|(a, b)| a.distance(*b))));
    }
    if let Some(points) = inputs.truth.points_in(index) {
        measure_points(&mut metrics, inputs, triangles, positions, points, (seed, index));
    }
    let tracks = inputs.truth.tracks.as_ref();
    let distances = tracks.map_or(Vec::new(), |tracks| tracked::distances(tracks, positions, index));
    if let Some(of) = tracked::Distances::of(distances.clone()) {
        (metrics.track, metrics.track_p90, metrics.track_worst) =
            (Some(of.mean), Some(of.p90), Some(of.worst));
    }
    (metrics, distances)
}

fn measure_points(
    metrics: &mut Metrics,
    inputs: &Inputs,
    triangles: &[[u32; 3]],
    positions: &Positions,
    points: &[DVec3],
    (seed, index): (u64, usize),
) {
    let mut rng = Rng::new(seed, (inputs.first_frame + index) as u64);
    let samples = chamfer::sample(positions, triangles, points.len(), &mut rng);
    let pairs = [chamfer::nearest_squared(points, &samples), chamfer::nearest_squared(&samples, points)];
    (metrics.cd1, metrics.cd2) = both_means(&pairs);
    let exact = surface::distances_squared(points, positions, triangles);
    (metrics.p2s1, metrics.p2s2) = both_means(&exact);
    let inexact = published::distances_squared(points, positions, triangles, &exact);
    (metrics.p2s1_published, metrics.p2s2_published) = both_means(&inexact);
    metrics.depth = depth::mean_difference(points, positions, triangles, inputs.view(index));
}

/// Sums of the two directions' means, of distances and of squared distances.
fn both_means([a, b]: &[Vec<f64>; 2]) -> (Option<f64>, Option<f64>) {
    let root = |d: &[f64]| mean(d.iter().map(|d| d.sqrt()));
    (Some(root(a) + root(b)), Some(mean(a.iter().copied()) + mean(b.iter().copied())))
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}
