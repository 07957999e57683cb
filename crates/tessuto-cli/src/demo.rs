//! `tessuto demo`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use clap::Args;
use tessuto::config::{Config, Preset};
use tessuto::run::{self, RunOptions};
use tessuto::synth::Settings;

use crate::progress::stop_on_interrupt;
use crate::repeat;
use crate::say::say;
use crate::threads::Threads;
use crate::watch::{self, Watch};

/// See it work: make a small scene, recover its motion from the video alone, compare with the truth.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto demo
  tessuto demo --out /tmp/demo --seed 3
  tessuto demo --clip trial            (a clip as a phone films it, to try the whole way with)")]
pub struct Arguments {
    /// Folder for scene and result.
    #[arg(long, value_name = "DIR", default_value = "tessuto-out/demo")]
    out: PathBuf,
    /// Replace an earlier demonstration there.
    #[arg(long)]
    force: bool,
    /// Only make a clip with surroundings, noise and compression, and a README of corners, size and camera, in this new folder.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "force"])]
    clip: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    /// Seed of the scene.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    if let Some(folder) = &arguments.clip {
        return crate::clip::make(folder, arguments.seed);
    }
    let started = Instant::now();
    let (scene, result) = (arguments.out.join("scene"), arguments.out.join("result"));
    let settings = Settings::default().with(|s| s.seed = arguments.seed);
    let [columns, rows] = settings.grid;
    say!(
        "1. a cloth of {columns}×{rows} vertices in a gust of wind, {} frames of {}×{} px",
        settings.frames,
        settings.size,
        settings.size
    );
    crate::synth::synth_into(&scene, &settings, arguments.force)?;
    say!("2. check of the scene");
    crate::check::check(&scene, None)?;
    say!("3. reconstruction from the images and the first frame's shape");
    let config = Config::preset(Preset::Default);
    let mut options = RunOptions { appearance: false, replace: arguments.force, ..RunOptions::new(config) };
    options.command = repeat::reconstruct(&scene, &result, &options);
    let mut watch = Watch::new(false);
    stop_on_interrupt().context("cannot listen for Ctrl-C")?;
    let finished = run::run(&scene, &result, &options, &mut watch);
    watch.stop();
    let outcome = finished?;
    watch::tell(&outcome, &result);
    outcome.failure.map_or(Ok(()), Err)?;
    say!("4. comparison with the truth, in {:.0} s all together", started.elapsed().as_secs_f64());
    if let Some(mean) = outcome.evaluation.map(|e| e.mean).and_then(|m| m.vertex) {
        let largest = largest_displacement(&scene)?;
        say!(
            "   the cloth moved by up to {:.0} mm; its vertices were found to {:.1} mm on average",
            1e3 * largest,
            1e3 * mean
        );
    }
    say!("scene:    {}", scene.display());
    say!("result:   {}", result.display());
    say!("report:   {}", result.join("report.html").display());
    say!("images:   {}", result.join("pictures/contact_sheet.png").display());
    Ok(())
}

/// Farthest that a vertex is from its place in frame 0 [m].
fn largest_displacement(scene: &Path) -> tessuto::Result<f64> {
    let truth = tessuto::io::npy::read_motion(&scene.join("gt/vertices.npy"))?;
    let distances = truth.iter().flat_map(|shape| shape.iter().zip(&truth[0]).map(|(p, q)| p.distance(*q)));
    Ok(distances.fold(0.0, f64::max))
}
