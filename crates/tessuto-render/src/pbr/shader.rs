//! The hot path: radiance from one point towards the camera, estimated in bundles of eight directions.

use glam::Vec3;
use wide::{f32x8, u32x8};

use super::brdf::{Brdf, Eval};
use super::gradient_sums::GradientSums;
use super::material::Footprint;
use super::{EnvironmentSampler, Geometry, Material, SurfacePoint};
use tessuto_core::math::rng::mix32;

/// Directions in a bundle. Samples are taken in bundles of this many, each with one direction from the light and one
/// from the BRDF.
pub const LANES: usize = 8;

/// Least cosine between shading normal and viewer: near outlines, interpolated normals lean away from the viewer
/// and are turned back to this.
const LEAST_COSINE: f32 = 1e-2;

/// Steps of additive sequences, by random dimension: multiples of irrational numbers fill [0, 1) evenly. Golden
/// ratio for the choices; Roberts' two-dimensional R2 for places in a texel and directions.
const STEPS: [u32; 6] = [0x9e37_79b9, 0xc13f_a9a9, 0x91e1_0da5, 0x6a09_e667, 0xc13f_a9a9, 0x91e1_0da5];

/// Everything that colours depend on.
#[derive(Debug, Clone, Copy)]
pub struct Shader<'a> {
    /// The cloth.
    pub geometry: &'a Geometry,
    /// Its material.
    pub material: &'a Material,
    /// The light around it.
    pub light: &'a EnvironmentSampler,
}

/// What one direction of a bundle added: the texel of the light, and colour per radiance of it.
#[derive(Debug, Clone, Copy)]
struct Record {
    texels: [u32; 8],
    gains: [f32x8; 3],
}

/// Outgoing radiance of a point, and what its derivatives need. With these sums over all directions, W_c being
/// radiance · visibility · cosine / density, the colour is
/// diffuse_c/π Σ W_c + F0_c Σ W_c dg (1 − s) + Σ W_c dg s.
#[derive(Debug, Clone, Default)]
pub struct RadianceEstimate {
    /// Linear colour.
    pub colour: [f32; 3],
    irradiance: [f32; 3],
    by_f0: [f32; 3],
    by_alpha2: [f32; 3],
    records: Vec<Record>,
}

impl RadianceEstimate {
    /// Irradiance over π, the microfacets' part by F0, and the rest: colour = diffuse · E + F0 · S + R.
    pub(super) fn parts(&self, brdf: &Brdf) -> [[f32; 3]; 3] {
        let e = self.irradiance.map(|i| i * std::f32::consts::FRAC_1_PI);
        let rest = |c: usize| self.colour[c] - brdf.diffuse[c] * e[c] - brdf.f0[c] * self.by_f0[c];
        [e, self.by_f0, [0, 1, 2].map(rest)]
    }

    /// ∂ colour/∂ T_D, each channel by its own.
    pub(super) fn by_diffuse(&self, brdf: &Brdf) -> [f32; 3] {
        let m = brdf.metallic;
        let e = |c: usize| self.irradiance[c] * std::f32::consts::FRAC_1_PI;
        [0, 1, 2].map(|c| (1.0 - m) * e(c) + m * self.by_f0[c])
    }
}

/// Which random numbers a point takes: those of `key`, from bundle number `first` on. Points with the same key
/// whose bundles follow one another fill the directions evenly together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers {
    pub key: u32,
    pub first: usize,
}

impl Numbers {
    /// A key's own.
    pub fn of(key: u32) -> Self {
        Self { key, first: 0 }
    }
}

/// The point's own quantities, the same for all directions.
pub(super) struct ShadingContext {
    pub brdf: Brdf,
    pub footprint: Footprint,
    /// Whether the other side is seen, which the maps do not show.
    plain: bool,
    axes: [[f32x8; 3]; 3],
}

impl Shader<'_> {
    pub(super) fn shading_context(&self, point: &SurfacePoint) -> ShadingContext {
        let to_viewer = self.geometry.to_viewer(point);
        let mut n = point.normal;
        let lean = n.dot(to_viewer);
        if lean < LEAST_COSINE {
            n = (n + (LEAST_COSINE - lean) * 1.001 * to_viewer).normalize();
        }
        let [t, b] = tangents(n);
        let wo = [t, b, n].map(|a| a.dot(to_viewer));
        let wo = [wo[0], wo[1], wo[2].max(0.5 * LEAST_COSINE)];
        let footprint = self.material.footprint(point.uv);
        let back = self.material.of_back(point.turned);
        ShadingContext {
            brdf: Brdf::new(&back.unwrap_or_else(|| self.material.lookup(&footprint)), wo),
            footprint,
            plain: back.is_some(),
            axes: [t, b, n].map(|a| a.to_array().map(f32x8::splat)),
        }
    }

    /// Estimates the outgoing radiance of `point` with `samples_per_pixel` samples, rounded up to a multiple of
    /// [`LANES`]. Random numbers are those of `key` and of nothing else.
    pub fn estimate(
        &self,
        point: &SurfacePoint,
        key: u32,
        samples_per_pixel: usize,
        out: &mut RadianceEstimate,
    ) {
        self.estimate_at(&self.shading_context(point), point, Numbers::of(key), samples_per_pixel, out);
    }

    pub(super) fn estimate_at(
        &self,
        context: &ShadingContext,
        point: &SurfacePoint,
        Numbers { key, first }: Numbers,
        samples_per_pixel: usize,
        out: &mut RadianceEstimate,
    ) {
        out.records.clear();
        let mut sums = [[f32x8::ZERO; 3]; 4];
        let brdf = &context.brdf;
        let bundles = samples_per_pixel.div_ceil(LANES);
        let scale = f32x8::splat(1.0 / (bundles * LANES) as f32);
        let offsets: [u32; 6] = std::array::from_fn(|d| mix32(key.wrapping_add((d as u32) << 28)));
        for bundle in 0..bundles {
            let numbers: [u32x8; 6] = std::array::from_fn(|d| additive(offsets[d], STEPS[d], first + bundle));
            let [pick, across, down, lobe, u, v] = numbers;
            let (light_texels, from_light) = self.light.sample(pick, unit(across), unit(down));
            let local_light = rotate(&context.axes, &from_light);
            let local_brdf = brdf.sample(unit(lobe), unit(u), unit(v));
            let from_brdf = rotate_back(&context.axes, &local_brdf);
            let brdf_texels = self.light.texels_of(&from_brdf);
            let mut wanted = [local_light[2].simd_gt(f32x8::ZERO), local_brdf[2].simd_gt(f32x8::ZERO)];
            self.geometry.keep_visible(point, &[from_light, from_brdf], &mut wanted);
            for (texels, local, wanted) in
                [(light_texels, local_light, wanted[0]), (brdf_texels, local_brdf, wanted[1])]
            {
                let light = self.light.lookup(&texels);
                let e = brdf.eval(&local);
                let density = (light[3] + e.pdf).fast_max(f32x8::splat(1e-20));
                // The balance heuristic: both draws divide by the sum of both densities.
                let w = wanted & (e.cosine * scale / density);
                out.records.push(Record { texels, gains: add(brdf, &e, w, &light, &mut sums) });
            }
        }
        let [colour, irradiance, by_f0, by_alpha2] = sums.map(|s| s.map(f32x8::reduce_add));
        (out.colour, out.irradiance, out.by_f0, out.by_alpha2) = (colour, irradiance, by_f0, by_alpha2);
    }

    /// Adds the derivatives of `adjoint` · colour to `sums`: the material's, and the light's.
    pub(super) fn estimate_vjp(
        &self,
        context: &ShadingContext,
        estimate: &RadianceEstimate,
        adjoint: [f32; 3],
        sums: &mut GradientSums,
    ) {
        let b = &context.brdf;
        let mut texel = [0.0f32; 8];
        let by_diffuse = estimate.by_diffuse(b);
        for c in 0..3 {
            let irradiance = estimate.irradiance[c] * std::f32::consts::FRAC_1_PI;
            let f0 = estimate.by_f0[c];
            texel[c] = adjoint[c] * by_diffuse[c];
            texel[3] += adjoint[c] * estimate.by_alpha2[c] * b.alpha2_slope();
            texel[4] += adjoint[c] * ((b.base[c] - 0.04) * f0 - b.base[c] * irradiance);
        }
        if !context.plain {
            sums.add_material(&context.footprint, &texel);
        }
        for record in &estimate.records {
            let gains: [[f32; 8]; 3] =
                std::array::from_fn(|c| (record.gains[c] * f32x8::splat(adjoint[c])).to_array());
            for lane in 0..LANES {
                let gain = [gains[0][lane], gains[1][lane], gains[2][lane]];
                if gain != [0.0; 3] {
                    sums.add_light(record.texels[lane], gain);
                }
            }
        }
    }
}

/// Adds one bundle to the sums (colour, irradiance, ∂/∂F0, ∂/∂α²) and returns the colour per radiance.
#[inline]
fn add(brdf: &Brdf, e: &Eval, w: f32x8, light: &[f32x8; 4], sums: &mut [[f32x8; 3]; 4]) -> [f32x8; 3] {
    let specular = e.dg * e.schlick;
    let by_f0 = e.dg - specular;
    std::array::from_fn(|c| {
        let diffuse = f32x8::splat(brdf.diffuse[c] * std::f32::consts::FRAC_1_PI);
        let layer = f32x8::splat(brdf.f0[c]) * by_f0 + specular;
        let gain = w * (diffuse + layer);
        let radiance = w * light[c];
        sums[0][c] += gain * light[c];
        sums[1][c] += radiance;
        sums[2][c] += radiance * by_f0;
        sums[3][c] += radiance * layer * e.log_slope;
        gain
    })
}

/// Numbers `offset` + (8 `bundle` + lane) · `step`, modulo 2³².
#[inline]
fn additive(offset: u32, step: u32, bundle: usize) -> u32x8 {
    let first = offset.wrapping_add(step.wrapping_mul((bundle * LANES) as u32));
    u32x8::from(std::array::from_fn::<u32, 8, _>(|lane| first.wrapping_add(step.wrapping_mul(lane as u32))))
}

/// In [0, 1), from the upper 24 bits.
#[inline]
fn unit(numbers: u32x8) -> f32x8 {
    let upper: wide::i32x8 = bytemuck::cast(numbers >> 8);
    f32x8::from_i32x8(upper) * f32x8::splat(1.0 / (1 << 24) as f32)
}

#[inline]
fn rotate(axes: &[[f32x8; 3]; 3], d: &[f32x8; 3]) -> [f32x8; 3] {
    std::array::from_fn(|k| axes[k][0] * d[0] + axes[k][1] * d[1] + axes[k][2] * d[2])
}

#[inline]
fn rotate_back(axes: &[[f32x8; 3]; 3], d: &[f32x8; 3]) -> [f32x8; 3] {
    std::array::from_fn(|k| axes[0][k] * d[0] + axes[1][k] * d[1] + axes[2][k] * d[2])
}

/// Two unit vectors that with the unit vector `n` make a right-handed frame (Duff et al. 2017, "Building an
/// Orthonormal Basis, Revisited").
fn tangents(n: Vec3) -> [Vec3; 2] {
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y)]
}
