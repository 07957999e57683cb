//! The BRDF of the cloth: a diffuse base and a microfacet layer, with sampling and derivatives.
//!
//! f = T_D (1 − T_M)/π + D·G·F/(4 (n·o)(n·i)), with o to the viewer, i to the light, h between them:
//! D is GGX with α = T_R², G Smith's for correlated heights, F = F0 + (1 − F0)(1 − o·h)⁵ and
//! F0 = 0.04 (1 − T_M) + T_D T_M.
//!
//! Sources: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Heitz 2014,
//! "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs"; Schlick 1994, "An Inexpensive
//! BRDF Model for Physically-based Rendering"; sampling: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals
//! with Spherical Caps".
//!
//! Vectors are in the frame of the shading normal (0, 0, 1) and point away from the surface.

use std::f32::consts::{FRAC_1_PI, TAU};

use wide::f32x8;

/// Least probability of sampling either lobe: without it a lobe that is small now could not be found again.
const LEAST_PROBABILITY: f32 = 0.15;

/// The material at one point and what it takes to evaluate it for one viewer.
#[derive(Debug, Clone, Copy)]
pub struct Brdf {
    /// Unit vector to the viewer; z > 0.
    pub wo: [f32; 3],
    /// Base colour T_D.
    pub base: [f32; 3],
    /// Roughness T_R.
    pub roughness: f32,
    /// Metallic T_M.
    pub metallic: f32,
    /// T_D (1 − T_M).
    pub diffuse: [f32; 3],
    /// Reflectance F0 of the microfacets seen straight on.
    pub f0: [f32; 3],
    /// α² = T_R⁴.
    alpha2: f32,
    /// √(α² + (1 − α²)(n·o)²).
    smith_o: f32,
    /// Probability of drawing from the microfacet lobe.
    specular_probability: f32,
}

/// [`Brdf::eval`] in eight directions. With these, f_c = diffuse_c/π + dg (F0_c (1 − s) + s).
#[derive(Debug, Clone, Copy)]
pub struct Eval {
    /// n·i where it is positive, else 0.
    pub cosine: f32x8,
    /// D·G/(4 (n·o)(n·i)).
    pub dg: f32x8,
    /// s = (1 − o·h)⁵.
    pub schlick: f32x8,
    /// ∂ log dg/∂α².
    pub log_slope: f32x8,
    /// Density [1/sr] of [`Brdf::sample`].
    pub pdf: f32x8,
}

impl Brdf {
    /// The material of one texel `[red, green, blue, roughness, metallic, ..]` seen from `wo`.
    #[inline]
    pub fn new(texel: &[f32; 8], wo: [f32; 3]) -> Self {
        let [r, g, b, roughness, metallic, ..] = *texel;
        let base = [r, g, b];
        let diffuse = base.map(|t| t * (1.0 - metallic));
        let f0 = base.map(|t| 0.04 * (1.0 - metallic) + t * metallic);
        let alpha = roughness * roughness;
        let alpha2 = alpha * alpha;
        let away = 1.0 - wo[2];
        let away2 = away * away;
        let mean = |c: [f32; 3]| (c[0] + c[1] + c[2]) / 3.0;
        // Schlick's reflectance of the mean surface is a fair guess of the lobe's albedo.
        let specular = mean(f0) + (1.0 - mean(f0)) * away2 * away2 * away;
        let probability = specular / (specular + mean(diffuse)).max(1e-6);
        Self {
            wo,
            base,
            roughness,
            metallic,
            diffuse,
            f0,
            alpha2,
            smith_o: (alpha2 + (1.0 - alpha2) * wo[2] * wo[2]).sqrt(),
            specular_probability: probability.clamp(LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY),
        }
    }

    /// The layers and the density of eight unit vectors `wi`; 0 below the horizon.
    #[inline]
    pub fn eval(&self, [x, y, z]: &[f32x8; 3]) -> Eval {
        let [ox, oy, oz] = self.wo.map(f32x8::splat);
        let a2 = f32x8::splat(self.alpha2);
        let one = f32x8::ONE;
        let above = z.simd_gt(f32x8::ZERO);
        let l = above.select(*z, one);
        let [hx, hy, hz] = [ox + *x, oy + *y, oz + l];
        let inverse = one / (hx * hx + hy * hy + hz * hz).max(f32x8::splat(1e-12));
        // sin² from the components parallel to the surface: no cancellation where the lobe is narrow.
        let sin2 = (hx * hx + hy * hy) * inverse;
        let cos2 = hz * hz * inverse;
        let t = a2 * cos2 + sin2;
        let d = a2 * f32x8::splat(FRAC_1_PI) / (t * t);
        let smith_i = (a2 + (one - a2) * l * l).sqrt();
        let smith_o = f32x8::splat(self.smith_o);
        let g = f32x8::splat(0.5) / (l * smith_o + oz * smith_i);
        let dg = above.select(d * g, f32x8::ZERO);
        // ∂ log D/∂α² = 1/α² − 2 cos²/t;  ∂√(α² + (1 − α²) c²)/∂α² = (1 − c²)/(2 √…).
        let half = f32x8::splat(0.5);
        let smith_slope = l * (one - oz * oz) / smith_o + oz * (one - l * l) / smith_i;
        let log_slope = one / a2 - (cos2 + cos2) / t - smith_slope * g;
        let oh = ((ox * hx + oy * hy + oz * hz) * inverse.sqrt()).min(one);
        let away = one - oh;
        let away2 = away * away;
        // Visible normals: G1 D/(4 n·o) = D/(2 (n·o + √…)).
        let specular_pdf = d * half / (oz + smith_o);
        let probability = f32x8::splat(self.specular_probability);
        let pdf = probability * specular_pdf + (one - probability) * l * f32x8::splat(FRAC_1_PI);
        Eval {
            cosine: above.select(*z, f32x8::ZERO),
            dg,
            schlick: away2 * away2 * away,
            log_slope,
            pdf: above.select(pdf, f32x8::ZERO),
        }
    }

    /// Eight directions from numbers uniform in [0, 1): `lobe` chooses diffuse or microfacet, (`u`, `v`) the
    /// direction. Those of the microfacet lobe may lie below the horizon.
    #[inline]
    pub fn sample(&self, lobe: f32x8, u: f32x8, v: f32x8) -> [f32x8; 3] {
        let one = f32x8::ONE;
        let (sin, cos) = (u * f32x8::splat(TAU)).sin_cos();
        // Diffuse: uniform on the disc, lifted onto the sphere.
        let radius = v.sqrt();
        let [dx, dy, dz] = [radius * cos, radius * sin, (one - v).max(f32x8::ZERO).sqrt()];
        // Microfacets: a uniform point of the spherical cap that the stretched viewer sees.
        let alpha = self.roughness * self.roughness;
        let [ox, oy, oz] = self.wo;
        let stretched = [alpha * ox, alpha * oy, oz];
        let length = (stretched[0] * stretched[0] + stretched[1] * stretched[1] + oz * oz).sqrt();
        let [sx, sy, sz] = stretched.map(|s| f32x8::splat(s / length));
        let cz = (one - v) * (one + sz) - sz;
        let ring = (one - cz * cz).max(f32x8::ZERO).sqrt();
        let a = f32x8::splat(alpha);
        let [mx, my, mz] = [a * (ring * cos + sx), a * (ring * sin + sy), (cz + sz).max(f32x8::ZERO)];
        let scale = one / (mx * mx + my * my + mz * mz).max(f32x8::splat(1e-20)).sqrt();
        let [mx, my, mz] = [mx * scale, my * scale, mz * scale];
        let [ox, oy, oz] = self.wo.map(f32x8::splat);
        let om = ox * mx + oy * my + oz * mz;
        let twice = om + om;
        let specular = lobe.simd_lt(f32x8::splat(self.specular_probability));
        [
            specular.select(twice * mx - ox, dx),
            specular.select(twice * my - oy, dy),
            specular.select(twice * mz - oz, dz),
        ]
    }

    /// dg's derivative with respect to the roughness is dg · log_slope · this: ∂α²/∂T_R = 4 T_R³.
    #[inline]
    pub fn alpha2_slope(&self) -> f32 {
        4.0 * self.roughness * self.roughness * self.roughness
    }
}
