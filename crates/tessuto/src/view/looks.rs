//! Ways to draw a frame that need no material: texture, plain shading, depth.

use glam::DVec3;

use crate::report::colour::sequential;
use tessuto_core::camera::Camera;
use tessuto_core::image::Image;
use tessuto_core::image::srgb;
use tessuto_core::mesh::Positions;
use tessuto_render::pbr::{Geometry, visible_points};
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// Fraction of light that reaches a surface seen edge-on.
const AMBIENT: f32 = 0.2;
/// Linear grey of the plain surface.
const GREY: f32 = 0.6;

/// The texture as it was seen in the first frame, without any new light: sRGB on black.
pub(crate) fn draw_texture(
    rasterizer: &Rasterizer,
    camera: &Camera,
    positions: &Positions,
    texture: &Texture,
) -> Image {
    let mut rendering = Rendering::new();
    rasterizer.render(camera, positions, texture, &mut rendering);
    let data = rendering.rgba.iter().flat_map(|c| [c[0], c[1], c[2]]).map(|c| c.clamp(0.0, 1.0)).collect();
    Image { width: camera.width, height: camera.height, channels: 3, data }
}

/// A plain grey surface lit from the camera: sRGB on black.
pub(crate) fn draw_shaded(
    rasterizer: &Rasterizer,
    camera: &Camera,
    geometry: &Geometry,
    (frame, positions): (usize, &Positions),
) -> Image {
    let mut rendering = Rendering::new();
    let mut image = Image::new(camera.width, camera.height, 3);
    for (pixel, point) in
        visible_points(rasterizer, camera, geometry, frame, positions, &mut rendering, |_, _| true)
    {
        let facing = point.normal.dot(geometry.to_viewer(&point)).max(0.0);
        let coverage = rendering.rgba[pixel as usize][3].clamp(0.0, 1.0);
        let value = srgb::encode(GREY * (AMBIENT + (1.0 - AMBIENT) * facing) * coverage);
        image.data[3 * pixel as usize..][..3].fill(value);
    }
    image
}

/// Depth as a colour, the nearest of `range` `[m]` dark and the farthest bright, on black.
pub(crate) fn draw_depth(
    rasterizer: &Rasterizer,
    camera: &Camera,
    positions: &Positions,
    range: [f64; 2],
) -> Image {
    let mut rendering = Rendering::new();
    rasterizer.render(camera, positions, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
    let mut image = Image::new(camera.width, camera.height, 3);
    for y in 0..camera.height {
        for x in 0..camera.width {
            if let Some(z) = rendering.depth(x, y) {
                let fraction = (z - range[0]) / (range[1] - range[0]).max(1e-9);
                let colour = sequential(fraction.clamp(0.0, 1.0) as f32);
                image.pixel_mut(x, y).copy_from_slice(&colour);
            }
        }
    }
    image
}

/// Least and largest z over all `shapes` `[m]`.
pub(crate) fn depth_range(motion: &[Positions]) -> [f64; 2] {
    let z = || motion.iter().flatten().map(|x: &DVec3| x.z);
    [z().fold(f64::INFINITY, f64::min), z().fold(f64::NEG_INFINITY, f64::max)]
}
