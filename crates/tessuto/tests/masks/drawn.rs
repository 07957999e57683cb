//! An outline that somebody drew around the whole fabric binds, also where the fabric has the colours beside it.

use std::path::Path;

use tessuto::Image;
use tessuto::io::image::{read_mask, write_png};
use tessuto::masks::{Border, Click, Record, Request, make};

use super::{CLOTH, Clip, SIZE, corner, filmed, overlap, scene, worst_overlap};

const COUNT: usize = 14;
/// Width and height of the sheet [px].
const SHEET: [f64; 2] = [70.0, 60.0];
/// Its upper left corner in frame 0 [px].
const CORNER: [f64; 2] = [48.25, 34.5];

/// Place on the sheet, which moves over a table.
fn on_sheet(n: usize, x: f64, y: f64) -> Option<[f64; 2]> {
    let t = n as f64;
    let [u, v] = [x - CORNER[0] - 9.0 * (t / 4.0).sin(), y - CORNER[1] - 5.0 * (t / 3.0).sin()];
    ((0.0..=SHEET[0]).contains(&u) && (0.0..=SHEET[1]).contains(&v)).then_some([u, v])
}

/// A printed sheet with half a diamond at its right side that is white as the table.
fn colour(n: usize, x: f64, y: f64) -> [f64; 3] {
    let white = |x: f64, y: f64| [0.82, 0.82, 0.8].map(|c| c + 0.01 * (x / 5.0).sin() * (y / 7.0).cos());
    match on_sheet(n, x, y) {
        Some([u, v]) if (u - SHEET[0]).abs() + (v - 30.0).abs() < 14.0 => white(u, v),
        Some([u, v]) => {
            let wave = ((u / 5.0).sin() * (v / 4.0).cos() + (u / 11.0 + v / 7.0).sin()) * 0.1;
            [0.25 + wave, 0.3 - wave, 0.45 + 0.5 * wave]
        }
        None => white(x, y),
    }
}

/// The sheet's border in frame 0, of six points.
fn drawn() -> Request {
    let [x, y] = CORNER;
    let [w, h] = SHEET;
    let outline = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0], [0.0, 1.0]];
    let outline = outline.map(|[s, t]| [x + s * w, y + t * h]).to_vec();
    Request { outline: Some(outline), ..Request::default() }
}

fn overlaps(folder: &Path) -> Vec<f64> {
    (0..COUNT).map(|n| overlap(folder, n, &|n, x, y| on_sheet(n, x, y).is_some())).collect()
}

fn first_mask(folder: &Path) -> Image {
    read_mask(&folder.join("masks/mask_000.png")).unwrap().0
}

/// How much of the pixel of the drawn rectangle covers.
fn covered(x: usize, y: usize) -> f64 {
    let part = |at: usize, c: usize| {
        let [low, high] = [CORNER[c], CORNER[c] + SHEET[c]];
        ((at as f64 + 0.5).min(high) - (at as f64 - 0.5).max(low)).clamp(0.0, 1.0)
    };
    part(x, 0) * part(y, 1)
}

#[test]
fn the_first_frame_is_what_was_drawn() {
    let folder = filmed(COUNT, &colour);
    make(folder.path(), &Request { border: Some(Border::Found), ..drawn() }, &|_| {}).unwrap();
    let found = overlaps(folder.path());
    let made = make(folder.path(), &drawn(), &|_| {}).unwrap();
    let bound = overlaps(folder.path());
    println!("found {found:.4?}\nbound {bound:.4?}");
    let mask = first_mask(folder.path());
    for (i, value) in mask.data.iter().enumerate() {
        let [x, y] = [i % SIZE[0], i / SIZE[0]];
        assert!((f64::from(*value) - covered(x, y)).abs() < 0.01, "{x},{y}: {value}");
    }
    assert_eq!((made.record.frames[0].confidence, &made.record.frames[0].reason), (1.0, &None));
    // Colours alone cut the half diamond out, 196 of 4200 px, sooner or later.
    assert!(found[0] < 0.97, "{found:?}");
    for n in 1..COUNT {
        assert!(bound[n] >= found[n] - 0.002, "frame {n}: {found:?} {bound:?}");
    }
    assert!(bound[0] > 0.999 && bound.iter().all(|o| *o > 0.96), "{bound:?}");
}

#[test]
fn other_frames_are_found_as_without_a_drawn_one() {
    let [x, y] = corner(Clip::Good, 0);
    let lower = (0..=16).rev().map(|k| {
        let u = CLOTH[0] * f64::from(k) / 16.0;
        [x + u, y + CLOTH[1] + 4.0 * (u / 12.0).sin()]
    });
    let outline: Vec<_> = [[x, y], [x + CLOTH[0], y]].into_iter().chain(lower).collect();
    for clip in [Clip::Good, Clip::Shadow, Clip::Person] {
        let folder = scene(clip);
        let worst = [Border::Found, Border::Drawn].map(|border| {
            let request =
                Request { outline: Some(outline.clone()), border: Some(border), ..Request::default() };
            make(folder.path(), &request, &|_| {}).unwrap();
            worst_overlap(clip, folder.path())
        });
        println!("found {:.4}, drawn {:.4}", worst[0], worst[1]);
        assert!(worst[1] > worst[0] - 0.002 && worst[1] > 0.95, "{worst:?}");
    }
}

#[test]
fn a_mask_of_the_first_frame_binds_and_is_kept() {
    let folder = filmed(COUNT, &colour);
    let mut mask = Image::new(SIZE[0], SIZE[1], 1);
    let values = (0..SIZE[0] * SIZE[1]).map(|i| (covered(i % SIZE[0], i / SIZE[0]) * 255.0).round() / 255.0);
    mask.data = values.map(|v| v as f32).collect();
    let file = folder.path().join("of_somebody.png");
    write_png(&file, &mask).unwrap();
    make(folder.path(), &Request { first: Some(file), ..Request::default() }, &|_| {}).unwrap();
    assert!(first_mask(folder.path()) == mask);
    // A click in another frame leaves it; one in this frame says otherwise, and where.
    let click = |frame: usize, x: f64| Request {
        clicks: vec![Click { frame, x, y: 64.0, inside: false }],
        ..Request::default()
    };
    make(folder.path(), &click(5, 20.0), &|_| {}).unwrap();
    assert!(first_mask(folder.path()) == mask);
    make(folder.path(), &click(0, 113.0), &|_| {}).unwrap();
    let clicked = first_mask(folder.path());
    assert_eq!(clicked.pixel(113, 64)[0], 0.0);
    let differs = |i: &usize| (clicked.data[*i] - mask.data[*i]).abs() > 0.01;
    let far = (0..mask.data.len())
        .filter(differs)
        .map(|i| (i % SIZE[0]).abs_diff(113).max((i / SIZE[0]).abs_diff(64)));
    assert!(far.max().unwrap() < 24, "only around the click");
    make(folder.path(), &Request { forget: true, ..Request::default() }, &|_| {}).unwrap();
    assert!(first_mask(folder.path()) == mask);
    let record = Record::read(folder.path()).unwrap().unwrap();
    assert_eq!((record.first.as_deref(), record.outline), (Some("drawn.png"), None));
}
