//! Files as segmenters, cameras, phones and robots write them: masks in colours, labels and transparency, names,
//! formats, numbers of masks that begin elsewhere.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use image::{GrayImage, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::Value;
use tempfile::TempDir;
use tessuto::Image;
use tessuto::io::image::{read, read_mask, write_png};

use crate::missing::not_tested;
use crate::scene_maker::{SIZE, colour, fabric, mask};

/// Folders `frames` and `masks`, empty, beside the scene `out`.
pub(super) struct Files {
    home: TempDir,
}

const CAMERA: [&str; 6] = ["--fx", "40", "--cx", "11.5", "--cy", "13.5"];

impl Files {
    pub(super) fn new() -> Self {
        let files = Self { home: tempfile::tempdir().unwrap() };
        for sub in ["frames", "masks"] {
            std::fs::create_dir_all(files.path(sub)).unwrap();
        }
        files
    }

    /// Frames of these names, each of another colour, and masks of those.
    pub(super) fn with(frames: &[String], masks: &[String]) -> Self {
        let files = Self::new();
        for (n, name) in frames.iter().enumerate() {
            write_png(&files.path("frames").join(name), &colour(n)).unwrap();
        }
        for (n, name) in masks.iter().enumerate() {
            files.put_mask(n, name);
        }
        files
    }

    /// The mask of number `n` lacks so many pixels of the first row of the fabric, so that masks can be told apart.
    fn put_mask(&self, n: usize, name: &str) {
        write_png(&self.path("masks").join(name), &numbered(n)).unwrap();
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    pub(super) fn run(&self, words: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
        for word in words {
            match word.strip_prefix('@') {
                Some(name) => command.arg(self.path(name)),
                None => command.arg(word),
            };
        }
        let output: Output = command.output().unwrap();
        (output.status.code(), one_line(&output.stdout) + " " + &one_line(&output.stderr))
    }

    /// Imports frames with masks; the status and all that was printed.
    fn import(&self, more: &[&str]) -> (Option<i32>, String) {
        let start = ["import", "@frames", "@out", "--masks", "@masks", "--force"];
        let fps: &[&str] = if more.contains(&"--no-fps") { &[] } else { &["--fps", "25"] };
        let more: Vec<&str> = more.iter().copied().filter(|word| *word != "--no-fps").collect();
        self.run(&[&start[..], &CAMERA[..], fps, &more].concat())
    }

    fn imported(&self, more: &[&str]) -> String {
        let (status, text) = self.import(more);
        assert_eq!(status, Some(0), "{more:?}: {text}");
        text
    }

    fn refused(&self, more: &[&str], fragments: &[&str]) -> String {
        let (status, text) = self.import(more);
        assert_eq!(status, Some(3), "{more:?}: {text}");
        for fragment in fragments.iter().chain(&["hint: "]) {
            assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
        }
        assert!(!self.path("out.partial").exists());
        text
    }

    /// Which of [`numbered`] the mask of frame `k` of the scene is.
    fn number_of(&self, k: usize) -> usize {
        let (found, _) = read_mask(&self.path(&format!("out/masks/mask_{k:03}.png"))).unwrap();
        let fabric = |mask: &Image| mask.data.iter().filter(|v| **v >= 0.5).count();
        fabric(&mask()) - fabric(&found)
    }

    fn scene(&self) -> Value {
        serde_json::from_str(&std::fs::read_to_string(self.path("out/scene.json")).unwrap()).unwrap()
    }

    /// Whether the scene's mask `k` is [`mask`], exactly.
    fn is_mask(&self, k: usize) -> bool {
        read_mask(&self.path(&format!("out/masks/mask_{k:03}.png"))).unwrap().0 == mask()
    }
}

fn one_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn numbered(n: usize) -> Image {
    let mut out = mask();
    let first: Vec<usize> = (0..out.data.len()).filter(|i| out.data[*i] >= 0.5).take(n).collect();
    first.into_iter().for_each(|i| out.data[i] = 0.0);
    out
}

pub(super) fn names(range: std::ops::Range<usize>, name: impl Fn(usize) -> String) -> Vec<String> {
    range.map(name).collect()
}

/// The fabric is object 1, a strip beside it object 2.
fn label(x: u32, y: u32, objects: &[u8]) -> u8 {
    let label = if fabric(x as usize, y as usize) { 1 } else { 2 * u8::from(y < 4) };
    if objects.contains(&label) { label } else { 0 }
}

fn save_labels(path: &Path, objects: &[u8], colour: impl Fn(u8) -> [u8; 3]) {
    let pixel = |x, y| Rgb(colour(label(x, y, objects)));
    RgbImage::from_fn(SIZE as u32, SIZE as u32, pixel).save(path).unwrap();
}

/// The first colours of DAVIS's palette.
fn davis(label: u8) -> [u8; 3] {
    [[0, 0, 0], [128, 0, 0], [0, 128, 0]][usize::from(label)]
}

#[test]
fn masks_of_one_object_in_its_colour_or_label() {
    let files = Files::with(&names(0..3, |n| format!("{n:05}.png")), &[]);
    let save = |n: usize, value: &dyn Fn(u8) -> [u8; 3]| {
        save_labels(&files.path(&format!("masks/{n:05}.png")), &[1], value);
    };
    (0..3).for_each(|n| save(n, &davis));
    let text = files.imported(&[]);
    assert!(text.contains("two values, 0 and 128,0,0; taken as black and white"), "{text}");
    assert!((0..3).all(|k| files.is_mask(k)));
    // Labels in grey, and 16 bits that hold 0 and 255.
    (0..3).for_each(|n| save(n, &|label| [3 * label; 3]));
    assert!(files.imported(&[]).contains("two values, 0 and 3") && files.is_mask(2));
    for n in 0..3 {
        let pixel = |x: u32, y: u32| Luma([255 * u16::from(label(x, y, &[1]))]);
        let deep = image::ImageBuffer::<Luma<u16>, _>::from_fn(SIZE as u32, SIZE as u32, pixel);
        deep.save(files.path(&format!("masks/{n:05}.png"))).unwrap();
    }
    assert!(files.imported(&[]).contains("two values, 0 and 255") && files.is_mask(1));
}

#[test]
fn masks_of_several_objects_are_listed_and_one_is_chosen() {
    let files = Files::with(&names(0..3, |n| format!("{n:05}.png")), &[]);
    // The second object comes in later.
    for (n, objects) in [&[1][..], &[1, 2], &[2]].into_iter().enumerate() {
        save_labels(&files.path(&format!("masks/{n:05}.png")), objects, davis);
    }
    let list = ["holds 2 objects: 1: colour 0,128,0", "in 2 of 3 masks; 2: colour 128,0,0", "--object N"];
    files.refused(&[], &list);
    let told = files.refused(
        &["--object", "128,0,0"],
        &[
            "00002.png: the mask is empty (1 of 3 masks are): its brightest value is 92 of 255, \
             fabric is colour 128,0,0",
            "--frames 0..2",
        ],
    );
    assert!(!told.contains("00000.png"), "{told}");
    let text = files.imported(&["--object", "2", "--frames", "0..2"]);
    assert!(text.contains("the fabric is colour 128,0,0"), "{text}");
    assert!(files.is_mask(0) && files.is_mask(1) && !text.contains("below half"), "{text}");
    assert!(files.imported(&["--object", "#800000", "--frames", "0..2"]).contains("2 frames"));
    files.refused(&["--object", "5"], &["has no object 5; it holds 2 objects"]);
    let (status, text) = files.import(&["--object", "red"]);
    assert!(status == Some(2) && text.contains("neither a label (2) nor a colour"), "{text}");
    // Labels, of which the number is the label.
    for n in 0..3 {
        save_labels(&files.path(&format!("masks/{n:05}.png")), &[1, 2], |label| [label; 3]);
    }
    files.refused(&[], &["holds 2 objects: label 1, 44.4 % of the image in 3 of 3 masks; label 2, 16.7 %"]);
    files.imported(&["--object", "1"]);
    assert!((0..3).all(|k| files.is_mask(k)));
}

#[test]
fn every_reader_of_masks_takes_the_same_files() {
    let files = Files::with(&names(0..3, |n| format!("{n:05}.png")), &[]);
    let (status, text) =
        files.run(&[&["import", "@frames", "@out", "--fps", "25"][..], &CAMERA[..]].concat());
    assert_eq!(status, Some(0), "{text}");
    let both = files.path("both.png");
    save_labels(&both, &[1, 2], davis);
    save_labels(&files.path("none.png"), &[], davis);
    let flat =
        ["--flat", "40x40cm", "--corners", "4,6", "19,6", "19,21", "4,21", "--out", "@t.obj", "--force"];
    let of_image = ["template", "@frames/00000.png", "--mask"];
    for start in [&["masks", "@out", "--first"][..], &of_image] {
        let end: Vec<&str> = if start[0] == "template" { [&CAMERA[..], &flat[..]].concat() } else { vec![] };
        let run = |more: &[&str]| files.run(&[start, more, &end].concat());
        let (status, text) = run(&["@both.png"]);
        assert!(
            status == Some(3) && text.contains("both.png: holds 2 objects") && text.contains("--object N"),
            "{text}"
        );
        let (status, text) = run(&["@none.png"]);
        assert!(
            status == Some(3) && text.contains("none.png: the mask is empty: its brightest value is 0"),
            "{text}"
        );
        let (_, text) = run(&["@both.png", "--object", "7"]);
        assert!(text.contains("has no object 7"), "{text}");
        let (_, text) = run(&["@both.png", "--object", "128,0,0"]);
        assert!(!text.contains("objects") && !text.contains("empty"), "{text}");
    }
    // A scene whose masks are of one colour is read as if they were white.
    let scene = crate::scene_maker::TinyScene::new();
    let checked = || {
        let output =
            Command::new(env!("CARGO_BIN_EXE_tessuto")).arg("check").arg(scene.folder()).output().unwrap();
        (output.status.code(), one_line(&output.stdout))
    };
    let before = checked();
    for n in 0..4 {
        save_labels(&scene.path(&format!("masks/mask_{n:03}.png")), &[1], davis);
    }
    let (status, text) = checked();
    assert_eq!(status, Some(0), "{text}");
    assert!(
        text.contains("9 ok, 1 warnings, 0 errors") && before.1.contains("10 ok, 0 warnings"),
        "{text} {before:?}"
    );
    save_labels(&scene.path("masks/mask_002.png"), &[1, 2], davis);
    let (status, text) = checked();
    assert!(status == Some(3) && text.contains("holds 2 objects"), "{text}");
}

#[test]
fn masks_in_the_alpha_channel() {
    let files = Files::with(&names(0..2, |n| format!("{n:05}.png")), &[]);
    let save = |colour: &dyn Fn(u32, u32) -> [u8; 3]| {
        for n in 0..2 {
            let pixel = |x: u32, y: u32| {
                let [r, g, b] = colour(x, y);
                Rgba([r, g, b, 255 * u8::from(fabric(x as usize, y as usize))])
            };
            let image = RgbaImage::from_fn(SIZE as u32, SIZE as u32, pixel);
            image.save(files.path(&format!("masks/{n:05}.png"))).unwrap();
        }
    };
    save(&|_, _| [255; 3]);
    assert!(files.imported(&[]).contains("the transparency (alpha) is the mask"));
    assert!(files.is_mask(0) && files.is_mask(1));
    save(&|x, y| [(9 * x) as u8, (9 * y) as u8, (31 * x + 17 * y) as u8]);
    assert!(files.imported(&[]).contains("cut-outs: the transparency (alpha) is taken as the mask"));
    assert!(files.is_mask(1));
}

#[test]
fn what_is_noted_of_masks_is_repeated() {
    let files = Files::with(&names(0..2, |n| format!("{n:05}.png")), &[]);
    for n in 0..2 {
        // A ramp, so that nothing of it is a label, and half of white at most.
        let pixel =
            |x: u32, y: u32| Luma([if fabric(x as usize, y as usize) { 118 + (x % 9) as u8 } else { 0 }]);
        GrayImage::from_fn(SIZE as u32, SIZE as u32, pixel)
            .save(files.path(&format!("masks/{n:05}.png")))
            .unwrap();
    }
    let told =
        files.refused(&[], &["00000.png: the mask is empty (2 of 2 masks are): its brightest value is 126"]);
    assert!(told.contains("fabric must be white"), "{told}");
    // White, black where nothing is, opaque but for the name's ending: JPEG inside.
    for n in 0..2 {
        let white = GrayImage::from_fn(SIZE as u32, SIZE as u32, |x, y| {
            Luma([255 * u8::from(fabric(x as usize, y as usize))])
        });
        let file = files.path(&format!("masks/{n:05}.png"));
        white.save_with_format(file, image::ImageFormat::Jpeg).unwrap();
    }
    let text = files.imported(&[]);
    assert!(text.contains("ending does not say what the file is (in 2 masks, first 00000.png)"), "{text}");
}

#[test]
fn masks_that_begin_at_another_number_are_paired_in_order() {
    let one =
        |first: usize, ending: &'static str| names(first..first + 4, move |n| format!("{n:05}{ending}"));
    let frames = |first: usize| names(first..first + 4, |n| format!("frame_{n:05}.png"));
    for (first, mask) in [(1, 0), (0, 1), (101, 0)] {
        let files = Files::with(&frames(first), &one(mask, ".png"));
        let text = files.imported(&[]);
        assert!(
            text.contains(&format!("masks are numbered from {mask}, frames from {first}, as many of each")),
            "{text}"
        );
        assert_eq!([0, 1, 2, 3].map(|k| files.number_of(k)), [0, 1, 2, 3]);
        // A part of it shifts nothing.
        files.imported(&["--frames", "1..3"]);
        assert_eq!([0, 1].map(|k| files.number_of(k)), [1, 2]);
    }
    // Of the same names, numbers count, wherever they begin.
    let files = Files::with(&one(1, ".png"), &one(0, ".png"));
    assert!(files.imported(&[]).contains("00000.png belongs to 00001.png"));
    assert_eq!(files.number_of(3), 3);
    // One missing: nobody knows which, and no part is offered that would shift them.
    std::fs::remove_file(files.path("masks/00003.png")).unwrap();
    let told = files.refused(
        &[],
        &["no mask for 2 of 4 frames", "masks are numbered from 0, frames from 1: it is not clear"],
    );
    assert!(!told.contains("--frames"), "{told}");
}

#[test]
fn masks_of_another_rate_are_refused() {
    let frames = || names(0..8, |n| format!("f{n:03}.png"));
    let files = Files::with(&frames(), &names(0..4, |n| format!("m{:03}.png", 2 * n)));
    files.refused(&[], &["no mask for 4 of 8 frames", "for every second", "--frames 0..8 --stride 2"]);
    files.imported(&["--frames", "0..8", "--stride", "2"]);
    assert_eq!([0, 1, 2, 3].map(|k| files.number_of(k)), [0, 1, 2, 3]);
    let files = Files::with(&frames(), &names(0..4, |n| format!("m{n:03}.png")));
    files.refused(
        &[],
        &[
            "4 masks of 8 frames are of the first ones, or of every second",
            "number them as their frames (0, 2, 4 …)",
        ],
    );
    let files = Files::with(&frames(), &names(0..16, |n| format!("m{n:03}.png")));
    files.refused(&[], &["holds 16 masks for 8 frames, 2 for each: are they of another frame rate?"]);
    let files = Files::with(&frames(), &names(0..10, |n| format!("m{n:03}.png")));
    assert!(files.imported(&[]).contains("2 of 10 masks belong to no frame and are left out"));
}

#[test]
fn gaps_are_found_behind_any_number() {
    let name = |n: usize| format!("frame{n:04}_cam2.png");
    let files = Files::with(&names(0..6, name), &names(0..6, |n| format!("m{n:04}_8bit.png")));
    files.imported(&[]);
    assert_eq!(files.number_of(5), 5);
    std::fs::remove_file(files.path("frames").join(name(3))).unwrap();
    files.refused(
        &[],
        &["gap: frame0002_cam2.png is followed by frame0004_cam2.png", "--frames 0..3", "--allow-gaps"],
    );
    // Two cameras in one folder.
    for n in 0..6 {
        write_png(&files.path(&format!("frames/frame{n:04}_cam1.png")), &colour(n)).unwrap();
    }
    files.refused(&[], &["frame0000_cam1.png and frame0000_cam2.png: several takes or cameras"]);
}

#[test]
fn names_that_are_times_tell_the_rate() {
    let stamps = ["1699999.9", "1699999.934", "1699999.966", "1700000.0", "1700000.033"];
    let frames: Vec<String> = stamps.iter().map(|t| format!("frame_{t}.png")).collect();
    let files = Files::with(&frames, &names(0..5, |n| format!("m{n}.png")));
    let text = files.imported(&["--no-fps"]);
    assert!(text.contains("30 images per second, 32.0 to 34.0 ms apart, taken as evenly spaced"), "{text}");
    assert!(text.contains("frames named by their times; paired in order"), "{text}");
    assert_eq!(files.scene()["fps"], 30.0);
    assert_eq!(
        read(&files.path("out/rgbs/rgb_004.png")).unwrap(),
        read(&files.path("frames").join(&frames[4])).unwrap()
    );
    assert!(files.imported(&[]).contains("the names give 30 images per second, but 25 were given"));
    std::fs::remove_file(files.path("frames").join(&frames[2])).unwrap();
    files.refused(&["--no-fps"], &["gap: frame_1699999.934.png is followed by frame_1700000.0.png"]);
}

#[test]
fn formats_that_are_not_read_are_named() {
    let files = Files::with(&names(0..3, |n| format!("{n:05}.png")), &names(0..3, |n| format!("{n:05}.png")));
    let put = |name: &str| std::fs::write(files.path("frames").join(name), "another format").unwrap();
    // A raw file beside each image, and what is no frame.
    (0..3).for_each(|n| put(&format!("{n:05}.dng")));
    assert!(files.imported(&[]).contains("3 files are left out, of formats that are not read: 00000.dng"));
    put("cover.webp");
    assert!(files.imported(&[]).contains("4 files are left out"));
    put("00003.webp");
    put("00004.webp");
    files.refused(
        &[],
        &["has 3 files of other formats beside 3 PNG or JPEG images: 00003.webp, 00004.webp", "*.webp"],
    );
    // Nothing else, and folders in the folder.
    std::fs::remove_dir_all(files.path("frames")).unwrap();
    std::fs::create_dir_all(files.path("frames/left")).unwrap();
    write_png(&files.path("frames/left/0.png"), &colour(0)).unwrap();
    files.refused(&[], &["no PNG or JPEG image itself; folders in it have: left", "name one of them"]);
    put("IMG_0001.HEIC");
    files.refused(
        &[],
        &["has no PNG or JPEG image, but IMG_0001.HEIC", "magick mogrify -format png FOLDER/*.heic"],
    );
}

#[test]
fn what_is_noted_of_frames_is_repeated() {
    let files = Files::with(&[], &names(0..2, |n| format!("{n:05}.png")));
    for n in 0..2 {
        let image = RgbaImage::from_fn(SIZE as u32, SIZE as u32, |x, y| {
            Rgba([
                9 * x as u8,
                9 * y as u8,
                40 * n as u8,
                if fabric(x as usize, y as usize) { 255 } else { 7 },
            ])
        });
        image.save(files.path(&format!("frames/{n:05}.png"))).unwrap();
    }
    let text = files.imported(&[]);
    assert!(text.contains("frames: transparency (alpha) is ignored (in 2 files, first 00000.png)"), "{text}");
    let (status, text) = files.run(
        &[&["import", "@frames", "@out", "--alpha", "--fps", "25", "--force"][..], &CAMERA[..]].concat(),
    );
    assert!(status == Some(0) && !text.contains("ignored"), "{text}");
}

#[test]
fn a_video_of_masks_in_colours_is_refused() {
    let ffmpeg = std::env::var_os("TESSUTO_FFMPEG").unwrap_or_else(|| "ffmpeg".into());
    if Command::new(&ffmpeg).arg("-version").output().is_err() {
        return not_tested("ffmpeg");
    }
    let files = Files::with(&names(0..3, |n| format!("{n:05}.png")), &[]);
    let encode = |colour: &dyn Fn(u8) -> [u8; 3]| {
        for n in 0..3 {
            save_labels(&files.path(&format!("masks/{n:05}.png")), &[1, 2], colour);
        }
        let output = Command::new(&ffmpeg)
            .args(["-y", "-v", "error", "-nostdin", "-framerate", "25", "-i"])
            .arg(files.path("masks/%05d.png"))
            .args(["-c:v", "ffv1", "-pix_fmt", "yuv420p"])
            .arg(files.path("masks.mkv"))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", one_line(&output.stderr));
    };
    let import = || {
        let words = ["import", "@frames", "@out", "--masks", "@masks.mkv", "--fps", "25", "--force"];
        files.run(&[&words[..], &CAMERA[..]].concat())
    };
    encode(&davis);
    let (status, text) = import();
    assert!(status == Some(3) && text.contains("masks.mkv: frame 0 is coloured in"), "{text}");
    assert!(text.contains("as a folder of PNG images"), "{text}");
    // White for the fabric alone, and nothing in all frames.
    encode(&|label| [255 * u8::from(label == 1); 3]);
    assert_eq!(import().0, Some(0));
    encode(&|_| [0; 3]);
    let (status, text) = import();
    assert!(
        status == Some(3) && text.contains("masks.mkv, frame 0: the mask is empty (3 of 3 masks are)"),
        "{text}"
    );
}

#[test]
fn plain_cloth_of_which_only_the_border_moves_is_no_wrong_outline() {
    let files = Files::new();
    let sheet = |n: u32, x: u32, y: u32| (30 + n..66 + n).contains(&x) && (30..66).contains(&y);
    for n in 0..4 {
        let image = RgbImage::from_fn(96, 96, |x, y| {
            let print = ((x * 37 + y * 91 + x * y * 7) % 60) as u8;
            Rgb(if sheet(n, x, y) { [180, 90, 20] } else { [20 + print, 40, 60] })
        });
        image.save(files.path(&format!("frames/{n:03}.png"))).unwrap();
    }
    let first = RgbImage::from_fn(96, 96, |x, y| Rgb(if sheet(0, x, y) { [128, 0, 0] } else { [0; 3] }));
    first.save(files.path("first.png")).unwrap();
    let (status, text) = files.run(&["import", "@frames", "@out", "--fps", "25", "--fx", "100"]);
    assert_eq!(status, Some(0), "{text}");
    let (status, text) = files.run(&["masks", "@out", "--first", "@first.png"]);
    assert!(status == Some(0) && text.contains("4 masks, confidence"), "{text}");
    assert!(text.contains("two values, 0 and 128,0,0"), "{text}");
}

#[test]
fn after_a_cut_the_take_of_the_outline_is_offered() {
    let files = Files::new();
    // Seven frames; the scene is every second one from the first on, and the cut is behind its second.
    for n in 0..14 {
        let image = RgbImage::from_fn(96, 96, |x, y| {
            let inside = (30 + n / 2..66 + n / 2).contains(&x) && (30..66).contains(&y);
            let print = ((x * 37 + y * 91 + x * y * 7) % 60) as u8;
            let place = if n < 5 { [20 + print, 40, 60] } else { [200, 190 - print, 160] };
            Rgb(if inside { [180, 90 + print, 20] } else { place })
        });
        image.save(files.path(&format!("frames/{n:03}.png"))).unwrap();
    }
    let camera = ["--fps", "25", "--fx", "100", "--force", "--frames", "1..14", "--stride", "2"];
    let outline = ["--outline", "30,30 65,30 65,65 30,65"];
    let (status, text) = files.run(&[&["import", "@frames", "@out"][..], &camera[..], &outline[..]].concat());
    assert_eq!(status, Some(3), "{text}");
    assert!(text.contains("frame 2: the whole image changes here: a cut"), "{text}");
    assert!(
        text.contains("begins with frame 0, to which the outline belongs") && text.contains("--frames 1..4"),
        "{text}"
    );
}
