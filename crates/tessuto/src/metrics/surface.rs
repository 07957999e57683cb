//! Exact distance between points and triangles.

use glam::DVec3;
use kiddo::SquaredEuclidean;

use super::chamfer::tree;

/// Squared distance [m²] of `p` to the triangle `[a, b, c]`, all [m]. A triangle without area is
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

/// Squared distance [m²] of `p` to the segment from `a` to `b`, which may be a point.
pub fn point_segment_squared(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let d = b - a;
    let dd = d.length_squared();
    let t = if dd > 0.0 { ((p - a).dot(d) / dd).clamp(0.0, 1.0) } else { 0.0 };
    (a + d * t).distance_squared(p)
}

/// Squared distances [m²] of each point to the nearest triangle, shape [P], and of each triangle
/// to the nearest point, shape [T].
///
/// Exact: a triangle of radius r around its centre c is at least |p − c| − r away from p, so
/// everything that can be nearer than the first candidate lies in a ball around p (or c).
pub fn distances_squared(points: &[DVec3], positions: &[DVec3], triangles: &[[u32; 3]]) -> [Vec<f64>; 2] {
    let corners: Vec<[DVec3; 3]> =
        triangles.iter().map(|t| t.map(|i| positions[i as usize])).collect();
    let centres: Vec<DVec3> = corners.iter().map(|[a, b, c]| (*a + *b + *c) / 3.0).collect();
    let radii: Vec<f64> = corners
        .iter()
        .zip(&centres)
        .map(|(t, m)| t.iter().map(|x| x.distance(*m)).fold(0.0, f64::max))
        .collect();
    [to_triangles(points, &corners, &centres, &radii), to_points(points, &corners, &centres, &radii)]
}

fn to_triangles(points: &[DVec3], corners: &[[DVec3; 3]], centres: &[DVec3], radii: &[f64]) -> Vec<f64> {
    let tree = tree(centres);
    let widest = radii.iter().copied().fold(0.0, f64::max);
    let nearest = |p: &DVec3| {
        let query = p.to_array();
        let first = tree.nearest_one::<SquaredEuclidean>(&query).item as usize;
        let mut best = point_triangle_squared(*p, corners[first]);
        let mut distance = best.sqrt();
        for candidate in tree.within_unsorted::<SquaredEuclidean>(&query, grown(distance + widest)) {
            let k = candidate.item as usize;
            let bound = distance + radii[k];
            if candidate.distance < bound * bound {
                best = best.min(point_triangle_squared(*p, corners[k]));
                distance = best.sqrt();
            }
        }
        best
    };
    points.iter().map(nearest).collect()
}

fn to_points(points: &[DVec3], corners: &[[DVec3; 3]], centres: &[DVec3], radii: &[f64]) -> Vec<f64> {
    let tree = tree(points);
    let nearest = |k: usize| {
        let query = centres[k].to_array();
        let first = tree.nearest_one::<SquaredEuclidean>(&query).item as usize;
        let mut best = point_triangle_squared(points[first], corners[k]);
        let mut bound = best.sqrt() + radii[k];
        for candidate in tree.within_unsorted::<SquaredEuclidean>(&query, grown(bound)) {
            if candidate.distance < bound * bound {
                best = best.min(point_triangle_squared(points[candidate.item as usize], corners[k]));
                bound = best.sqrt() + radii[k];
            }
        }
        best
    };
    (0..corners.len()).map(nearest).collect()
}

/// Square of `radius` with room for rounding.
fn grown(radius: f64) -> f64 {
    radius * radius * (1.0 + 1e-9) + 1e-24
}
