//! Many points at once: from colours to a loss, and its derivatives back to material and environment map.

use rayon::prelude::*;

use super::gradient_sums::GradientSums;
use super::material::CHANNELS;
use super::shader::Numbers;
use super::{RadianceEstimate, Shader, SurfacePoint};
use tessuto_core::math::rng::mix32;

/// Parts into which points are divided, whatever the number of threads: each has sums of its own, which are then
/// added in their order.
const PARTS: usize = 4;

/// Derivatives of a loss.
#[derive(Debug, Clone, Default)]
pub struct Gradients {
    /// With respect to the material, one plane per channel as [`Material::to_planes`](super::Material::to_planes).
    pub material: Vec<f32>,
    /// With respect to the radiance of the light's texels.
    pub light: Vec<[f32; 3]>,
    /// Sum of the losses that the points returned.
    pub loss: f64,
    /// The loss that each point returned.
    pub losses: Vec<f32>,
    parts: Vec<GradientSums>,
}

/// Estimates each point's colour twice, independently, and lets `loss` say, for point number i and the two linear
/// colours, its value and its derivatives with respect to either colour. Replaces `gradients`.
///
/// Two estimates give derivatives of a squared error without bias from noise: the error from one, the colour's
/// derivative from the other.
pub fn accumulate(
    shader: &Shader,
    points: &[SurfacePoint],
    seed: u32,
    samples_per_pixel: usize,
    loss: impl Fn(usize, &[[f32; 3]; 2]) -> (f32, [[f32; 3]; 2]) + Sync,
    gradients: &mut Gradients,
) {
    accumulate_of(shader, points, seed, samples_per_pixel, loss, gradients);
}

/// Linear colour of every point, each estimated once; shape `[P]`.
pub fn radiance(
    shader: &Shader,
    points: &[SurfacePoint],
    seed: u32,
    samples_per_pixel: usize,
) -> Vec<[f32; 3]> {
    let colour = |estimate: &mut RadianceEstimate, (i, point): (usize, &SurfacePoint)| {
        shader.estimate(point, key(seed, i, 0), samples_per_pixel, estimate);
        estimate.colour
    };
    points.par_iter().enumerate().map_init(RadianceEstimate::default, colour).collect()
}

/// [`radiance`], and its derivative by the diffuse map at the point, each channel by its own; shape `[P]`. The
/// colour is linear in that map.
pub fn radiance_by_diffuse(
    shader: &Shader,
    points: &[SurfacePoint],
    seed: u32,
    samples_per_pixel: usize,
) -> Vec<[[f32; 3]; 2]> {
    let both = |estimate: &mut RadianceEstimate, (i, point): (usize, &SurfacePoint)| {
        let context = shader.shading_context(point);
        shader.estimate_at(&context, point, Numbers::of(key(seed, i, 0)), samples_per_pixel, estimate);
        [estimate.colour, estimate.by_diffuse(&context.brdf)]
    };
    points.par_iter().enumerate().map_init(RadianceEstimate::default, both).collect()
}

/// Adjoint of [`radiance`] for the derivatives `grad` of a loss by the colours, shape `[P]`. Directions and their
/// densities are constants to it.
pub fn radiance_vjp(
    shader: &Shader,
    points: &[SurfacePoint],
    seed: u32,
    samples_per_pixel: usize,
    grad: &[[f32; 3]],
) -> Gradients {
    assert_eq!(points.len(), grad.len(), "one gradient per point");
    let mut gradients = Gradients::default();
    let given = |i: usize, _: &[[f32; 3]; 1]| (0.0, [grad[i]]);
    accumulate_of(shader, points, seed, samples_per_pixel, given, &mut gradients);
    gradients
}

/// [`accumulate`] of K estimates per point.
fn accumulate_of<const K: usize>(
    shader: &Shader,
    points: &[SurfacePoint],
    seed: u32,
    samples_per_pixel: usize,
    loss: impl Fn(usize, &[[f32; 3]; K]) -> (f32, [[f32; 3]; K]) + Sync,
    gradients: &mut Gradients,
) {
    let texels = shader.material.texels.len();
    let [width, height] = shader.light.size();
    let Gradients { material, light, loss: total, losses, parts } = gradients;
    parts.resize_with(PARTS, GradientSums::default);
    let length = points.len().div_ceil(PARTS).max(1);
    losses.clear();
    losses.resize(points.len(), 0.0);
    let chunks = points.par_chunks(length).zip(losses.par_chunks_mut(length));
    parts[chunks.len()..].iter_mut().for_each(|sums| sums.clear(texels, width * height));
    parts.par_iter_mut().zip(chunks).enumerate().for_each(|(part, (sums, (points, losses)))| {
        sums.clear(texels, width * height);
        let mut estimates: [RadianceEstimate; K] = std::array::from_fn(|_| RadianceEstimate::default());
        for (k, (point, own)) in points.iter().zip(losses).enumerate() {
            let i = part * length + k;
            let context = shader.shading_context(point);
            for (k, estimate) in estimates.iter_mut().enumerate() {
                shader.estimate_at(
                    &context,
                    point,
                    Numbers::of(key(seed, i, k as u32)),
                    samples_per_pixel,
                    estimate,
                );
            }
            let (value, adjoints) = loss(i, &std::array::from_fn(|k| estimates[k].colour));
            *own = value;
            sums.loss += f64::from(value);
            for (estimate, adjoint) in estimates.iter().zip(adjoints) {
                shader.estimate_vjp(&context, estimate, adjoint, sums);
            }
        }
    });
    *total = parts.iter().map(|p| p.loss).sum();
    material.resize(CHANNELS * texels, 0.0);
    const BLOCK: usize = 1 << 14;
    let mut planes: Vec<_> = material.chunks_exact_mut(texels).map(|p| p.chunks_mut(BLOCK)).collect();
    let block = |_| std::array::from_fn(|c| planes[c].next().expect("every plane has as many blocks"));
    let blocks: Vec<[&mut [f32]; CHANNELS]> = (0..texels.div_ceil(BLOCK)).map(block).collect();
    blocks.into_par_iter().enumerate().for_each(|(block, mut planes)| {
        for k in 0..planes[0].len() {
            let mut sum = [0.0; 8];
            for part in parts.iter() {
                sum.iter_mut().zip(&part.material[block * BLOCK + k]).for_each(|(s, g)| *s += g);
            }
            planes.iter_mut().zip(sum).for_each(|(plane, s)| plane[k] = s);
        }
    });
    light.resize(width * height, [0.0; 3]);
    light.par_chunks_mut(BLOCK).enumerate().for_each(|(block, values)| {
        for (k, value) in values.iter_mut().enumerate() {
            *value = std::array::from_fn(|c| parts.iter().map(|p| p.light[block * BLOCK + k][c]).sum());
        }
    });
}

/// Key of the random numbers of estimate `k` of point `i`.
pub(super) fn key(seed: u32, i: usize, k: u32) -> u32 {
    mix32(mix32(seed ^ 0x5bd1_e995).wrapping_add(i as u32).wrapping_mul(2).wrapping_add(k))
}
