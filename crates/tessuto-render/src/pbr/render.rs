//! Images of the cloth under an environment map.

use rayon::prelude::*;

use super::denoise::{Lit, RADIUS, denoise};
use super::shader::{LANES, Numbers};
use super::{EnvironmentSampler, Geometry, Material, RadianceEstimate, Shader, visible_points};
use crate::raster::{Rasterizer, Rendering};
use tessuto_core::camera::Viewpoint;
use tessuto_core::image::Image;
use tessuto_core::image::srgb;
use tessuto_core::math::rng::mix32;
use tessuto_core::mesh::Positions;

/// What an image shows.
#[derive(Debug, Clone, Copy)]
pub struct RenderScene<'a> {
    /// The template's rasteriser.
    pub rasterizer: &'a Rasterizer,
    /// The whole motion.
    pub geometry: &'a Geometry,
    /// Its material.
    pub material: &'a Material,
    /// The light.
    pub light: &'a EnvironmentSampler,
}

/// Draws frame `frame`, whose vertices are at `positions`, as `view`, one that the geometry is seen from, sees it,
/// with `samples_per_pixel` samples, rounded up to a multiple of eight, which neighbouring pixels share (see
/// `denoise.rs`): sRGB in 0…1 on black, shape [height, width, 3].
pub fn render_frame(
    scene: &RenderScene,
    view: impl Into<Viewpoint>,
    (frame, positions): (usize, &Positions),
    samples_per_pixel: usize,
) -> Image {
    let view = view.into();
    let camera = &view.camera;
    let mut rendering = Rendering::new();
    let all = |_: &Rendering, _| true;
    let seen = visible_points(scene.rasterizer, view, scene.geometry, frame, positions, &mut rendering, all);
    let shader = Shader { geometry: scene.geometry, material: scene.material, light: scene.light };
    let seed = mix32(frame as u32 ^ 0x7e55_0170);
    let estimated: Vec<(Lit, [[f32; 3]; 2])> = seen
        .par_iter()
        .with_min_len(256)
        .map_init(RadianceEstimate::default, |estimate, (pixel, point)| {
            let context = shader.shading_context(point);
            let place = [*pixel as usize % camera.width, *pixel as usize / camera.width];
            let numbers = shared_numbers(seed, place, samples_per_pixel);
            shader.estimate_at(&context, point, numbers, samples_per_pixel, estimate);
            let brdf = &context.brdf;
            let lit = Lit {
                from_eye: scene.geometry.offset(point),
                normal: point.normal,
                roughness: brdf.roughness,
                metallic: brdf.metallic,
                parts: estimate.parts(brdf),
            };
            (lit, [brdf.diffuse, brdf.f0])
        })
        .collect();
    let (width, height) = (camera.width, camera.height);
    let mut lit = vec![None; width * height];
    for ((pixel, _), (light, _)) in seen.iter().zip(&estimated) {
        lit[*pixel as usize] = Some(*light);
    }
    let pixel_size = (1.0 / camera.fx.max(camera.fy)) as f32;
    let smooth = denoise(&lit, width, pixel_size, RADIUS);
    let mut linear: Vec<Option<[f32; 3]>> = vec![None; width * height];
    for ((pixel, _), (_, [diffuse, f0])) in seen.iter().zip(&estimated) {
        let [e, s, r] = smooth[*pixel as usize];
        linear[*pixel as usize] = Some(std::array::from_fn(|c| diffuse[c] * e[c] + f0[c] * s[c] + r[c]));
    }
    let mut image = Image::new(width, height, 3);
    for y in 0..height {
        for x in 0..width {
            let coverage = rendering.rgba[y * width + x][3].clamp(0.0, 1.0);
            if coverage == 0.0 {
                continue;
            }
            let near = rendering.covered_near(x, y).and_then(|(x, y)| linear[y * width + x]);
            if let Some(colour) = near {
                let value = colour.map(|l| srgb::encode(l * coverage).clamp(0.0, 1.0));
                image.pixel_mut(x, y).copy_from_slice(&value);
            }
        }
    }
    image
}

/// Pixels along the side of a square that shares its random numbers; a power of two.
const SHARED: usize = 16;

/// Random numbers of the pixel at `[column, row]`: those of a square of pixels follow one another along a Z-curve,
/// so that averages over neighbours are of directions that are spread evenly.
fn shared_numbers(seed: u32, [x, y]: [usize; 2], samples_per_pixel: usize) -> Numbers {
    let square = mix32(seed.wrapping_add((x / SHARED) as u32)).wrapping_add((y / SHARED) as u32);
    let bits = SHARED.ilog2() as usize;
    let place: usize = (0..bits).map(|b| (x >> b & 1) << (2 * b) | (y >> b & 1) << (2 * b + 1)).sum();
    Numbers { key: mix32(square), first: place * samples_per_pixel.div_ceil(LANES) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn every_square_of_pixels_has_a_run_of_numbers_of_its_own() {
        let (width, samples) = (4 * SHARED, 2 * LANES);
        let mut keys: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for i in 0..width * width {
            let numbers = shared_numbers(9, [i % width, i / width], samples);
            keys.entry(numbers.key).or_default().push(numbers.first);
        }
        // Sixteen large squares, each with all of its numbers once.
        assert_eq!(keys.len(), 16);
        for firsts in keys.values_mut() {
            firsts.sort_unstable();
            assert!(firsts.iter().enumerate().all(|(i, first)| *first == 2 * i));
        }
        // So have the small squares within: sixteen pixels, sixteen neighbours of the sequence.
        for corner in [[0, 0], [4, 8], [12, 12]] {
            let inside =
                (0..16).map(|i| shared_numbers(9, [corner[0] + i % 4, corner[1] + i / 4], samples).first);
            let (low, high) = inside.fold((usize::MAX, 0), |(l, h), f| (l.min(f), h.max(f)));
            assert_eq!(high - low, 2 * 15, "{corner:?}");
        }
    }
}
