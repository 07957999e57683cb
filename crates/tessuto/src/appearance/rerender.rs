//! Frames re-rendered from the estimate.

use crate::error::Result;
use crate::image::Image;
use crate::mesh::Positions;
use crate::metrics::masked_psnr;
use crate::pbr::{EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame};
use crate::raster::Rasterizer;
use crate::scene::Scene;

/// A re-rendered frame.
#[derive(Debug, Clone)]
pub struct Rerendered {
    /// sRGB colour on black, the size of the full frame, shape [height, width, 3].
    pub rgb: Image,
    /// |drawn − video| inside the mask, four times as bright, shape [crop height, crop width, 3].
    pub difference: Image,
    /// Peak signal-to-noise ratio `[dB]` against the video where its mask is above one half, inside the crop.
    pub psnr: f64,
}

/// Draws frame `frame` with the maps on all of uv space, the light, and `samples_per_pixel` samples.
///
/// # Errors
/// Those of reading the frame.
pub fn rerender(
    scene: &Scene,
    rasterizer: &Rasterizer,
    geometry: &Geometry,
    (frame, positions): (usize, &Positions),
    (maps, environment): (&Material, &EnvironmentMap),
    samples_per_pixel: usize,
) -> Result<Rerendered> {
    let light = &EnvironmentSampler::new(environment, 0.05);
    let cloth = RenderScene { rasterizer, geometry, material: maps, light };
    let drawn = render_frame(&cloth, &scene.camera, (frame, positions), samples_per_pixel);
    let [full_width, full_height] = scene.full_size;
    let mut rgb = Image::new(full_width, full_height, 3);
    let observed = scene.frames.frame(frame)?;
    let mut difference = Image::new(drawn.width, drawn.height, 3);
    let covered: Vec<bool> = observed.mask.data.iter().map(|m| *m > 0.5).collect();
    for y in 0..drawn.height {
        for x in 0..drawn.width {
            let value = drawn.pixel(x, y);
            rgb.pixel_mut(x + scene.crop.x0, y + scene.crop.y0).copy_from_slice(value);
            if covered[y * drawn.width + x] {
                let pairs = value.iter().zip(observed.rgb.pixel(x, y));
                for ((a, b), shown) in pairs.zip(difference.pixel_mut(x, y)) {
                    *shown = (4.0 * (a - b).abs()).min(1.0);
                }
            }
        }
    }
    // Without a pixel nothing differs.
    let psnr = masked_psnr(&drawn, &observed.rgb, &covered).unwrap_or(120.0);
    Ok(Rerendered { rgb, difference, psnr })
}
