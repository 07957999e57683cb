//! Material maps on the surface: bilinear lookup and its adjoint.

use glam::DVec2;
use rayon::prelude::*;

/// Channels of a material: diffuse red, green, blue, roughness, metallic.
pub const CHANNELS: usize = 5;

/// Fewest texels of a parallel task.
const TASK: usize = 1 << 14;

/// Maps in uv space. Row 0 is v = 1: the point (u, v) lies at texel coordinates x = u·width − ½,
/// y = (1 − v)·height − ½, whole numbers being texel centres. Outside the outermost centres the maps go on
/// constantly.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Width `[texel]`.
    pub width: usize,
    /// Height `[texel]`.
    pub height: usize,
    /// Linear base colour T_D `[3]`, roughness T_R, metallic T_M and three zeros that fill a vector register,
    /// shape [height, width].
    pub texels: Vec<[f32; 8]>,
    /// Linear base colour of the other side, which is matt and has no metal; `None`: the maps go through.
    pub back: Option<[f32; 3]>,
}

/// The four texels around a point and their weights.
#[derive(Debug, Clone, Copy)]
pub struct Footprint {
    /// Indices of the upper left, upper right, lower left and lower right texel.
    pub texels: [u32; 4],
    /// Weights, sum 1.
    pub weights: [f32; 4],
}

impl Footprint {
    /// Of the point (u, v) on a map of `w` × `h` texels; clamped at the border.
    #[inline]
    pub fn new([w, h]: [usize; 2], [u, v]: [f32; 2]) -> Self {
        let x = (u * w as f32 - 0.5).clamp(0.0, (w - 1) as f32);
        let y = ((1.0 - v) * h as f32 - 0.5).clamp(0.0, (h - 1) as f32);
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f32, y - row as f32);
        let right = usize::from(column + 1 < w);
        let below = if row + 1 < h { w } else { 0 };
        let first = row * w + column;
        Self {
            texels: [first, first + right, first + below, first + below + right].map(|t| t as u32),
            weights: [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy],
        }
    }

    /// Texels and their weights.
    #[inline]
    pub fn shares(&self) -> impl Iterator<Item = (usize, f32)> {
        self.texels.into_iter().map(|t| t as usize).zip(self.weights)
    }
}

impl Material {
    /// The same material everywhere.
    pub fn uniform(width: usize, height: usize, diffuse: [f32; 3], roughness: f32, metallic: f32) -> Self {
        assert!(width > 0 && height > 0, "a material needs texels, not {width}×{height}");
        let [r, g, b] = diffuse;
        Self {
            width,
            height,
            texels: vec![[r, g, b, roughness, metallic, 0.0, 0.0, 0.0]; width * height],
            back: None,
        }
    }

    /// From one plane per channel, shape [[`CHANNELS`], height, width].
    pub fn from_planes(width: usize, height: usize, planes: &[f32]) -> Self {
        let n = width * height;
        assert_eq!(planes.len(), CHANNELS * n, "{CHANNELS} planes of {width}×{height}");
        let mut material = Self { width, height, texels: vec![[0.0; 8]; n], back: None };
        material.set_planes(planes);
        material
    }

    /// Replaces the first channels by `planes`, shape [K, height, width].
    pub fn set_planes(&mut self, planes: &[f32]) {
        let n = self.texels.len();
        self.texels.par_iter_mut().enumerate().with_min_len(TASK).for_each(|(t, texel)| {
            texel
                .iter_mut()
                .zip(planes[t..].iter().step_by(n))
                .for_each(|(channel, value)| *channel = *value);
        });
    }

    /// One plane per channel, shape [[`CHANNELS`], height, width].
    pub fn to_planes(&self) -> Vec<f32> {
        (0..CHANNELS).flat_map(|c| self.texels.iter().map(move |t| t[c])).collect()
    }

    /// Texel coordinates of `uv`.
    pub fn texel_position(&self, uv: DVec2) -> DVec2 {
        DVec2::new(uv.x * self.width as f64 - 0.5, (1.0 - uv.y) * self.height as f64 - 0.5)
    }

    pub(super) fn footprint(&self, uv: [f32; 2]) -> Footprint {
        Footprint::new([self.width, self.height], uv)
    }

    pub(super) fn lookup(&self, footprint: &Footprint) -> [f32; 8] {
        let mut sum = [0.0; 8];
        for (texel, weight) in footprint.texels.iter().zip(footprint.weights) {
            let texel = &self.texels[*texel as usize];
            sum.iter_mut().zip(texel).for_each(|(s, t)| *s += weight * t);
        }
        sum
    }

    /// The texel of the other side, if `turned` to it and it has one of its own.
    pub(super) fn of_back(&self, turned: bool) -> Option<[f32; 8]> {
        self.back.filter(|_| turned).map(|[r, g, b]| [r, g, b, 1.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Diffuse `[3]`, roughness and metallic at `uv`.
    pub fn sample(&self, uv: [f32; 2]) -> [f32; CHANNELS] {
        let [r, g, b, roughness, metallic, ..] = self.lookup(&self.footprint(uv));
        [r, g, b, roughness, metallic]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_0_is_v_1_and_planes_survive_a_round_trip() {
        let planes: Vec<f32> = (0..CHANNELS * 6).map(|k| k as f32).collect();
        let material = Material::from_planes(3, 2, &planes);
        assert_eq!(material.to_planes(), planes);
        assert_eq!(material.sample([0.5, 0.75]), [1.0, 7.0, 13.0, 19.0, 25.0]);
        assert_eq!(material.sample([-1.0, -1.0]), [3.0, 9.0, 15.0, 21.0, 27.0]);
        let middle = material.sample([0.5, 0.5])[0];
        assert!((middle - 2.5).abs() < 1e-6, "{middle}");
    }
}
