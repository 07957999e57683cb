//! The frames as the estimate explains them.

use rayon::prelude::*;

use super::Appearance;
use crate::image::Image;
use crate::math::rng::mix32;
use crate::pbr::{Estimate, Geometry, Light, Point, Shader, see, srgb};
use crate::raster::{Rasterizer, Rendering};
use crate::scene::{Scene, Shape};

/// A frame drawn again.
#[derive(Debug, Clone)]
pub struct Rerendered {
    /// sRGB colour on black, the size of the full frame, shape [height, width, 3].
    pub rgb: Image,
    /// Peak signal-to-noise ratio [dB] against the video where its mask is above one half, inside the crop.
    pub psnr: f64,
}

/// Draws frame `frame` with `passes` passes of eight samples per pixel.
pub fn rerender(
    scene: &Scene,
    rasterizer: &Rasterizer,
    geometry: &Geometry,
    (frame, shape): (usize, &Shape),
    appearance: &Appearance,
    passes: usize,
) -> Rerendered {
    let mut rendering = Rendering::new();
    let seen = see(rasterizer, &scene.camera, geometry, frame, shape, &mut rendering);
    let light = Light::new(&appearance.environment, 0.05);
    let shader = Shader { geometry, material: &appearance.material, light: &light };
    let seed = mix32(frame as u32 ^ 0x7e55_0170);
    let colours: Vec<[f32; 3]> = seen
        .par_iter()
        .with_min_len(256)
        .map_init(Estimate::default, |estimate, (pixel, point)| {
            let point = Point { uv: appearance.window.inside(point.uv), ..*point };
            shader.estimate(&point, mix32(seed.wrapping_add(*pixel)), passes, estimate);
            estimate.colour
        })
        .collect();
    let (width, height) = (scene.camera.width, scene.camera.height);
    let mut linear: Vec<Option<[f32; 3]>> = vec![None; width * height];
    for ((pixel, _), colour) in seen.iter().zip(colours) {
        linear[*pixel as usize] = Some(colour);
    }
    let [full_width, full_height] = scene.full_size;
    let mut rgb = Image::new(full_width, full_height, 3);
    let observed = &scene.frames[frame];
    let (mut squares, mut count) = (0.0, 0);
    for y in 0..height {
        for x in 0..width {
            let coverage = rendering.rgba[y * width + x][3].clamp(0.0, 1.0);
            let candidates = [(x, y), (x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            // A pixel whose centre just misses the cloth has a neighbour's colour.
            let near = candidates
                .into_iter()
                .filter(|&(x, y)| x < width && y < height)
                .find_map(|(x, y)| linear[y * width + x]);
            let value = match near {
                Some(colour) if coverage > 0.0 => colour.map(|l| srgb::encode(l * coverage).clamp(0.0, 1.0)),
                _ => [0.0; 3],
            };
            rgb.pixel_mut(x + scene.crop.x0, y + scene.crop.y0).copy_from_slice(&value);
            if observed.mask.pixel(x, y)[0] > 0.5 {
                let differences = value.iter().zip(observed.rgb.pixel(x, y));
                squares += differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
                count += 3;
            }
        }
    }
    let psnr = -10.0 * (squares / f64::from(count.max(1))).max(1e-12).log10();
    Rerendered { rgb, psnr }
}
