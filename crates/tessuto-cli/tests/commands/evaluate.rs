//! `tessuto evaluate` as a user runs it, on a made-up scene of one square.

use std::path::Path;
use std::process::{Command, Output};

use tessuto::{Image, io};

const FRAMES: usize = 3;

/// A square of 4 vertices, 20 cm wide and 1 m away, that does not move.
fn scene(folder: &Path) {
    for name in ["rgbs", "masks", "gt"] {
        std::fs::create_dir(folder.join(name)).unwrap();
    }
    let json = format!(
        r#"{{"name": "square", "fps": 50, "n_frames": {FRAMES}, "width": 64, "height": 64,
            "fx": 100.0, "fy": 100.0, "cx": 31.5, "cy": 31.5, "units": "m"}}"#
    );
    std::fs::write(folder.join("scene.json"), json).unwrap();
    let template = "v -0.1 -0.1 1\nv -0.1 0.1 1\nv 0.1 0.1 1\nv 0.1 -0.1 1\n\
                    vt 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(folder.join("template.obj"), template).unwrap();
    let mut mask = Image::new(64, 64, 1);
    for y in 22..=41 {
        for x in 22..=41 {
            mask.pixel_mut(x, y)[0] = 1.0;
        }
    }
    let rgb =
        Image { channels: 3, data: mask.data.iter().flat_map(|v| [*v, 0.5 * v, 0.3 * v]).collect(), ..mask };
    for k in 0..FRAMES {
        io::image::write_png(&folder.join(format!("rgbs/rgb_{k:03}.png")), &rgb).unwrap();
        io::image::write_png(&folder.join(format!("masks/mask_{k:03}.png")), &mask).unwrap();
    }
    io::npy::write(&folder.join("gt/vertices.npy"), &[FRAMES, 4, 3], &motion(0.0)).unwrap();
}

/// The square, `shift` [m] farther away in the last frame.
fn motion(shift: f32) -> Vec<f32> {
    let corners = [[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.1, -0.1]];
    (0..FRAMES)
        .flat_map(|k| corners.map(|[x, y]| [x, y, if k + 1 == FRAMES { 1.0 + shift } else { 1.0 }]))
        .flatten()
        .collect()
}

fn tessuto(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .arg("evaluate")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn prints_the_distance_as_table_and_as_json() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    std::fs::create_dir(folder.path().join("result")).unwrap();
    io::npy::write(&folder.path().join("result/motion.npy"), &[FRAMES, 4, 3], &motion(0.03)).unwrap();

    let table = tessuto(&[".", "result"], folder.path());
    let text = String::from_utf8(table.stdout).unwrap();
    assert!(table.status.success(), "{}", String::from_utf8_lossy(&table.stderr));
    assert!(text.contains("vertex") && text.contains("[m]") && text.contains("3.0000e-2"), "{text}");

    for (frames, count, mean) in [("0..3", 3, 0.01), ("2..3", 1, 0.03)] {
        let output = tessuto(&[".", "result/motion.npy", "--json", "--frames", frames], folder.path());
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(json["frames"].as_array().unwrap().len(), count);
        assert_eq!(json["frames"][count - 1]["frame"], 2);
        assert!((json["mean"]["vertex"].as_f64().unwrap() - mean).abs() < 1e-6, "{json}");
        assert!(json["mean"].get("cd1").is_none());
    }
}

#[test]
fn tracked_points_of_some_frames_are_truth_enough() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    std::fs::remove_file(folder.path().join("gt/vertices.npy")).unwrap();
    io::npy::write(&folder.path().join("motion.npy"), &[FRAMES, 4, 3], &motion(0.03)).unwrap();
    // The middle, and a corner, in frames 0 and 2.
    let tracks = io::npy::archive(&[
        ("frames", io::npy::encode(&[2], &[0u32, 2])),
        ("vertices", io::npy::encode(&[2, 4], &[0u32, 1, 2, 3, 0, 0, 0, 0])),
        ("weights", io::npy::encode(&[2, 4], &[0.25f32, 0.25, 0.25, 0.25, 1.0, 0.0, 0.0, 0.0])),
        ("points", io::npy::encode(&[2, 2, 3], &[0.0, 0.0, 1.0, -0.1, -0.1, 1.0].repeat(2))),
    ]);
    std::fs::write(folder.path().join("gt/tracks.npz"), tracks).unwrap();
    let output = tessuto(&[".", "motion.npy", "--json"], folder.path());
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&json["frames"][1]["frame"], &json["frames_without_truth"]),
        (&2.into(), &1.into()),
        "{json}"
    );
    for (key, expected) in [("track", 0.015), ("track_p90", 0.03), ("track_worst", 0.03)] {
        assert!((json["mean"][key].as_f64().unwrap() - expected).abs() < 1e-6, "{key}: {json}");
    }
    let text = String::from_utf8(tessuto(&[".", "motion.npy"], folder.path()).stdout).unwrap();
    assert!(text.contains("tracked points: mean 15.00 mm, 90 % below 30.00 mm, largest 30.00 mm"), "{text}");
    assert!(text.contains("truth in 2 of 3 frames"), "{text}");
}

#[test]
fn maps_and_rerendered_frames_are_compared_where_the_result_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    scene(folder.path());
    for name in ["gt/material", "result/material", "result/rerendered"] {
        std::fs::create_dir_all(path(name)).unwrap();
    }
    io::npy::write(&path("result/motion.npy"), &[FRAMES, 4, 3], &motion(0.0)).unwrap();
    let before = tessuto(&[".", "result", "--json"], folder.path());
    let json: serde_json::Value = serde_json::from_slice(&before.stdout).unwrap();
    assert!(json.get("maps").is_none(), "{json}");

    let grey = |v: f32| Image { width: 16, height: 16, channels: 3, data: vec![v; 768] };
    io::image::write_png(&path("gt/material/diffuse.png"), &grey(0.4)).unwrap();
    io::image::write_png(&path("result/material/diffuse.png"), &grey(0.5)).unwrap();
    let mut frame = io::image::read(&path("rgbs/rgb_001.png")).unwrap();
    frame.data.iter_mut().for_each(|v| *v += 0.1 * (1.0 - *v));
    io::image::write_png(&path("result/rerendered/rgb_001.png"), &frame).unwrap();
    let output = tessuto(&[".", "result", "--json"], folder.path());
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let maps = &json["maps"];
    assert!((maps["diffuse_psnr"].as_f64().unwrap() - 20.0).abs() < 0.2, "{maps}");
    assert!(maps["diffuse_psnr_scaled"].as_f64().unwrap() > 60.0, "{maps}");
    assert_eq!((&maps["frames"], maps.get("roughness_psnr")), (&1.into(), None), "{maps}");
    assert!((20.0..30.0).contains(&maps["frames_psnr"].as_f64().unwrap()), "{maps}");
    let text = String::from_utf8(tessuto(&[".", "result"], folder.path()).stdout).unwrap();
    assert!(text.contains("vertex") && text.contains("frames_psnr"), "{text}");

    io::image::write_png(&path("result/rerendered/rgb_001.png"), &grey(0.5)).unwrap();
    let refused = tessuto(&[".", "result"], folder.path());
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(3), "{message}");
    assert!(message.contains("rgb_001.png") && message.contains("hint:"), "{message}");

    // Without any truth of the motion, frames are still compared.
    std::fs::remove_file(path("gt/vertices.npy")).unwrap();
    io::image::write_png(&path("result/rerendered/rgb_001.png"), &frame).unwrap();
    let text = String::from_utf8(tessuto(&[".", "result"], folder.path()).stdout).unwrap();
    assert!(text.contains("frames_psnr") && !text.contains("vertex"), "{text}");
}

#[test]
fn unusable_results_are_named_with_status_3() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    let mut broken = motion(0.0);
    broken[16] = f32::NAN;
    io::npy::write(&folder.path().join("nan.npy"), &[FRAMES, 4, 3], &broken).unwrap();
    io::npy::write(&folder.path().join("short.npy"), &[1, 4, 3], &broken[..12]).unwrap();
    io::npy::write(&folder.path().join("other.npy"), &[FRAMES, 2, 3], &motion(0.0)[..FRAMES * 6]).unwrap();
    for (file, word) in [
        ("nan.npy", "NaN"),
        ("short.npy", "frames"),
        ("other.npy", "2 vertices"),
        ("missing.npy", "missing.npy"),
    ] {
        let output = tessuto(&[".", file], folder.path());
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{message}");
        assert!(message.contains(word) && message.contains("hint") && output.stdout.is_empty(), "{message}");
    }
    std::fs::remove_file(folder.path().join("gt/vertices.npy")).unwrap();
    let output = tessuto(&[".", "other.npy"], folder.path());
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8(output.stderr).unwrap().contains("neither"));
}
