//! Scenes from what people have: images, videos, masks and camera files of other programs, good and bad.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::missing::not_tested;
use crate::scene_maker::{FRAMES, SIZE, colour, contents, fabric, mask, template};
use serde_json::Value;
use tempfile::TempDir;
use tessuto::Image;
use tessuto::import::{Calibration, read_calibration};
use tessuto::io::image::{read, read_mask, write_png};
use tessuto::io::obj;

/// A folder whose name has a space and letters beyond ASCII, with frames, masks and a template.
struct Recording {
    home: TempDir,
}

impl Recording {
    fn new() -> Self {
        let recording = Self { home: tempfile::tempdir().unwrap() };
        for sub in ["frames été", "masks été"] {
            std::fs::create_dir_all(recording.path(sub)).unwrap();
        }
        for n in 0..FRAMES {
            // Numbers without zeros: 9 comes before 10.
            write_png(&recording.path(&format!("frames été/shot {}.png", n + 8)), &colour(n)).unwrap();
            write_png(&recording.path(&format!("masks été/shot {}.mask.png", n + 8)), &mask()).unwrap();
        }
        obj::write(&recording.path("drap.obj"), &template(), None).unwrap();
        recording
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path().join("à moi").join(name)
    }

    /// Runs `tessuto import INPUT OUT …` with the test's camera; options that start with @ are paths of this folder.
    fn import(&self, input: &str, options: &[&str]) -> Output {
        self.import_with(input, options, |_| {})
    }

    fn import_with(&self, input: &str, options: &[&str], change: impl Fn(&mut Command)) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
        command.arg("import").arg(self.path(input)).arg(self.path("scène 1"));
        for option in options {
            match option.strip_prefix('@') {
                Some(name) => command.arg(self.path(name)),
                None => command.arg(option),
            };
        }
        change(&mut command);
        command.output().unwrap()
    }

    /// Asserts status 0; the printed text in one line, and scene.json.
    fn imported(&self, input: &str, options: &[&str]) -> (String, Value) {
        let output = self.import(input, options);
        let text = one_line(&output.stdout);
        assert!(output.status.success(), "{options:?}: {text}\n{}", one_line(&output.stderr));
        let manifest = std::fs::read_to_string(self.path("scène 1/scene.json")).unwrap();
        (text, serde_json::from_str(&manifest).unwrap())
    }

    /// Asserts the status, all fragments in the message, and that no scene was made.
    fn refused(&self, status: i32, input: &str, options: &[&str], fragments: &[&str]) {
        let there = self.path("scène 1").exists();
        let output = self.import(input, options);
        let text = one_line(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{options:?}: {text}");
        for fragment in fragments.iter().chain(&["hint: "]) {
            assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
        }
        assert_eq!(self.path("scène 1").exists(), there);
        assert!(!self.path("scène 1.partial").exists());
    }
}

fn one_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).split_whitespace().collect::<Vec<_>>().join(" ")
}

const CAMERA: [&str; 6] = ["--fx", "40", "--cx", "11.5", "--cy", "13.5"];
const MASKS: [&str; 2] = ["--masks", "@masks été"];

/// The options every import of images here has, and `more`.
fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&MASKS[..], &CAMERA[..], &["--fps", "25"], more].concat()
}

#[test]
fn pictures_become_a_checked_scene() {
    let recording = Recording::new();
    let (text, scene) = recording.imported("frames été", &with(&["--template", "@drap.obj"]));
    assert!(text.contains("10 ok, 0 warnings, 0 errors"), "{text}");
    assert_eq!(
        (&scene["name"], &scene["n_frames"], &scene["fps"]),
        (&"scène 1".into(), &4.into(), &25.0.into())
    );
    assert_eq!(
        (&scene["fx"], &scene["fy"], &scene["cx"], &scene["cy"]),
        (&40.0.into(), &40.0.into(), &11.5.into(), &13.5.into())
    );
    // Shot 8 is frame 0, shot 11 frame 3, bit for bit.
    for (n, shot) in [(0, 8), (3, 11)] {
        let original = std::fs::read(recording.path(&format!("frames été/shot {shot}.png"))).unwrap();
        assert_eq!(std::fs::read(recording.path(&format!("scène 1/rgbs/rgb_00{n}.png"))).unwrap(), original);
    }
    // What is there is not replaced unasked, and what does not belong to a scene not at all.
    let before = contents(&recording.path("scène 1"));
    recording.refused(3, "frames été", &with(&[]), &["already exists", "--force"]);
    assert_eq!(contents(&recording.path("scène 1")), before);
    let (_, scene) =
        recording.imported("frames été", &with(&["--force", "--frames", "1..4", "--stride", "2"]));
    assert_eq!((&scene["n_frames"], &scene["fps"]), (&2.into(), &12.5.into()));
    assert!(recording.path("scène 1/template.obj").is_file(), "the template is kept where no other is given");
    assert_eq!(
        read(&recording.path("scène 1/rgbs/rgb_001.png")).unwrap(),
        read(&recording.path("frames été/shot 11.png")).unwrap()
    );
    std::fs::write(recording.path("scène 1/notes.txt"), "mine").unwrap();
    recording.refused(3, "frames été", &with(&["--force"]), &["notes.txt", "would be lost"]);
}

#[test]
fn without_template_the_way_to_one_is_shown() {
    let recording = Recording::new();
    let (text, _) = recording.imported("frames été", &with(&[]));
    assert!(text.contains("5 ok, 0 warnings, 0 errors"), "{text}");
    assert!(text.contains("tessuto template") && text.contains("--flat WIDTHxHEIGHTm --from-mask"), "{text}");
}

#[test]
fn smaller_frames_keep_the_projection() {
    let recording = Recording::new();
    let (text, scene) =
        recording.imported("frames été", &with(&["--downscale", "2", "--template", "@drap.obj"]));
    assert_eq!((&scene["width"], &scene["fx"], &scene["cx"]), (&12.into(), &20.0.into(), &5.5.into()));
    assert!(text.contains("0 errors"), "{text}");
    let small = read(&recording.path("scène 1/rgbs/rgb_000.png")).unwrap();
    let difference =
        |a: &Image, b: &Image| a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(difference(&small, &colour(0).downsampled(2)) < 1.01 / 255.0);
}

#[test]
fn transparency_as_masks() {
    let recording = Recording::new();
    let rgba = |n: usize| {
        let image = image::RgbaImage::from_fn(SIZE as u32, SIZE as u32, |x, y| {
            image::Rgba([90, 120, 40 * n as u8, if fabric(x as usize, y as usize) { 255 } else { 0 }])
        });
        image.save(recording.path(&format!("frames été/shot {}.png", n + 8))).unwrap();
    };
    let options = [&CAMERA[..], &["--fps", "25", "--alpha"]].concat();
    recording.refused(3, "frames été", &options, &["shot 8.png", "has no alpha channel"]);
    (0..FRAMES).for_each(rgba);
    recording.imported("frames été", &options);
    assert_eq!(read_mask(&recording.path("scène 1/masks/mask_003.png")).unwrap().0, mask());
    let frame = std::fs::read(recording.path("scène 1/rgbs/rgb_003.png")).unwrap();
    assert_eq!(image::load_from_memory(&frame).unwrap().color(), image::ColorType::Rgb8);
}

#[test]
fn masks_of_other_sizes_and_names() {
    let recording = Recording::new();
    for n in 0..FRAMES {
        let file = recording.path(&format!("masks été/shot {}.mask.png", n + 8));
        std::fs::remove_file(file).unwrap();
        // Half the size, inverted, other names with the same numbers.
        let mut small = mask().downsampled(2);
        small.data.iter_mut().for_each(|v| *v = 1.0 - *v);
        write_png(&recording.path(&format!("masks été/m_{:03}.png", n + 8)), &small).unwrap();
    }
    let (text, _) = recording.imported("frames été", &with(&["--invert-masks"]));
    assert!(text.contains("4 masks have another size than the frames and were scaled"), "{text}");
    let (found, _) = read_mask(&recording.path("scène 1/masks/mask_002.png")).unwrap();
    assert!(found.data.iter().zip(&mask().data).all(|(a, b)| (a >= &0.5) == (b >= &0.5)));
    write_png(&recording.path("masks été/m_010.png"), &Image::new(SIZE, SIZE / 2, 1)).unwrap();
    recording.refused(3, "frames été", &with(&["--force"]), &["m_010.png", "24×12", "another shape"]);
}

#[test]
fn missing_masks_and_gaps() {
    let recording = Recording::new();
    std::fs::remove_file(recording.path("masks été/shot 10.mask.png")).unwrap();
    recording.refused(
        3,
        "frames été",
        &with(&[]),
        &["has no mask for 1 of 4 frames: shot 10.png", "--frames 0..2"],
    );
    recording.imported("frames été", &with(&["--frames", "0..2"]));
    std::fs::remove_file(recording.path("frames été/shot 10.png")).unwrap();
    recording.refused(
        3,
        "frames été",
        &with(&["--force"]),
        &["gap: shot 9.png is followed by shot 11.png", "--allow-gaps"],
    );
    recording.imported("frames été", &with(&["--force", "--allow-gaps"]));
}

#[test]
fn wrong_input() {
    let recording = Recording::new();
    let no_fps = [&MASKS[..], &CAMERA[..]].concat();
    recording.refused(2, "frames été", &no_fps, &["frame rate", "--fps"]);
    let no_camera = [&MASKS[..], &["--fps", "25"]].concat();
    recording.refused(2, "frames été", &no_camera, &["camera is not given", "--fov", "--camera estimate"]);
    recording.refused(
        2,
        "frames été",
        &with(&["--frames", "2..9"]),
        &["frames 2..9 of 4 frames", "0 ≤ A < B ≤ 4: --frames A..B"],
    );
    recording.refused(3, "nothing", &with(&[]), &["nothing", "does not exist"]);
    let wide = [&MASKS[..], &["--fps", "25", "--fov", "500"]].concat();
    recording.refused(2, "frames été", &wide, &["--fov is 500"]);
}

/// A QuickTime file's metadata: the focal length in 35 mm terms as text.
fn quicktime_metadata(value: &[u8]) -> Vec<u8> {
    let in_box =
        |kind: &[u8], content: &[u8]| [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat();
    let name = in_box(b"mdta", b"com.apple.quicktime.camera.focal_length.35mm_equivalent");
    let data = in_box(b"data", &[&[0, 0, 0, 1, 0, 0, 0, 0], value].concat());
    let meta = [
        in_box(b"hdlr", &[0; 25]),
        in_box(b"keys", &[&[0, 0, 0, 0, 0, 0, 0, 1][..], &name].concat()),
        in_box(b"ilst", &in_box(&[0, 0, 0, 1], &data)),
    ];
    in_box(b"moov", &in_box(b"trak", &in_box(b"meta", &meta.concat())))
}

#[cfg(unix)]
#[test]
fn the_camera_that_the_video_says_or_one_to_be_estimated() {
    let recording = Recording::new();
    let script = stand_in(&recording, &said([0, 1, 2, 3], "1/25", ""), "exit 0");
    for n in 0..FRAMES {
        let from = recording.path(&format!("masks été/shot {}.mask.png", n + 8));
        std::fs::rename(from, recording.path(&format!("masks été/{:04}.png", n + 1))).unwrap();
    }
    let import = |bytes: &[u8], more: &[&str]| {
        std::fs::write(recording.path("clip.mov"), bytes).unwrap();
        let options = [&["--masks", "@masks été"], more].concat();
        let output = recording.import_with("clip.mov", &options, |command| {
            command.env("TESSUTO_FFMPEG", &script);
        });
        (output.status.code(), one_line(&output.stdout) + &one_line(&output.stderr))
    };
    let scene = || -> Value {
        let text = std::fs::read_to_string(recording.path("scène 1/scene.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let (status, text) = import(b"nothing", &[]);
    assert!(status == Some(2) && text.contains("the camera is not given"), "{text}");
    let (status, text) = import(&quicktime_metadata(b"26"), &[]);
    assert!(status == Some(0) && text.contains("says of its lens 26 mm in 35-mm terms"), "{text}");
    let diagonal = |mm: f64| mm * 24.0 * 2f64.sqrt() / 36f64.hypot(24.0);
    assert!((scene()["fx"].as_f64().unwrap() - diagonal(26.0)).abs() < 1e-9, "{}", scene());
    assert_eq!(scene()["notes"]["camera"]["uncertainty"], 0.06);
    assert!(!text.contains("focal length is known"), "{text}");
    // What is given counts more; what nobody says is assumed, and doubted.
    assert_eq!(import(&quicktime_metadata(b"26"), &["--fx", "40", "--force"]).0, Some(0));
    assert_eq!(scene()["fx"], 40.0);
    let (status, text) = import(b"nothing", &["--camera", "estimate", "--force"]);
    assert!(status == Some(0) && text.contains("focal length is known to 20 % only"), "{text}");
    assert!((scene()["fx"].as_f64().unwrap() - diagonal(28.0)).abs() < 1e-9, "{}", scene());
}

#[test]
fn frames_that_cannot_be_used() {
    let recording = Recording::new();
    write_png(&recording.path("frames été/shot 9.png"), &Image::new(SIZE + 1, SIZE, 3)).unwrap();
    recording.refused(3, "frames été", &with(&[]), &["shot 9.png", "25×24", "the first frame 24×24"]);
    std::fs::write(recording.path("frames été/shot 9.png"), "no image").unwrap();
    recording.refused(3, "frames été", &with(&[]), &["shot 9.png", "neither PNG nor JPEG"]);
}

/// A camera file of this name and text, read.
pub(super) fn camera_file(name: &str, text: &str) -> tessuto::Result<Calibration> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_calibration(&path, None)
}

#[test]
fn cameras_of_other_programs() {
    let fitted = |name: &str, text: &str, size: [usize; 2]| {
        let calibration = camera_file(name, text).unwrap();
        let camera = calibration.scaled_to(size, &mut Vec::new()).unwrap();
        ([camera.fx, camera.fy, camera.cx, camera.cy], calibration.distortion)
    };
    let colmap = "# Camera list\n1 OPENCV 1920 1080 1500 1510 960 540 -0.1 0.02 0.001 -0.002\n";
    let (camera, d) = fitted("cameras.txt", colmap, [1920, 1080]);
    // The corner of the first pixel is COLMAP's origin, its centre ours.
    assert_eq!(
        (camera, d.k1, d.k2, d.p1, d.p2, d.k3),
        ([1500.0, 1510.0, 959.5, 539.5], -0.1, 0.02, 0.001, -0.002, 0.0)
    );
    // Half the size, half the focal length.
    assert_eq!(fitted("cameras.txt", colmap, [960, 540]).0, [750.0, 755.0, 479.5, 269.5]);
    assert_eq!(
        fitted("cameras.txt", "7 SIMPLE_RADIAL 640 480 500 320 240 0.1", [640, 480]).0,
        [500.0, 500.0, 319.5, 239.5]
    );
    let nerfstudio = r#"{"camera_model": "OPENCV", "fl_x": 1500, "fl_y": 1510, "cx": 960, "cy": 540,
        "w": 1920, "h": 1080, "k1": -0.1, "frames": []}"#;
    let (camera, d) = fitted("transforms.json", nerfstudio, [1920, 1080]);
    assert_eq!((camera, d.k1), ([1500.0, 1510.0, 959.5, 539.5], -0.1));
    let blender = r#"{"camera_angle_x": 1.5707963267948966, "frames": []}"#;
    let (camera, _) = fitted("transforms.json", blender, [800, 600]);
    assert!((camera[0] - 400.0).abs() < 1e-9 && camera[2..] == [399.5, 299.5]);
    let opencv = "%YAML:1.0\n---\nimage_width: 1920\nimage_height: 1080\n\
                  camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                  data: [ 1.5e+03, 0., 959.5, 0.,\n       1510., 539.5, 0., 0., 1. ]\n\
                  distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   \
                  data: [ -1.0e-01, 2.0e-02, 1.0e-03, -2.0e-03, 5.0e-03 ]\n";
    let (camera, d) = fitted("camera.yml", opencv, [1920, 1080]);
    assert_eq!((camera, d.k1, d.p2, d.k3), ([1500.0, 1510.0, 959.5, 539.5], -0.1, -0.002, 0.005));
    let json = r#"{"K": [[1500, 0, 959.5], [0, 1510, 539.5], [0, 0, 1]],
        "dist": [[-0.1, 0.02, 0.001, -0.002, 0.005]]}"#;
    assert_eq!(fitted("calibration.json", json, [1920, 1080]), (camera, d));
}

#[test]
fn cameras_that_are_refused() {
    let nerfstudio = |more: &str| format!("{{\"fl_x\": 1500, \"frames\": []{more}}}");
    let yaml = |more: &str| {
        format!("camera_matrix: {{rows: 3, cols: 3, data: [9, 0, 4, 0, 9, 4, 0, 0, 1]}}\n{more}")
    };
    let cases = [
        (
            "cameras.txt",
            "1 FULL_OPENCV 640 480 5 5 3 2 0 0 0 0 0 0 0 0".to_owned(),
            "the camera model FULL_OPENCV is not read",
        ),
        ("cameras.txt", "1 PINHOLE 640 480 5 5 3".to_owned(), "PINHOLE has 3 parameters, 4 expected"),
        (
            "cameras.txt",
            "1 PINHOLE 640 480 5 5 3 2\n2 PINHOLE 640 480 5 5 3 2".to_owned(),
            "holds 2 cameras: 1, 2",
        ),
        (
            "transforms.json",
            nerfstudio(", \"camera_model\": \"EQUIRECTANGULAR\""),
            "the camera model EQUIRECTANGULAR is not read",
        ),
        ("transforms.json", nerfstudio(", \"k4\": 0.1"), "\"k4\" is not 0"),
        (
            "transforms.json",
            "{\"frames\": [],\n \"cx\": 5,}".to_owned(),
            "transforms.json:2: is not valid JSON",
        ),
        ("camera.yml", yaml("distortion_model: omni\n"), "the camera model omni is not read"),
        (
            "camera.yml",
            yaml("distortion_model: equidistant\n"),
            "fisheye lens, but has 0 distortion coefficients",
        ),
        ("camera.yml", yaml("D: [0, 0, 0, 0, 0, 0.5, 0, 0]\n"), "distortion coefficient 6 of 8 is 0.5"),
        ("camera.yml", "width: 5\n".to_owned(), "has no camera matrix"),
        ("camera.xml", "<a/>".to_owned(), "has the ending \"xml\""),
    ];
    for (name, text, fragment) in cases {
        let error = camera_file(name, &text).unwrap_err();
        assert!(
            error.to_string().contains(fragment) && error.exit_code() == 3,
            "{fragment:?} is missing in: {error}"
        );
    }
    let portrait = camera_file("cameras.txt", "1 PINHOLE 640 480 5 5 3 2").unwrap();
    let error = portrait.scaled_to([480, 640], &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("is for images of 640×480") && error.contains("turned by 90°"), "{error}");
}

#[test]
fn videos_without_ffmpeg_tell_how_to_get_it() {
    let recording = Recording::new();
    std::fs::write(recording.path("clip.mp4"), "not really").unwrap();
    let options = [&MASKS[..], &CAMERA[..]].concat();
    let output = recording.import_with("clip.mp4", &options, |command| {
        command.env("PATH", "").env_remove("TESSUTO_FFMPEG");
    });
    let text = one_line(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    for fragment in ["clip.mp4", "needs the program ffmpeg", "sudo apt install ffmpeg", "TESSUTO_FFMPEG"] {
        assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
    }
}

/// What a stand-in for ffprobe says of a file with one film of the test's frames at these times, `more` of which
/// are its own.
#[cfg(unix)]
fn said(times: [u32; FRAMES], time_base: &str, more: &str) -> String {
    let packets =
        times.map(|pts| format!(r#"{{"stream_index": 0, "pts": {pts}, "flags": "K_"}}"#)).join(", ");
    format!(
        r#"{{"packets": [{packets}], "frames": [{{"width": {SIZE}, "height": {SIZE}, "pix_fmt": "yuv420p"}}],
        "streams": [{{"index": 0, "codec_name": "h264", "width": {SIZE}, "height": {SIZE},
            "time_base": "{time_base}" {more}}}],
        "format": {{"format_name": "mov,mp4,m4a,3gp,3g2,mj2"}}}}"#
    )
}

/// Stand-ins for ffmpeg, which sends the test's frames as images, and for ffprobe beside it, which answers `said`;
/// the former.
#[cfg(unix)]
fn stand_in(recording: &Recording, said: &str, end: &str) -> PathBuf {
    use std::io::Write as _;
    use std::os::unix::fs::PermissionsExt as _;
    let mut frames = Vec::new();
    for n in 0..FRAMES {
        write!(frames, "P6\n{SIZE} {SIZE}\n255\n").unwrap();
        frames.extend(colour(n).data.iter().map(|v| (v * 255.0).round() as u8));
    }
    std::fs::write(recording.path("frames.ppm"), frames).unwrap();
    let write = |name: &str, does: &str| {
        let script = recording.path(name);
        let text = format!("#!/bin/sh\necho \"$@\" >> \"$(dirname \"$0\")/calls\"\n{does}\n");
        std::fs::write(&script, text).unwrap();
        std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).unwrap();
        script
    };
    let answer = if said.starts_with('{') {
        std::fs::write(recording.path("said.json"), said).unwrap();
        "/bin/cat \"$(dirname \"$0\")/said.json\"".to_owned()
    } else {
        format!("echo '{said}' >&2; exit 1")
    };
    write("ffprobe", &answer);
    write("ffmpeg", &format!("/bin/cat \"$(dirname \"$0\")/frames.ppm\"; {end}"))
}

#[cfg(unix)]
fn import_with_stand_in(recording: &Recording, script: &Path, more: &[&str]) -> (Option<i32>, String) {
    std::fs::write(recording.path("clip.mp4"), "video").unwrap();
    for n in 0..FRAMES {
        let from = recording.path(&format!("masks été/shot {}.mask.png", n + 8));
        if from.exists() {
            std::fs::rename(from, recording.path(&format!("masks été/{:04}.png", n + 1))).unwrap();
        }
    }
    let options = [&MASKS[..], &CAMERA[..], more].concat();
    let output = recording.import_with("clip.mp4", &options, |command| {
        command.env("TESSUTO_FFMPEG", script);
    });
    (output.status.code(), one_line(&output.stdout) + &one_line(&output.stderr))
}

#[cfg(unix)]
#[test]
fn what_ffmpeg_says_of_a_video_is_passed_on() {
    let recording = Recording::new();
    let turned = r#", "side_data_list": [{"side_data_type": "Display Matrix", "rotation": -90}]"#;
    let script = stand_in(&recording, &said([0, 40, 73, 100], "1/1000", turned), "exit 0");
    let (status, text) = import_with_stand_in(&recording, &script, &["--template", "@drap.obj"]);
    assert_eq!(status, Some(0), "{text}");
    for fragment in [
        "its frame rate varies (30 per",
        "30.0000 per second",
        "turned by 90°",
        "mask 1 belongs to the first frame",
        "0 errors",
    ] {
        assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
    }
    for n in 0..FRAMES {
        let found = read(&recording.path(&format!("scène 1/rgbs/rgb_00{n}.png"))).unwrap();
        let expected = colour(n);
        assert!(found.data.iter().zip(&expected.data).all(|(a, b)| (a - b).abs() < 1.0 / 255.0), "frame {n}");
    }
    // A constant rate is left alone: one frame follows the other.
    let said = said([0, 1001, 2002, 3003], "1/30000", "");
    let script = stand_in(&recording, &said, "exit 0");
    let (status, text) = import_with_stand_in(&recording, &script, &["--force"]);
    assert!(status == Some(0) && text.contains("29.97 per second"), "{text}");
    let scene = std::fs::read_to_string(recording.path("scène 1/scene.json")).unwrap();
    let scene: Value = serde_json::from_str(&scene).unwrap();
    assert_eq!(scene["fps"], 30_000.0 / 1001.0);
    // Both programs are kept to the named file and to images of a bounded size.
    let calls = std::fs::read_to_string(recording.path("calls")).unwrap();
    for call in calls.lines() {
        let is_kept = ["-protocol_whitelist file,pipe", "-format_whitelist mov,mp4,", "-max_pixels 89478485"];
        assert!(is_kept.iter().all(|option| call.contains(option)), "{call}");
    }
    // A decoder that gives up.
    let script = stand_in(&recording, &said, "echo 'moov atom not found' >&2; exit 1");
    let (status, text) = import_with_stand_in(&recording, &script, &["--force"]);
    assert!(status == Some(3) && text.contains("ffmpeg cannot decode it: moov atom not found"), "{text}");
    // A file without video.
    let script = stand_in(&recording, "clip.mp4: Invalid data found when processing input", "exit 0");
    let (status, text) = import_with_stand_in(&recording, &script, &["--force"]);
    assert!(status == Some(3) && text.contains("finds no film") && text.contains("Invalid data"), "{text}");
}

/// Where there is an ffmpeg, it is used for real: encode, import, compare.
#[test]
fn a_video_through_ffmpeg() {
    let ffmpeg = std::env::var_os("TESSUTO_FFMPEG").unwrap_or_else(|| "ffmpeg".into());
    if Command::new(&ffmpeg).arg("-version").output().is_err() {
        return not_tested("ffmpeg");
    }
    let recording = Recording::new();
    let encode = |from: &str, to: &str, more: &[&str]| {
        let mut command = Command::new(&ffmpeg);
        command
            .args(["-v", "error", "-nostdin", "-framerate", "25", "-start_number", "8", "-i"])
            .arg(recording.path(from));
        let output = command
            .args(["-c:v", "ffv1", "-pix_fmt", "bgr0"])
            .args(more)
            .arg(recording.path(to))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", one_line(&output.stderr));
    };
    encode("frames été/shot %d.png", "clip 1.mkv", &[]);
    encode("masks été/shot %d.mask.png", "masks.mkv", &[]);
    let options = [&["--masks", "@masks.mkv", "--template", "@drap.obj"][..], &CAMERA[..]].concat();
    let (text, scene) = recording.imported("clip 1.mkv", &options);
    assert!(text.contains("10 ok, 0 warnings, 0 errors"), "{text}");
    assert_eq!((&scene["fps"], &scene["n_frames"]), (&25.0.into(), &4.into()));
    let found = read(&recording.path("scène 1/rgbs/rgb_002.png")).unwrap();
    assert_eq!(found, read(&recording.path("frames été/shot 10.png")).unwrap());
    let (text, _) =
        recording.imported("clip 1.mkv", &[&options[..], &["--force", "--frames", "1..3"]].concat());
    assert!(text.contains("2 frames of 24×24 px"), "{text}");
    recording.refused(
        2,
        "clip 1.mkv",
        &[&options[..], &["--force", "--frames", "1..9"]].concat(),
        &["frames 1..9 of 4 frames"],
    );
}
