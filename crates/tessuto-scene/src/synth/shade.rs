//! Soft shading of a rendered cloth, so that folds show as in a photograph.

use glam::{DVec2, DVec3};

use tessuto_core::camera::Viewpoint;
use tessuto_core::image::Image;
use tessuto_core::mesh::vertex_normals;
use tessuto_render::pbr::barycentrics;
use tessuto_render::raster::{Rasterizer, Rendering};

/// From the cloth to the light: above the camera, to its left.
const LIGHT: DVec3 = DVec3::new(-0.45, -0.55, -0.70);

/// Colour and coverage of `rendering` with the colour darkened by up to `shading` where the cloth turns
/// away from the light.
pub fn shaded(
    rasterizer: &Rasterizer,
    view: &Viewpoint,
    positions: &[DVec3],
    shading: f64,
    rendering: &Rendering,
) -> [Image; 2] {
    let normals = vertex_normals(rasterizer.triangles(), positions);
    let (width, height) = (rendering.width, rendering.height);
    let mut rgb = Image::new(width, height, 3);
    let mut mask = Image::new(width, height, 1);
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let [r, g, b, a] = rendering.rgba[i];
            mask.data[i] = a;
            if a == 0.0 {
                continue;
            }
            let light = rendering.covered_near(x, y).map_or(1.0, |(x, y)| {
                let corners = rasterizer.triangles()[rendering.triangle[y * width + x] as usize];
                let ray = view.camera.ray(DVec2::new(x as f64, y as f64));
                let seen = corners.map(|v| view.in_camera(positions[v as usize]));
                let weights = barycentrics(seen, ray);
                let n: DVec3 = (0..3).map(|k| normals[corners[k] as usize] * weights[k]).sum();
                n.normalize_or_zero().dot(LIGHT.normalize()).abs()
            });
            let gain = (1.0 - shading * (1.0 - light)) as f32;
            rgb.pixel_mut(x, y).copy_from_slice(&[gain * r, gain * g, gain * b]);
        }
    }
    [rgb, mask]
}
