//! Importance sampling of an environment map: directions in proportion to its power.

use std::f64::consts::PI;

use wide::{f32x8, u32x8};

use super::EnvironmentMap;

/// An environment, and a distribution of directions whose density follows the power of an environment like it:
/// the density is kept while the radiance changes, until the next [`EnvironmentSampler::new`].
#[derive(Debug, Clone)]
pub struct EnvironmentSampler {
    width: u32,
    height: u32,
    /// Red, green, blue radiance and the density [1/sr] with which the texel's directions are drawn.
    texels: Vec<[f32; 4]>,
    /// Start of each texel's interval of the 2³² random numbers, ascending. Densities are those of these whole
    /// numbers, so that drawing and density agree exactly.
    starts: Vec<u32>,
    /// First texel to look at for random numbers with the upper bits of this index.
    guide: Vec<u32>,
    /// Random number → index into `guide`.
    guide_shift: u32,
    /// sin lat at the upper border of each row, and its change to the lower one.
    rows: Vec<[f32; 2]>,
    /// cos lon and sin lon at the middle of each column.
    columns: Vec<[f32; 2]>,
}

impl EnvironmentSampler {
    /// Draws the fraction `uniform_fraction` of the samples uniformly over the sphere, the rest in proportion to the
    /// mean radiance of red, green and blue.
    pub fn new(environment: &EnvironmentMap, uniform_fraction: f64) -> Self {
        let (w, h) = (environment.width, environment.height);
        let mut light = Self {
            width: w as u32,
            height: h as u32,
            texels: vec![[0.0; 4]; w * h],
            starts: vec![0; w * h],
            guide: Vec::new(),
            guide_shift: 32 - (w * h).next_power_of_two().ilog2().clamp(1, 24),
            rows: (0..h)
                .map(|j| [j, j + 1].map(|j| (PI * j as f64 / h as f64).cos()))
                .map(|[a, b]| [a as f32, (b - a) as f32])
                .collect(),
            columns: (0..w)
                .map(|i| ((i as f64 + 0.5) / w as f64 - 0.5) * 2.0 * PI)
                .map(|lon| [lon.cos() as f32, lon.sin() as f32])
                .collect(),
        };
        light.set_radiance(environment);
        light.set_distribution(environment, uniform_fraction);
        light
    }

    /// Width and height of the environment.
    pub fn size(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// Takes over new radiance, of the same size; the distribution stays.
    pub fn set_radiance(&mut self, environment: &EnvironmentMap) {
        assert_eq!([environment.width, environment.height], self.size(), "an environment of the same size");
        for (texel, [r, g, b]) in self.texels.iter_mut().zip(&environment.texels) {
            *texel = [*r, *g, *b, texel[3]];
        }
    }

    fn set_distribution(&mut self, environment: &EnvironmentMap, uniform_fraction: f64) {
        let w = environment.width;
        let solid_angles: Vec<f64> = (0..environment.height).map(|j| environment.solid_angle(j)).collect();
        let power = |i: usize| {
            let [r, g, b] = environment.texels[i].map(f64::from);
            (r + g + b) * solid_angles[i / w]
        };
        let total: f64 = (0..self.starts.len()).map(power).sum();
        // A dark environment is drawn uniformly.
        let uniform = if total > 0.0 { uniform_fraction } else { 1.0 };
        let by_power = if total > 0.0 { (1.0 - uniform_fraction) / total } else { 0.0 };
        let mut sum = 0.0;
        let numbers = 2f64.powi(32);
        let mut start = 0u64;
        for i in 0..self.starts.len() {
            sum += by_power * power(i) + uniform * solid_angles[i / w] / (4.0 * PI);
            let last = i + 1 == self.starts.len();
            let end = if last { 1 << 32 } else { ((sum * numbers) as u64).min(1 << 32) };
            self.starts[i] = start.min(u64::from(u32::MAX)) as u32;
            let probability = (end - start) as f64 / numbers;
            self.texels[i][3] = (probability / solid_angles[i / w]) as f32;
            start = end;
        }
        self.guide.clear();
        let mut texel = 0;
        for k in 0..1u64 << (32 - self.guide_shift) {
            let u = (k << self.guide_shift) as u32;
            while texel + 1 < self.starts.len() && self.starts[texel + 1] <= u {
                texel += 1;
            }
            self.guide.push(texel as u32);
        }
    }

    /// The texel that owns the random number `u`.
    #[inline]
    fn pick(&self, u: u32) -> u32 {
        let mut texel = self.guide[(u >> self.guide_shift) as usize] as usize;
        while texel + 1 < self.starts.len() && self.starts[texel + 1] <= u {
            texel += 1;
        }
        texel as u32
    }

    /// Eight directions to the light from uniform numbers: `pick` chooses the texels, (`across`, `down`) in
    /// [0, 1)² the places in them, uniformly by solid angle. Returns the texels and the directions.
    #[inline]
    pub fn sample(&self, pick: u32x8, across: f32x8, down: f32x8) -> ([u32; 8], [f32x8; 3]) {
        let texels = pick.to_array().map(|u| self.pick(u));
        let (mut top, mut change) = ([0.0; 8], [0.0; 8]);
        let (mut cos, mut sin) = ([0.0; 8], [0.0; 8]);
        for k in 0..8 {
            let row = texels[k] / self.width;
            let column = texels[k] - row * self.width;
            [top[k], change[k]] = self.rows[row as usize];
            [cos[k], sin[k]] = self.columns[column as usize];
        }
        let sin_lat = f32x8::from(change).mul_add(down, f32x8::from(top));
        let cos_lat = (f32x8::ONE - sin_lat * sin_lat).max(f32x8::ZERO).sqrt();
        // The column's middle, turned by a part of its width; at 8 columns the series still is exact to 1e-6.
        let d = (across - f32x8::splat(0.5)) * f32x8::splat((2.0 * PI / f64::from(self.width)) as f32);
        let (cos_d, sin_d) = if self.width >= 64 {
            let d2 = d * d;
            let sixth = f32x8::splat(-1.0 / 6.0);
            let twenty_fourth = f32x8::splat(1.0 / 24.0);
            let cos_d = (twenty_fourth.mul_add(d2, f32x8::splat(-0.5))).mul_add(d2, f32x8::ONE);
            (cos_d, (sixth.mul_add(d2, f32x8::ONE)) * d)
        } else {
            let (sin, cos) = d.sin_cos();
            (cos, sin)
        };
        let (cos, sin) = (f32x8::from(cos), f32x8::from(sin));
        let cos_lon = cos * cos_d - sin * sin_d;
        let sin_lon = sin * cos_d + cos * sin_d;
        (texels, [cos_lat * sin_lon, -sin_lat, cos_lat * cos_lon])
    }

    /// The texels that eight unit vectors point to.
    #[inline]
    pub fn texels_of(&self, [x, y, z]: &[f32x8; 3]) -> [u32; 8] {
        let scale = |s: f64| f32x8::splat(s as f32);
        let polar = (-*y).clamp(-f32x8::ONE, f32x8::ONE).acos();
        let lon = x.atan2(*z);
        let row = (polar * scale(f64::from(self.height) / PI)).trunc_int().to_array();
        let column = ((lon * scale(0.5 / PI) + f32x8::splat(0.5)) * scale(self.width.into())).trunc_int();
        let column = column.to_array();
        std::array::from_fn(|k| {
            let row = (row[k].max(0) as u32).min(self.height - 1);
            row * self.width + (column[k].max(0) as u32).min(self.width - 1)
        })
    }

    /// Red, green, blue radiance and density [1/sr] of eight texels.
    #[inline]
    pub fn lookup(&self, texels: &[u32; 8]) -> [f32x8; 4] {
        let mut out = [[0.0f32; 8]; 4];
        for k in 0..8 {
            let texel = &self.texels[texels[k] as usize];
            for c in 0..4 {
                out[c][k] = texel[c];
            }
        }
        out.map(f32x8::from)
    }
}
