//! Ways to draw a frame that need no material: its print, its shape, its depth.

use glam::DVec3;

use crate::camera::Camera;
use crate::image::Image;
use crate::image::srgb;
use crate::mesh::Positions;
use crate::pbr::{Geometry, visible_points};
use crate::raster::{Rasterizer, Rendering, Texture};
use crate::report::colour::sequential;

/// Share of light that reaches a surface seen edge-on.
const AMBIENT: f32 = 0.2;
/// Linear grey of the plain surface.
const GREY: f32 = 0.6;

/// The print as it was seen in the first frame, without any new light: sRGB on black.
pub fn draw_texture(rasterizer: &Rasterizer, camera: &Camera, shape: &Positions, texture: &Texture) -> Image {
    let mut rendering = Rendering::new();
    rasterizer.render(camera, shape, texture, &mut rendering);
    let data = rendering.rgba.iter().flat_map(|c| [c[0], c[1], c[2]]).map(|c| c.clamp(0.0, 1.0)).collect();
    Image { width: camera.width, height: camera.height, channels: 3, data }
}

/// A plain grey surface lit from the camera: sRGB on black.
pub fn draw_shaded(
    rasterizer: &Rasterizer,
    camera: &Camera,
    geometry: &Geometry,
    (frame, shape): (usize, &Positions),
) -> Image {
    let mut rendering = Rendering::new();
    let mut picture = Image::new(camera.width, camera.height, 3);
    for (pixel, point) in
        visible_points(rasterizer, camera, geometry, frame, shape, &mut rendering, |_, _| true)
    {
        let facing = point.normal.dot(-point.position.normalize()).max(0.0);
        let coverage = rendering.rgba[pixel as usize][3].clamp(0.0, 1.0);
        let value = srgb::encode(GREY * (AMBIENT + (1.0 - AMBIENT) * facing) * coverage);
        picture.data[3 * pixel as usize..][..3].fill(value);
    }
    picture
}

/// Depth as a colour, the nearest of `range` `[m]` dark and the farthest bright, on black.
pub fn draw_depth(rasterizer: &Rasterizer, camera: &Camera, shape: &Positions, range: [f64; 2]) -> Image {
    let mut rendering = Rendering::new();
    rasterizer.render(camera, shape, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
    let mut picture = Image::new(camera.width, camera.height, 3);
    for y in 0..camera.height {
        for x in 0..camera.width {
            if let Some(z) = rendering.depth(x, y) {
                let share = (z - range[0]) / (range[1] - range[0]).max(1e-9);
                let colour = sequential(share.clamp(0.0, 1.0) as f32);
                picture.pixel_mut(x, y).copy_from_slice(&colour);
            }
        }
    }
    picture
}

/// Least and largest z over all `shapes` `[m]`.
pub fn depth_range(shapes: &[Positions]) -> [f64; 2] {
    let z = || shapes.iter().flatten().map(|x: &DVec3| x.z);
    [z().fold(f64::INFINITY, f64::min), z().fold(f64::NEG_INFINITY, f64::max)]
}
