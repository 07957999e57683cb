//! Images of the cloth under an environment map.

use rayon::prelude::*;

use super::denoise::{Lit, RADIUS, denoise};
use super::{EnvironmentSampler, Geometry, Material, RadianceEstimate, Shader, visible_points};
use crate::camera::Camera;
use crate::image::Image;
use crate::image::srgb;
use crate::math::rng::mix32;
use crate::mesh::Positions;
use crate::raster::{Rasterizer, Rendering};

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

/// Draws frame `frame`, whose vertices are at `positions`, as `camera` sees it from the origin, with `samples_per_pixel` samples,
/// rounded up to a multiple of eight, which neighbouring pixels share (see `denoise.rs`): sRGB in 0…1 on black, shape [height, width, 3].
pub fn render_frame(
    scene: &RenderScene,
    camera: &Camera,
    (frame, positions): (usize, &Positions),
    samples_per_pixel: usize,
) -> Image {
    let mut rendering = Rendering::new();
    let seen =
        visible_points(scene.rasterizer, camera, scene.geometry, frame, positions, &mut rendering, |_, _| {
            true
        });
    let shader = Shader { geometry: scene.geometry, material: scene.material, light: scene.light };
    let seed = mix32(frame as u32 ^ 0x7e55_0170);
    let estimated: Vec<(Lit, [[f32; 3]; 2])> = seen
        .par_iter()
        .with_min_len(256)
        .map_init(RadianceEstimate::default, |estimate, (pixel, point)| {
            let context = shader.shading_context(point);
            shader.estimate_at(
                &context,
                point,
                mix32(seed.wrapping_add(*pixel)),
                samples_per_pixel,
                estimate,
            );
            let brdf = &context.brdf;
            let lit = Lit {
                position: point.position,
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
