//! JPEG of a part of an image, shrunk to a largest side.

use ::image::RgbImage;
use ::image::codecs::jpeg::JpegEncoder;
use ::image::imageops::{crop_imm, thumbnail};

use tessuto_core::camera::Rect;

/// Size `[px]` of `region` with sides of at most `side`, never enlarged.
pub fn fitted(region: Rect, side: u32) -> [u32; 2] {
    let (width, height) = (region.width() as f64, region.height() as f64);
    let scale = (f64::from(side) / width.max(height)).min(1.0);
    [width, height].map(|s| ((s * scale).round() as u32).max(1))
}

/// The part `region` of `image` as JPEG, with sides of at most `side` `[px]`.
pub fn encode_part(image: &RgbImage, region: Rect, side: u32, quality: u8) -> Vec<u8> {
    let [x, y, w, h] = [region.x0, region.y0, region.width(), region.height()].map(|v| v as u32);
    let [width, height] = fitted(region, side);
    let cut = crop_imm(image, x, y, w, h);
    let small = if (w, h) == (width, height) { cut.to_image() } else { thumbnail(&*cut, width, height) };
    encode(&small, quality)
}

/// `image` as JPEG.
pub fn encode(image: &RgbImage, quality: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode_image(image)
        .expect("a vector takes every byte");
    bytes
}
