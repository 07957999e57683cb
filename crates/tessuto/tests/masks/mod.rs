//! Masks made from small clips: a printed cloth that moves over a wall with things on it, good clips and bad ones.

mod among;
mod drawn;
mod moving;

use std::path::Path;

use tempfile::TempDir;
use tessuto::io::image::{read_mask, write_png};
use tessuto::io::scene::write_manifest;
use tessuto::masks::{Click, EmptyPlace, Record, Request, make};
use tessuto::math::rng::Rng;
use tessuto::{Camera, Error, Image};

const SIZE: [usize; 2] = [170, 130];
const FRAMES: usize = 8;
/// Width and height of the cloth [px].
const CLOTH: [f64; 2] = [64.0, 52.0];

/// A clip and what is wrong with it.
#[derive(Clone, Copy, PartialEq)]
enum Clip {
    Good,
    Shadow,
    Person,
    MovingCamera,
    Cut,
    Leaves,
}

/// Left upper corner of the cloth in a frame.
fn corner(clip: Clip, n: usize) -> [f64; 2] {
    let n = n as f64;
    if clip == Clip::Leaves { [40.0 + 22.0 * n, 34.0] } else { [40.0 + 2.3 * n, 34.0 + 1.4 * n] }
}

/// Whether a place is cloth: a sheet whose lower side is bent.
fn cloth(clip: Clip, n: usize, x: f64, y: f64) -> Option<[f64; 2]> {
    let [x0, y0] = corner(clip, n);
    let (u, v) = (x - x0, y - y0);
    let bent = CLOTH[1] + 4.0 * (u / 12.0).sin();
    ((0.0..=CLOTH[0]).contains(&u) && (0.0..=bent).contains(&v)).then_some([u, v])
}

fn colour(clip: Clip, n: usize, x: f64, y: f64) -> [f64; 3] {
    if let Some([u, v]) = cloth(clip, n, x, y) {
        let print = ((u / 5.0).sin() * (v / 4.0).cos() + (u / 11.0 + v / 7.0).sin()) * 0.15;
        return [0.6 + print, 0.55 - print, 0.3 + 0.5 * print];
    }
    let x = if clip == Clip::MovingCamera { x + 3.0 * n as f64 } else { x };
    let plaster = 0.08 * (x / 3.1 + y / 7.0).sin() * (y / 2.9 - x / 11.0).cos();
    let mut wall = [0.35, 0.4, 0.5].map(|c| c + plaster);
    if (x - 90.0).abs() < 9.0 || (y - 105.0).abs() < 4.0 {
        wall = [0.5, 0.3, 0.25];
    }
    if clip == Clip::Cut && n >= 5 {
        wall = wall.map(|c| 1.0 - c);
    }
    if clip == Clip::Shadow && cloth(clip, n, x - 6.0, y - 6.0).is_some() {
        wall = wall.map(|c| 0.8 * c);
    }
    if clip == Clip::Person && (x - 15.0 * n as f64).abs() < 8.0 {
        wall = [0.2, 0.15 + 0.05 * (y / 3.0).sin(), 0.2];
    }
    wall
}

/// A scene folder of colour frames alone.
fn scene(clip: Clip) -> TempDir {
    filmed(FRAMES, &|n, x, y| colour(clip, n, x, y))
}

/// A scene folder of frames in which a place has the colour that `colour` says of frame, column and row.
fn filmed(count: usize, colour: &dyn Fn(usize, f64, f64) -> [f64; 3]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("rgbs")).unwrap();
    let mut random = Rng::new(11, 0);
    for n in 0..count {
        let mut image = Image::new(SIZE[0], SIZE[1], 3);
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                // 3×3 samples a pixel, and the noise of a sensor.
                let mut sum = [0.0; 3];
                for k in 0..9 {
                    let [dx, dy] = [k % 3, k / 3].map(|v| (f64::from(v) - 1.0) / 3.0);
                    let c = colour(n, x as f64 + dx, y as f64 + dy);
                    (0..3).for_each(|k| sum[k] += c[k] / 9.0);
                }
                let noisy = sum.map(|c| (c + 0.01 * random.signed()) as f32);
                image.pixel_mut(x, y).copy_from_slice(&noisy);
            }
        }
        write_png(&folder.path().join(format!("rgbs/rgb_{n:03}.png")), &image).unwrap();
    }
    let camera = Camera { fx: 200.0, fy: 200.0, cx: 84.5, cy: 64.5, width: SIZE[0], height: SIZE[1] };
    write_manifest(folder.path(), "small", 25.0, count, &camera, serde_json::Value::Null).unwrap();
    folder
}

/// The cloth's corners in frame 0, as somebody clicks them.
fn clicked() -> Request {
    let outline = vec![[41.0, 33.0], [103.0, 35.0], [104.0, 85.0], [40.0, 87.0]];
    Request { outline: Some(outline), ..Request::default() }
}

/// Least intersection over union with the truth.
fn worst_overlap(clip: Clip, folder: &Path) -> f64 {
    let truth = |n: usize, x: f64, y: f64| cloth(clip, n, x, y).is_some();
    (0..FRAMES).map(|n| overlap(folder, n, &truth)).fold(1.0, f64::min)
}

/// Intersection over union of the mask of frame `n` with what is true at a frame, column and row.
fn overlap(folder: &Path, n: usize, truth: &dyn Fn(usize, f64, f64) -> bool) -> f64 {
    let (mask, _) = read_mask(&folder.join(format!("masks/mask_{n:03}.png"))).unwrap();
    let (mut both, mut any) = (0.0, 0.0);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let (found, truth) = (mask.pixel(x, y)[0] >= 0.5, truth(n, x as f64, y as f64));
            both += f64::from(u8::from(found && truth));
            any += f64::from(u8::from(found || truth));
        }
    }
    both / any
}

fn error(clip: Clip, request: &Request) -> String {
    let folder = scene(clip);
    let error = make(folder.path(), request, &|_| {}).unwrap_err();
    assert!(!folder.path().join("masks").exists(), "nothing is written where nothing was found");
    error.to_string()
}

#[test]
fn four_corners_are_enough() {
    for (clip, least) in [(Clip::Good, 0.97), (Clip::Shadow, 0.96), (Clip::Person, 0.95)] {
        let folder = scene(clip);
        make(folder.path(), &clicked(), &|_| {}).unwrap();
        let worst = worst_overlap(clip, folder.path());
        assert!(worst >= least, "{worst}");
        let page = std::fs::read_to_string(folder.path().join("masks.html")).unwrap();
        assert_eq!(page.matches("<figure").count(), FRAMES);
        let (mask, _) = read_mask(&folder.path().join("masks/mask_003.png")).unwrap();
        let soft = mask.data.iter().filter(|v| (0.05..0.95).contains(*v)).count();
        assert!(soft > 40, "an outline of 230 px has {soft} soft pixels");
    }
}

#[test]
fn masks_are_the_same_for_any_number_of_threads() {
    let bytes = |threads: usize| {
        let folder = scene(Clip::Person);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| make(folder.path(), &clicked(), &|_| {})).unwrap();
        ["masks/mask_000.png", "masks/mask_005.png", "masks.json", "masks.html"]
            .map(|name| std::fs::read(folder.path().join(name)).unwrap())
    };
    assert!(bytes(1) == bytes(3));
}

#[test]
fn what_was_said_before_is_kept_and_can_be_forgotten() {
    let folder = scene(Clip::Good);
    let path = folder.path();
    assert!(matches!(make(path, &Request::default(), &|_| {}), Err(Error::Usage { .. })));
    make(path, &clicked(), &|_| {}).unwrap();
    // A place on the wall beside the cloth that is said to be cloth, and the other way round.
    let clicks = vec![
        Click { frame: 2, x: 38.0, y: 60.0, inside: true },
        Click { frame: 2, x: 60.0, y: 40.0, inside: false },
    ];
    let record =
        make(path, &Request { clicks: clicks.clone(), ..Request::default() }, &|_| {}).unwrap().record;
    assert_eq!((record.outline.as_ref().map(Vec::len), record.clicks), (Some(4), clicks));
    let (mask, _) = read_mask(&path.join("masks/mask_002.png")).unwrap();
    assert!(mask.pixel(38, 60)[0] > 0.5 && mask.pixel(60, 40)[0] < 0.5);
    make(path, &Request { forget: true, ..Request::default() }, &|_| {}).unwrap();
    let record = Record::read(path).unwrap().unwrap();
    assert!(record.clicks.is_empty() && record.frames.len() == FRAMES);
    assert!(worst_overlap(Clip::Good, path) > 0.97);
    // A mask that somebody painted is not lost.
    write_png(&path.join("masks/mask_001.png"), &Image::new(SIZE[0], SIZE[1], 1)).unwrap();
    let refused = make(path, &Request::default(), &|_| {}).unwrap_err().to_string();
    assert!(refused.contains("mask_001.png") && refused.contains("changed"), "{refused}");
}

#[test]
fn an_empty_plate_is_a_source() {
    let folder = scene(Clip::Good);
    let mut plate = Image::new(SIZE[0], SIZE[1], 3);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            // Of a clip in which the cloth is far away.
            let empty = colour(Clip::Leaves, 1000, x as f64, y as f64).map(|c| c as f32);
            plate.pixel_mut(x, y).copy_from_slice(&empty);
        }
    }
    let file = folder.path().join("empty.png");
    write_png(&file, &plate).unwrap();
    make(folder.path(), &Request { plate: Some(EmptyPlace::File(file)), ..clicked() }, &|_| {}).unwrap();
    assert!(worst_overlap(Clip::Good, folder.path()) >= 0.97);
    assert_eq!(Record::read(folder.path()).unwrap().unwrap().plate.as_deref(), Some("plate.png"));
}

#[test]
fn what_masks_cannot_be_made_of_is_said_with_the_frame() {
    let told = error(Clip::Cut, &clicked());
    assert!(told.contains("frame 5") && told.contains("cut") && told.contains("frames = 0..5"), "{told}");
    let told = error(Clip::MovingCamera, &clicked());
    assert!(told.contains("camera did not stand still"), "{told}");
    let wrong = Request {
        outline: Some(vec![[5.0, 5.0], [35.0, 5.0], [35.0, 50.0], [5.0, 50.0]]),
        ..Request::default()
    };
    let told = error(Clip::Good, &wrong);
    assert!(told.contains("frame 0") && told.contains("outline"), "{told}");
    for (outline, part) in [
        (vec![[0.0, 0.0], [9.0, 9.0]], "2 corners"),
        (vec![[0.0, 0.0], [900.0, 9.0], [9.0, 90.0]], "900,9"),
        (vec![[10.0, 10.0], [80.0, 10.0], [10.0, 10.5]], "px"),
    ] {
        let told = error(Clip::Good, &Request { outline: Some(outline), ..Request::default() });
        assert!(told.contains(part) || told.contains("pixels"), "{told}");
    }
    let clicks = vec![Click { frame: 8, x: 5.0, y: 5.0, inside: true }];
    assert!(error(Clip::Good, &Request { clicks, ..clicked() }).contains("frame 8 of 8"));
}

#[test]
fn fabric_that_leaves_the_image_is_named() {
    let folder = scene(Clip::Leaves);
    match make(folder.path(), &clicked(), &|_| {}) {
        Err(error) => {
            let told = error.to_string();
            assert!(told.contains("no fabric is left in frame"), "{told}");
        }
        Ok(made) => {
            let first = made.record.doubtful().next().expect("a doubtful frame");
            assert!(first.frame <= 5, "{first:?}");
        }
    }
}
