//! The whole run: from a scene folder to a finished result folder.
//!
//! [`run`] loads the scene, reconstructs, writes, estimates material and light, exports, makes the page and puts the
//! folder in its place. An [`Observer`] hears of every step. [`appearance`](mod@appearance) does the same for
//! material and light of a motion that is known, [`mod@evaluate`] compares with the truth, [`replay`] simulates again.

pub mod appearance;
mod causes;
mod changed;
pub mod evaluate;
#[doc(hidden)]
pub mod fabric;
#[doc(hidden)]
pub mod forecast;
mod observer;
#[doc(hidden)]
pub mod replay;

use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

use observer::Shared;
pub use observer::{Observer, Silent, Stage};

use crate::check;
use crate::export::{Clip, Format, export};
use crate::result::{self, Run, Summary};
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::mesh::Motion;
use tessuto_core::scene::{PoseUnit, Scene};
use tessuto_estimate::config::{Config, Method};
use tessuto_estimate::io::scene::{LoadOptions, Loaded, load};
use tessuto_estimate::metrics::{self, Evaluation};
use tessuto_estimate::motion::spacetime::scaled;
use tessuto_estimate::output::{FolderKind, OutputFolder};
use tessuto_estimate::reconstruct;
use tessuto_estimate::session::{Checkpoints, Session, identity};
use tessuto_estimate::template::irregular::of_scene;

/// Stage that makes the images of the frames and measures them.
const IMAGES: &str = "images";
/// The same, and simulates the changed motions.
const REPLAYS: &str = "images, changed replays";

/// What to do.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// All settings.
    pub config: Config,
    /// Only these frames; the template belongs to the first.
    pub frames: Option<Range<usize>>,
    /// Estimate material and light.
    pub appearance: bool,
    /// Replace an earlier result, if it is all tessuto's.
    pub replace: bool,
    /// Go on from the checkpoints that an interrupted run left.
    pub resume: bool,
    /// Least time between checkpoints; none are written without.
    pub checkpoint: Option<Duration>,
    /// The command line that repeats the run, for the result's log.
    pub command: String,
}

impl RunOptions {
    /// Everything that `config` says, into a new folder, without checkpoints.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            frames: None,
            appearance: true,
            replace: false,
            resume: false,
            checkpoint: None,
            command: String::new(),
        }
    }

    /// The stages of a run, in order, with their usual part of the time.
    fn stages(&self) -> Vec<Stage> {
        let stage = |name: &'static str, weight: f64| Stage { name, weight };
        let mut stages = vec![stage("texture", 2.0)];
        match self.config.method {
            Method::Rollout => stages.push(stage("rollout", 300.0)),
            Method::Spacetime => {
                stages.extend([stage("track", 10.0), stage("refine", 20.0), stage("fuse", 10.0)]);
                stages.push(stage("deviation", 2.0));
                stages.push(stage("forces and stiffnesses", if self.config.causes.fit { 25.0 } else { 5.0 }));
            }
        }
        let fit = self.config.causes.fit;
        stages.push(if fit { stage(REPLAYS, 14.0) } else { stage(IMAGES, 6.0) });
        if self.appearance {
            stages.extend([stage(appearance::FIT, 60.0), stage(appearance::RERENDER, 10.0)]);
        }
        stages.push(stage("report", 3.0));
        stages
    }
}

/// A warning where a stiffness that was found lies at its bound. Of causes, the numbers that the video does not
/// constrain are reported as unknown, wherever the search left them: that such a one came to lie at a bound is no
/// news, and true of almost every clip (the prior is wide, and what does not bear on the motion drifts). One that the
/// video constrains and that lies at its bound is cut off, which matters.
fn stiffness_doubt(settings: &Config, log_stiffness: &[f64], informed: Option<[bool; 3]>) -> Option<Warning> {
    let mut told = log_stiffness.to_vec();
    // What is no number lies at no bound.
    let known = informed.into_iter().flatten();
    told.iter_mut().zip(known).filter(|(_, known)| !known).for_each(|(k, _)| *k = f64::NAN);
    settings.dynamics.doubt(&told)
}

/// What a finished run left. The folder is there even if `failure` is set.
#[derive(Debug)]
pub struct Outcome {
    /// Whether the result is good.
    pub summary: Summary,
    /// Errors against the truth, where there is one.
    pub evaluation: Option<Evaluation>,
    /// Mean PSNR of the re-rendered frames `[dB]`.
    pub rerendered_psnr: Option<f64>,
    /// Stage and its wall time `[s]`, of this run alone.
    pub timings: Vec<(String, f64)>,
    /// What went wrong but cost neither the motion nor the folder.
    pub failure: Option<Error>,
}

/// Recovers the motion of the scene in `scene_folder`, and its material and light if asked to, into the folder `out`,
/// which appears whole or not at all. Failures of all but the motion do not cost the result.
///
/// # Errors
/// [`Error::Input`] for a scene that cannot be used, and if anything but a result of tessuto's is at `out`;
/// [`Error::Numerical`] if not even a first state is finite; [`Error::Output`]; whatever the observer returns.
pub fn run(
    scene_folder: &Path,
    out: &Path,
    options: &RunOptions,
    observer: &mut dyn Observer,
) -> Result<Outcome> {
    // Everything that can be refused is refused before the work.
    let output = OutputFolder::prepare(out, FolderKind::Result, options.replace)?;
    let loaded =
        load(scene_folder, &LoadOptions { frames: options.frames.clone(), ..LoadOptions::default() })?;
    work(&loaded, scene_folder, output, options, observer)
}

/// [`run`] of a scene that is in memory, all of its frames; `name` is what the result says it is of.
///
/// # Errors
/// As [`run`].
pub fn run_loaded(
    loaded: &Loaded,
    name: &Path,
    out: &Path,
    options: &RunOptions,
    observer: &mut dyn Observer,
) -> Result<Outcome> {
    let output = OutputFolder::prepare(out, FolderKind::Result, options.replace)?;
    work(loaded, name, output, options, observer)
}

fn work(
    loaded: &Loaded,
    scene_folder: &Path,
    output: OutputFolder,
    options: &RunOptions,
    observer: &mut dyn Observer,
) -> Result<Outcome> {
    let scene = of_scene(&loaded.scene, options.config.irregular_vertices)?;
    let scene = &*in_metres(scene, options, observer)?;
    // What a check refuses is refused here, too.
    let mut warnings = loaded.warnings.clone();
    warnings.extend(check::gate(loaded)?);
    if loaded.scene.pose_unit == PoseUnit::Unknown {
        warnings.extend(check::views_in_metres(scene)?);
    }
    warnings.iter().for_each(|warning| observer.warning(warning));
    let first = scene.first_frame;
    let run = Run {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene_folder.to_path_buf(),
        frames: [first, first + scene.frames.len()],
        settings: options.config.clone(),
    };

    let observer = RefCell::new(observer);
    let session = &mut Session::observed(Shared(&observer));
    let place = output.beside(".checkpoints");
    let checkpoints = keep_checkpoints(session, scene, &place, options, &observer)?;
    observer.borrow_mut().begin(scene, &run, &options.stages(), session.history())?;

    // Motion, and at once what is known of it.
    let found = reconstruct(scene, &run.settings, session)?;
    observer.borrow_mut().motion(&found.motion, &found.texture.to_image());
    let of_causes = found.causes.as_ref().and_then(|causes| causes.found.doubt());
    let of_replay = found.causes.as_ref().and_then(|causes| causes.sizes.doubt());
    let informed = found.causes.as_ref().map(|causes| causes.found.informed_stiffness());
    let of_stiffness = stiffness_doubt(&run.settings, &found.parameters.log_stiffness, informed);
    for doubt in of_causes.into_iter().chain(of_replay).chain(of_stiffness) {
        observer.borrow_mut().warning(&doubt);
        warnings.push(doubt);
    }
    // The log and the page keep them as text.
    let mut warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    warnings.extend(found.failure.iter().map(Error::to_string));
    let folder = output.partial().to_path_buf();
    let folder = &folder;
    result::write_motion(folder, scene, &run, &found)?;

    // Images and metrics, and at the same time what the page lets one play: simulations hardly share their work among
    // threads.
    let fit = run.settings.causes.fit;
    session.begin(if fit { REPLAYS } else { IMAGES });
    let pictures = || {
        let evaluation = evaluate(scene, &found.motion, run.settings.seed)?;
        let context = result::Context {
            scene,
            run: &run,
            evaluation: evaluation.as_ref(),
            warnings: &warnings,
            command: &options.command,
        };
        result::write_pictures(folder, &context, &found)?;
        Ok(evaluation)
    };
    let replays = || if fit { changed::write(&result::Folder::open(folder)?) } else { Ok(Vec::new()) };
    let (evaluation, left_out): (Result<_>, Result<_>) = rayon::join(pictures, replays);
    let (evaluation, left_out) = (evaluation?, left_out?);
    left_out.iter().for_each(|warning| observer.borrow_mut().warning(warning));
    session.end();

    // Material and light. The motion is finished work: whatever happens here, it is written.
    let mut failure = found.failure;
    let mut rerendered_psnr = None;
    if options.appearance && failure.is_none() {
        let settings = &run.settings;
        let told = &*scene.with_back(found.back);
        match appearance::estimate(folder, told, &found.motion, &settings.appearance, settings.seed, session)
        {
            Ok(psnr) => {
                rerendered_psnr = Some(psnr);
                result::write_metrics(folder, scene, &found.motion, evaluation.as_ref())?;
            }
            // Nothing is lost: it resumes from the checkpoint.
            Err(error @ Error::Interrupted(_)) if checkpoints.is_some() => return Err(error),
            Err(error) => failure = Some(error),
        }
    }

    // For other programs and for people, from the folder alone.
    let timings = session.timings().to_vec();
    session.begin("report");
    let mut log = result::Log::read(folder)?;
    timings.iter().for_each(|(stage, seconds)| log.set_time(stage, *seconds));
    log.warnings.extend(left_out.iter().map(Warning::to_string));
    log.write(folder)?;
    let opened = result::Folder::open(folder)?;
    export(&Clip::of(&opened)?, &[Format::Glb, Format::Usd], &folder.join("export"), true)?;
    let summary = Summary::of(&opened)?;
    summary.write(folder)?;
    let page = result::write_page(&opened);
    if let Some(kept) = output.publish()? {
        observer.borrow_mut().note(&observer::kept_aside(&kept));
    }
    checkpoints.iter().try_for_each(Checkpoints::remove)?;
    Ok(Outcome { summary, evaluation, rerendered_psnr, timings, failure: failure.or(page.err()) })
}

/// `scene` with the path of its camera in metres.
fn in_metres<'a>(
    scene: Cow<'a, Scene>,
    options: &RunOptions,
    observer: &mut dyn Observer,
) -> Result<Cow<'a, Scene>> {
    if scene.pose_unit != PoseUnit::Unknown {
        return Ok(scene);
    }
    observer.note("the camera's poses have no unit: how long it is, is found first");
    let cloth = options.config.dynamics.model.cloth(&scene.template);
    let scaled = scaled(&scene, &cloth, &options.config.spacetime)?;
    if let PoseUnit::Found { length, sd } = scaled.pose_unit {
        observer.note(&format!("one unit is {length:.4} m, to {:.1} %", 100.0 * sd / length));
    }
    Ok(Cow::Owned(scaled))
}

/// Lets `session` keep its states in `folder`, and resume from those that are there if that is asked for.
fn keep_checkpoints(
    session: &mut Session,
    scene: &Scene,
    folder: &Path,
    options: &RunOptions,
    observer: &RefCell<&mut dyn Observer>,
) -> Result<Option<Checkpoints>> {
    let Some(interval) = options.checkpoint else { return Ok(None) };
    let text = serde_json::to_string(&options.config).expect("plain data");
    let identity = identity(scene, &text)?;
    let open = || Checkpoints::open(folder, identity.clone(), interval);
    let found = match options.resume {
        true => open().newest(&mut |problem| {
            let warning = Warning { topic: "checkpoint".into(), found: problem.to_owned(), hint: None };
            observer.borrow_mut().warning(&warning);
        })?,
        false => None,
    };
    let mut observer = observer.borrow_mut();
    match &found {
        Some(found) => observer.note(&format!("going on after {}", found.reached)),
        None if options.resume => {
            observer.note(&format!("no checkpoint in {}: starting from the beginning", folder.display()));
        }
        None if folder.exists() => {
            let text =
                format!("{} of an earlier run, which could have been resumed, is replaced", folder.display());
            observer.note(&text);
            open().remove()?;
        }
        None => {}
    }
    session.keep_in(open(), found)?;
    Ok(Some(open()))
}

fn evaluate(scene: &Scene, motion: &Motion, seed: u64) -> Result<Option<Evaluation>> {
    if !(0..motion.len()).any(|k| scene.truth.knows(k)) {
        return Ok(None);
    }
    metrics::evaluate(&scene.into(), motion, 0..motion.len(), seed).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stiffness_that_the_video_does_not_tell_is_not_doubted() {
        let config = Config::default();
        let range = config.dynamics.stretch;
        let at_bound = [range.low, config.dynamics.bend.start, config.dynamics.shear.start];
        assert_eq!(stiffness_doubt(&config, &at_bound, Some([false, true, true])), None);
        // Known, or found for the replay alone.
        for informed in [Some([true, false, false]), None] {
            let doubt = stiffness_doubt(&config, &at_bound, informed).unwrap();
            assert!(doubt.found.contains("stretch at its lower bound"), "{doubt}");
        }
    }
}
