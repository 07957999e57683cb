//! JPEG of a part of an image, shrunk to a largest side.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

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
    let [width, height] =
        [image.width, image.height].map(|side| u16::try_from(side).expect("a side that JPEG can tell"));
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    // Prints have edges in colour alone.
    encoder.set_sampling_factor(SamplingFactor::F_1_1);
    encoder.encode(&image.data, width, height, ColorType::Rgb).expect("a vector takes every byte");
    bytes
}
