//! A texture: bilinear lookup and its derivatives.

use glam::{DVec2, Vec4};

use tessuto_core::image::Image;

/// Image on the surface. Row 0 is v = 1: the point (u, v) lies at texel coordinates
/// x = u·width − ½, y = (1 − v)·height − ½, whole numbers being texel centres. Outside the outermost
/// centres the texture goes on constantly.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Texture {
    /// Width `[texel]`.
    pub width: usize,
    /// Height `[texel]`.
    pub height: usize,
    /// Red, green, blue and 1.0 (the mask), shape [height, width].
    pub texels: Vec<[f32; 4]>,
}

/// The four texels around a point, and where it lies between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    /// Indices of the upper left, upper right, lower left and lower right texel.
    texels: [usize; 4],
    /// Place between left and right, and between upper and lower texels, in [0, 1].
    fraction: [f32; 2],
    /// 1 where the lookup depends on x (or y), 0 where it was clamped.
    live: [f32; 2],
}

impl Texture {
    /// A texture of one colour.
    pub fn uniform(width: usize, height: usize, [r, g, b]: [f32; 3]) -> Self {
        assert!(width > 0 && height > 0, "a texture needs at least one texel, not {width}×{height}");
        Self { width, height, texels: vec![[r, g, b, 1.0]; width * height] }
    }

    /// The first three channels of `image`.
    pub fn from_image(image: &Image) -> Self {
        assert!(image.channels >= 3, "a texture needs 3 channels, not {}", image.channels);
        let texels = image.data.chunks_exact(image.channels).map(|c| [c[0], c[1], c[2], 1.0]).collect();
        Self { width: image.width, height: image.height, texels }
    }

    /// Red, green and blue, shape [height, width, 3].
    pub fn to_image(&self) -> Image {
        let data = self.texels.iter().flat_map(|t| [t[0], t[1], t[2]]).collect();
        Image { width: self.width, height: self.height, channels: 3, data }
    }

    /// Texel coordinates of `uv`.
    pub fn texel_position(&self, uv: DVec2) -> DVec2 {
        DVec2::new(uv.x * self.width as f64 - 0.5, (1.0 - uv.y) * self.height as f64 - 0.5)
    }

    /// Colour at texel coordinates (x, y), bilinear.
    #[inline]
    pub fn sample(&self, x: f64, y: f64) -> Vec4 {
        let footprint = self.footprint(x, y);
        let [t00, t10, t01, t11] = self.corners(&footprint);
        let [fx, fy] = footprint.fraction;
        let upper = t00 + (t10 - t00) * fx;
        let lower = t01 + (t11 - t01) * fx;
        upper + (lower - upper) * fy
    }

    /// Gradient of `grad` · [`sample`](Self::sample) with respect to x and y; 0 where the lookup is
    /// clamped, and that of the texel square to the right and below on the lines between texels.
    #[inline]
    pub(super) fn sample_vjp(&self, x: f64, y: f64, grad: Vec4) -> [f64; 2] {
        let footprint = self.footprint(x, y);
        let [t00, t10, t01, t11] = self.corners(&footprint);
        let [fx, fy] = footprint.fraction;
        let (upper, lower) = (t10 - t00, t11 - t01);
        let by_x = upper + (lower - upper) * fy;
        let by_y = (t01 - t00) * (1.0 - fx) + (t11 - t10) * fx;
        [f64::from(grad.dot(by_x) * footprint.live[0]), f64::from(grad.dot(by_y) * footprint.live[1])]
    }

    /// Adds the gradient of `grad` · [`sample`](Self::sample) with respect to the texels to `grads`.
    #[inline]
    pub(super) fn scatter_vjp(&self, x: f64, y: f64, grad: Vec4, grads: &mut [[f32; 4]]) {
        let footprint = self.footprint(x, y);
        let [fx, fy] = footprint.fraction;
        let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
        for (&texel, weight) in footprint.texels.iter().zip(weights) {
            let sum = Vec4::from_array(grads[texel]) + grad * weight;
            grads[texel] = sum.to_array();
        }
    }

    #[inline]
    fn footprint(&self, x: f64, y: f64) -> Footprint {
        // Floats throughout: converting the index back would chain each lookup to the one before,
        // because x86's conversion keeps a part of its target register.
        let inside = [x.clamp(0.0, (self.width - 1) as f64), y.clamp(0.0, (self.height - 1) as f64)];
        // The last texel square ends at the last centre, so that its right neighbour exists; a texture
        // of one texel has no square and is its own neighbour.
        let column = inside[0].floor().min(self.width.saturating_sub(2) as f64);
        let row = inside[1].floor().min(self.height.saturating_sub(2) as f64);
        let right = usize::from(self.width > 1);
        let below = if self.height > 1 { self.width } else { 0 };
        let first = (row as u32 as usize) * self.width + (column as u32 as usize);
        Footprint {
            texels: [first, first + right, first + below, first + below + right],
            fraction: [(inside[0] - column) as f32, (inside[1] - row) as f32],
            live: [if inside[0] == x { 1.0 } else { 0.0 }, if inside[1] == y { 1.0 } else { 0.0 }],
        }
    }

    #[inline]
    fn corners(&self, footprint: &Footprint) -> [Vec4; 4] {
        footprint.texels.map(|i| Vec4::from_array(self.texels[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texel_centres_return_texels_and_row_0_is_v_1() {
        let mut texture = Texture::uniform(4, 2, [0.0; 3]);
        texture.texels[1] = [0.5, 0.25, 0.125, 1.0];
        let p = texture.texel_position(DVec2::new(1.5 / 4.0, 0.75));
        assert_eq!(texture.sample(p.x, p.y).to_array(), texture.texels[1]);
        assert_eq!(texture.sample(1.5, 0.0).to_array(), [0.25, 0.125, 0.0625, 1.0]);
        assert_eq!(texture.sample(1.0, -7.0).to_array(), texture.texels[1]);
    }

    #[test]
    fn one_texel_is_constant() {
        let texture = Texture::uniform(1, 1, [0.5, 0.25, 0.125]);
        assert_eq!(texture.sample(3.0, -2.0).to_array(), [0.5, 0.25, 0.125, 1.0]);
        assert_eq!(texture.sample_vjp(0.3, 0.0, Vec4::ONE), [0.0, 0.0]);
    }
}
