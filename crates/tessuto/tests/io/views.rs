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
