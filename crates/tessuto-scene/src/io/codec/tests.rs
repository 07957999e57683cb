//! Plain twin: the crate `image`, which decodes and encodes the same files.

use std::io::Cursor;

use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, RgbImage};

use super::*;
use crate::io::jpeg;
use crate::io::rgb8::Rgb8;
use tessuto_core::camera::Rect;
use tessuto_core::math::rng::Rng;

const MOST: u64 = 1 << 24;

/// Grey in a smooth wave with some noise, or opacity.
fn noise(rng: &mut Rng) -> impl Fn(u32, u32) -> u8 + use<> {
    let [a, b, c] = [rng.uniform(), rng.uniform(), rng.uniform()];
    move |x, y| {
        let wave = (0.3 * a * f64::from(x) + 0.3 * b * f64::from(y) + 6.0 * c).sin();
        (127.0 + 90.0 * wave + f64::from((x * 7919 + y * 104_729) % 31)) as u8
    }
}

/// Images of all eight colour types that PNG has, of one size.
fn images(rng: &mut Rng, width: u32, height: u32) -> Vec<DynamicImage> {
    let values = [noise(rng), noise(rng), noise(rng), noise(rng)];
    let rgba = ::image::RgbaImage::from_fn(width, height, |x, y| {
        ::image::Rgba(std::array::from_fn(|k| values[k](x, y)))
    });
    let mut deep = DynamicImage::from(rgba.clone()).to_rgba16();
    deep.iter_mut().for_each(|v| *v = v.wrapping_mul(40_503));
    let (rgba, deep) = (DynamicImage::from(rgba), DynamicImage::from(deep));
    vec![
        rgba.to_luma8().into(),
        rgba.to_luma_alpha8().into(),
        rgba.to_rgb8().into(),
        deep.to_luma16().into(),
        deep.to_luma_alpha16().into(),
        deep.to_rgb16().into(),
        rgba,
        deep,
    ]
}

fn written(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// `bytes` as the twin reads them, the right way up.
fn twin(bytes: &[u8]) -> DynamicImage {
    let mut decoder =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().unwrap().into_decoder().unwrap();
    let orientation = decoder.orientation().unwrap();
    let mut image = DynamicImage::from_decoder(decoder).unwrap();
    image.apply_orientation(orientation);
    image
}

/// Whether `pixels` are those of `image`, numbers and conversions.
fn expect_same(pixels: &Pixels, image: &DynamicImage) {
    let samples = match image {
        DynamicImage::ImageLuma8(p) => Samples::Bytes(p.to_vec()),
        DynamicImage::ImageLumaA8(p) => Samples::Bytes(p.to_vec()),
        DynamicImage::ImageRgb8(p) => Samples::Bytes(p.to_vec()),
        DynamicImage::ImageRgba8(p) => Samples::Bytes(p.to_vec()),
        DynamicImage::ImageLuma16(p) => Samples::Words(p.to_vec()),
        DynamicImage::ImageLumaA16(p) => Samples::Words(p.to_vec()),
        DynamicImage::ImageRgb16(p) => Samples::Words(p.to_vec()),
        DynamicImage::ImageRgba16(p) => Samples::Words(p.to_vec()),
        _ => panic!("no PNG or JPEG"),
    };
    assert_eq!([pixels.width, pixels.height], [image.width(), image.height()].map(|side| side as usize));
    assert_eq!(pixels.kind(), format!("{:?}", image.color()));
    assert!(pixels.samples == samples, "{}", pixels.kind());
    assert!(pixels.clone().into_rgb8() == image.to_rgb8().into_raw(), "{}", pixels.kind());
    if let Some(alpha) = pixels.alpha() {
        let rgba = image.to_rgba16();
        assert!(rgba.pixels().map(|p| f32::from(p.0[3]) / 65_535.0).eq(alpha), "{}", pixels.kind());
    }
    let brightest = match pixels.samples {
        Samples::Bytes(_) => image.to_luma8().iter().copied().max().unwrap().into(),
        Samples::Words(_) => f32::from(image.to_luma16().iter().copied().max().unwrap()),
    };
    assert!((pixels.largest().0 - brightest).abs() <= 1.0, "{:?} {brightest}", pixels.largest());
}

#[test]
fn every_colour_type_is_read_as_by_the_twin() {
    let mut rng = Rng::new(5, 0);
    for (width, height) in [(1, 1), (7, 5), (33, 20), (64, 48)] {
        for image in images(&mut rng, width, height) {
            let decoded = decode(&written(&image, ImageFormat::Png), Format::Png, MOST).unwrap();
            assert!(!decoded.turned && !decoded.inks);
            expect_same(&decoded.pixels, &image);
            if matches!(image, DynamicImage::ImageLuma8(_) | DynamicImage::ImageRgb8(_)) {
                let jpeg = written(&image, ImageFormat::Jpeg);
                expect_same(&decode(&jpeg, Format::Jpeg, MOST).unwrap().pixels, &twin(&jpeg));
            }
        }
    }
}

#[test]
fn however_the_camera_was_held_the_twin_turns_it_alike() {
    let image = &images(&mut Rng::new(6, 0), 19, 11)[2];
    let jpeg = written(image, ImageFormat::Jpeg);
    for (number, big) in (0..=9u16).flat_map(|number| [(number, false), (number, true)]) {
        let word = |v: u16| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let long = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let start: &[u8] = if big { b"Exif\0\0MM\0*" } else { b"Exif\0\0II*\0" };
        // Another tag, then the orientation.
        let entries = [word(0x10F), word(3), word(1), word(0), word(7), word(0)].concat();
        let own = [&word(0x112)[..], &word(3), &long(1), &word(number), &word(0)].concat();
        let body = [start, &long(8), &word(2), &entries, &own, &long(0)].concat();
        let length = (body.len() as u16 + 2).to_be_bytes();
        let file = [&jpeg[..2], &[0xFF, 0xE1], &length, &body, &jpeg[2..]].concat();
        let decoded = decode(&file, Format::Jpeg, MOST).unwrap();
        let told = Orientation::from_exif(number as u8).unwrap_or(Orientation::NoTransforms);
        assert_eq!(decoded.turned, told != Orientation::NoTransforms, "{number}");
        expect_same(&decoded.pixels, &twin(&file));
    }
}

#[test]
fn written_png_has_the_twins_bytes() {
    let mut rng = Rng::new(7, 0);
    let all = images(&mut rng, 57, 31);
    for (image, channels) in [(&all[0], 1), (&all[2], 3)] {
        let bytes = png::encode(image.as_bytes(), [57, 31], channels);
        assert!(bytes == written(image, ImageFormat::Png), "{channels}");
    }
}

#[test]
fn written_jpeg_is_as_near_and_as_small_as_the_twins() {
    let mut rng = Rng::new(8, 0);
    for (width, height) in [(1, 1), (8, 8), (41, 23), (160, 90)] {
        let rgb = images(&mut rng, width, height)[2].to_rgb8();
        let own = Rgb8::new([width as usize, height as usize], rgb.to_vec());
        for quality in [1, 40, 74, 90, 100] {
            let mut theirs = Vec::new();
            let encoder = ::image::codecs::jpeg::JpegEncoder::new_with_quality(&mut theirs, quality);
            rgb.write_with_encoder(encoder).unwrap();
            let ours = jpeg::encode(&own, quality);
            let error = |file: &[u8]| {
                let found = twin(file).to_rgb8();
                let squares =
                    found.iter().zip(rgb.iter()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
                (squares.sum::<f64>() / rgb.len() as f64).sqrt()
            };
            let (a, b) = (error(&ours), error(&theirs));
            println!(
                "{width}×{height} at {quality}: off by {a:.3} and {b:.3}, {} and {} bytes",
                ours.len(),
                theirs.len()
            );
            assert!(a <= 1.01 * b, "{width}×{height} at {quality}: {a} {b}");
            // Colours at half of the size would be off by far more, and take a third less. The finest steps, at
            // which the twin drops the remainder of a division, keep more of the noise.
            let [a, b] = [&ours, &theirs].map(|file| file.len() as f64);
            let most = if quality == 100 { 1.2 } else { 1.03 };
            assert!((0.97..most).contains(&(a / b)), "{width}×{height} at {quality}: {a} and {b} bytes");
        }
    }
}

#[test]
fn smaller_images_have_the_twins_pixels() {
    let mut rng = Rng::new(9, 0);
    let image: RgbImage = images(&mut rng, 173, 97)[2].to_rgb8();
    let own = Rgb8::new([173, 97], image.to_vec());
    for _ in 0..40 {
        let [width, height] = [173.0, 97.0].map(|side| 1 + (rng.uniform() * side) as u32);
        let theirs = ::image::imageops::thumbnail(&image, width, height);
        assert!(
            own.shrunk([width, height].map(|side| side as usize)).data == theirs.into_raw(),
            "{width}×{height}"
        );
    }
    let part = own.cropped(Rect { x0: 20, y0: 3, x1: 90, y1: 60 });
    let theirs = ::image::imageops::crop_imm(&image, 20, 3, 70, 57).to_image();
    assert!(part.data == theirs.into_raw() && (part.width, part.height) == (70, 57));
}

#[test]
fn radiance_is_read_as_by_the_twin() {
    let mut rng = Rng::new(10, 0);
    for (width, height) in [(1, 1), (9, 4), (300, 3)] {
        let mut value = || (8.0 * rng.normal()).exp2() as f32;
        let pixels: Vec<_> = (0..width * height).map(|_| ::image::Rgb([value(), value(), value()])).collect();
        let mut bytes = Vec::new();
        ::image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, width, height).unwrap();
        let (size, data) = radiance::decode(&bytes, MOST).unwrap();
        assert_eq!(size, [width, height]);
        assert!(data == twin(&bytes).to_rgb32f().into_raw());
        // Every truncated one is refused, and none panics.
        for length in 0..bytes.len() {
            assert!(matches!(radiance::decode(&bytes[..length], MOST), Err(Refusal::Broken(_))), "{length}");
        }
    }
    // Rows of old: repeated pixels, a repetition of a repetition.
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 300\n".to_vec();
    bytes.extend([[9, 8, 7, 130], [1, 1, 1, 42], [1, 1, 1, 1], [5, 6, 7, 1]].concat());
    assert!(radiance::decode(&bytes, MOST).unwrap().1 == twin(&bytes).to_rgb32f().into_raw());
}

#[test]
fn linear_colours_are_read_and_written_as_by_the_twin() {
    let mut rng = Rng::new(11, 0);
    let data: Vec<f32> = (0..3 * 21 * 13).map(|_| rng.normal() as f32).collect();
    let image: ::image::Rgb32FImage = ::image::ImageBuffer::from_raw(21, 13, data.clone()).unwrap();
    let image = DynamicImage::from(image);
    let theirs = written(&image, ImageFormat::OpenExr);
    assert!(exr::encode(&data, [21, 13]).unwrap() == theirs);
    assert!(exr::decode(&theirs, MOST).unwrap() == ([21, 13], data.clone()));
    let with_alpha = written(&image.to_rgba32f().into(), ImageFormat::OpenExr);
    assert!(exr::decode(&with_alpha, MOST).unwrap() == ([21, 13], data));
    assert!(matches!(exr::decode(&with_alpha, 16 * 21 * 13 - 1), Err(Refusal::Large { .. })));
}
