//! Masks of clips by a camera that goes around the cloth and shakes, in a made-up room.

use std::path::Path;

use glam::{DMat3, DVec3};
use tempfile::TempDir;
use tessuto::io::image::read_mask;
use tessuto::io::scene::{read_poses, write_poses};
use tessuto::masks::{Click, Request, make};
use tessuto::synth::{self, Settings};
use tessuto::{Pose, PoseUnit};

const FRAMES: usize = 8;

/// A clip with the true masks in `true`, and the corners of the cloth.
fn filmed(seed: u64) -> (TempDir, Request) {
    let settings = Settings::default().with(|s| {
        (s.frames, s.size, s.grid, s.seed) = (FRAMES, 240, [9, 9], seed);
        (s.orbit, s.shake, s.surroundings) = (8.0, 0.005, true);
    });
    let scene = synth::film(&settings).unwrap();
    let folder = tempfile::tempdir().unwrap();
    synth::write::write(folder.path(), &scene, &settings).unwrap();
    std::fs::rename(folder.path().join("masks"), folder.path().join("true")).unwrap();
    let x = &scene.template.positions;
    let corner = |v: usize| scene.viewpoint(0).project(x[v]).to_array();
    let outline = vec![corner(0), corner(8), corner(80), corner(72)];
    (folder, Request { outline: Some(outline), ..Request::default() })
}

/// Least intersection over union with the truth.
fn worst(folder: &Path) -> f64 {
    let read = |name: &str, n: usize| read_mask(&folder.join(format!("{name}/mask_{n:03}.png"))).unwrap().0;
    let overlap = |n: usize| {
        let (found, truth) = (read("masks", n), read("true", n));
        assert_eq!((found.width, found.height), (truth.width, truth.height));
        let pairs = || found.data.iter().zip(&truth.data).map(|(a, b)| (*a >= 0.5, *b >= 0.5));
        pairs().filter(|(a, b)| *a && *b).count() as f64 / pairs().filter(|(a, b)| *a || *b).count() as f64
    };
    (0..FRAMES).map(overlap).fold(1.0, f64::min)
}

#[test]
fn known_poses_hold_the_wall_still_whatever_their_unit() {
    let (folder, request) = filmed(3);
    let path = folder.path();
    make(path, &request, &|_| {}).unwrap();
    let metres = worst(path);
    assert!(metres > 0.94, "{metres}");
    let poses = read_poses(path, FRAMES).unwrap().unwrap();
    let scaled: Vec<_> = poses.iter().map(|p| Pose { translation: 40.0 * p.translation, ..*p }).collect();
    write_poses(path, &scaled, PoseUnit::Unknown).unwrap();
    make(path, &request, &|_| {}).unwrap();
    let unitless = worst(path);
    assert!((unitless - metres).abs() < 0.01, "{unitless} {metres}");
    // Clicks are of the frames as they were filmed.
    let click = Click { frame: FRAMES - 1, x: 12.0, y: 120.0, inside: true };
    make(path, &Request { clicks: vec![click], ..Request::default() }, &|_| {}).unwrap();
    let (mask, _) = read_mask(&path.join(format!("masks/mask_{:03}.png", FRAMES - 1))).unwrap();
    assert!(mask.pixel(12, 120)[0] > 0.5);
}

#[test]
fn a_moving_camera_without_its_own_poses_is_refused() {
    let (folder, request) = filmed(2);
    let path = folder.path();
    let refused = || make(path, &request, &|_| {}).unwrap_err().to_string();
    let poses = read_poses(path, FRAMES).unwrap().unwrap();
    // Of a camera that turns away.
    let turned = |(n, pose): (usize, &Pose)| {
        Pose { rotation: DMat3::from_rotation_y(0.2 * n as f64), translation: DVec3::ZERO }.after(pose)
    };
    let other: Vec<_> = poses.iter().enumerate().map(turned).collect();
    write_poses(path, &other, PoseUnit::Metres).unwrap();
    let told = refused();
    assert!(told.contains("camera's motion taken out") && told.contains("masks"), "{told}");
    std::fs::remove_file(path.join("poses.json")).unwrap();
    let told = refused();
    assert!(told.contains("camera did not stand still") && told.contains("poses"), "{told}");
    assert!(!path.join("masks").exists());
    assert!(poses.iter().any(|pose| pose.translation.distance(DVec3::ZERO) > 0.05), "it moves");
}
