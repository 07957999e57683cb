//! `tessuto appearance`.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use tessuto::run::appearance::{self, AppearanceOptions, MotionSource};

use crate::progress::{Verbosity, stop_on_interrupt};
use crate::repeat;
use crate::say::say;
use crate::threads::Threads;
use crate::watch::{self, Watch};

/// Estimate material maps and environment map of a scene whose motion is known, and re-render its frames.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto appearance scenes/curtain results/curtain
  tessuto appearance scenes/curtain results/curtain --motion gt
  tessuto appearance scenes/curtain results/curtain --set appearance.steps=2000

Writes two folders into RESULT: material/ with maps, environment map and a note on \
their conventions; rerendered/ with frames, their differences from the video and \
psnr.csv.")]
pub struct Arguments {
    /// Scene folder: scene.json, template.obj, rgbs/, masks/.
    scene: PathBuf,
    /// Result folder of `tessuto reconstruct` for this scene; with --motion gt, any folder.
    result: PathBuf,
    /// Which motion: the result's, or the scene's true vertices.
    #[arg(long, value_enum, default_value_t = Motion::Result)]
    motion: Motion,
    /// Change one setting of appearance.*; `tessuto settings appearance` lists them. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    verbosity: Verbosity,
    /// Seed of all random numbers.
    #[arg(long)]
    seed: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Motion {
    /// motion.npy of RESULT.
    Result,
    /// gt/vertices.npy of SCENE.
    Gt,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let (scene, folder) = (&arguments.scene, &arguments.result);
    let mut options = AppearanceOptions {
        motion: match arguments.motion {
            Motion::Result => MotionSource::Result,
            Motion::Gt => MotionSource::Truth,
        },
        changes: arguments.set.clone(),
        seed: arguments.seed,
        command: String::new(),
    };
    options.command = repeat::appearance(scene, folder, &options);
    let mut watch = Watch::new(arguments.verbosity.verbose);
    stop_on_interrupt().context("cannot listen for Ctrl-C")?;
    let finished = appearance::run(scene, folder, &options, &mut watch);
    watch.stop();
    let outcome = finished?;
    watch::report_appearance(outcome.psnr, &outcome.timings);
    say!("{}", folder.join("material").display());
    say!("{}", folder.join("rerendered").display());
    if outcome.is_result {
        say!("{}", folder.join("report.html").display());
    }
    Ok(())
}
