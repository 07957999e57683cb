//! Area-uniform surface samples and nearest neighbours between two point sets.

use glam::DVec3;

use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::boxes::{Bounds, BoxTree};
use tessuto_core::mesh::triangle_area;

/// `count` points, uniform in area, on the surface of `triangles`. Positions `[count]`.
///
/// - `positions`: vertices `[m]`, shape `[V]`; the total area must be positive
///
/// A triangle is drawn by inversion of the cumulated area; inside it the point is
/// (1 − √u) a + √u (1 − v) b + √u v c with u, v uniform in [0, 1).
pub fn sample(positions: &[DVec3], triangles: &[[u32; 3]], count: usize, rng: &mut Rng) -> Vec<DVec3> {
    let mut total = 0.0;
    let cumulated: Vec<f64> = triangles
        .iter()
        .map(|t| {
            total += triangle_area(positions, *t);
            total
        })
        .collect();
    (0..count)
        .map(|_| {
            let at = rng.uniform() * total;
            let k = cumulated.partition_point(|c| *c <= at).min(triangles.len() - 1);
            let [a, b, c] = triangles[k].map(|i| positions[i as usize]);
            let (root, v) = (rng.uniform().sqrt(), rng.uniform());
            a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
        })
        .collect()
}

/// Squared distance `[m²]` from each point of `from` to the nearest of `to`. Positions `[from]`.
pub fn nearest_squared(from: &[DVec3], to: &[DVec3]) -> Vec<f64> {
    let tree = BoxTree::of_points(to);
    let nearest = |p: &DVec3| tree.nearest(&Bounds::around([*p]), |k| p.distance_squared(to[k]));
    from.iter().map(nearest).collect()
}
