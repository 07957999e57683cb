use ::image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage, Rgba, RgbaImage};

use super::*;

const SIDE: u32 = 40;

/// Which object is at a pixel: 1 in a disc on the left, 2 in one on the right, 0 around them.
fn label(x: u32, y: u32) -> usize {
    let near = |cx: f64, cy: f64| (f64::from(x) - cx).hypot(f64::from(y) - cy) < 9.0;
    if near(10.0, 20.0) { 1 } else { 2 * usize::from(near(29.0, 20.0)) }
}

/// Coverage of the first disc with soft edges, in [0, 1].
fn soft(x: u32, y: u32) -> f64 {
    (9.5 - (f64::from(x) - 10.0).hypot(f64::from(y) - 20.0)).clamp(0.0, 1.0)
}

fn grey(value: impl Fn(u32, u32) -> u8) -> DynamicImage {
    GrayImage::from_fn(SIDE, SIDE, |x, y| Luma([value(x, y)])).into()
}

fn colours(value: impl Fn(u32, u32) -> [u8; 3]) -> DynamicImage {
    RgbImage::from_fn(SIDE, SIDE, |x, y| Rgb(value(x, y))).into()
}

fn transparent(value: impl Fn(u32, u32) -> [u8; 4]) -> DynamicImage {
    RgbaImage::from_fn(SIDE, SIDE, |x, y| Rgba(value(x, y))).into()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn save(&self, name: &str, image: &DynamicImage) -> std::path::PathBuf {
        let path = self.0.path().join(name);
        image.save_with_format(&path, ImageFormat::from_path(&path).unwrap()).unwrap();
        path
    }

    /// The mask that `image` is, and what is said of it.
    fn read(&self, image: &DynamicImage, object: Option<&str>) -> Result<(Image, String)> {
        let path = self.save("m.png", image);
        let object = object.map(|text| text.parse().unwrap());
        read(&path, object.as_ref()).map(|(mask, note)| (mask, note.unwrap_or_default()))
    }
}

/// Whether the mask is the disc of object `n`, exactly.
fn is_object(mask: &Image, n: usize) -> bool {
    let expected = |i: usize| f32::from(u8::from(label(i as u32 % SIDE, i as u32 / SIDE) == n));
    mask.data.iter().enumerate().all(|(i, v)| *v == expected(i))
}

const RED: [u8; 3] = [128, 0, 0];
const GREEN: [u8; 3] = [0, 128, 0];

#[test]
fn one_object_is_a_mask_whatever_its_colour_or_label() {
    let folder = Folder::new();
    let one = |x, y| label(x, y) == 1;
    let value = |v: u8| grey(move |x, y| v * u8::from(one(x, y)));
    let words = |v: u16| -> DynamicImage {
        ImageBuffer::<Luma<u16>, _>::from_fn(SIDE, SIDE, |x, y| Luma([v * u16::from(one(x, y))])).into()
    };
    let images = [
        (value(1), "0 and 1"),
        (value(2), "two values, 0 and 2"),
        (value(38), "two values, 0 and 38"),
        (value(255), ""),
        (words(255), "two values, 0 and 255"),
        (words(1), "0 and 1"),
        (words(65_535), ""),
        (colours(|x, y| if one(x, y) { RED } else { [0; 3] }), "two values, 0 and 128,0,0"),
        // As plots paint it.
        (colours(|x, y| if one(x, y) { [253, 231, 37] } else { [68, 1, 84] }), "two values, 68,1,84 and"),
        (transparent(|x, y| if one(x, y) { [255; 4] } else { [0, 0, 0, 255] }), ""),
    ];
    for (image, said) in images {
        let (mask, note) = folder.read(&image, None).unwrap();
        assert!(is_object(&mask, 1), "{said}");
        assert_eq!(
            (note.contains(said), said.is_empty()),
            (true, note.is_empty() || note.contains("alpha")),
            "{note}"
        );
    }
}

#[test]
fn several_objects_are_listed_and_one_is_chosen() {
    let folder = Folder::new();
    let images = [
        (
            grey(|x, y| label(x, y) as u8),
            ["1", "2"],
            "2 objects: label 1, 15.6 % of the image; label 2, 15.6 %",
        ),
        (
            grey(|x, y| [0, 128, 255][label(x, y)]),
            ["128", "255"],
            "label 128, 15.6 % of the image; label 255",
        ),
        (
            colours(|x, y| [[0; 3], RED, GREEN][label(x, y)]),
            ["2", "0,128,0"],
            "1: colour 0,128,0, 15.6 % of the image; 2: colour 128,0,0",
        ),
        (
            transparent(|x, y| [[9, 9, 9, 0], [255, 0, 0, 255], [0, 0, 255, 255]][label(x, y)]),
            ["#ff0000", "1"],
            "1: colour 0,0,255, 15.6 % of the image; 2: colour 255,0,0",
        ),
    ];
    for (image, names, list) in images {
        let told = folder.read(&image, None).unwrap_err().to_string();
        assert!(told.contains(list) && told.contains("m.png") && told.contains("hint: choose"), "{told}");
        for (k, name) in names.into_iter().enumerate() {
            let (mask, note) = folder.read(&image, Some(name)).unwrap();
            assert!(is_object(&mask, k + 1), "{name}: {note}");
            assert!(note.contains("the fabric is"), "{note}");
        }
        let told = folder.read(&image, Some("77")).unwrap_err().to_string();
        assert!(told.contains("has no object 77; it holds 2 objects"), "{told}");
    }
}

#[test]
fn soft_masks_stay_soft() {
    let folder = Folder::new();
    let byte = |x, y| (255.0 * soft(x, y)).round() as u8;
    let (mask, note) = folder.read(&grey(byte), None).unwrap();
    let same = |mask: &Image, within: f64| {
        mask.data
            .iter()
            .enumerate()
            .all(|(i, v)| (f64::from(*v) - soft(i as u32 % SIDE, i as u32 / SIDE)).abs() <= within)
    };
    assert!(same(&mask, 0.01) && note.is_empty(), "{note}");
    // Noise of a camera or of compression, written without losses.
    let noisy = grey(|x, y| {
        let noise = ((x * 7 + y * 13) % 5) as u8;
        if byte(x, y) > 127 { byte(x, y).saturating_sub(noise) } else { byte(x, y).saturating_add(noise) }
    });
    let (mask, note) = folder.read(&noisy, None).unwrap();
    assert!(same(&mask, 0.03) && note.is_empty(), "{note}");
    let path = folder.save("m.jpg", &grey(byte));
    let (mask, note) = read(&path, None).unwrap();
    assert!(same(&mask, 0.3) && note.is_none(), "{note:?}");
    // Of one colour, and dim.
    let red = colours(|x, y| [(128.0 * soft(x, y)).round() as u8, 0, 0]);
    let (mask, note) = folder.read(&red, None).unwrap();
    assert!(same(&mask, 0.01) && note.contains("128 of 255) is taken as white"), "{note}");
    let (mask, note) = folder.read(&grey(|x, y| (60.0 * soft(x, y)).round() as u8), None).unwrap();
    assert!(same(&mask, 0.02) && note.contains("brightest value, 60, is taken as white"), "{note}");
}

#[test]
fn transparency_is_the_mask_where_colours_are_none() {
    let folder = Folder::new();
    let alpha = |x, y| (255.0 * soft(x, y)).round() as u8;
    let same = |mask: &Image| {
        let expected = |i: usize| soft(i as u32 % SIDE, i as u32 / SIDE);
        mask.data.iter().enumerate().all(|(i, v)| (f64::from(*v) - expected(i)).abs() < 0.01)
    };
    let layer = transparent(|x, y| [255, 255, 255, alpha(x, y)]);
    let (mask, note) = folder.read(&layer, None).unwrap();
    assert!(same(&mask) && note.contains("alpha) is the mask") && !note.contains("ignored"), "{note}");
    let black = transparent(|x, y| [0, 0, 0, alpha(x, y)]);
    assert!(same(&folder.read(&black, None).unwrap().0));
    let cut_out =
        transparent(|x, y| [(x * 6) as u8, (y * 6) as u8, ((x * 31 + y * 17) % 256) as u8, alpha(x, y)]);
    let (mask, note) = folder.read(&cut_out, None).unwrap();
    assert!(same(&mask) && note.contains("cut-outs"), "{note}");
    // Black and white, some of it transparent: the colours are the mask.
    let (mask, note) = folder
        .read(
            &transparent(|x, y| {
                let v = if label(x, y) == 1 { 255 } else { 0 };
                [v, v, v, if y == 0 { 0 } else { 255 }]
            }),
            None,
        )
        .unwrap();
    assert!(is_object(&mask, 1) && note.contains("transparent counts as black"), "{note}");
}

#[test]
fn what_is_no_mask_is_refused() {
    let folder = Folder::new();
    let film = colours(|x, y| [(x * 6) as u8, (y * 6) as u8, ((x * 31 + y * 17) % 256) as u8]);
    let told = folder.read(&film, None).unwrap_err().to_string();
    assert!(told.contains("the colours of a filmed image, and no mask") && told.contains("m.png"), "{told}");
    let told = folder.read(&grey(|x, y| (255.0 * soft(x, y)) as u8), Some("3")).unwrap_err().to_string();
    assert!(told.contains("no object 3"), "{told}");
    let path = folder.save("empty.png", &grey(|_, _| 3));
    let told = read_fabric(&path, None).unwrap_err().to_string();
    assert!(told.contains("empty.png: the mask is empty: its brightest value is 3 of 255"), "{told}");
}

#[test]
fn a_clip_is_read_alike() {
    let folder = Folder::new();
    let frame = |name: &str, objects: &[usize]| {
        let objects = objects.to_vec();
        let value = grey(move |x, y| if objects.contains(&label(x, y)) { label(x, y) as u8 } else { 0 });
        open(&folder.save(name, &value)).unwrap()
    };
    // Object 1 alone, both, none.
    let mut files = [frame("0.png", &[1]), frame("1.png", &[1, 2]), frame("2.png", &[])];
    let looks: Vec<Look> = files.iter().map(ImageFile::look).collect();
    let told = understand("masks", &looks, None).unwrap_err().to_string();
    assert!(
        told.contains("label 1, 15.6 % of the image in 2 of 3 masks; label 2, 15.6 % of the image in 1 of 3"),
        "{told}"
    );
    let reading = understand("masks", &looks, Some(&Object::Number(2))).unwrap();
    let masks = files.each_mut().map(|file| file.mask_as(&reading, file.full()));
    assert!(brightest(&masks[0]) == 0.0 && is_object(&masks[1], 2) && brightest(&masks[2]) == 0.0);
    // A speck of 1 in a black mask is none of white where others have white.
    let mut files = [
        frame("0.png", &[1]),
        open(&folder.save("w.png", &grey(|x, y| 255 * (label(x, y) == 1) as u8))).unwrap(),
    ];
    let looks: Vec<Look> = files.iter().map(ImageFile::look).collect();
    let reading = understand("masks", &looks, None).unwrap();
    assert!(brightest(&files[0].mask_as(&reading, files[0].full())) < 2.0);
    assert!(is_object(&files[1].mask_as(&reading, files[1].full()), 1));
}
