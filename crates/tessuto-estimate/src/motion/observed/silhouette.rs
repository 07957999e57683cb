//! Outlines of the sheet in the image: its border, and folds where it turns away from the camera.
//!
//! A mask's outline is explained once. Where a fold of the sheet lies on it, a border that is nearby may as well
//! lie behind, and is free to; a border in front of more of the sheet is no outline either.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::outline_distance::OutlineDistance;
use super::samples::EdgePoint;
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::Mesh;
use tessuto_sim::Cloth;

/// Beyond a point of an outline by this many pixels nothing of the sheet is seen.
const BEYOND: f64 = 1.5;
/// Distance between the points of folds `[px]`.
const SPACING: f64 = 2.0;

/// An edge of two triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnerEdge {
    /// End points.
    pub vertices: [u32; 2],
    /// The third corner of either triangle.
    pub opposite: [u32; 2],
    /// The end points' pair in the pattern of the cloth's systems.
    pub pair: usize,
}

/// The edges of `mesh` that two triangles share, whatever polygons these are of; in the order of the triangles.
pub fn inner_edges(mesh: &Mesh, cloth: &Cloth) -> Vec<InnerEdge> {
    let mut first: HashMap<[u32; 2], u32> = HashMap::new();
    let mut out = Vec::new();
    for ([a, b, c], [ba, ca, cb]) in mesh.triangles().into_iter().zip(&cloth.triangle_pairs) {
        for ([v, w], opposite, pair) in [([a, b], c, ba), ([a, c], b, ca), ([b, c], a, cb)] {
            let vertices = [v.min(w), v.max(w)];
            match first.remove(&vertices) {
                Some(other) => out.push(InnerEdge { vertices, opposite: [other, opposite], pair: *pair }),
                None => {
                    first.insert(vertices, opposite);
                }
            }
        }
    }
    out
}

/// A point of a fold that is an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoldPoint {
    /// The point.
    pub point: EdgePoint,
    /// Its end points' pair in the pattern of the cloth's systems.
    pub pair: usize,
}

/// The points, about two pixels apart, of those `edges` of the mesh at `x` where both triangles lie on the same
/// side in the image of `view`, and beyond which it is not `seen`. None of a mesh that comes up to the camera.
pub fn folds(
    edges: &[InnerEdge],
    view: &Viewpoint,
    x: &[DVec3],
    seen: impl Fn(DVec2) -> bool,
) -> Vec<FoldPoint> {
    if x.iter().any(|p| view.depth(*p) <= 0.0) {
        return Vec::new();
    }
    let mut out = Vec::new();
    for InnerEdge { vertices, opposite, pair } in edges {
        let [a, b] = vertices.map(|v| view.project(x[v as usize]));
        let normal = (b - a).perp();
        let [first, second] = opposite.map(|v| normal.dot(view.project(x[v as usize]) - a));
        if first * second <= 0.0 {
            continue;
        }
        let count = (a.distance(b) / SPACING).ceil().max(1.0);
        for k in 0..count as usize {
            let t = (k as f64 + 0.5) / count;
            let point = EdgePoint {
                vertices: *vertices,
                opposite: opposite[0],
                weights: [1.0 - t, t],
                length: a.distance(b) / count,
            };
            if !seen(beyond(&point, view, x)) {
                out.push(FoldPoint { point, pair: *pair });
            }
        }
    }
    out
}

/// Whether each point of the `boundary` of the mesh at `x` is no outline in the image of `view`: if beyond it more
/// of the sheet is `seen`.
pub fn inner(
    boundary: &[EdgePoint],
    view: &Viewpoint,
    x: &[DVec3],
    seen: impl Fn(DVec2) -> bool,
) -> Vec<bool> {
    boundary.iter().map(|point| seen(beyond(point, view, x))).collect()
}

/// Sets `inner` where a point of the `boundary` lies in the mask whose outline has this `distance`, as `view` sees
/// it, and one of the `folds` is nearer to the place of that outline which is nearest to the point.
pub fn explained_by(
    folds: &[FoldPoint],
    boundary: &[EdgePoint],
    distance: &OutlineDistance,
    view: &Viewpoint,
    x: &[DVec3],
    inner: &mut [bool],
) {
    let folds: Vec<DVec2> = folds.iter().map(|fold| view.project(fold.point.position(x))).collect();
    for (point, inner) in boundary.iter().zip(inner) {
        let p = point.position(x);
        if *inner || view.depth(p) <= 0.0 {
            continue;
        }
        let p = view.project(p);
        if let Some((d, slope)) = distance.sample(p).filter(|(d, _)| *d > 0.0) {
            let outline = p - slope.normalize_or_zero() * d;
            *inner = folds.iter().any(|fold| fold.distance_squared(outline) < d * d);
        }
    }
}

/// The place beyond `point`, away from its triangle.
pub(super) fn beyond(point: &EdgePoint, view: &Viewpoint, x: &[DVec3]) -> DVec2 {
    let [a, b] = point.vertices.map(|v| view.project(x[v as usize]));
    let normal = (b - a).perp().normalize_or_zero();
    let away = if normal.dot(view.project(x[point.opposite as usize]) - a) > 0.0 { -normal } else { normal };
    a * point.weights[0] + b * point.weights[1] + away * BEYOND
}
