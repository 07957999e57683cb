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
fn filmed(seed: u64, surroundings: bool) -> (TempDir, Request) {
    let settings = Settings::default().with(|s| {
        (s.frames, s.size, s.grid, s.seed) = (FRAMES, 240, [9, 9], seed);
        (s.orbit, s.shake, s.surroundings) = (8.0, 0.005, surroundings);
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
    let (folder, request) = filmed(3, true);
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

/// What making masks says with these poses.
fn refused(folder: &Path, request: &Request, poses: &[Pose]) -> String {
    write_poses(folder, poses, PoseUnit::Metres).unwrap();
    make(folder, request, &|_| {}).unwrap_err().to_string()
}

/// Of a camera that turns away.
fn turned_away(poses: &[Pose]) -> Vec<Pose> {
    let turn = |n: usize| Pose { rotation: DMat3::from_rotation_y(0.2 * n as f64), translation: DVec3::ZERO };
    poses.iter().enumerate().map(|(n, pose)| turn(n).after(pose)).collect()
}

#[test]
fn poses_that_are_not_the_clips_are_refused_by_name() {
    for seed in [2, 3] {
        let (folder, request) = filmed(seed, true);
        let path = folder.path();
        let poses = read_poses(path, FRAMES).unwrap().unwrap();
        let shuffled: Vec<Pose> = (0..FRAMES).map(|n| poses[(3 * n + 2) % FRAMES]).collect();
        let opengl = |pose: &Pose| {
            let mut rows = pose.rows();
            [1, 2, 4, 7, 8, 11].iter().for_each(|k| rows[*k] = -rows[*k]);
            Pose::from_rows(&rows)
        };
        let opengl: Vec<Pose> = poses.iter().map(opengl).collect();
        for (other, word) in [
            (turned_away(&poses), "this clip's, one per frame"),
            (shuffled, "this clip's, one per frame"),
            (opengl, "as OpenGL has them"),
        ] {
            let told = refused(path, &request, &other);
            println!("{told}");
            assert!(told.contains("the poses are not this clip's") && told.contains(word), "{told}");
            assert!(told.contains("frame ") && told.contains("px from where") && told.contains("masks"));
        }
        assert!(!path.join("masks").exists());
        write_poses(path, &poses, PoseUnit::Metres).unwrap();
        let notes = make(path, &request, &|_| {}).unwrap().record.notes;
        assert!(notes.iter().all(|note| !note.contains("poses")), "{notes:?}");
        // Of a camera that is a little late, they are bearable, but not unseen.
        let late: Vec<Pose> = (0..FRAMES).map(|n| poses[n.saturating_sub(2)]).collect();
        write_poses(path, &late, PoseUnit::Metres).unwrap();
        match make(path, &request, &|_| {}) {
            Ok(made) => assert!(made.record.notes.iter().any(|note| note.contains("not quite"))),
            Err(error) => assert!(error.to_string().contains("poses are not this clip's"), "{error}"),
        }
    }
}

#[test]
fn a_moving_camera_without_its_own_poses_is_refused() {
    // Nothing but the fabric is there to be compared.
    let (folder, request) = filmed(2, false);
    let poses = read_poses(folder.path(), FRAMES).unwrap().unwrap();
    let told = refused(folder.path(), &request, &turned_away(&poses));
    assert!(told.contains("camera's motion taken out") && told.contains("masks"), "{told}");
    let (folder, request) = filmed(2, true);
    let path = folder.path();
    std::fs::remove_file(path.join("poses.json")).unwrap();
    let told = make(path, &request, &|_| {}).unwrap_err().to_string();
    assert!(told.contains("camera did not stand still") && told.contains("poses"), "{told}");
    assert!(!path.join("masks").exists());
    assert!(poses.iter().any(|pose| pose.translation.distance(DVec3::ZERO) > 0.05), "it moves");
}
