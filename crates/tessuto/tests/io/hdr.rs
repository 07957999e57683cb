//! Linear images: EXR comes back bit for bit, half floats and .hdr are read, and an environment map
//! that cannot light anything is refused with file, pixel and remedy.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use tessuto::Image;
use tessuto::io::hdr::{read_environment, read_linear, write_exr};

use crate::support::recordings::recorded;

/// A sky of 8×4 pixels with values from 0.01 to about 1e5.
fn sky() -> Image {
    let mut image = Image::new(8, 4, 3);
    for (k, v) in image.data.iter_mut().enumerate() {
        *v = 0.01 * 1.183f32.powi(k as i32);
    }
    image
}

fn refused(path: &Path, parts: &[&str]) {
    let error = read_environment(path).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    let message = error.to_string();
    for part in parts.iter().chain(&[path.file_name().unwrap().to_str().unwrap(), "hint:"]) {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn exr_comes_back_bit_for_bit_and_is_written_alike_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    paths.iter().for_each(|p| write_exr(p, &sky()).unwrap());
    assert_eq!(read_environment(&paths[0]).unwrap(), sky());
    assert_eq!(std::fs::read(&paths[0]).unwrap(), std::fs::read(&paths[1]).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "a temporary file was left");
}

#[test]
fn radiance_pictures_are_read_to_their_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.hdr");
    let mut bytes = Cursor::new(Vec::new());
    let pixels: Vec<image::Rgb<f32>> = sky().data.chunks(3).map(|p| image::Rgb([p[0], p[1], p[2]])).collect();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 8, 4).unwrap();
    std::fs::write(&path, bytes.get_ref()).unwrap();
    let found = read_environment(&path).unwrap();
    assert_eq!((found.width, found.height, found.channels), (8, 4, 3));
    for (a, b) in found.data.iter().zip(&sky().data) {
        // RGBE has 8 bits of mantissa, shared by a pixel's channels.
        assert!((a - b).abs() <= 0.02 * b, "{a} for {b}");
    }
}

#[test]
fn half_floats_of_another_program_are_read() {
    let Some(path) = recorded("S1/gt/material/environment.exr") else { return };
    let found = read_environment(&path).unwrap();
    assert_eq!((found.width, found.height), (1024, 512));
    let mean = found.data.iter().map(|v| f64::from(*v)).sum::<f64>() / found.data.len() as f64;
    assert!((0.05..5.0).contains(&mean), "mean radiance {mean}");
}

#[test]
fn an_environment_that_cannot_be_used_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, image: &Image| -> PathBuf {
        let path = folder.path().join(name);
        write_exr(&path, image).unwrap();
        path
    };
    for (value, word) in [
        (f32::NAN, "not finite"),
        (f32::INFINITY, "not finite"),
        (-0.25, "negative: -0.25"),
        (2e6, "too large: 2000000"),
    ] {
        let mut image = sky();
        image.pixel_mut(5, 2)[1] = value;
        image.pixel_mut(6, 3)[0] = value;
        let path = write("sky.exr", &image);
        refused(&path, &["2 of 96 values", "column 5, row 2, channel G", word]);
        assert!(read_linear(&path).is_ok(), "only an environment has rules");
    }
    refused(&write("square.exr", &Image::new(4, 4, 3)), &["4×4 pixels", "twice as wide"]);
}

#[test]
fn a_file_that_is_no_linear_picture_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    refused(&path, &["cannot be read"]);
    std::fs::write(&path, b"not an image").unwrap();
    refused(&path, &["neither OpenEXR nor Radiance"]);
    write_exr(&path, &sky()).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for length in [4, 40, 200, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).unwrap();
        refused(&path, &["cannot be decoded"]);
    }
}

#[test]
fn a_tile_far_larger_than_the_picture_is_refused_before_it_takes_memory() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/invariants/regressions/radiance/tile_of_a_gigabyte.exr");
    refused(&path, &["tile_of_a_gigabyte.exr", "tiles of 64×3625024 pixels"]);
}
