//! Primary hits: the points of the cloth that pixels see.

use glam::{DVec2, DVec3};

use super::Geometry;
use super::surface::{SurfacePoint, barycentrics};
use crate::raster::{Rasterizer, Rendering, Texture};
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::vertex_normals;

/// The points that those pixels of `view` see of frame `frame` of `geometry` with vertices at `positions` `[m]`
/// for which `wanted` says so, with their pixel indices, in the order of rows.
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
                turned: rendering.shows_back(pixel),
            },
        ));
    }
    points
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use super::*;
    use tessuto_core::camera::{Camera, Pose};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn a_cloth_moved_with_its_camera_is_seen_at_the_same_points() {
        let camera = Camera { fx: 60.0, fy: 55.0, cx: 23.2, cy: 23.6, width: 48, height: 48 };
        let mut rng = Rng::new(3, 0);
        let mesh = grid(7, 6, DVec2::splat(0.5), 1.0);
        let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p + rng.vector() * 0.02).collect();
        let pose = Pose::random(&mut rng);
        let view = Viewpoint { camera, camera_from_world: Some(pose) };
        let moved: Vec<DVec3> = x.iter().map(|p| pose.in_world(*p)).collect();
        let rasterizer = Rasterizer::new(&mesh);
        let see = |view: Viewpoint, x: &Vec<DVec3>| {
            let geometry = Geometry::seen(&mesh, from_ref(x), &[view]);
            let seen = visible_points(&rasterizer, view, &geometry, 0, x, &mut Rendering::new(), |_, _| true);
            (geometry, seen)
        };
        let ((here, points), (there, points_there)) = (see(camera.into(), &x), see(view, &moved));
        assert!(points.len() > 500 && points.len() == points_there.len());
        let mut worst = 0.0f64;
        for ((pixel, a), (pixel_there, b)) in points.iter().zip(&points_there) {
            assert_eq!((pixel, a.patch), (pixel_there, b.patch));
            let turned = |d: glam::Vec3| pose.rotation * d.as_dvec3();
            for (a, b) in [(a.normal, b.normal), (here.to_viewer(a), there.to_viewer(b))] {
                worst = worst.max(turned(b).distance(a.as_dvec3()));
            }
            worst = worst.max(pose.in_world(a.position.as_dvec3()).distance(b.position.as_dvec3()));
            worst = worst.max(f64::from((a.uv[0] - b.uv[0]).abs().max((a.uv[1] - b.uv[1]).abs())));
        }
        println!("worst difference {worst:.1e}");
        assert!(worst < 1e-5);
    }
}
