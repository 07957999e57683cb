//! Delaunay triangulation of points in the plane: no point lies in the circle around any triangle.
//!
//! Source: Bowyer 1981, "Computing Dirichlet tessellations"; Watson 1981, "Computing the n-dimensional Delaunay
//! tessellation". Every point looks at all triangles, which is enough for some thousands.

use glam::DVec2;

use super::rng::Rng;

/// How far points are moved, in sizes of the point set, before they are looked at. Of four points on one circle,
/// as every square has them, rounding would say one thing of one triangle and another of its neighbour; and no
/// triangle then contradicts the others. Far smaller than the curvature of the circles through the far corners, so
/// that a straight border stays whole.
const JITTER: f64 = 1e-9;
/// How far off the corners of the triangle lie that the others are cut from, in sizes of the point set.
const FAR: f64 = 1e4;

/// The triangles over `points`, each with [`DVec2::perp_dot`] of its sides above 0, ascending. Points at the same
/// place make triangles without area, or are left out.
pub fn delaunay(points: &[DVec2]) -> Vec<[u32; 3]> {
    let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let (middle, size) = ((low + high) / 2.0, FAR * (high - low).max_element());
    let count = points.len() as u32;
    let mut rng = Rng::new(0, 0);
    let jitter = JITTER * (high - low).max_element();
    let mut all: Vec<DVec2> = points.iter().map(|p| *p + rng.vector().truncate() * jitter).collect();
    all.extend(
        [DVec2::new(-1.7, -1.0), DVec2::new(1.7, -1.0), DVec2::new(0.0, 2.0)].map(|p| middle + p * size),
    );
    let mut triangles = vec![[count, count + 1, count + 2]];
    for k in 0..points.len() {
        let p = all[k];
        let (hit, mut kept): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
            triangles.into_iter().partition(|t| in_circle(t.map(|v| all[v as usize]), p));
        // The hole is star-shaped about the point; its sides are those that no other of its triangles has.
        let sides: Vec<[u32; 2]> = hit.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        let outer = sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a]));
        kept.extend(outer.map(|[a, b]| [*a, *b, k as u32]));
        triangles = kept;
    }
    let inner = triangles.into_iter().filter(|t| t.iter().all(|v| *v < count));
    let mut found: Vec<[u32; 3]> = inner.map(first_smallest).collect();
    found.sort_unstable();
    found
}

/// Whether `p` lies in the circle around a triangle whose sides have a [`DVec2::perp_dot`] above 0. The circle's own
/// centre must not be asked: that of three points of a straight border is so far away that its distances say nothing of
/// what lies on the border.
fn in_circle(corners: [DVec2; 3], p: DVec2) -> bool {
    let [a, b, c] = corners.map(|corner| corner - p);
    let [u, v, w] = [a, b, c].map(DVec2::length_squared);
    u * b.perp_dot(c) + v * c.perp_dot(a) + w * a.perp_dot(b) > 0.0
}

/// The same triangle from its smallest corner on.
fn first_smallest([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    /// Centre and radius of the circle through three points.
    fn circle([a, b, c]: [DVec2; 3]) -> (DVec2, f64) {
        let (p, q) = (b - a, c - a);
        let offset = (q.perp() * p.length_squared() - p.perp() * q.length_squared()) / (2.0 * q.perp_dot(p));
        (a + offset, offset.length())
    }

    #[test]
    fn every_circle_is_empty_and_the_square_is_covered() {
        let mut rng = Rng::new(4, 0);
        let side = |k: usize| k as f64 / 10.0;
        let mut points: Vec<DVec2> = (0..10)
            .flat_map(|k| {
                [[side(k), 0.0], [1.0, side(k)], [1.0 - side(k), 1.0], [0.0, 1.0 - side(k)]].map(DVec2::from)
            })
            .collect();
        points.extend((0..120).map(|_| DVec2::new(rng.uniform(), rng.uniform())));
        let triangles = delaunay(&points);
        // Euler: V − E + F = 2, with 40 points on the border.
        assert_eq!(triangles.len(), 2 * points.len() - 2 - 40);
        let mut area = 0.0;
        for corners in &triangles {
            let [a, b, c] = corners.map(|v| points[v as usize]);
            let doubled = (b - a).perp_dot(c - a);
            assert!(doubled > 0.0);
            area += doubled / 2.0;
            let (centre, radius) = circle(corners.map(|v| points[v as usize]));
            let inside = |p: &&DVec2| p.distance(centre) < radius * (1.0 - 1e-7);
            assert_eq!(points.iter().filter(inside).count(), 0);
        }
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }

    #[test]
    fn points_on_common_circles_are_triangulated_once() {
        for n in [3, 6, 11] {
            let at = |k: usize| DVec2::new((k % n) as f64, (k / n) as f64) / (n - 1) as f64;
            let points: Vec<DVec2> = (0..n * n).map(at).collect();
            let triangles = delaunay(&points);
            assert_eq!(triangles.len(), 2 * (n - 1) * (n - 1));
            let doubled = triangles.iter().map(|t| t.map(|v| points[v as usize]));
            let doubled: Vec<f64> = doubled.map(|[a, b, c]| (b - a).perp_dot(c - a)).collect();
            assert!(doubled.iter().all(|d| *d > 1e-3), "{doubled:?}");
            assert!((doubled.iter().sum::<f64>() - 2.0).abs() < 1e-12);
        }
    }
}
