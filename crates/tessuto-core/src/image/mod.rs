//! Float images in memory, and the sRGB transfer curve.

#[doc(hidden)]
pub mod region;
pub mod srgb;

/// Interleaved float image; row 0 is the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Width `[px]`.
    pub width: usize,
    /// Height `[px]`.
    pub height: usize,
    /// Values per pixel.
    pub channels: usize,
    /// Values, shape [height, width, channels].
    pub data: Vec<f32>,
}

impl Image {
    /// An image of zeros.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// The values of pixel (column `x`, row `y`), shape `[channels]`.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.data[start..start + self.channels]
    }

    /// The values of pixel (column `x`, row `y`), shape `[channels]`.
    #[inline]
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> &mut [f32] {
        let start = (y * self.width + x) * self.channels;
        &mut self.data[start..start + self.channels]
    }

    /// Means of `factor`×`factor` blocks; incomplete blocks at the right and lower border are dropped.
    pub fn downsampled(&self, factor: usize) -> Self {
        let mut out = Self::new(self.width / factor, self.height / factor, self.channels);
        let scale = 1.0 / (factor * factor) as f32;
        for y in 0..out.height {
            for x in 0..out.width {
                for dy in 0..factor {
                    for dx in 0..factor {
                        for c in 0..self.channels {
                            let value = self.pixel(x * factor + dx, y * factor + dy)[c];
                            out.pixel_mut(x, y)[c] += value * scale;
                        }
                    }
                }
            }
        }
        out
    }
}
