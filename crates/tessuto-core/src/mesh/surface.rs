//! Exact distance between points and triangles.

use glam::DVec3;

use super::boxes::{Bounds, BoxTree};

/// Squared distance `[m²]` of `p` to the triangle `[a, b, c]`, all `[m]`. A triangle without area is
/// its edges.
pub fn point_triangle_squared(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let nn = n.length_squared();
    if nn > 0.0 {
        // Barycentric coordinates of the foot of the perpendicular.
        let w = (b - a).cross(p - a).dot(n) / nn;
        let v = (p - a).cross(c - a).dot(n) / nn;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            let height = (p - a).dot(n);
            return height * height / nn;
        }
    }
    point_segment_squared(p, a, b).min(point_segment_squared(p, b, c)).min(point_segment_squared(p, c, a))
}

/// Squared distance `[m²]` of `p` to the segment from `a` to `b`, which may be a point.
pub fn point_segment_squared(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let d = b - a;
    let dd = d.length_squared();
    let t = if dd > 0.0 { ((p - a).dot(d) / dd).clamp(0.0, 1.0) } else { 0.0 };
    (a + d * t).distance_squared(p)
}

/// Squared distances `[m²]` of each point to the nearest triangle, shape `[P]`, and of each triangle
/// to the nearest point, shape `[T]`. Exact.
pub fn distances_squared(points: &[DVec3], positions: &[DVec3], triangles: &[[u32; 3]]) -> [Vec<f64>; 2] {
    let corners: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(|i| positions[i as usize])).collect();
    let triangle_bounds: Vec<Bounds> = corners.iter().map(|t| Bounds::around(*t)).collect();
    let point_tree = BoxTree::of_points(points);
    let triangle_tree = BoxTree::new(triangle_bounds.clone());
    let of_point =
        |p: &DVec3| triangle_tree.nearest(&Bounds::around([*p]), |k| point_triangle_squared(*p, corners[k]));
    let of_triangle =
        |(t, b): (&[DVec3; 3], &Bounds)| point_tree.nearest(b, |k| point_triangle_squared(points[k], *t));
    [points.iter().map(of_point).collect(), corners.iter().zip(&triangle_bounds).map(of_triangle).collect()]
}
