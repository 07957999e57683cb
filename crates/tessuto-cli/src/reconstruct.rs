//! `tessuto reconstruct`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use tessuto::Error;
use tessuto::config::{Config, Method, Preset};
use tessuto::run::{self, RunOptions};
use tessuto::text::quoted;

use crate::progress::{Verbosity, stop_on_interrupt};
use crate::repeat;
use crate::say::{aside, say};
use crate::threads::Threads;
use crate::watch::{self, Watch};

/// Recover motion, physics, texture, material and light from a scene folder.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto reconstruct scenes/curtain
  tessuto reconstruct scenes/curtain --preset saft --out results/curtain-saft
  tessuto reconstruct scenes/curtain --frames 0..20 --set spacetime.iterations=5
  tessuto reconstruct scenes/curtain --live
  tessuto reconstruct scenes/curtain --rerun curtain.rrd")]
pub struct Arguments {
    /// Scene folder: scene.json, template.obj, rgbs/, masks/.
    scene: PathBuf,
    /// Result folder [default: tessuto-out/<name of the scene folder>].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Settings to start from: `default`; `motion`, the same search without physics; or the published methods
    /// `saft`, `phi-sft` and `pg-sft`.
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
    #[command(flatten)]
    verbosity: Verbosity,
    /// Seed of all random numbers.
    #[arg(long)]
    seed: Option<u64>,
    /// Motion only; material and light are not estimated.
    #[arg(long)]
    no_appearance: bool,
    /// Replace an earlier result that was not changed since.
    #[arg(long)]
    force: bool,
    /// Resume an interrupted run of the same command. The result is the same, byte for byte.
    #[arg(long)]
    resume: bool,
    /// Seconds between checkpoints, which are kept beside the result folder until it is finished.
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = crate::values::seconds)]
    checkpoint: f64,
    /// Show the run in a browser on this machine, at http://127.0.0.1:PORT [default: a free port].
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    live: Option<u16>,
    /// Write a recording for the rerun viewer while the run goes on.
    ///
    /// It holds the video, the camera, the losses of every step and the recovered motion; it can be opened at any time.
    /// Only an earlier recording by tessuto is replaced. The result is the same with and
    /// without. Needs a build with `--features full`.
    #[arg(long, value_name = "FILE.rrd")]
    rerun: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut config = match &arguments.config {
        Some(file) => Config::read(file)?,
        None => Config::preset(arguments.preset),
    };
    config.set_all(arguments.set.iter().map(String::as_str))?;
    config.check_build()?;
    for assignment in &arguments.set {
        if let Some(why) = without_effect(&config, assignment, !arguments.no_appearance) {
            aside!("note: --set {assignment} has no effect: {why}");
        }
    }
    config.seed = arguments.seed.unwrap_or(config.seed);
    arguments.threads.start()?;
    let out = arguments.out.clone().unwrap_or_else(|| repeat::default_out(&arguments.scene));
    let mut options = RunOptions {
        frames: arguments.frames.clone(),
        appearance: !arguments.no_appearance,
        replace: arguments.force,
        resume: arguments.resume,
        checkpoint: Some(Duration::from_secs_f64(arguments.checkpoint)),
        ..RunOptions::new(config)
    };
    options.command = repeat::reconstruct(&arguments.scene, &out, &options);
    let aids = (arguments.live, arguments.rerun.as_deref());
    let mut watch = Watch::new(arguments.verbosity.verbose).with(aids, &out, &options.command)?;
    stop_on_interrupt().context("cannot listen for Ctrl-C")?;
    let finished = run::run(&arguments.scene, &out, &options, &mut watch);
    watch.stop();
    let outcome = finished.inspect_err(|error| {
        if matches!(error, Error::Interrupted(_)) {
            let force = if arguments.force { " --force" } else { "" };
            let rerun =
                arguments.rerun.as_ref().map_or_else(String::new, |f| format!(" --rerun {}", quoted(f)));
            aside!("go on with: {}{rerun}{force} --resume", options.command);
        }
    })?;
    let recorded = watch.finish(&out);
    watch::report(&outcome, &out);
    if let Some(file) = arguments.rerun.as_ref().filter(|_| recorded.is_ok()) {
        say!("  and, in rerun, at {}", file.display());
    }
    outcome.failure.or(recorded.err()).map_or(Ok(()), |failure| Err(failure.into()))
}

/// Why the run of `config` never looks at the setting of `assignment`, if it does not.
fn without_effect(config: &Config, assignment: &str, appearance: bool) -> Option<&'static str> {
    let key = assignment.split('=').next().unwrap_or_default();
    let group = key.split('.').next().unwrap_or_default();
    let search = config.method == Method::Spacetime;
    match group {
        "appearance" if !appearance => Some("material and light are not estimated"),
        "rollout" if search => Some("the method is spacetime"),
        "spacetime" | "inverse" | "material" | "causes" if !search => Some("the method is rollout"),
        "material" if config.causes.fit => Some("causes.fit finds the stiffnesses"),
        "causes" if !config.causes.fit && key != "causes.fit" => Some("causes.fit is false"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_what_does_not_run_are_told() {
        let told = |preset, key, appearance| without_effect(&Config::preset(preset), key, appearance);
        assert_eq!(told(Preset::Default, "spacetime.levels=2", true), None);
        assert_eq!(told(Preset::Default, "appearance.steps=2", true), None);
        assert!(told(Preset::Default, "appearance.steps=2", false).is_some());
        assert!(told(Preset::Default, "rollout.epochs=2", true).is_some());
        assert!(told(Preset::Default, "material.spread=2", true).is_some());
        assert!(told(Preset::Motion, "causes.iterations=2", true).is_some());
        assert_eq!(told(Preset::Motion, "causes.fit=false", true), None);
        assert!(told(Preset::Saft, "spacetime.levels=2", true).is_some());
    }
}
