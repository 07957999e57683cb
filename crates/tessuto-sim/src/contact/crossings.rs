//! Where a sheet passes through itself: edges that go through triangles.

use glam::DVec3;

use super::candidates::{Bounds, meetings};

/// The vertices of edges that pass through a triangle, and of the triangles, ascending; `positions` `[V]` m. An edge
/// that shares a corner with a triangle does not pass through it.
pub fn crossed_vertices(triangles: &[[u32; 3]], positions: &[DVec3]) -> Vec<u32> {
    let boxes: Vec<Bounds> = positions.iter().map(|x| Bounds::of(*x, *x)).collect();
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [*a.min(b), *a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    let of_edges: Vec<Bounds> = edges.iter().map(|e| Bounds::around(&boxes, e)).collect();
    let of_triangles: Vec<Bounds> = triangles.iter().map(|t| Bounds::around(&boxes, t)).collect();
    let at = |k: u32| positions[k as usize];
    let mut crossed: Vec<u32> = Vec::new();
    for [e, t] in meetings(&of_edges, &of_triangles) {
        let (edge, triangle) = (edges[e as usize], triangles[t as usize]);
        let shares = edge.iter().any(|k| triangle.contains(k));
        if !shares && passes(edge.map(at), triangle.map(at)) {
            crossed.extend(edge.iter().chain(&triangle));
        }
    }
    crossed.sort_unstable();
    crossed.dedup();
    crossed
}

/// Whether the edge goes through the triangle.
fn passes([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let sides = [volume(a, b, c, p), volume(a, b, c, q)];
    if sides[0] * sides[1] >= 0.0 {
        return false;
    }
    let around = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
    around.iter().all(|v| *v > 0.0) || around.iter().all(|v| *v < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn a_sheet_pushed_through_itself_is_found_and_a_folded_one_is_not() {
        let mesh = tessuto_core::mesh::grid(11, 11, DVec2::splat(0.1), 1.0);
        let triangles = mesh.triangles();
        assert!(crossed_vertices(&triangles, &mesh.positions).is_empty());
        // Its right half turned over to the left and above it; with a slope its rim comes out below.
        let folded = |slope: f64| -> Vec<DVec3> {
            let of = |x: &DVec3| match x.x {
                ..=0.001 => *x,
                out => DVec3::new(-out, x.y + 0.003, x.z - 0.01 + slope * out),
            };
            mesh.positions.iter().map(of).collect()
        };
        assert!(crossed_vertices(&triangles, &folded(0.0)).is_empty());
        let crossed = crossed_vertices(&triangles, &folded(0.3));
        println!("{} vertices", crossed.len());
        assert!(crossed.len() > 10 && crossed.len() < 100);
    }
}
