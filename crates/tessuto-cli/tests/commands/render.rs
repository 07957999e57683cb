//! `tessuto render` under lights of the user's own, and what it and `tessuto appearance` refuse.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;
use tessuto::Image;
use tessuto::Positions;
use tessuto::io::hdr::write_exr;
use tessuto::io::{image, npy};

fn tessuto(arguments: &[&str], ffmpeg: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.args(arguments).env("TESSUTO_FFMPEG", ffmpeg).output().unwrap()
}

fn succeed(arguments: &[&str], ffmpeg: &Path) -> String {
    let output = tessuto(arguments, ffmpeg);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Asserts status 3 and all `fragments` in the message.
fn refused(arguments: &[&str], fragments: &[&str]) {
    let output = tessuto(arguments, Path::new("no-such-program"));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{arguments:?}: {message}");
    for fragment in fragments {
        assert!(message.contains(fragment), "{fragment:?} is missing in: {message}");
    }
    assert!(message.contains("hint: "), "{message}");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Scene and result that all tests share, made once.
fn made() -> (PathBuf, PathBuf) {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().unwrap();
        let [scene, result] = ["scene", "result"].map(|name| folder.path().join(name));
        let nothing = Path::new("no-such-program");
        succeed(
            &["synth", text(&scene), "--frames", "3", "--size", "64", "--grid", "7x7", "--seed", "3"],
            nothing,
        );
        let mut arguments = vec!["reconstruct", text(&scene), "--out", text(&result)];
        for setting in [
            "texture.size=32",
            "appearance.steps=4",
            "appearance.batch=500",
            "appearance.map_size=32",
            "appearance.render_samples_per_pixel=8",
        ] {
            arguments.extend(["--set", setting]);
        }
        succeed(&arguments, nothing);
        folder
    };
    let folder = FOLDER.get_or_init(make).path();
    (folder.join("scene"), folder.join("result"))
}

/// A light of 16 × 8 texels of which `radiance` gives the colour by column.
fn light(path: &Path, radiance: impl Fn(usize) -> [f32; 3]) {
    let mut image = Image::new(16, 8, 3);
    for y in 0..8 {
        for x in 0..16 {
            image.pixel_mut(x, y).copy_from_slice(&radiance(x));
        }
    }
    write_exr(path, &image).unwrap();
}

/// Mean linear colour of frame 0 of `result` under the light in `file`.
fn mean_under(result: &Path, file: &Path) -> [f64; 3] {
    let out = file.with_extension("views");
    let arguments = ["render", text(result), "--camera", "original", "--environment", text(file)];
    let more = ["--frames", "0..1", "--samples", "64", "--out", text(&out)];
    let said = succeed(&[&arguments[..], &more].concat(), Path::new("no-such-program"));
    assert!(said.contains("no video.mp4") && said.contains("TESSUTO_FFMPEG"), "{said}");
    let image = image::read(&out.join("frame_000.png")).unwrap();
    let mut sums = [0.0; 3];
    for pixel in image.data.chunks_exact(3) {
        for (sum, value) in sums.iter_mut().zip(pixel) {
            let v = f64::from(*value);
            *sum += if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        }
    }
    sums.map(|s| s / (image.data.len() / 3) as f64)
}

#[test]
fn a_light_that_lights_nothing_is_told() {
    let (_, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    light(&file, |_| [0.2; 3]);
    let render = |look: &str| {
        let out = folder.path().join(look);
        let start =
            ["render", text(&result), "--look", look, "--environment", text(&file), "--out", text(&out)];
        succeed(&[&start[..], &["--frames", "0..1", "--samples", "8"]].concat(), Path::new("no-such-program"))
    };
    let said = render("texture");
    assert!(
        said.contains("sky.exr has no effect on the look texture: only the look material is lit"),
        "{said}"
    );
    assert!(!render("material").contains("no effect"));
}

#[test]
fn pictures_follow_the_light_linearly() {
    let (_, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let under = |name: &str, radiance: &dyn Fn(usize) -> [f32; 3]| {
        let file = folder.path().join(name);
        light(&file, radiance);
        mean_under(&result, &file)
    };
    assert_eq!(under("dark.exr", &|_| [0.0; 3]), [0.0; 3]);
    let red = under("red.exr", &|_| [0.2, 0.0, 0.0]);
    assert!(red[0] > 0.005 && red[1] == 0.0 && red[2] == 0.0, "{red:?}");
    // Halves of the sky add up to the whole, and twice the light is twice as bright: 8-bit rounding is left over.
    let whole = under("whole.exr", &|_| [0.2; 3])[0];
    let left = under("left.exr", &|x| [if x < 8 { 0.2 } else { 0.0 }; 3])[0];
    let right = under("right.exr", &|x| [if x < 8 { 0.0 } else { 0.2 }; 3])[0];
    let twice = under("twice.exr", &|_| [0.4; 3])[0];
    println!("red {red:?} whole {whole:.5} halves {:.5} twice {twice:.5}", left + right);
    assert!((left + right - whole).abs() < 0.05 * whole && left > 0.0 && right > 0.0);
    assert!((twice - 2.0 * whole).abs() < 0.02 * twice);
}

#[test]
fn lights_that_are_none_are_refused_and_nothing_is_written() {
    let (_, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("views");
    let file = folder.path().join("light.exr");
    let tries = [(f32::NAN, "column 5"), (-1.0, "column 5"), (f32::INFINITY, "column 5"), (1e9, "column 5")];
    for (bad, fragment) in tries {
        light(&file, |x| if x == 5 { [0.5, bad, 0.5] } else { [0.5; 3] });
        refused(
            &["render", text(&result), "--environment", text(&file), "--out", text(&out)],
            &["light.exr", fragment],
        );
        assert!(!out.exists());
    }
    write_exr(&file, &Image::new(12, 8, 3)).unwrap();
    refused(
        &["render", text(&result), "--environment", text(&file), "--out", text(&out)],
        &["light.exr", "12"],
    );
    std::fs::write(&file, "no image").unwrap();
    refused(&["render", text(&result), "--environment", text(&file), "--out", text(&out)], &["light.exr"]);
    let missing = folder.path().join("missing.hdr");
    refused(
        &["render", text(&result), "--environment", text(&missing), "--out", text(&out)],
        &["missing.hdr"],
    );
    assert!(!out.exists());
}

#[test]
fn motions_that_do_not_fit_are_refused_and_the_material_stays() {
    let (scene, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("result");
    for from in ["", "material"].map(|part| result.join(part)) {
        let to = copy.join(from.strip_prefix(&result).unwrap());
        std::fs::create_dir_all(&to).unwrap();
        for entry in from.read_dir().unwrap().map(Result::unwrap).filter(|e| e.path().is_file()) {
            std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }
    let motion = npy::read_field(&result.join("motion.npy")).unwrap();
    let material = std::fs::read(copy.join("material/diffuse.png")).unwrap();
    let spoilt = |change: &dyn Fn(&mut Vec<Positions>), fragments: &[&str]| {
        let mut other = motion.clone();
        change(&mut other);
        npy::write_field(&copy.join("motion.npy"), &other).unwrap();
        refused(&["appearance", text(&scene), text(&copy)], fragments);
        assert_eq!(std::fs::read(copy.join("material/diffuse.png")).unwrap(), material);
        assert!(!copy.join("rerendered").exists());
    };
    spoilt(&|m| m.iter_mut().flatten().for_each(|x| x.x += 50.0), &["no pixel shows the cloth"]);
    spoilt(&|m| m[1][4].y = f64::NAN, &["motion.npy"]);
    spoilt(&|m| m.iter_mut().for_each(|s| _ = s.pop()), &["48 vertices"]);
    spoilt(&|m| _ = m.pop(), &["2 frames"]);
    std::fs::remove_file(copy.join("motion.npy")).unwrap();
    refused(&["appearance", text(&scene), text(&copy)], &["motion.npy"]);
}

#[test]
fn camera_or_light_go_once_around() {
    let (_, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let nothing = Path::new("no-such-program");
    let picture = |out: &Path, n: usize| image::read(&out.join(format!("frame_{n:03}.png"))).unwrap();
    let film = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        let common = ["render", text(&result), "--samples", "8", "--size", "32x32", "--out", text(&out)];
        succeed(&[&common[..], options].concat(), nothing);
        out
    };
    let about = ["--turn", "camera", "--camera", "0", "--frames", "1..2", "--pictures", "4"];
    let turntable = film("turntable", &about);
    assert!(turntable.join("frame_003.png").is_file() && !turntable.join("frame_004.png").exists());
    let still = film("still", &["--camera", "0", "--frames", "1..2", "--pictures", "2"]);
    // Without a turn all pictures of one frame are the same; the turntable's are not, and start alike.
    assert_eq!(picture(&still, 0).data, picture(&still, 1).data);
    assert_ne!(picture(&turntable, 0).data, picture(&turntable, 2).data);
    let file = folder.path().join("side.exr");
    light(&file, |x| if (6..10).contains(&x) { [0.0; 3] } else { [0.4, 0.3, 0.2] });
    let under = ["--environment", text(&file), "--camera", "original", "--turn", "light"];
    let relit = film("relit", &under);
    let sum = |n: usize| picture(&relit, n).data.iter().sum::<f32>();
    // The light from behind the camera is what the cloth shows: the dark quarter of the light comes there in between.
    assert!(sum(0) > 1.02 * sum(1), "{} {}", sum(0), sum(1));
    let bad = |options: &[&str], fragment: &str| {
        let out = folder.path().join("bad");
        let arguments = [&["render", text(&result), "--out", text(&out)][..], options].concat();
        let output = tessuto(&arguments, nothing);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && message.contains(fragment) && !out.exists(), "{message}");
    };
    bad(&["--turn", "camera", "--camera", "original"], "give degrees");
    bad(&["--turn", "light", "--look", "depth"], "only the material is lit");
}

#[cfg(unix)]
#[test]
fn ffmpeg_gets_the_frames_and_its_failure_keeps_them() {
    use std::os::unix::fs::PermissionsExt;
    let (_, result) = made();
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("ffmpeg");
    let write = |script: &str| {
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let out = folder.path().join("views");
    let arguments = ["render", text(&result), "--look", "depth", "--size", "33x31", "--out", text(&out)];
    write("echo \"$@\" > video.mp4; ls >> video.mp4");
    assert!(succeed(&arguments, &program).contains("video.mp4"));
    let got = std::fs::read_to_string(out.join("video.mp4")).unwrap();
    assert!(
        got.contains("frame_%03d.png") && got.contains("frame_002.png") && !got.contains("frame_003"),
        "{got}"
    );
    write("exit 1");
    assert!(
        succeed(&[&arguments[..], &["--force"]].concat(), &program).contains("no video.mp4: ffmpeg ended")
    );
    assert!(out.join("frame_002.png").is_file() && !out.join("video.mp4").exists());
}
