//! Frames re-rendered from the estimate.
//!
//! The cloth is drawn on black, except at the pixels that its outline crosses: what the cloth leaves of them shows
//! what the video shows beside the cloth, as it does in the camera.

use crate::metrics::masked_psnr;
use tessuto_core::error::Result;
use tessuto_core::image::{Image, srgb};
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_render::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame,
};
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// A re-rendered frame.
#[derive(Debug, Clone)]
pub struct Rerendered {
    /// sRGB colour on black, outlines on the video, the size of the full frame, shape [height, width, 3].
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
    let mut drawn = render_frame(&cloth, scene.viewpoint(frame), (frame, positions), samples_per_pixel);
    let [full_width, full_height] = scene.full_size;
    let mut rgb = Image::new(full_width, full_height, 3);
    let observed = scene.frames.frame(frame)?;
    let mut rendering = Rendering::new();
    rasterizer.render(scene.viewpoint(frame), positions, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
    let coverage: Vec<f32> = rendering.rgba.iter().map(|c| c[3].clamp(0.0, 1.0)).collect();
    fill_outline(&mut drawn, &coverage, &observed.rgb);
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

/// Pixels around one on the outline that may show what lies behind: those of the square of this radius.
const BESIDE: usize = 2;

/// Adds to the pixels of `drawn` that are covered in part, their fraction of what `video` shows in pixels nearby
/// that are not covered at all, in linear light.
fn fill_outline(drawn: &mut Image, coverage: &[f32], video: &Image) {
    let (width, height) = (drawn.width, drawn.height);
    for y in 0..height {
        for x in 0..width {
            let covered = coverage[y * width + x];
            if covered <= 0.0 || covered >= 1.0 {
                continue;
            }
            let (mut sum, mut count) = ([0.0; 3], 0.0);
            for row in y.saturating_sub(BESIDE)..(y + BESIDE + 1).min(height) {
                for column in x.saturating_sub(BESIDE)..(x + BESIDE + 1).min(width) {
                    if coverage[row * width + column] <= 0.0 {
                        let beside = video.pixel(column, row);
                        (0..3).for_each(|c| sum[c] += srgb::decode(beside[c]));
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 {
                for (value, behind) in drawn.pixel_mut(x, y).iter_mut().zip(sum) {
                    let linear = srgb::decode(*value) + (1.0 - covered) * behind / count;
                    *value = srgb::encode(linear).clamp(0.0, 1.0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_show_what_the_video_shows_beside_the_cloth() {
        // White cloth at the left that covers a quarter of the third column, in front of a green wall.
        let (width, height) = (6, 5);
        let coverage: Vec<f32> =
            (0..width * height).map(|i| [1.0, 1.0, 0.25, 0.0, 0.0, 0.0][i % width]).collect();
        let mut drawn = Image::new(width, height, 3);
        let mut video = Image::new(width, height, 3);
        for (i, covered) in coverage.iter().enumerate() {
            drawn.data[3 * i..3 * i + 3].fill(srgb::encode(*covered));
            let wall = [0.2, 0.6, 0.3].map(srgb::encode);
            let seen = if *covered > 0.0 { [0.5; 3] } else { wall };
            video.data[3 * i..3 * i + 3].copy_from_slice(&seen);
        }
        let before = drawn.clone();
        fill_outline(&mut drawn, &coverage, &video);
        for x in [0, 1, 3, 4, 5] {
            assert_eq!(drawn.pixel(x, 2), before.pixel(x, 2));
        }
        let expected = [0.2, 0.6, 0.3].map(|wall| srgb::encode(0.25 + 0.75 * wall));
        let off = drawn.pixel(2, 2).iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{:?} {expected:?}", drawn.pixel(2, 2));
    }
}
