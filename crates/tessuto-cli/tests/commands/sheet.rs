//! A flat sheet and its corners: what is kept of the fit, what is refused, the camera without a calibration.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;
use tessuto::glam::{DMat3, DVec2, DVec3, EulerRot};
use tessuto::io::image::write_png;
use tessuto::io::scene::write_manifest;
use tessuto::{Camera, Image};

use crate::scene_maker::TinyScene;

const CAMERA: Camera = Camera { fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5, width: 320, height: 240 };
const SIZE: DVec2 = DVec2::new(0.7, 0.5);

/// Runs the program; status and what was printed, in one line.
fn tessuto(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    (output.status.code(), text.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A scene of a plane sheet turned by these angles `[rad]`, and its corners as options.
fn scene([x, y]: [f64; 2], distance: f64) -> (TempDir, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let turn = DMat3::from_euler(EulerRot::XYZ, x, y, 0.05);
    let place = |c: DVec2| turn * (c * SIZE).extend(0.0) + DVec3::new(0.01, 0.02, distance);
    let quad = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
        .map(|c| CAMERA.project(place(DVec2::from_array(c))));
    let inside = |p: DVec2| (0..4).all(|k| (quad[(k + 1) % 4] - quad[k]).perp_dot(p - quad[k]) >= 0.0);
    let (mut mask, mut rgb) = (Image::new(320, 240, 1), Image::new(320, 240, 3));
    for (x, y) in (0..240).flat_map(|y| (0..320).map(move |x| (x, y))) {
        if inside(DVec2::new(x as f64, y as f64)) {
            mask.pixel_mut(x, y)[0] = 1.0;
            rgb.pixel_mut(x, y).fill(0.7);
        }
    }
    for sub in ["rgbs", "masks"] {
        std::fs::create_dir_all(folder.path().join(sub)).unwrap();
    }
    for n in 0..2 {
        write_png(&folder.path().join(format!("rgbs/rgb_{n:03}.png")), &rgb).unwrap();
        write_png(&folder.path().join(format!("masks/mask_{n:03}.png")), &mask).unwrap();
    }
    // The scene knows a wrong camera, of a focal length a third too long.
    let assumed = Camera { fx: 400.0, fy: 400.0, ..CAMERA };
    let notes = serde_json::json!({ "camera": { "source": "assumed", "uncertainty": 0.2 } });
    write_manifest(folder.path(), "sheet", 25.0, 2, &assumed, notes).unwrap();
    let corners = quad.map(|p| format!("{:.1},{:.1}", p.x, p.y));
    (folder, corners.to_vec())
}

fn flat<'a>(folder: &'a TempDir, corners: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    let start =
        ["template", folder.path().to_str().unwrap(), "--flat", "70x50cm", "--grid", "9", "--corners"];
    start.into_iter().chain(corners.iter().map(String::as_str)).chain(more.iter().copied()).collect()
}

#[test]
fn the_corners_of_a_tilted_sheet_tell_the_camera() {
    let (folder, corners) = scene([0.5, -0.6], 0.8);
    let check = ["check", folder.path().to_str().unwrap()];
    let (_, text) = tessuto(&flat(&folder, &corners, &[]));
    assert!(text.contains("no plane rectangle") || text.contains("no rectangle"), "{text}");
    let (status, text) = tessuto(&flat(&folder, &corners, &["--camera", "estimate", "--force"]));
    assert!(status == Some(0) && text.contains("focal length from the corners"), "{text}");
    // scene.json was not written by the program's import: it is kept.
    assert!(
        text.contains("scene.before1.json") && folder.path().join("scene.before1.json").is_file(),
        "{text}"
    );
    let (scene, record) =
        (json(&folder.path().join("scene.json")), json(&folder.path().join("template.json")));
    let fx = scene["fx"].as_f64().unwrap();
    assert!((fx / 300.0 - 1.0).abs() < 0.01 && scene["fy"] == scene["fx"] && scene["fps"] == 25.0, "{scene}");
    let interval: Vec<f64> =
        record["camera"]["interval"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(interval[0] < 300.0 && 300.0 < interval[1] && interval[1] < 1.3 * interval[0], "{interval:?}");
    let doubt = scene["notes"]["camera"]["uncertainty"].as_f64().unwrap();
    assert!((doubt - (interval[1] - interval[0]) / (2.0 * fx)).abs() < 1e-9 && doubt < 0.1);
    assert!(record["kind"] == "flat" && (record["size"][0].as_f64().unwrap() - 0.7).abs() < 1e-9, "{record}");
    assert!(record["residual"].as_f64().unwrap() < 0.2 && record["plane"] == true, "{record}");
    let (status, text) = tessuto(&check);
    assert!(status == Some(0) && text.contains("ok template flat sheet of 0.700×0.500 m"), "{text}");
    assert!(text.contains("estimated from the corners of the sheet"), "{text}");
    // Another mesh in its place, and nothing is said of the sheet any more.
    std::fs::copy(folder.path().join("template.obj"), folder.path().join("a.obj")).unwrap();
    let moved = std::fs::read_to_string(folder.path().join("a.obj")).unwrap() + "# mine\n";
    std::fs::write(folder.path().join("template.obj"), moved).unwrap();
    assert!(!tessuto(&check).1.contains("flat sheet"));
}

#[test]
fn a_sheet_seen_from_the_front_does_not_and_a_guess_is_doubted() {
    let (folder, corners) = scene([0.0, 0.02], 1.0);
    let (status, text) = tessuto(&flat(&folder, &corners, &["--camera", "estimate"]));
    assert!(status == Some(3) && text.contains("do not determine the focal length"), "{text}");
    assert!(
        !folder.path().join("template.obj").exists()
            && json(&folder.path().join("scene.json"))["fx"] == 400.0
    );
    assert_eq!(tessuto(&flat(&folder, &corners, &[])).0, Some(0));
    let (status, text) = tessuto(&["check", folder.path().to_str().unwrap()]);
    assert!(status == Some(0) && text.contains("focal length is known to 20 % only"), "{text}");
    assert!(text.contains("--camera estimate"), "{text}");
}

#[test]
fn a_template_works_before_there_are_masks() {
    let (folder, corners) = scene([0.4, -0.3], 0.8);
    std::fs::remove_dir_all(folder.path().join("masks")).unwrap();
    let (status, text) = tessuto(&flat(&folder, &corners, &["--camera", "estimate"]));
    assert!(
        status == Some(0) && !text.contains("overlap") && !text.contains("next: tessuto check"),
        "{text}"
    );
    let from_mask =
        ["template", folder.path().to_str().unwrap(), "--flat", "70x50cm", "--from-mask", "--force"];
    let (status, text) = tessuto(&from_mask);
    assert!(status == Some(2) && text.contains("--from-mask without a mask"), "{text}");
}

#[test]
fn rectangles_that_no_fabric_can_be_are_refused() {
    let scene = TinyScene::new();
    let folder = scene.folder().to_str().unwrap();
    std::fs::remove_file(scene.path("template.obj")).unwrap();
    let made = |size: &str, corners: [&str; 4]| {
        let start = ["template", folder, "--flat", size, "--grid", "5", "--corners"];
        let told = tessuto(&[&start[..], &corners[..]].concat());
        assert_eq!(scene.path("template.obj").exists(), told.0 == Some(0), "{}", told.1);
        told
    };
    // A millimetre size given as metres is far away; as centimetres of a crumb, on the lens.
    let own = ["3.5,5.5", "19.5,5.5", "19.5,21.5", "3.5,21.5"];
    let (status, text) = made("0.4x0.4cm", own);
    assert!(status == Some(3) && text.contains("nearest vertex is 10 mm from the camera"), "{text}");
    // Width and height that belong to something else.
    let (status, text) = made("0.4x1.6m", own);
    assert!(status == Some(3) && text.contains("no rectangle of this size looks like this"), "{text}");
    // A rectangle beside the fabric.
    let (status, text) = made("0.1x0.1m", ["20.5,1.5", "23.5,1.5", "23.5,4.5", "20.5,4.5"]);
    assert!(
        status == Some(3) && text.contains("overlap with the mask of the first frame, 256 pixels, is 0.00"),
        "{text}"
    );
    assert_eq!(made("0.4x0.4m", own).0, Some(0));
    // One that was written all the same, by an earlier version.
    let text = std::fs::read_to_string(scene.path("template.obj")).unwrap();
    let told = "# made of a rectangle, but no plane one has these corners: off by 405.0 px\n";
    scene.put("template.obj", &(told.to_owned() + &text));
    let (status, text) = tessuto(&["check", folder]);
    assert!(
        status == Some(3) && text.contains("off by 405.0 px") && text.contains("it is not the fabric's"),
        "{text}"
    );
}

/// Depth [m] of the sheet that [`scene`] shows, as a sensor of 64×48 pixels measures it: with a ripple, noise and
/// a hole. 0 is nothing.
fn measured([x, y]: [f64; 2], distance: f64) -> Vec<f32> {
    let sensor = CAMERA.resized([64, 48]);
    let turn = DMat3::from_euler(EulerRot::XYZ, x, y, 0.05);
    let (normal, middle) = (turn * DVec3::Z, DVec3::new(0.01, 0.02, distance));
    let depth = |k: usize| {
        let p = DVec2::new((k % 64) as f64, (k / 64) as f64);
        let ray = sensor.ray(p);
        let noise = 0.002 * ((k * 7919 % 1000) as f64 / 500.0 - 1.0);
        if (28..33).contains(&(k % 64)) && (20..25).contains(&(k / 64)) {
            0.0
        } else {
            normal.dot(middle) / normal.dot(ray) + noise
        }
    };
    (0..64 * 48).map(|k| depth(k) as f32).collect()
}

#[test]
fn a_depth_map_brings_shape_and_camera() {
    let (pose, distance) = ([0.5, -0.6], 0.8);
    let (folder, _) = scene(pose, distance);
    let at = |name: &str| folder.path().join(name);
    let map = measured(pose, distance);
    for sub in ["stray/depth", "stray/confidence", "poly/keyframes/depth", "poly/keyframes/cameras"] {
        std::fs::create_dir_all(at(sub)).unwrap();
    }
    // Phones' colour images are larger than the map; here 640×480, of which the scene's are half the size.
    std::fs::write(at("stray/camera_matrix.csv"), "600,0,319.5\n0,600,239.5\n0,0,1\n").unwrap();
    // What the sensor is not sure of is far off.
    let (mut wild, mut sure) = (map.clone(), Image::new(64, 48, 1));
    sure.data.fill(1.0);
    (1500..1510).for_each(|k| (wild[k], sure.data[k]) = (2.0, 0.0));
    tessuto::io::npy::write(&at("stray/depth/000000.npy"), &[48, 64], &wild).unwrap();
    write_png(&at("stray/confidence/000000.png"), &sure).unwrap();
    tessuto::io::npy::write(&at("poly/keyframes/depth/17.npy"), &[48, 64], &map).unwrap();
    let camera = r#"{"fx": 600, "fy": 600, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}"#;
    std::fs::write(at("poly/keyframes/cameras/17.json"), camera).unwrap();
    std::fs::write(at("camera.json"), camera).unwrap();
    tessuto::io::npy::write(&at("plain.npy"), &[48, 64], &map).unwrap();
    let scene = folder.path().to_str().unwrap();
    let make = |depth: &str, more: &[&str]| {
        let depth = at(depth);
        let start = ["template", scene, "--depth", depth.to_str().unwrap(), "--grid", "9", "--force"];
        tessuto(&[&start[..], more].concat())
    };
    let camera = at("camera.json");
    let turn = DMat3::from_euler(EulerRot::XYZ, pose[0], pose[1], 0.05);
    for (depth, more) in [
        ("stray", &["--from-mask"][..]),
        ("poly", &["--from-mask"]),
        ("plain.npy", &["--from-mask", "--depth-camera", camera.to_str().unwrap()]),
    ] {
        let (status, text) = make(depth, more);
        assert!(status == Some(0) && text.contains("camera of the depth map: fx 300.0"), "{depth}: {text}");
        assert_eq!(json(&at("scene.json"))["fx"], 300.0);
        let mesh = tessuto::io::obj::read(&at("template.obj")).unwrap();
        let off = |p: &DVec3| (turn * DVec3::Z).dot(*p - DVec3::new(0.01, 0.02, distance)).abs();
        let worst = mesh.positions.iter().map(off).fold(0.0, f64::max);
        assert!(worst < 4e-3, "{depth}: {worst} m off the plane");
        let side = mesh.positions[0].distance(mesh.positions[8]);
        assert!((side - SIZE.x).abs() < 0.01, "{depth}: the upper side is {side} m");
        let record = json(&at("template.json"));
        assert!(record["kind"] == "depth" && record["depth"]["noise"].as_f64().unwrap() < 4e-3, "{record}");
        let (status, text) = tessuto(&["check", scene]);
        assert!(
            status == Some(0) && text.contains("from a depth map") && !text.contains("focal length is known"),
            "{text}"
        );
    }
    // A map of another shape, and none at all.
    tessuto::io::npy::write(&at("bad.npy"), &[64, 48], &map).unwrap();
    std::fs::write(at("tall.json"), r#"{"fx": 600, "cx": 239.5, "cy": 319.5, "width": 480, "height": 640}"#)
        .unwrap();
    let tall = at("tall.json");
    let (status, text) = make("bad.npy", &["--from-mask", "--depth-camera", tall.to_str().unwrap()]);
    assert!(status == Some(3) && text.contains("turned by 90°"), "{text}");
    let (status, text) = make("bad.npy", &["--from-mask"]);
    assert!(status == Some(3) && text.contains("another shape"), "{text}");
    let (status, text) = make("stray/confidence", &["--from-mask"]);
    assert!(status == Some(3) && text.contains("has no depth maps"), "{text}");
}

#[test]
fn a_made_up_clip_comes_with_what_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("trial");
    let make = |out: &Path| {
        Command::new(env!("CARGO_BIN_EXE_tessuto"))
            .args(["demo", "--clip", out.to_str().unwrap()])
            .env("TESSUTO_FFMPEG", "/no/such/program")
            .output()
            .unwrap()
    };
    let output = make(&out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(out.join("README.md")).unwrap();
    assert!(text.contains("Size of the sheet: 50 × 50 cm") && text.contains("--fps 50"), "{text}");
    assert_eq!(std::fs::read_dir(out.join("frames")).unwrap().count(), 30);
    // The corners it names are those of a plane sheet of that size.
    let line = text.lines().find(|l| l.starts_with("tessuto template")).unwrap();
    let corners: Vec<&str> = line.split("--corners ").nth(1).unwrap().split(' ').collect();
    let (image, mesh) = (out.join("frames/frame_000.png"), folder.path().join("sheet.obj"));
    let (image, mesh) = (image.to_str().unwrap(), mesh.to_str().unwrap());
    let start = ["template", image, "--fx", "600", "--flat", "50x50cm", "--out", mesh, "--corners"];
    let (status, text) = tessuto(&[&start[..], &corners[..]].concat());
    assert!(status == Some(0) && text.contains("a plane rectangle fits them"), "{text}");
    let again = make(&out);
    assert_eq!(again.status.code(), Some(3), "{}", String::from_utf8_lossy(&again.stderr));
}
