//! What the pixels see: points on the cloth.

use glam::{DVec2, DVec3, Vec3};

use super::Geometry;
use crate::camera::Camera;
use crate::raster::{Rasterizer, Rendering, Texture};

/// A point of the cloth as a pixel sees it.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// Position `[m]`, camera frame.
    pub position: Vec3,
    /// Shading normal: the vertices' normals interpolated, on the side that the camera sees, unit.
    pub normal: Vec3,
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Frame · number of triangles + triangle.
    pub patch: u32,
}

/// The points that those pixels of `camera` see of frame `frame` of `geometry` with vertices at `shape` `[m]` for which
/// `wanted` says so, with their pixel indices, in the order of rows.
pub fn visible_points(
    rasterizer: &Rasterizer,
    camera: &Camera,
    geometry: &Geometry,
    frame: usize,
    shape: &[DVec3],
    rendering: &mut Rendering,
    mut wanted: impl FnMut(&Rendering, usize) -> bool,
) -> Vec<(u32, SurfacePoint)> {
    rasterizer.render(camera, shape, &Texture::uniform(1, 1, [0.0; 3]), rendering);
    let normals = vertex_normals(rasterizer.triangles(), shape);
    let first = frame * rasterizer.triangles().len();
    let mut points = Vec::new();
    for (pixel, &t) in rendering.triangle.iter().enumerate() {
        if t == Rendering::NO_TRIANGLE || !wanted(rendering, pixel) {
            continue;
        }
        let t = t as usize;
        let corners = rasterizer.triangles()[t];
        let (column, row) = (pixel % camera.width, pixel / camera.width);
        let ray = camera.ray(DVec2::new(column as f64, row as f64));
        let weights = barycentrics(corners.map(|v| shape[v as usize]), ray);
        let at = |k: usize| weights[k];
        let position: DVec3 = (0..3).map(|k| shape[corners[k] as usize] * at(k)).sum();
        let uvs = rasterizer.triangle_uvs()[t];
        let uv: DVec2 = (0..3).map(|k| rasterizer.uvs()[uvs[k] as usize] * at(k)).sum();
        let patch = first + t;
        let facing = geometry.normal(patch).as_dvec3();
        let normal: DVec3 = (0..3).map(|k| normals[corners[k] as usize] * at(k)).sum();
        let normal = normal.normalize_or(facing);
        let normal = if normal.dot(facing) < 0.0 { -normal } else { normal };
        points.push((
            pixel as u32,
            SurfacePoint {
                position: position.as_vec3(),
                normal: normal.as_vec3(),
                uv: uv.as_vec2().to_array(),
                patch: patch as u32,
            },
        ));
    }
    points
}

/// Unit normals of the vertices: sums over their triangles, weighted by area.
pub(super) fn vertex_normals(triangles: &[[u32; 3]], shape: &[DVec3]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; shape.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| shape[v as usize]);
        t.iter().for_each(|v| normals[*v as usize] += (b - a).cross(c - a));
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

/// Weights of a triangle's corners where the ray from the camera along `ray` meets its plane.
fn barycentrics([a, b, c]: [DVec3; 3], ray: DVec3) -> [f64; 3] {
    let weights = [ray.dot(b.cross(c)), ray.dot(c.cross(a)), ray.dot(a.cross(b))];
    weights.map(|w| w / weights.iter().sum::<f64>())
}
