//! A camera that moves.

use glam::{DMat3, DVec3};
use tessuto::config::{Config, Preset};
use tessuto::motion::spacetime::scaled;
use tessuto::session::Session;
use tessuto::synth::{self, Settings};
use tessuto::{Mesh, Motion, Pose, PoseUnit, Scene, reconstruct};

/// Of `change` over a small clip.
pub(super) fn filmed(change: impl FnOnce(&mut Settings)) -> Scene {
    let small = |s: &mut Settings| (s.frames, s.size, s.grid, s.seed) = (12, 240, [13, 13], 3);
    synth::make(&Settings::default().with(small).with(change)).unwrap()
}

fn config() -> Config {
    let mut config = Config::preset(Preset::Motion);
    for assignment in ["texture.epochs=5", "texture.size=32"] {
        config.set(assignment).unwrap();
    }
    config
}

pub(super) fn found(scene: &Scene) -> Motion {
    let result = reconstruct(scene, &config(), &mut Session::silent()).unwrap();
    assert!(result.failure.is_none(), "{:?}", result.failure);
    result.motion
}

/// Mean distance of the vertices from `truth` `[m]`.
pub(super) fn off(found: &Motion, truth: &Motion) -> f64 {
    let pairs = found.iter().flatten().zip(truth.iter().flatten());
    pairs.map(|(a, b)| a.distance(*b)).sum::<f64>() / (truth.len() * truth.vertex_count()) as f64
}

#[test]
fn a_sheet_is_found_as_well_by_a_camera_in_the_hand() {
    let still = filmed(|_| ());
    let moving = filmed(|s| (s.orbit, s.shake) = (20.0, 0.008));
    assert!(still.poses.is_none() && moving.poses.as_ref().unwrap().len() == 12);
    let truth = |scene: &Scene| scene.truth.vertices.clone().unwrap();
    assert_eq!(truth(&still), truth(&moving), "the same motion of the same sheet");
    let errors = [&still, &moving].map(|scene| off(&found(scene), &truth(scene)));
    let forgotten = off(&found(&Scene { poses: None, ..moving.clone() }), &truth(&moving));
    println!("{errors:?} m standing and moving, {forgotten} m where the poses are left out");
    assert!(errors[1] < 1.2 * errors[0]);
    assert!(forgotten > 10.0 * errors[1]);
}

#[test]
fn a_world_that_is_moved_and_turned_holds_the_same_motion() {
    let scene = filmed(|s| (s.frames, s.orbit) = (4, 15.0));
    let turn = Pose { rotation: DMat3::from_rotation_y(0.7), translation: DVec3::new(0.3, -0.2, 0.5) };
    let back = turn.inverse();
    let moved = |p: &DVec3| turn.rotation * *p + turn.translation;
    let positions = scene.template.positions.iter().map(moved).collect();
    let poses = scene.poses.iter().flatten().map(|pose| pose.after(&back)).collect();
    let template = Mesh { positions, ..scene.template.clone() };
    let there = Scene { template, poses: Some(poses), ..scene.clone() };
    let (here, there) = (found(&scene), found(&there));
    let expected = Motion::new(here.iter().map(|x| x.iter().map(moved).collect()).collect()).unwrap();
    let size = scene.template.area().sqrt();
    println!("{:e} of the sheet's size apart", off(&there, &expected) / size);
    assert!(off(&there, &expected) < 1e-6 * size);
}

#[test]
fn the_unit_of_a_path_is_found() {
    let scene = filmed(|s| (s.orbit, s.shake) = (20.0, 0.004));
    let smaller = |pose: &Pose| Pose { translation: pose.translation / 0.37, ..*pose };
    let poses = scene.poses.iter().flatten().map(smaller).collect();
    let unknown = Scene { poses: Some(poses), pose_unit: PoseUnit::Unknown, ..scene.clone() };
    let refused = reconstruct(&unknown, &config(), &mut Session::silent()).unwrap_err().to_string();
    assert!(refused.contains("no unit"), "{refused}");
    let cloth = config().dynamics.model.cloth(&scene.template);
    let metres = scaled(&unknown, &cloth, &config().spacetime).unwrap();
    let PoseUnit::Found { length, sd } = metres.pose_unit else { panic!("{:?}", metres.pose_unit) };
    println!("{length} ± {sd} m");
    assert!((length / 0.37 - 1.0).abs() < 0.01 && (length - 0.37).abs() < 2.0 * sd);
    let still = Scene { poses: None, ..unknown };
    assert!(scaled(&still, &cloth, &config().spacetime).is_err());
}

#[test]
fn measured_depth_makes_the_sheet_more_exact() {
    let plain = filmed(|_| ());
    let measured = filmed(|s| s.depth_noise = 0.01);
    let depths = measured.depths.as_ref().unwrap();
    assert_eq!((depths.maps.len(), depths.maps[0].len()), (12, 120 * 120));
    let truth = plain.truth.vertices.clone().unwrap();
    let errors = [&plain, &measured].map(|scene| off(&found(scene), &truth));
    println!("{errors:?} m without and with depth");
    assert!(errors[1] < 0.8 * errors[0]);
    // Maps of another number of frames are refused.
    let mut short = measured.clone();
    std::sync::Arc::make_mut(short.depths.as_mut().unwrap()).maps.pop();
    let refused = reconstruct(&short, &config(), &mut Session::silent()).unwrap_err().to_string();
    assert!(refused.contains("11 maps of 12 frames"), "{refused}");
}
