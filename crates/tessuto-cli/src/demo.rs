//! `tessuto demo`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use clap::Args;
use tessuto::config::{Config, Preset};
use tessuto::metrics::causes::CauseMetrics;
use tessuto::run::{self, RunOptions};
use tessuto::synth::Settings;
use tessuto::text::quoted;

use crate::progress::stop_on_interrupt;
use crate::say::{aside, say};
use crate::threads::Threads;
use crate::watch::{self, Watch};
use crate::{remedy, repeat};

/// Speed of the wind [m/s]: the sheet swings by a third of its width, which constrains its stiffness.
const WIND: f64 = 3.0;

/// Make a small scene, recover motion and physics from its video alone, and compare them with the truth.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto demo
  tessuto demo --out /tmp/demo --seed 3

  # a clip as a phone films it, to try every step on
  tessuto demo --clip trial")]
pub struct Arguments {
    /// Folder for scene and result.
    #[arg(long, value_name = "DIR", default_value = "tessuto-out/demo")]
    out: PathBuf,
    /// Replace an earlier demonstration there.
    #[arg(long)]
    force: bool,
    /// Only make a clip with surroundings, noise and compression in this new folder, with corners, size and camera
    /// in a README.
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
    let settings = Settings::default().with(|s| {
        s.seed = arguments.seed;
        s.air = true;
        s.wind = WIND;
    });
    let [columns, rows] = settings.grid;
    say!(
        "1. a cloth of {columns}×{rows} vertices in a wind of {WIND:.0} m/s, {} frames of {}×{} px",
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
    watch::report(&outcome, &result);
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
    let warn = &mut |warning: &_| aside!("warning: {}", remedy::warning(warning));
    let compared = tessuto::run::evaluate::evaluate(&scene, &result, None, 0, warn)?;
    compared.causes.iter().flat_map(physics).for_each(|line| say!("   {line}"));
    say!(
        "open {}: motion, wind, and the same cloth in still air or ten times stiffer",
        quoted(&result.join("report.html"))
    );
    say!("next:  tessuto simulate {} --scale bend=2 --out stiffer", quoted(&result));
    say!("yours: tessuto import CLIP.mp4 scenes/mine --fov 65 --outline \"X,Y X,Y X,Y X,Y\"");
    Ok(())
}

/// Farthest that a vertex is from its place in frame 0 [m].
fn largest_displacement(scene: &Path) -> tessuto::Result<f64> {
    let truth = tessuto::io::npy::read_motion(&scene.join("gt/vertices.npy"))?;
    let distances = truth.iter().flat_map(|shape| shape.iter().zip(&truth[0]).map(|(p, q)| p.distance(*q)));
    Ok(distances.fold(0.0, f64::max))
}

/// How the physics that was found compares with the truth, in lines for people.
fn physics(causes: &CauseMetrics) -> Vec<String> {
    let mut lines = Vec::new();
    if let (Some(bend), Some(shear), Some(gravity)) = (causes.bend, causes.shear, causes.gravity) {
        let factor = |log10: f64| 10f64.powf(log10);
        lines.push(format!(
            "bend stiffness is {:.2} times the true one, shear stiffness {:.2} times, gravity is within {:.1}°",
            factor(bend.log10),
            factor(shear.log10),
            gravity.degrees
        ));
    }
    if let Some(calm) = causes.calm {
        lines.push(format!(
            "in still air, 20 frames on, the found cloth is {:.1} mm from the true one; a guess without \
             physics {:.1} mm",
            1e3 * calm.error,
            1e3 * calm.baseline
        ));
    }
    lines
}
