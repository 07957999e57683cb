//! `tessuto forecast`.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use tessuto::Error;
use tessuto::config::{Config, Preset};
use tessuto::io::atomic_write;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::result::Folder;
use tessuto::run::forecast::forecast;
use tessuto::run::{self, RunOptions};

use crate::progress::{Verbosity, stop_on_interrupt};
use crate::say::{self, aside, say};
use crate::threads::Threads;
use crate::watch::Watch;
use crate::{remedy, repeat};

/// Estimate physics from the first part of a clip, predict the rest, and compare with the truth.
#[derive(Args)]
#[command(after_help = "\
Example:
  tessuto forecast scenes/curtain --fit 0.7 --out forecast

Writes DIR/fit, the result of the first part, and DIR/forecast: forecast.txt, \
forecast.csv, forecast.json and forecast.svg. An existing fit is used again.

The forecast is compared with four simpler ones: with the prior's stiffnesses, with \
the last residual held, with the last shape held still, and in a straight line.")]
pub struct Arguments {
    /// Scene folder with ground truth.
    scene: PathBuf,
    /// Fraction of the frames from which causes are found.
    #[arg(long, default_value_t = 0.7, value_parser = fraction)]
    fit: f64,
    /// Folder of all that is written.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Change one setting of the preset default. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    verbosity: Verbosity,
}

fn fraction(text: &str) -> Result<f64, String> {
    let fraction: f64 = text.parse().map_err(|_| "give a fraction such as 0.7".to_owned())?;
    if fraction > 0.0 && fraction < 1.0 {
        Ok(fraction)
    } else {
        Err("give a fraction between 0 and 1".to_owned())
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut config = Config::preset(Preset::Default);
    config.set_all(arguments.set.iter().map(String::as_str))?;
    arguments.threads.start()?;
    let loaded = load(&arguments.scene, &LoadOptions::default())?;
    loaded.warnings.iter().for_each(|warning| aside!("warning: {}", remedy::warning(warning)));
    let scene = loaded.scene;
    let all = scene.frames.len();
    let fit = ((arguments.fit * all as f64).round() as usize).clamp(3.min(all), all.saturating_sub(1));
    let frames = scene.first_frame..scene.first_frame + fit;
    let folder = arguments.out.join("fit");
    if folder.join("manifest.json").is_file() {
        let there = Folder::open(&folder)?;
        if there.run.settings != config || there.run.frames != [frames.start, frames.end] {
            let problem = "is a result of other settings or frames";
            let hint = "choose another output folder, or remove this one";
            return Err(Error::input(folder.display().to_string(), problem, hint).into());
        }
    } else {
        let mut options =
            RunOptions { frames: Some(frames), appearance: false, resume: true, ..RunOptions::new(config) };
        options.command = repeat::reconstruct(&arguments.scene, &folder, &options);
        let mut watch = Watch::new(arguments.verbosity.verbose);
        stop_on_interrupt().context("cannot listen for Ctrl-C")?;
        let finished = run::run(&arguments.scene, &folder, &options, &mut watch);
        watch.stop();
        finished?.failure.map_or(Ok(()), Err)?;
    }
    let fitted = Folder::open(&folder)?;
    let forecast = forecast(&scene, &fitted, fitted.run.settings.seed)?;
    let output = OutputFolder::prepare(&arguments.out.join("forecast"), FolderKind::Comparison, true)?;
    let table = forecast.table();
    let write = |name: &str, text: &str| atomic_write(&output.partial().join(name), text.as_bytes());
    write("forecast.txt", &table)?;
    write("forecast.csv", &forecast.csv())?;
    write("forecast.svg", &forecast.svg())?;
    write("forecast.json", &(serde_json::to_string_pretty(&forecast)? + "\n"))?;
    output.publish()?;
    say::output(format_args!("{table}"));
    say!("{}", arguments.out.join("forecast").display());
    Ok(())
}
