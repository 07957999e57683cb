//! Primary hits: the points of the cloth that pixels see.

use glam::{DVec2, DVec3};

use super::Geometry;
use super::surface::{SurfacePoint, barycentrics};
use crate::camera::Viewpoint;
use crate::mesh::vertex_normals;
use crate::raster::{Rasterizer, Rendering, Texture};

/// The points that those pixels of `view` see of frame `frame` of `geometry` with vertices at `positions` `[m]` for which
/// `wanted` says so, with their pixel indices, in the order of rows.
pub fn visible_points(
    rasterizer: &Rasterizer,
    view: impl Into<Viewpoint>,
    geometry: &Geometry,
    frame: usize,
    positions: &[DVec3],
    rendering: &mut Rendering,
    mut wanted: impl FnMut(&Rendering, usize) -> bool,
) -> Vec<(u32, SurfacePoint)> {
    let view = view.into();
    let camera = &view.camera;
    rasterizer.render(view, positions, &Texture::uniform(1, 1, [0.0; 3]), rendering);
    let normals = vertex_normals(rasterizer.triangles(), positions);
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
        let weights = barycentrics(corners.map(|v| view.in_camera(positions[v as usize])), ray);
        let at = |k: usize| weights[k];
        let position: DVec3 = (0..3).map(|k| positions[corners[k] as usize] * at(k)).sum();
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
