//! JPEG of a part of an image, shrunk to a largest side.

use jpeg_encoder::{Encoder, ImageBuffer, JpegColorType, SamplingFactor, rgb_to_ycbcr};

use super::rgb8::Rgb8;
use tessuto_core::camera::Rect;

/// Size `[px]` of `region` with sides of at most `side`, never enlarged.
pub fn fitted(region: Rect, side: u32) -> [u32; 2] {
    let (width, height) = (region.width() as f64, region.height() as f64);
    let scale = (f64::from(side) / width.max(height)).min(1.0);
    [width, height].map(|s| ((s * scale).round() as u32).max(1))
}

/// The part `region` of `image` as JPEG, with sides of at most `side` `[px]`.
pub fn encode_part(image: &Rgb8, region: Rect, side: u32, quality: u8) -> Vec<u8> {
    let size = fitted(region, side).map(|side| side as usize);
    let cut = image.cropped(region);
    let small = if [cut.width, cut.height] == size { cut } else { cut.shrunk(size) };
    encode(&small, quality)
}

/// `image` as JPEG; `quality` in percent, above 0.
///
/// # Panics
/// If a side is 0 or above 65535 pixels.
pub fn encode(image: &Rgb8, quality: u8) -> Vec<u8> {
    let size =
        [image.width, image.height].map(|side| u16::try_from(side).expect("a side that JPEG can tell"));
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    // Prints have edges in colour alone.
    encoder.set_sampling_factor(SamplingFactor::F_1_1);
    encoder.encode_image(Colours { image, size }).expect("a vector takes every byte");
    bytes
}

/// The one kind of image that is written: the encoder's own way in compiles all of its kinds.
struct Colours<'a> {
    image: &'a Rgb8,
    size: [u16; 2],
}

impl ImageBuffer for Colours<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }

    fn width(&self) -> u16 {
        self.size[0]
    }

    fn height(&self) -> u16 {
        self.size[1]
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        for pixel in
            self.image.data.chunks_exact(3).skip(usize::from(y) * self.image.width).take(self.image.width)
        {
            let (y, cb, cr) = rgb_to_ycbcr(pixel[0], pixel[1], pixel[2]);
            [y, cb, cr].into_iter().zip(&mut *buffers).for_each(|(value, row)| row.push(value));
        }
    }
}
