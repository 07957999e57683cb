//! Images of every kind equal their 8-bit RGB twin; broken ones are refused.

use std::io::Cursor;
use std::path::PathBuf;

use image::{DynamicImage, ImageFormat, RgbImage};
use tessuto::io::image::{read, read_mask, write_png};

/// An image of grey values, so that grey formats can hold it.
fn twin() -> RgbImage {
    RgbImage::from_fn(9, 7, |x, y| image::Rgb([(20 * x + 9 * y) as u8; 3]))
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn save(&self, name: &str, image: impl Into<DynamicImage>, format: ImageFormat) -> PathBuf {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, format).unwrap();
        self.put(name, bytes.get_ref())
    }
}

/// PNG of a palette or of few bits, which the encoder of `image` does not write: uncompressed deflate.
fn raw_png(width: u32, height: u32, depth: u8, colour_type: u8, palette: &[u8], rows: &[u8]) -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        !bytes.iter().fold(!0u32, |crc, b| {
            (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
        })
    };
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        let body = [kind, data].concat();
        png.extend((data.len() as u32).to_be_bytes());
        png.extend(&body);
        png.extend(crc(&body).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[depth, colour_type, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    if !palette.is_empty() {
        chunk(b"PLTE", palette);
    }
    let adler = rows
        .iter()
        .fold((1u32, 0u32), |(a, b), v| ((a + u32::from(*v)) % 65521, (a + u32::from(*v) + b) % 65521));
    let length = rows.len() as u16;
    let mut data = vec![0x78, 0x01, 1];
    data.extend(length.to_le_bytes());
    data.extend((!length).to_le_bytes());
    data.extend(rows);
    data.extend((adler.1 << 16 | adler.0).to_be_bytes());
    chunk(b"IDAT", &data);
    chunk(b"IEND", &[]);
    png
}

#[test]
fn every_colour_type_equals_its_rgb_twin() {
    let folder = Folder::new();
    let rgb = DynamicImage::from(twin());
    let png = ImageFormat::Png;
    let expected = read(&folder.save("rgb.png", rgb.clone(), png)).unwrap();
    assert_eq!((expected.width, expected.height, expected.channels), (9, 7, 3));
    assert_eq!(expected.pixel(3, 2), [78.0 / 255.0; 3]);
    let kinds: [(&str, DynamicImage); 7] = [
        ("grey", rgb.to_luma8().into()),
        ("grey and alpha", rgb.to_luma_alpha8().into()),
        ("alpha", rgb.to_rgba8().into()),
        ("16 bit grey", rgb.to_luma16().into()),
        ("16 bit grey and alpha", rgb.to_luma_alpha16().into()),
        ("16 bit", rgb.to_rgb16().into()),
        ("16 bit alpha", rgb.to_rgba16().into()),
    ];
    for (kind, image) in kinds {
        assert_eq!(read(&folder.save("twin.png", image, png)).unwrap(), expected, "{kind}");
    }
    let palette: Vec<u8> = (0..=255u8).flat_map(|v| [v; 3]).collect();
    let rows: Vec<u8> = (0..7)
        .flat_map(|y| std::iter::once(0).chain((0..9).map(move |x| twin().get_pixel(x, y)[0])))
        .collect();
    let path = folder.put("palette.png", &raw_png(9, 7, 8, 3, &palette, &rows));
    assert_eq!(read(&path).unwrap(), expected);
}

#[test]
fn one_bit_and_four_bit_grey() {
    let folder = Folder::new();
    let path = folder.put("one.png", &raw_png(8, 1, 1, 0, &[], &[0, 0b1010_0011]));
    let (mask, warning) = read_mask(&path).unwrap();
    assert_eq!((mask.data, warning), (vec![1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0], None));
    let path = folder.put("four.png", &raw_png(2, 1, 4, 0, &[], &[0, 0x3F]));
    assert_eq!(read(&path).unwrap().data, [0.2, 0.2, 0.2, 1.0, 1.0, 1.0]);
}

#[test]
fn sixteen_bits_keep_their_precision() {
    let folder = Folder::new();
    let image =
        image::ImageBuffer::<image::Luma<u16>, _>::from_fn(4, 1, |x, _| image::Luma([1000 + x as u16]));
    let path = folder.save("deep.png", DynamicImage::from(image), ImageFormat::Png);
    assert_eq!(read(&path).unwrap().pixel(3, 0), [1003.0 / 65_535.0; 3]);
}

#[test]
fn mask_of_colours_is_luminance_and_grey_is_exact() {
    let folder = Folder::new();
    let image = RgbImage::from_fn(3, 1, |x, _| {
        image::Rgb([[255, 255, 255], [200, 200, 200], [255, 0, 0]][x as usize])
    });
    let (mask, warning) = read_mask(&folder.save("colour.png", image, ImageFormat::Png)).unwrap();
    assert_eq!((mask.data, warning), (vec![1.0, 200.0 / 255.0, 0.2126], None));
}

#[test]
fn odd_masks_give_a_warning() {
    let folder = Folder::new();
    let dim =
        |value: u8| image::GrayImage::from_fn(3, 1, |x, _| image::Luma([[0, value, value][x as usize]]));
    let (mask, warning) = read_mask(&folder.save("ones.png", dim(1), ImageFormat::Png)).unwrap();
    assert_eq!(mask.data, [0.0, 1.0, 1.0]);
    assert!(warning.unwrap().contains("0 and 1"));
    let (mask, warning) = read_mask(&folder.save("dim.png", dim(100), ImageFormat::Png)).unwrap();
    assert_eq!(mask.data, [0.0, 1.0, 1.0]);
    assert!(warning.unwrap().contains("two values, 0 and 100; taken as black and white"));
    let ramp = image::GrayImage::from_fn(3, 1, |x, _| image::Luma([50 * x as u8]));
    let (mask, warning) = read_mask(&folder.save("ramp.png", ramp, ImageFormat::Png)).unwrap();
    assert_eq!(mask.data, [0.0, 50.0 / 255.0, 100.0 / 255.0]);
    assert!(warning.unwrap().contains("below half of white"));
    let (_, warning) = read_mask(&folder.save("lie.jpg", dim(255), ImageFormat::Png)).unwrap();
    assert!(warning.unwrap().contains("ending"));
}

#[test]
fn truncated_files_are_refused_at_every_length() {
    let folder = Folder::new();
    for (name, format) in [("a.png", ImageFormat::Png), ("a.jpg", ImageFormat::Jpeg)] {
        let whole = std::fs::read(folder.save(name, twin(), format)).unwrap();
        assert!(read(&folder.put(name, &whole)).is_ok());
        // PNG is whole once its pixels are; JPEG needs its end marker.
        let end = if format == ImageFormat::Png { whole.len() - 16 } else { whole.len() };
        for length in 0..end {
            let error = read(&folder.put(name, &whole[..length])).expect_err("a truncated file was read");
            assert_eq!(error.exit_code(), 3);
            let text = error.to_string();
            assert!(text.contains(name) && text.contains(&format!("file of {length} bytes")), "{text}");
        }
    }
}

#[test]
fn preview_inside_a_truncated_jpeg_does_not_pass_for_its_end() {
    let folder = Folder::new();
    let whole = std::fs::read(folder.save("a.jpg", twin(), ImageFormat::Jpeg)).unwrap();
    // An application segment that holds a whole little image, as cameras write it.
    let mut segment = vec![0xFF, 0xE1];
    segment.extend((whole.len() as u16 + 2).to_be_bytes());
    segment.extend(&whole);
    let with_preview = [&whole[..2], &segment, &whole[2..]].concat();
    assert!(read(&folder.put("b.jpg", &with_preview)).is_ok());
    let error = read(&folder.put("b.jpg", &with_preview[..with_preview.len() - 20])).unwrap_err();
    assert!(error.to_string().contains("truncated JPEG"), "{error}");
}

#[test]
fn huge_dimensions_are_refused_before_decoding() {
    let folder = Folder::new();
    for (width, height) in [(20_000, 1), (16_384, 16_384), (u32::MAX >> 1, u32::MAX >> 1)] {
        let start = std::time::Instant::now();
        let error = read(&folder.put("bomb.png", &raw_png(width, height, 8, 2, &[], &[0; 100]))).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{error}");
        assert!(start.elapsed().as_secs() < 1);
    }
}

#[test]
fn written_png_is_read_back() {
    let folder = Folder::new();
    let path = folder.save("a.png", twin(), ImageFormat::Png);
    let image = read(&path).unwrap();
    let copy = folder.0.path().join("copy.png");
    write_png(&copy, &image).unwrap();
    assert_eq!(read(&copy).unwrap(), image);
}

#[test]
fn the_camera_says_how_it_was_held() {
    let folder = Folder::new();
    // Wider than high, and bright on the left.
    let lying = RgbImage::from_fn(16, 8, |x, _| image::Rgb([if x < 8 { 250 } else { 5 }; 3]));
    let mut jpeg = Cursor::new(Vec::new());
    DynamicImage::from(lying).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    let held = |orientation: u8| {
        // An Exif segment behind the start marker: one entry, the orientation, as a short.
        let entry = [0x12, 0x01, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0];
        let body = [&b"Exif\0\0II*\0\x08\0\0\0\x01\0"[..], &entry, &[0; 4]].concat();
        let length = (body.len() as u16 + 2).to_be_bytes();
        let file = [&jpeg[..2], &[0xFF, 0xE1], &length, &body, &jpeg[2..]].concat();
        read(&folder.put("held.jpg", &file)).unwrap()
    };
    let usual = held(1);
    assert_eq!((usual.width, usual.height), (16, 8));
    assert!(usual.pixel(1, 4)[0] > 0.9 && usual.pixel(14, 4)[0] < 0.1);
    // Turned by 90° to the right: what was left is up.
    let turned = held(6);
    assert_eq!((turned.width, turned.height), (8, 16));
    assert!(turned.pixel(4, 1)[0] > 0.9 && turned.pixel(4, 14)[0] < 0.1);
}
