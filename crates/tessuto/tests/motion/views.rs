//! Several cameras.

use tessuto::synth::{self, Settings};
use tessuto::{Scene, View};

use super::held::{filmed, found, off};

#[test]
fn two_cameras_find_a_sheet_twice_as_well() {
    let two = filmed(|s| (s.views, s.apart) = (2, 40.0));
    let alone = two.seen_by(0).into_owned();
    let alone = Scene { more: Vec::new(), ..alone };
    let truth = two.truth.vertices.clone().unwrap();
    let errors = [&alone, &two].map(|scene| off(&found(scene), &truth));
    println!("{errors:?} m by one camera and by two");
    assert!(errors[1] < 0.5 * errors[0]);
}

#[test]
fn a_view_that_does_not_fit_is_named() {
    let small = |s: &mut Settings| (s.frames, s.size, s.grid, s.views, s.apart) = (3, 96, [5, 5], 2, 30.0);
    let scene = synth::make(&Settings::default().with(small)).unwrap();
    scene.check().unwrap();
    let with = |change: &dyn Fn(&mut View)| {
        let mut changed = scene.clone();
        change(&mut changed.more[0]);
        changed.check().unwrap_err().to_string()
    };
    let short = with(&|view| view.frames = scene.frames.held().unwrap()[..2].to_vec().into());
    assert!(short.contains("view view1") && short.contains("2 frames"), "{short}");
    let poses = with(&|view| view.poses.truncate(2));
    assert!(poses.contains("view view1") && poses.contains("2 poses of 3 frames"), "{poses}");
    let behind = with(&|view| view.poses.iter_mut().for_each(|pose| pose.translation.z -= 5.0));
    assert!(behind.contains("view view1") && behind.contains("not in front"), "{behind}");
}

#[test]
fn a_camera_that_is_late_sees_the_sheet_on_its_way() {
    // Half of the time from frame to frame.
    let late = filmed(|s| (s.views, s.apart, s.late) = (2, 40.0, 0.01));
    let truth = late.truth.vertices.clone().unwrap();
    let mut taken_at_once = late.clone();
    taken_at_once.more[0].late = 0.0;
    let errors = [&late, &taken_at_once].map(|scene| off(&found(scene), &truth));
    println!("{errors:?} m where it is told that it is late, and where it is not");
    assert!(errors[0] < 0.3 * errors[1]);
}

#[test]
fn a_late_camera_sees_a_steady_motion_go_on_beyond_its_ends() {
    let small = |s: &mut Settings| (s.frames, s.size, s.grid, s.views, s.apart) = (3, 96, [5, 5], 2, 30.0);
    let mut scene = synth::make(&Settings::default().with(small)).unwrap();
    let steady: Vec<tessuto::Positions> =
        (0..3).map(|n| vec![tessuto::glam::DVec3::X * f64::from(n); 25]).collect();
    assert_eq!(scene.when_seen_by(1, &steady)[..], steady);
    for frames in [0.5, -0.25, 1.5] {
        scene.more[0].late = frames / scene.fps;
        let seen = scene.when_seen_by(1, &steady);
        let off = seen.iter().zip(&steady).map(|(a, b)| (a[7].x - b[7].x - frames).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{frames}: {off}");
        assert_eq!(scene.when_seen_by(0, &steady)[..], steady, "the scene's own is never late");
    }
}
