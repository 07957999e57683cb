//! The whole run from outside: what it announces, what it leaves, how it is stopped.

mod sides;

use std::path::Path;

use tempfile::TempDir;
use tessuto::config::{Config, Preset};
use tessuto::output::manifest;
use tessuto::result::Run;
use tessuto::run::appearance::{self, AppearanceOptions, MotionSource};
use tessuto::run::{self, Observer, RunOptions, Silent, Stage};
use tessuto::session::{self, Epoch};
use tessuto::synth::{self, Settings};
use tessuto::{Error, Image, Positions, Result, Scene};

/// Remembers what it hears; ends the run at the first step of a stage.
#[derive(Default)]
struct Heard {
    planned: Vec<String>,
    begun: Vec<String>,
    steps: usize,
    motion: usize,
    stop_in: Option<&'static str>,
}

impl session::Observer for Heard {
    fn stage(&mut self, name: &str) {
        self.begun.push(name.to_owned());
    }

    fn step(&mut self, epoch: &Epoch, _motion: &[Positions]) -> Result<()> {
        self.steps += 1;
        assert!(self.begun.len() > 1 || epoch.stage == "texture");
        match self.stop_in {
            Some(stage) if stage == epoch.stage => Err(Error::Interrupted("asked to".to_owned())),
            _ => Ok(()),
        }
    }
}

impl Observer for Heard {
    fn begin(&mut self, scene: &Scene, run: &Run, stages: &[Stage], _history: &[Epoch]) -> Result<()> {
        assert_eq!((scene.frames.len(), run.frames), (3, [0, 3]));
        assert!(stages.iter().all(|stage| stage.weight > 0.0));
        self.planned = stages.iter().map(|stage| stage.name.to_owned()).collect();
        Ok(())
    }

    fn motion(&mut self, motion: &[Positions], _texture: &Image) {
        self.motion += motion.len();
    }
}

fn scene(folder: &Path) -> std::path::PathBuf {
    let settings = Settings::default().with(|s| (s.frames, s.grid, s.size) = (3, [5, 5], 48));
    let path = folder.join("scene");
    std::fs::create_dir(&path).unwrap();
    synth::write::write(&path, &synth::make(&settings).unwrap(), &settings).unwrap();
    path
}

fn options() -> RunOptions {
    let mut config = Config::preset(Preset::Default);
    for change in [
        "texture.size=16",
        "texture.epochs=3",
        "spacetime.iterations=2",
        "appearance.steps=2",
        "appearance.batch=50",
        "appearance.map_size=8",
        "appearance.render_samples_per_pixel=8",
    ] {
        config.set(change).unwrap();
    }
    RunOptions::new(config)
}

#[test]
fn a_run_announces_its_stages_and_leaves_a_whole_folder() {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let (scene, out) = (scene(folder.path()), folder.path().join("result"));
    let mut heard = Heard::default();
    let outcome = run::run(&scene, &out, &options(), &mut heard).unwrap();
    assert!(outcome.failure.is_none() && outcome.evaluation.is_some(), "{outcome:?}");
    assert!(outcome.rerendered_psnr.unwrap() > 5.0);
    // What was planned is what began, but for parts that are too short to be named.
    heard.begun.retain(|name| name != "rollout of the result");
    assert_eq!(heard.begun, heard.planned);
    assert!(heard.steps > 5 && heard.motion == 3);
    let verified = manifest::verify(&out).unwrap();
    assert!(verified.wrong.is_empty() && verified.unknown.is_empty() && verified.sound > 20);
    assert_eq!(folder.path().read_dir().unwrap().count(), 2, "something was left beside the result");

    // A finished result stays unless the caller says otherwise.
    let error = run::run(&scene, &out, &options(), &mut Silent).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    run::run(&scene, &out, &RunOptions { replace: true, ..options() }, &mut Silent).unwrap();

    // Material and light alone, of the same motion, are those of the whole run.
    let material = |name: &str| std::fs::read(out.join("material").join(name)).unwrap();
    let before = material("diffuse.png");
    let again = AppearanceOptions {
        motion: MotionSource::Result,
        changes: Vec::new(),
        seed: None,
        command: "again".to_owned(),
    };
    let outcome = appearance::run(&scene, &out, &again, &mut Silent).unwrap();
    assert!(outcome.is_result && outcome.timings.len() == 2);
    assert!(material("diffuse.png") == before);
    assert!(manifest::verify(&out).unwrap().wrong.is_empty());
}

#[test]
fn a_run_measures_the_frames_of_which_something_is_known() {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let (scene, out) = (scene(folder.path()), folder.path().join("result"));
    std::fs::remove_file(scene.join("gt/vertices.npy")).unwrap();
    std::fs::remove_file(scene.join("gt/points/points_001.npy")).unwrap();
    let options = RunOptions { appearance: false, ..options() };
    let evaluation = run::run(&scene, &out, &options, &mut Silent).unwrap().evaluation.unwrap();
    assert_eq!(evaluation.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [0, 2]);
    assert_eq!(evaluation.frames_without_truth, 1);
    let read = tessuto::result::read_metrics(&out).unwrap().unwrap();
    assert_eq!((read.mean, read.frames_without_truth), (evaluation.mean, 1));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("depth difference, in 2 of 3 frames"));
    // Nothing at all is known of a part of the frames.
    let none = RunOptions { frames: Some(1..2), replace: true, ..options };
    assert!(run::run(&scene, &out, &none, &mut Silent).unwrap().evaluation.is_none());
}

#[test]
fn an_observer_ends_a_run_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (scene(folder.path()), folder.path().join("result"));
    let mut heard = Heard { stop_in: Some("refine"), ..Heard::default() };
    let error = run::run(&scene, &out, &options(), &mut heard).unwrap_err();
    assert_eq!(error.exit_code(), 75);
    assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    // Material and light are not worth the motion: without checkpoints the motion is written.
    let mut heard = Heard { stop_in: Some("appearance"), ..Heard::default() };
    let outcome = run::run(&scene, &out, &options(), &mut heard).unwrap();
    assert_eq!(outcome.failure.unwrap().exit_code(), 75);
    assert!(out.join("motion.npy").is_file() && !out.join("material").exists());
}
