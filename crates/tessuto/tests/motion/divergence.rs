//! A fit that is driven out of its valley comes back, or ends with its best state and says why.

use tessuto::config::{Config, Preset};
use tessuto::session::Session;
use tessuto::synth::{self, Settings};
use tessuto::{Reconstruction, Scene, reconstruct};

fn scene() -> Scene {
    let settings = Settings::default().with(|s| (s.frames, s.grid, s.size) = (6, [7, 7], 64));
    synth::make(&settings).unwrap()
}

fn run(assignments: &[&str]) -> (Reconstruction, Vec<f64>) {
    let scene = scene();
    let mut config = Config::preset(Preset::Saft);
    for assignment in [&["texture.epochs=20", "texture.size=64"], assignments].concat() {
        config.set(assignment).unwrap();
    }
    let mut totals = Vec::new();
    let mut session = Session::new(|epoch, _| {
        if epoch.stage == "rollout" {
            totals.push(epoch.losses[0].1);
        }
        Ok(())
    });
    let result = reconstruct(&scene, &config, &mut session);
    drop(session);
    (result.unwrap(), totals)
}

fn farthest(result: &Reconstruction) -> f64 {
    let first = &result.motion[0];
    let moved = result.motion.iter().flat_map(|x| x.iter().zip(first).map(|(a, b)| a.distance(*b)));
    moved.fold(0.0, f64::max)
}

#[test]
fn too_high_a_rate_is_lowered_until_the_fit_holds() {
    let (calm, _) = run(&[]);
    let (result, totals) = run(&["rollout.dynamic_rate=400"]);
    println!("farthest {} m, at the usual rate {} m; losses {totals:?}", farthest(&result), farthest(&calm));
    assert!(result.failure.is_none(), "{:?}", result.failure);
    assert!(farthest(&result) < 2.0 * farthest(&calm) + 0.05);
    // A driven-out epoch is not recorded; the recorded ones stay in the valley.
    assert!(totals.windows(2).all(|w| w[1] < 10.0 * w[0] + 1e-2), "{totals:?}");
}

#[test]
fn a_hopeless_fit_ends_with_its_best_state_and_the_epoch() {
    let (result, _) = run(&["rollout.dynamic_rate=1e9", "rollout.patience=3"]);
    let failure = result.failure.as_ref().expect("a failure").to_string();
    println!("{failure}");
    assert!(failure.contains("epoch") && failure.contains("grew"), "{failure}");
    assert!(farthest(&result) < 0.5, "{}", farthest(&result));
}

#[test]
fn a_frame_that_is_not_finite_leaves_the_frames_before_it() {
    let mut scene = scene();
    scene.frames.held_mut().unwrap()[3].rgb.data.fill(f32::NAN);
    let config = Config::preset(Preset::Default);
    let result = reconstruct(&scene, &config, &mut Session::new(|_, _| Ok(()))).unwrap();
    let failure = result.failure.as_ref().expect("a failure").to_string();
    println!("{failure}");
    assert!(failure.contains("frame 3"), "{failure}");
    assert_eq!(result.motion.len(), 6);
    assert!(farthest(&result).is_finite() && farthest(&result) > 1e-4, "{}", farthest(&result));
}
