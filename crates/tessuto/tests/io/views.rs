//! Where the camera was, and what a depth sensor beside it measured.

use tessuto::io::npy;
use tessuto::io::scene::{LoadOptions, Loaded, load};
use tessuto::{Pose, PoseUnit, Result};

use crate::support::scene_maker::{FRAMES, SIZE, TinyScene};

fn read(tiny: &TinyScene) -> Result<Loaded> {
    load(tiny.folder(), &LoadOptions::default())
}

fn refused(tiny: &TinyScene, words: &[&str]) {
    let error = read(tiny).unwrap_err().to_string();
    assert!(words.iter().all(|word| error.contains(word)), "{error}");
}

/// Matrices of a camera that moves by `step` a frame along x.
fn poses(step: f64, frames: usize) -> String {
    let row = |n: usize| format!("[1,0,0,{}, 0,1,0,0, 0,0,1,0, 0,0,0,1]", step * n as f64);
    (0..frames).map(row).collect::<Vec<_>>().join(",")
}

#[test]
fn poses_are_read_from_their_file_or_from_the_scene() {
    let tiny = TinyScene::new();
    assert!(read(&tiny).unwrap().scene.poses.is_none());
    tiny.put("poses.json", &format!("{{\"camera_from_world\": [{}]}}", poses(-0.01, FRAMES)));
    let loaded = read(&tiny).unwrap();
    let scene = loaded.scene;
    assert_eq!((&loaded.warnings[..], scene.pose_unit), (&[][..], PoseUnit::Metres));
    let found = scene.poses.as_ref().unwrap();
    assert_eq!((found.len(), found[0]), (FRAMES, Pose::IDENTITY));
    assert!((scene.viewpoint(2).eye().x - 0.02).abs() < 1e-12);
    // Of a part of the clip, the same poses.
    let part = LoadOptions { frames: Some(1..3), ..LoadOptions::default() };
    assert_eq!(load(tiny.folder(), &part).unwrap().scene.poses.unwrap(), found[1..3]);
    tiny.put("poses.json", &format!("{{\"camera_from_world\": [{}], \"unit\": null}}", poses(-0.01, FRAMES)));
    assert_eq!(read(&tiny).unwrap().scene.pose_unit, PoseUnit::Unknown);
    tiny.put("poses.json", &format!("{{\"camera_from_world\": [{}]}}", poses(-0.01, FRAMES + 1)));
    refused(&tiny, &["poses.json", &format!("{} poses of {FRAMES} frames", FRAMES + 1)]);
    tiny.put("poses.json", &poses(0.0, FRAMES).replacen("[1,0", "[2,0", 2));
    refused(&tiny, &["poses.json"]);
    tiny.put("poses.json", &format!("[{}]", poses(0.0, FRAMES).replacen("[1,0", "[-1,0", 1)));
    refused(&tiny, &["pose 0", "left-handed"]);
    // A jump is said, and bearable.
    tiny.put("poses.json", &format!("[{}]", poses(-1.5, FRAMES)));
    let warnings = read(&tiny).unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.found.contains("moves by 1.50 m")), "{warnings:?}");
}

#[test]
fn depth_is_read_by_its_unit_and_refused_where_it_does_not_fit() {
    let tiny = TinyScene::new();
    assert!(read(&tiny).unwrap().scene.depths.is_none());
    std::fs::create_dir(tiny.path("depth")).unwrap();
    tiny.put("depth/000000.png", "of a capture");
    assert!(read(&tiny).unwrap().scene.depths.is_none());
    let put = |n: usize, [width, height]: [usize; 2], z: f32| {
        let path = tiny.path(&format!("depth/depth_{n:03}.npy"));
        npy::write(&path, &[height, width], &vec![z; width * height]).unwrap();
    };
    let half = [SIZE / 2; 2];
    (0..FRAMES).for_each(|n| put(n, half, 1.0));
    let scene = read(&tiny).unwrap().scene;
    let whole = scene.camera;
    let depths = scene.depths.unwrap();
    assert_eq!((depths.maps.len(), depths.camera.width), (FRAMES, SIZE / 2));
    assert!((depths.camera.fx - 0.5 * whole.fx).abs() < 1e-12);
    // Half a pixel from the first centre is the corner of both; the crop is cut off the images alone.
    let cx = whole.cx + scene.crop.x0 as f64;
    assert!((depths.camera.cx - (0.5 * (cx + 0.5) - 0.5)).abs() < 1e-12);
    put(1, [SIZE / 2, SIZE / 4], 1.0);
    refused(&tiny, &["depth_001.npy", "pixels, the first map"]);
    (0..FRAMES).for_each(|n| put(n, [SIZE / 2, SIZE / 4], 1.0));
    refused(&tiny, &["depth_000.npy", "another shape"]);
    // The template is at about 1 m.
    (0..FRAMES).for_each(|n| put(n, half, 2.0));
    let warnings = read(&tiny).unwrap().warnings;
    assert!(warnings.iter().any(|w| w.found.contains("nearer than it was measured")), "{warnings:?}");
    std::fs::remove_file(tiny.path("depth/depth_001.npy")).unwrap();
    refused(&tiny, &["depth", "depth_001"]);
}

/// A made scene with a second camera, written as a folder; its scene.json after `change`.
fn by_two(change: impl FnOnce(&mut serde_json::Value)) -> (tempfile::TempDir, Result<Loaded>) {
    let settings = tessuto::synth::Settings::default().with(|s| {
        (s.frames, s.size, s.grid) = (3, 64, [5, 5]);
        (s.views, s.apart, s.depth_noise) = (2, 30.0, 0.01);
    });
    let made = tessuto::synth::make(&settings).unwrap();
    let folder = tempfile::tempdir().unwrap();
    tessuto::synth::write::write(folder.path(), &made, &settings).unwrap();
    let path = folder.path().join("scene.json");
    let mut scene = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut scene);
    std::fs::write(path, scene.to_string()).unwrap();
    let loaded = load(folder.path(), &LoadOptions::default());
    (folder, loaded)
}

#[test]
fn a_second_camera_is_read_with_its_files() {
    let (_folder, loaded) = by_two(|_| ());
    let Loaded { scene, warnings } = loaded.unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((scene.view_count(), scene.more[0].name.as_str()), (2, "view1"));
    let other = scene.seen_by(1);
    let depths = other.depths.as_ref().unwrap();
    assert_eq!((other.frames.len(), depths.maps.len(), other.full_size), (3, 3, [64, 64]));
    // It looks at the same sheet from another side.
    let centre = scene.template.positions.iter().sum::<glam::DVec3>() / 25.0;
    let [a, b] = [0, 1].map(|v| scene.seen_by(v).viewpoint(0));
    assert!((a.eye().distance(centre) - b.eye().distance(centre)).abs() < 1e-9);
    let angle = (a.eye() - centre).angle_between(b.eye() - centre).to_degrees();
    // The file of the template has six digits.
    assert!((angle - 30.0).abs() < 0.01, "{angle}");
    // The poses of both are in one world, whichever it is.
    let turned = "[0,0,1,0.5, 0,1,0,0, -1,0,0,0.25, 0,0,0,1]";
    let (folder, _) = by_two(|scene| {
        let turned: serde_json::Value = serde_json::from_str(turned).unwrap();
        scene["views"][0]["poses"] = turned;
    });
    let text = std::fs::read_to_string(folder.path().join("view1/poses.json")).unwrap();
    let listed: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rows = |value: &serde_json::Value| -> [f64; 16] { serde_json::from_value(value.clone()).unwrap() };
    let first = Pose::from_rows(&rows(&serde_json::from_str(turned).unwrap()));
    let second = Pose::from_rows(&rows(&listed["camera_from_world"][0])).after(&first);
    let text = format!("{{\"camera_from_world\": [{:?}]}}", second.rows());
    std::fs::write(folder.path().join("view1/poses.json"), text).unwrap();
    let again = load(folder.path(), &LoadOptions::default()).unwrap().scene;
    assert!(again.poses.is_none(), "the first stands still");
    assert!((again.seen_by(1).viewpoint(2).eye() - b.eye()).length() < 1e-9);
}

#[test]
fn a_second_camera_that_cannot_be_used_is_named() {
    let refused = |change: &dyn Fn(&mut serde_json::Value), words: &[&str]| {
        let error = by_two(change).1.unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    let second = |scene: &mut serde_json::Value, key: &str, value: serde_json::Value| {
        scene["views"][1][key] = value;
    };
    let lacks = |scene: &mut serde_json::Value, key: &str| {
        scene["views"][1].as_object_mut().unwrap().remove(key);
    };
    refused(&|scene| lacks(scene, "poses"), &["view view1", "no poses"]);
    refused(&|scene| lacks(scene, "masks"), &["view view1", "no folder"]);
    refused(&|scene| second(scene, "fz", 3.into()), &["view view1", "unknown key \"fz\"", "\"fx\""]);
    refused(&|scene| second(scene, "time_offset", 0.5.into()), &["view view1", "time_offset"]);
    refused(&|scene| second(scene, "fx", (-4).into()), &["view view1", "\"fx\" is -4"]);
    refused(&|scene| second(scene, "rgbs", "elsewhere".into()), &["view view1", "elsewhere"]);
    // Another camera's poses: it looks away from the sheet.
    let aside = "[[0,0,-1,0, 0,1,0,0, 1,0,0,1.5, 0,0,0,1]]";
    refused(
        &|scene| second(scene, "poses", serde_json::from_str(aside).unwrap()),
        &["view view1", "overlap with the mask"],
    );
    refused(&|scene| scene["views"] = serde_json::json!([]), &["lists 0 views"]);
}
