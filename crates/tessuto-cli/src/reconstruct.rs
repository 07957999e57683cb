//! `tessuto reconstruct`.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use tessuto::config::{Config, Preset};
use tessuto::export::{Clip, Format, export};
use tessuto::io::scene::{LoadOptions, load};
use tessuto::metrics::{self, Evaluation, QUANTITIES};
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::result::{self, Run};
use tessuto::session::{Checkpoints, Session, identity};
use tessuto::text::quoted;
use tessuto::{Error, Positions, Scene};

use crate::appearance::Outputs;
use crate::live::Server;
use crate::progress::{Progress, stop_on_interrupt};
use crate::record::Recorder;
use crate::say::{self, aside, say};
use crate::threads::Threads;

/// Recover motion and texture from a scene folder, with forces and stiffnesses that replay it.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto reconstruct scenes/curtain
  tessuto reconstruct scenes/curtain --preset saft --out results/curtain-saft
  tessuto reconstruct scenes/curtain --frames 0..20 --set spacetime.finest=1
  tessuto reconstruct scenes/curtain --live
  tessuto reconstruct scenes/curtain --rerun curtain.rrd")]
pub struct Arguments {
    /// Scene folder: scene.json, template.obj, rgbs/, masks/.
    scene: PathBuf,
    /// Result folder [default: tessuto-out/<name of the scene folder>].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Settings to start from: `default`, or `saft`, the published method.
    #[arg(long, value_parser = crate::frames::preset, default_value = "default")]
    preset: Preset,
    /// Settings to start from instead: config.json of a result, or settings alone as JSON.
    #[arg(long, value_name = "FILE", conflicts_with = "preset")]
    config: Option<PathBuf>,
    /// Change one setting; `tessuto settings` lists all of them. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Only frames A to B − 1; the template belongs to frame A.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<std::ops::Range<usize>>,
    #[command(flatten)]
    threads: Threads,
    /// Seed of everything random.
    #[arg(long)]
    seed: Option<u64>,
    /// Motion only; material and light are not estimated.
    #[arg(long)]
    no_appearance: bool,
    /// Replace an earlier result that nobody changed since.
    #[arg(long)]
    force: bool,
    /// Go on where an interrupted run of the same command was. The result is the same, byte for byte.
    #[arg(long)]
    resume: bool,
    /// Seconds between checkpoints, which are kept beside the result folder until it is finished.
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = parse_seconds)]
    checkpoint: f64,
    /// Show the work in a browser on this machine, at http://127.0.0.1:PORT [default: a free port].
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    live: Option<u16>,
    /// Write a recording for the viewer of rerun while the work goes on.
    ///
    /// It holds the video, the camera, the losses of every step and the recovered motion; it can be opened at any time.
    /// A recording of tessuto that is there already is replaced, nothing else is. The result is the same with and
    /// without.
    #[arg(long, value_name = "FILE.rrd")]
    rerun: Option<PathBuf>,
}

/// What to do besides the motion.
#[derive(Debug, Clone, Default)]
pub struct Extras {
    /// Estimate material and light.
    pub appearance: bool,
    /// Serve a page that shows the work, at this port; 0 is any free one.
    pub live: Option<u16>,
    /// Write a recording for the viewer of rerun here.
    pub rerun: Option<PathBuf>,
    /// Replace an earlier result.
    pub force: bool,
    /// Go on from checkpoints.
    pub resume: bool,
    /// Least time between checkpoints; none are written without.
    pub checkpoint: Option<Duration>,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|s| (0.0..=1e6).contains(s));
    value.ok_or_else(|| "expected seconds, 0 to 1000000".to_owned())
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut config = match &arguments.config {
        Some(file) => Config::read(file)?,
        None => Config::preset(arguments.preset),
    };
    config.set_all(arguments.set.iter().map(String::as_str))?;
    if let Some(seed) = arguments.seed {
        config.seed = seed;
    }
    arguments.threads.start()?;
    let out = arguments.out.clone().unwrap_or_else(|| default_out(&arguments.scene));
    let extras = Extras {
        appearance: !arguments.no_appearance,
        live: arguments.live,
        rerun: arguments.rerun.clone(),
        force: arguments.force,
        resume: arguments.resume,
        checkpoint: Some(Duration::from_secs_f64(arguments.checkpoint)),
    };
    reconstruct_into(&arguments.scene, arguments.frames.clone(), config, extras, &out)?;
    Ok(())
}

fn default_out(scene: &Path) -> PathBuf {
    let name = scene.canonicalize().ok().and_then(|p| p.file_name().map(PathBuf::from));
    Path::new("tessuto-out").join(name.unwrap_or_else(|| "scene".into()))
}

/// Loads, reconstructs, evaluates, estimates material and light if asked to, and writes; returns the metrics where
/// there is truth.
pub fn reconstruct_into(
    scene_folder: &Path,
    frames: Option<std::ops::Range<usize>>,
    config: Config,
    extras: Extras,
    out: &Path,
) -> anyhow::Result<Option<Evaluation>> {
    if let Some(file) = &extras.rerun {
        Recorder::check(file, out)?;
    }
    let output = OutputFolder::prepare(out, FolderKind::Result, extras.force)?;
    let server = extras.live.map(Server::bind).transpose()?;
    let loaded = load(scene_folder, &LoadOptions { frames, ..LoadOptions::default() })?;
    let scene = &loaded.scene;
    let mut warnings = loaded.warnings;
    warnings.iter().for_each(|w| aside!("warning: {w}"));
    stop_on_interrupt().context("cannot listen for Ctrl-C")?;
    aside!(
        "{}: {} frames of {}×{} px, {} vertices",
        scene.name,
        scene.frames.len(),
        scene.camera.width,
        scene.camera.height,
        scene.template.positions.len()
    );
    let first = scene.first_frame;
    let run = Run {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene_folder.to_path_buf(),
        frames: [first, first + scene.frames.len()],
        settings: config,
    };
    let mut command = repeat_command(&run, out);
    if !extras.appearance {
        command.push_str(" --no-appearance");
    }
    let progress = RefCell::new(Progress::new());
    if let Some(server) = server {
        aside!("live at {}", server.address());
        progress.borrow_mut().live = Some(server.start(result::live_page(scene, &run, &command)?));
    }
    let session = &mut Session::new(|epoch, motion| progress.borrow_mut().step(epoch, motion));
    let checkpoints =
        keep_checkpoints(session, scene, &run.settings, &output.beside(".checkpoints"), &extras)?;
    if let Some(file) = &extras.rerun {
        let recorder = Recorder::start(file, scene, &run.settings, session.history())?;
        progress.borrow_mut().recorder = Some(recorder);
    }
    let outcome = tessuto::reconstruct(scene, &run.settings, session);
    progress.borrow_mut().finish();
    let reconstruction = outcome.inspect_err(|e| say_how_to_go_on(e, &command, &extras))?;
    if let Some(recorder) = &mut progress.borrow_mut().recorder {
        recorder.motion(&reconstruction.motion, &reconstruction.texture.to_image());
    }
    if let Some(failure) = &reconstruction.failure {
        warnings.push(failure.to_string());
    }
    let evaluation = evaluate(scene, &reconstruction.motion, run.settings.seed)?;
    let context = result::Context {
        scene,
        run: &run,
        evaluation: evaluation.as_ref(),
        warnings: &warnings,
        command: &command,
    };
    result::write(output.partial(), &context, &reconstruction)?;
    // The motion is finished work: whatever happens to the appearance, it is written.
    let mut unseen = None;
    let mut table = String::new();
    if extras.appearance && reconstruction.failure.is_none() {
        let motion = &reconstruction.motion;
        let rows = add_appearance(output.partial(), scene, motion, &run.settings, session);
        progress.borrow_mut().finish();
        match rows {
            // Nothing is lost: it goes on from the checkpoint.
            Err(error @ Error::Interrupted(_)) if checkpoints.is_some() => {
                say_how_to_go_on(&error, &command, &extras);
                return Err(error.into());
            }
            Ok(rows) => {
                table = rows;
                result::write_metrics(output.partial(), scene, motion, evaluation.as_ref())?;
            }
            Err(error) => unseen = Some(error),
        }
    }
    let clip = Clip::read(output.partial())?;
    export(&clip, &[Format::Glb, Format::Usd], &output.partial().join("export"), true)?;
    let summary = result::Summary::of(output.partial())?;
    summary.write(output.partial())?;
    // A page that cannot be made must not cost the result either.
    let page = result::write_page(output.partial());
    crate::say_kept(output.publish()?);
    checkpoints.iter().try_for_each(Checkpoints::remove)?;
    page?;
    let mut recorded = Ok(());
    if let Some(mut recorder) = progress.borrow_mut().recorder.take() {
        if clip.material.roughness_metallic.is_some() {
            recorder.texture(&clip.material.base_colour);
        }
        recorded = recorder.finish();
    }
    if let Some(live) = progress.borrow_mut().live.take() {
        live.finish(&out.join("report.html"));
    }
    if let Some(e) = &evaluation {
        for (quantity, value) in QUANTITIES.iter().zip(e.mean.values()) {
            if let Some(value) = value {
                say!("{:<16} {value:.4e} {}", quantity.key, quantity.unit);
            }
        }
    }
    say::output(format_args!("{table}"));
    match (summary.doubt(), &summary.verdict) {
        (Some(doubt), _) => aside!("warning: the result is {doubt}"),
        (None, Some(verdict)) => say!("{}", verdict.sentence),
        (None, None) => {}
    }
    say!("{}", out.display());
    say!("  look at {}", out.join("report.html").display());
    say!("  and at  {}", out.join("pictures/contact_sheet.png").display());
    if let Some(file) = extras.rerun.filter(|_| recorded.is_ok()) {
        say!("  and, in rerun, at {}", file.display());
    }
    match reconstruction.failure.or(unseen).or(recorded.err()) {
        Some(failure) => Err(failure.into()),
        None => Ok(evaluation),
    }
}

/// Lets `session` keep its states in `folder`, and go on from those that are there if that is asked for.
fn keep_checkpoints(
    session: &mut Session,
    scene: &Scene,
    settings: &Config,
    folder: &Path,
    extras: &Extras,
) -> Result<Option<Checkpoints>, Error> {
    let Some(interval) = extras.checkpoint else { return Ok(None) };
    let text = serde_json::to_string(settings).expect("plain data");
    let identity = identity(scene, &text)?;
    let open = || Checkpoints::open(folder, identity.clone(), interval);
    let found = match extras.resume {
        true => open().newest(&mut |problem| aside!("warning: {problem}"))?,
        false => None,
    };
    match &found {
        Some(found) => aside!("going on after {}", found.reached),
        None if extras.resume => {
            aside!("no checkpoint in {}: starting from the beginning", folder.display())
        }
        None if folder.exists() => {
            aside!("note: {} of an earlier run is replaced; --resume would go on from it", folder.display());
            open().remove()?;
        }
        None => {}
    }
    session.keep_in(open(), found)?;
    Ok(Some(open()))
}

fn say_how_to_go_on(error: &Error, command: &str, extras: &Extras) {
    if matches!(error, Error::Interrupted(_)) && extras.checkpoint.is_some() {
        let rerun =
            extras.rerun.as_ref().map_or_else(String::new, |file| format!(" --rerun {}", quoted(file)));
        let force = if extras.force { " --force" } else { "" };
        aside!("go on with: {command}{rerun}{force} --resume");
    }
}

/// Material and light into the result at `folder`; returns a table for the user.
fn add_appearance(
    folder: &Path,
    scene: &Scene,
    motion: &[Positions],
    settings: &Config,
    session: &mut Session,
) -> Result<String, Error> {
    let outputs = Outputs::prepare(folder)?;
    let summary = outputs.compute(scene, motion, &settings.appearance, settings.seed, session)?;
    outputs.publish()?;
    let mut log = result::Log::read(folder)?;
    summary.times.iter().for_each(|(stage, seconds)| log.set_time(stage, *seconds));
    log.write(folder)?;
    Ok(summary.table)
}

fn evaluate(scene: &Scene, motion: &[tessuto::Positions], seed: u64) -> Result<Option<Evaluation>, Error> {
    if scene.truth.points.is_none() && scene.truth.vertices.is_none() {
        return Ok(None);
    }
    metrics::evaluate(&scene.into(), motion, 0..motion.len(), seed).map(Some)
}

/// The command line that repeats `run`: its preset and every setting that differs from it.
fn repeat_command(run: &Run, out: &Path) -> String {
    let preset = run.settings.preset.name();
    let mut command = format!(
        "tessuto reconstruct {} --out {} --preset {preset} --frames {}..{}",
        quoted(&run.scene),
        quoted(out),
        run.frames[0],
        run.frames[1]
    );
    for (key, value) in run.settings.changes() {
        command.push_str(&format!(" --set {key}={value}"));
    }
    command
}
