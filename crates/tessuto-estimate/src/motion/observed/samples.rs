//! Points fixed on the surface, at which frames are compared.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::pyramid::Level;
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::{Mesh, boundary_edges};

/// A point of a triangle.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceSample {
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weights of its corners.
    pub weights: [f64; 3],
    /// Area it stands for in the first frame [px of the level].
    pub area: f64,
}

/// Points about `spacing` pixels apart in the image of the mesh as `view` sees it at `positions`,
/// ordered by triangle: each triangle is cut into k² like parts, with a point in each centre.
pub fn interior_points(
    mesh: &Mesh,
    positions: &[DVec3],
    view: &Viewpoint,
    spacing: f64,
) -> Vec<SurfaceSample> {
    let mut points = Vec::new();
    for (triangle, t) in mesh.triangles().into_iter().enumerate() {
        let [a, b, c] = t.map(|v| view.project(positions[v as usize]));
        let area = 0.5 * (b - a).perp_dot(c - a).abs();
        let k = (area / (spacing * spacing)).sqrt().ceil().clamp(1.0, 64.0) as usize;
        let part = 1.0 / k as f64;
        for i in 0..k {
            for j in 0..k - i {
                let mut push = |s: f64, t: f64| {
                    let weights = [1.0 - s - t, s, t];
                    points.push(SurfaceSample {
                        triangle: triangle as u32,
                        weights,
                        area: area * part * part,
                    });
                };
                push((i as f64 + 1.0 / 3.0) * part, (j as f64 + 1.0 / 3.0) * part);
                if i + j + 1 < k {
                    push((i as f64 + 2.0 / 3.0) * part, (j as f64 + 2.0 / 3.0) * part);
                }
            }
        }
    }
    points
}

/// The surface points of one resolution, by triangle.
#[derive(Debug, Clone)]
pub struct SurfaceSamples {
    /// Triangles of the mesh.
    pub triangles: Vec<[u32; 3]>,
    /// The points, ordered by triangle.
    pub points: Vec<SurfaceSample>,
    /// `points[start[t]..start[t + 1]]` lie on triangle t.
    start: Vec<usize>,
}

impl SurfaceSamples {
    /// Points about `spacing` pixels apart in the image of the mesh as `view` sees it at `positions`.
    pub fn new(mesh: &Mesh, positions: &[DVec3], view: &Viewpoint, spacing: f64) -> Self {
        let triangles = mesh.triangles();
        let points = interior_points(mesh, positions, view, spacing);
        let mut start = vec![0; triangles.len() + 1];
        points.iter().for_each(|p| start[p.triangle as usize + 1] += 1);
        for t in 0..triangles.len() {
            start[t + 1] += start[t];
        }
        Self { triangles, points, start }
    }

    /// Indices of the points of a triangle.
    pub fn of_triangle(&self, triangle: usize) -> std::ops::Range<usize> {
        self.start[triangle]..self.start[triangle + 1]
    }

    /// Where `point` is on the mesh at `x`.
    pub fn position(&self, point: &SurfaceSample, x: &[DVec3]) -> DVec3 {
        let corners = self.triangles[point.triangle as usize].map(|v| x[v as usize]);
        corners.iter().zip(point.weights).map(|(x, w)| *x * w).sum()
    }

    /// What `level` shows at each point of the mesh at `x`; `None` where it shows no fabric, or the point is `hidden`.
    pub fn observe(&self, level: &Level, x: &[DVec3], hidden: &[bool]) -> Vec<Option<[f32; 3]>> {
        let of_point = |(index, point): (usize, &SurfaceSample)| {
            if hidden.get(index) == Some(&true) {
                return None;
            }
            let p = self.position(point, x);
            level.colour(level.view.project_in_front(p)?)
        };
        self.points.par_iter().enumerate().with_min_len(512).map(of_point).collect()
    }
}

/// A point of an edge: (1 − t)·first + t·second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgePoint {
    /// End points of the edge.
    pub vertices: [u32; 2],
    /// The third corner of the edge's triangle, or of one of them.
    pub opposite: u32,
    /// Weights of the end points.
    pub weights: [f64; 2],
    /// Length it stands for `[px]`; of the boundary that in the first frame.
    pub length: f64,
}

impl EdgePoint {
    /// Where it is on the mesh at `x`.
    pub fn position(&self, x: &[DVec3]) -> DVec3 {
        let [a, b] = self.vertices.map(|v| x[v as usize]);
        a * self.weights[0] + b * self.weights[1]
    }
}

/// Points about `spacing` pixels apart along the edges that belong to one polygon only, as `view` sees it at
/// `positions`.
pub fn boundary_points(mesh: &Mesh, positions: &[DVec3], view: &Viewpoint, spacing: f64) -> Vec<EdgePoint> {
    let mut points = Vec::new();
    let with_opposite = |[a, b, c]: [u32; 3]| ([a.min(b), a.max(b)], c);
    let opposites: HashMap<[u32; 2], u32> = mesh
        .triangles()
        .into_iter()
        .flat_map(|[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].map(with_opposite))
        .collect();
    for vertices in boundary_edges(mesh) {
        let opposite = opposites[&vertices];
        let [a, b] = vertices.map(|v| view.project(positions[v as usize]));
        let n = ((b - a).length() / spacing).ceil().max(1.0);
        for k in 0..n as usize {
            let t = (k as f64 + 0.5) / n;
            points.push(EdgePoint {
                vertices,
                opposite,
                weights: [1.0 - t, t],
                length: (b - a).length() / n,
            });
        }
    }
    points
}

/// The triangle of each point of a boundary.
pub fn border_triangles(triangles: &[[u32; 3]], boundary: &[EdgePoint]) -> Vec<u32> {
    let sorted = |mut corners: [u32; 3]| {
        corners.sort_unstable();
        corners
    };
    let of: HashMap<[u32; 3], u32> =
        triangles.iter().enumerate().map(|(t, corners)| (sorted(*corners), t as u32)).collect();
    boundary.iter().map(|point| of[&sorted([point.vertices[0], point.vertices[1], point.opposite])]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::camera::Camera;

    #[test]
    fn points_share_out_the_area_and_the_boundary() {
        let mesh = tessuto_core::mesh::grid(4, 3, DVec2::new(0.3, 0.2), 1.0);
        let camera = Camera { fx: 200.0, fy: 200.0, cx: 50.0, cy: 50.0, width: 100, height: 100 };
        let view = Viewpoint::from(camera);
        let points = interior_points(&mesh, &mesh.positions, &view, 2.0);
        let area: f64 = points.iter().map(|p| p.area).sum();
        assert!((area - 60.0 * 40.0).abs() < 1e-9, "{area}");
        assert!((500..1000).contains(&points.len()), "{}", points.len());
        assert!(points.iter().all(|p| p.weights.iter().all(|w| *w > 0.0)));
        let edge: f64 = boundary_points(&mesh, &mesh.positions, &view, 3.0).iter().map(|p| p.length).sum();
        assert!((edge - 200.0).abs() < 1e-9, "{edge}");
    }
}
