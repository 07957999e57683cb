//! The diffuse map's last word: all pixels at once.
//!
//! The steps of [`fit`](super::fit()) see a few of the pixels each and draw neighbouring texels to each other,
//! which leaves the print a little blurred. Once light and surface are found, every pixel's linear colour is b + a
//! x in the diffuse map's value x that it shows, and least squares over all pixels finish the map: min Σ w (c − b
//! − a x)² + ‖x − x₀‖² for the video's colours c, by passes of simultaneous projections (SIRT; Gregor and Benson
//! 2008, "Computational Analysis and Improvement of SIRT"), the first few of which follow the print and not yet
//! the noise. Weights w turn errors into those of sRGB colours and trust patches as the steps did.
//!
//! a and b are known with the noise of rendering alone. Products of the same estimate would take that for contrast
//! and darken the map, so both factors of every product come from estimates of their own.

use super::loss::SATURATED;
use super::observations::Observations;
use super::patch_weights::PatchWeights;
use super::texels::LIMITS;
use tessuto_core::image::srgb;
use tessuto_render::pbr::{Footprint, Material, Shader, SurfacePoint, radiance_by_diffuse};

/// Points whose light is estimated at once.
const TOGETHER: usize = 1 << 18;
/// Weight of the map that is there, in pixels.
const PRIOR: f32 = 1.0;

/// What a pixel says of the texels that it shows, each channel by its own.
struct Equation {
    uv: [f32; 2],
    /// w a (c − b − a x).
    pull: [f32; 3],
    /// w a².
    square: [f32; 3],
}

/// The diffuse planes [3, size, size] of the shader's material after `passes` over the pixels `seen`, whose light
/// is estimated twice with `samples_per_pixel` samples.
pub(super) fn sharpen(
    shader: &Shader,
    seen: &Observations,
    patch_weights: &PatchWeights,
    (passes, samples_per_pixel, seed): (usize, usize, u32),
) -> Vec<f32> {
    let material = shader.material;
    let mut equations = Vec::with_capacity(seen.points.len());
    for (points, colours) in seen.points.chunks(TOGETHER).zip(seen.colours.chunks(TOGETHER)) {
        let [first, second] = [0, 1].map(|k| {
            let seed = seed.wrapping_add(2 * equations.len() as u32 + k);
            radiance_by_diffuse(shader, points, seed, samples_per_pixel)
        });
        for (((point, colour), a), b) in points.iter().zip(colours).zip(first).zip(second) {
            let weight = patch_weights.weight(point.patch);
            equations.push(Equation::new(shader, point, weight, *colour, [a, b]));
        }
    }
    solve(material, &mut equations, passes)
}

impl Equation {
    /// Of two estimates, colour and its derivative, of the `point` that has the sRGB colour `observed`.
    fn new(
        shader: &Shader,
        point: &SurfacePoint,
        weight: f32,
        observed: [f32; 3],
        estimates: [[[f32; 3]; 2]; 2],
    ) -> Self {
        let cosine = point.normal.dot(shader.geometry.to_viewer(point));
        // What metal shows is the light: its texels stay what the steps made of them together.
        let paint = 1.0 - shader.material.sample(point.uv)[4];
        let weight = weight * (cosine * paint).powi(2);
        let mut equation = Self { uv: point.uv, pull: [0.0; 3], square: [0.0; 3] };
        for c in 0..3 {
            let [first, second] = estimates.map(|[colour, slope]| (colour[c], slope[c]));
            let (linear, drawn) = (srgb::decode(observed[c]), 0.5 * (first.0 + second.0));
            let weight = weight * srgb::encode_slope(0.5 * (linear + drawn)).powi(2);
            let pull = 0.5 * weight * (first.1 * (linear - second.0) + second.1 * (linear - first.0));
            let saturated = observed[c] >= SATURATED && drawn > linear;
            if pull.is_finite() && !saturated {
                equation.pull[c] = pull;
                equation.square[c] = weight * first.1 * second.1;
            }
        }
        equation
    }
}

/// The diffuse planes of `material` after `passes`.
fn solve(material: &Material, equations: &mut [Equation], passes: usize) -> Vec<f32> {
    let (size, n) = ([material.width, material.height], material.texels.len());
    let mut planes = material.to_planes();
    planes.truncate(3 * n);
    let start = planes.clone();
    let mut squares = vec![[PRIOR; 3]; n];
    for e in &*equations {
        for (t, share) in Footprint::new(size, e.uv).shares() {
            (0..3).for_each(|c| squares[t][c] += share * e.square[c]);
        }
    }
    let mut change = vec![[0.0f32; 3]; n];
    for _ in 0..passes {
        for (t, change) in change.iter_mut().enumerate() {
            *change = [0, 1, 2].map(|c| PRIOR * (start[c * n + t] - planes[c * n + t]));
        }
        for e in &*equations {
            for (t, share) in Footprint::new(size, e.uv).shares() {
                (0..3).for_each(|c| change[t][c] += share * e.pull[c]);
            }
        }
        for (t, change) in change.iter_mut().enumerate() {
            for c in 0..3 {
                let [low, high] = LIMITS[c].map(|l| l as f32);
                let old = planes[c * n + t];
                planes[c * n + t] = (old + change[c] / squares[t][c].max(PRIOR)).clamp(low, high);
                change[c] = planes[c * n + t] - old;
            }
        }
        for e in &mut *equations {
            for (t, share) in Footprint::new(size, e.uv).shares() {
                (0..3).for_each(|c| e.pull[c] -= share * e.square[c] * change[t][c]);
            }
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use tessuto_core::camera::Camera;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;
    use tessuto_render::pbr::{EnvironmentMap, EnvironmentSampler, Geometry, radiance, visible_points};
    use tessuto_render::raster::{Rasterizer, Rendering};

    const SIZE: usize = 32;
    const TEXELS: usize = SIZE * SIZE;

    /// Checks of four texels, light and dark, on a surface of `roughness` and `metallic`.
    fn checks([light, dark]: [f32; 2], roughness: f32, metallic: f32) -> Material {
        let mut material = Material::uniform(SIZE, SIZE, [0.0; 3], roughness, metallic);
        for (t, texel) in material.texels.iter_mut().enumerate() {
            let base = if (t % SIZE / 4 + t / SIZE / 4).is_multiple_of(2) { light } else { dark };
            texel[..3].copy_from_slice(&[base, 0.5 * base, base * base]);
        }
        material
    }

    /// Sharpens maps of one colour by images of `truth`, a bent sheet under light from a side, in many frames;
    /// returns the root mean square of the error of the diffuse map before and after, and what the mean is off
    /// after.
    fn sharpened(truth: &Material, passes: usize) -> [f64; 3] {
        let mut mesh = grid(9, 9, DVec2::splat(0.4), 0.6);
        mesh.positions.iter_mut().for_each(|p| p.z += 0.05 * (9.0 * p.x).sin());
        let camera = Camera { fx: 130.0, fy: 130.0, cx: 47.5, cy: 47.5, width: 96, height: 96 };
        let mut rng = Rng::new(4, 0);
        let motion: Vec<_> = (0..6)
            .map(|_| {
                let moved = 0.02 * rng.vector();
                mesh.positions.iter().map(|p| *p + moved).collect::<Vec<_>>()
            })
            .collect();
        let geometry = Geometry::new(&mesh, &motion);
        let mut environment = EnvironmentMap::uniform(32, 16, [0.5; 3]);
        environment.texels.iter_mut().enumerate().for_each(|(i, t)| {
            if i % 32 < 10 {
                *t = [2.0, 1.8, 1.5];
            }
        });
        let light = EnvironmentSampler::new(&environment, 0.25);
        let rasterizer = Rasterizer::new(&mesh);
        let mut points = Vec::new();
        for (n, positions) in motion.iter().enumerate() {
            let rendering = &mut Rendering::new();
            let seen = visible_points(&rasterizer, camera, &geometry, n, positions, rendering, |_, _| true);
            points.extend(seen.into_iter().map(|(_, point)| point));
        }
        let shader = Shader { geometry: &geometry, material: truth, light: &light };
        let colours = radiance(&shader, &points, 77, 2048).into_iter().map(|c| c.map(srgb::encode)).collect();
        let weights = PatchWeights::new(motion.len(), mesh.triangles().len());
        let mut start = truth.to_planes()[..3 * TEXELS].to_vec();
        start.chunks_exact_mut(TEXELS).for_each(|p| p.fill(p.iter().sum::<f32>() / TEXELS as f32));
        let error = |planes: &[f32]| -> (f64, f64) {
            let off: Vec<f64> = planes.iter().zip(truth.to_planes()).map(|(a, b)| f64::from(a - b)).collect();
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            ((off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt(), mean)
        };
        let mut material = truth.clone();
        material.set_planes(&start);
        let shader = Shader { material: &material, ..shader };
        let after = sharpen(&shader, &Observations { points, colours }, &weights, (passes, 8, 3));
        let (rms, mean) = error(&after);
        [error(&start).0, rms, mean]
    }

    #[test]
    fn a_print_that_is_gone_comes_back_pass_by_pass_and_no_darker() {
        let truth = checks([0.7, 0.15], 0.7, 0.0);
        let [before, few, mean] = sharpened(&truth, 3);
        let [_, many, mean_of_many] = sharpened(&truth, 30);
        eprintln!("off by {before:.4}, {few:.4}, {many:.4}; in the mean {mean:.4}, {mean_of_many:.4}");
        assert!(before > 0.2 && few < 0.2 * before && many < 0.7 * few);
        assert!(mean.abs() < 0.005 && mean_of_many.abs() < 0.005);
        assert_eq!(sharpened(&truth, 0)[1], before);
    }

    #[test]
    fn metal_stays_what_it_was() {
        let [before, after, _] = sharpened(&checks([0.7, 0.15], 0.7, 1.0), 3);
        assert_eq!(before, after);
    }
}
