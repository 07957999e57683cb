//! What a loaded scene holds, seen through the library.

use crate::support::scene_maker::{FRAMES, SIZE, TinyScene, colour, fabric, mask, paint, template};
use tessuto::Rect;
use tessuto::io::image::write_png;
use tessuto::io::scene::{LoadOptions, Loaded, load};

fn load_all(scene: &TinyScene) -> Loaded {
    load(scene.folder(), &LoadOptions::default()).unwrap()
}

#[test]
fn everything_arrives() {
    let tiny = TinyScene::with_truth();
    let Loaded { scene, warnings } = load_all(&tiny);
    assert_eq!(warnings, []);
    assert_eq!((scene.name.as_str(), scene.fps, scene.first_frame), ("tiny", 25.0, 0));
    assert_eq!(scene.template, template());
    // 16 pixels of fabric and 4 on each side, as far as the image reaches.
    assert_eq!(scene.crop, Rect { x0: 0, y0: 2, x1: 24, y1: 24 });
    assert_eq!((scene.camera.cx, scene.camera.cy, scene.camera.height), (11.5, 11.5, 22));
    for n in 0..scene.frames.len() {
        let frame = scene.frames.frame(n).unwrap();
        assert_eq!(frame.rgb.data, colour(n).data[2 * SIZE * 3..]);
        assert_eq!(frame.mask.data, mask().data[2 * SIZE..]);
    }
    assert_eq!(scene.truth.points.unwrap().len(), FRAMES);
    let apart = scene.truth.vertices.unwrap()[3][7] - scene.template.positions[7];
    assert!(apart.length() < 1e-7);
}

#[test]
fn crop_of_scene_json_is_kept() {
    let tiny = TinyScene::new();
    tiny.edit("scene.json", "\"name\"", "\"crop\": {\"x0\": 2, \"y0\": 5, \"x1\": 21, \"y1\": 23}, \"name\"");
    let scene = load_all(&tiny).scene;
    assert_eq!(scene.crop, Rect { x0: 2, y0: 5, x1: 21, y1: 23 });
    let rgb = &scene.frames.frame(1).unwrap().rgb;
    assert_eq!((rgb.width, rgb.height), (19, 18));
    assert_eq!(rgb.pixel(3, 4), colour(1).pixel(5, 9));
}

#[test]
fn a_range_of_frames() {
    let tiny = TinyScene::with_truth();
    std::fs::remove_file(tiny.path("rgbs/rgb_000.png")).unwrap();
    let scene =
        load(tiny.folder(), &LoadOptions { frames: Some(1..3), ..LoadOptions::default() }).unwrap().scene;
    assert_eq!((scene.first_frame, scene.frames.len()), (1, 2));
    assert_eq!(scene.frames.frame(0).unwrap().rgb.data, colour(1).data[2 * SIZE * 3..]);
    assert_eq!(scene.truth.vertices.unwrap().len(), 2);
    #[expect(clippy::reversed_empty_ranges, reason = "a user can type it")]
    for range in [0..5, 2..2, 3..1] {
        let error =
            load(tiny.folder(), &LoadOptions { frames: Some(range), ..LoadOptions::default() }).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
    }
}

#[test]
fn other_padding_and_endings() {
    let tiny = TinyScene::new();
    for n in 0..FRAMES {
        std::fs::rename(tiny.path(&format!("rgbs/rgb_{n:03}.png")), tiny.path(&format!("rgbs/rgb_{n}.PNG")))
            .unwrap();
        let [old, new] = [3, 5].map(|width| tiny.path(&format!("masks/mask_{n:0width$}.png")));
        std::fs::rename(old, new).unwrap();
    }
    tiny.put("rgbs/Thumbs.db", "not a frame");
    assert_eq!(load_all(&tiny).warnings, []);
}

#[test]
fn jpeg_frames() {
    let tiny = TinyScene::new();
    for n in 0..FRAMES {
        let png = tiny.path(&format!("rgbs/rgb_{n:03}.png"));
        image::open(&png).unwrap().save(tiny.path(&format!("rgbs/rgb_{n:03}.jpg"))).unwrap();
        std::fs::remove_file(png).unwrap();
    }
    let scene = load_all(&tiny).scene;
    let (found, expected) = (&scene.frames.frame(2).unwrap().rgb.data, colour(2));
    let apart = found.iter().zip(&expected.data[2 * SIZE * 3..]).map(|(a, b)| (a - b).abs());
    let mean = apart.sum::<f32>() / found.len() as f32;
    assert!(mean < 0.1, "JPEG differs by {mean} on average");
    tiny.truncate("rgbs/rgb_002.jpg");
    let error = load(tiny.folder(), &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("rgb_002.jpg") && error.contains("truncated JPEG"), "{error}");
}

#[test]
fn bright_background_becomes_black_and_dark_specks_stay() {
    let tiny = TinyScene::new();
    let bright =
        |n: usize| paint(3, move |x, y, c| if fabric(x, y) { colour(n).pixel(x, y)[c] } else { 0.5 });
    for n in 0..FRAMES {
        write_png(&tiny.path(&format!("rgbs/rgb_{n:03}.png")), &bright(n)).unwrap();
    }
    let Loaded { scene, warnings } = load_all(&tiny);
    assert_eq!(warnings, [], "every film has a background");
    assert_eq!(scene.frames.frame(2).unwrap().rgb.data, colour(2).data[2 * SIZE * 3..]);

    // A frame that is black but for the pixels next to the fabric is kept as it is.
    let tiny = TinyScene::new();
    let near = |x: usize, y: usize| fabric(x + 1, y) || fabric(x.saturating_sub(1), y);
    let edged = |n: usize| paint(3, move |x, y, c| if near(x, y) { 0.2 } else { colour(n).pixel(x, y)[c] });
    for n in 0..FRAMES {
        write_png(&tiny.path(&format!("rgbs/rgb_{n:03}.png")), &edged(n)).unwrap();
    }
    let Loaded { scene, warnings } = load_all(&tiny);
    assert_eq!(warnings, []);
    assert_eq!(
        scene.frames.frame(0).unwrap().rgb.data,
        tessuto::io::image::read(&tiny.path("rgbs/rgb_000.png")).unwrap().data[2 * SIZE * 3..]
    );
}

#[test]
fn masks_of_zeros_and_ones_are_understood() {
    let tiny = TinyScene::new();
    for n in 0..FRAMES {
        let mut dim = mask();
        dim.data.iter_mut().for_each(|v| *v /= 255.0);
        write_png(&tiny.path(&format!("masks/mask_{n:03}.png")), &dim).unwrap();
    }
    let Loaded { scene, warnings } = load_all(&tiny);
    assert_eq!(scene.frames.frame(0).unwrap().mask.data, mask().data[2 * SIZE..]);
    assert!(warnings.len() == 1 && warnings[0].found.contains("holds 0 and 1"), "{warnings:?}");
}

#[test]
fn errors_do_not_depend_on_threads() {
    let tiny = TinyScene::new();
    for n in [1, 2, 3] {
        tiny.truncate(&format!("rgbs/rgb_00{n}.png"));
    }
    let messages: Vec<String> = (1..=4)
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| load(tiny.folder(), &LoadOptions::default()).unwrap_err().to_string())
        })
        .collect();
    assert!(messages[0].contains("rgb_001.png"));
    assert!(messages.windows(2).all(|pair| pair[0] == pair[1]));
}
