//! `tessuto appearance`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use tessuto::appearance::{self, AppearanceSettings};
use tessuto::io::scene::{LoadOptions, load};
use tessuto::output::{FolderKind, OutputFolder, manifest};
use tessuto::pbr::Geometry;
use tessuto::raster::Rasterizer;
use tessuto::session::Session;
use tessuto::text::quoted;
use tessuto::{Error, Positions, Scene, io, result};

use crate::progress::{Progress, stop_on_interrupt};
use crate::say::{self, aside, say};
use crate::threads::Threads;

/// What it writes or changes in the folder.
const WRITTEN: [&str; 6] =
    ["material", "rerendered", "metrics.json", "log.json", "summary.json", "report.html"];

/// Estimate material maps and light of a scene whose motion is known, and re-render its frames.
#[derive(Args)]
#[command(after_help = "\
Writes into RESULT: material/ (maps, light, and a note that tells their conventions) and rerendered/ (frames,
differences from the video, psnr.csv).

Examples:
  tessuto appearance scenes/curtain results/curtain
  tessuto appearance scenes/curtain results/curtain --motion gt
  tessuto appearance scenes/curtain results/curtain --set appearance.steps=2000")]
pub struct Arguments {
    /// Scene folder: scene.json, template.obj, rgbs/, masks/.
    scene: PathBuf,
    /// Result folder of `tessuto reconstruct` for this scene; with --motion gt, any folder.
    result: PathBuf,
    /// Whose motion: the result's, or the scene's true vertices.
    #[arg(long, value_enum, default_value_t = Motion::Result)]
    motion: Motion,
    /// Change one setting of appearance.*; config.json of a result lists all of them. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    threads: Threads,
    /// Seed of everything random.
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
    let folder = &arguments.result;
    let saved = folder.join("config.json").is_file().then(|| result::read(folder)).transpose()?;
    if saved.is_none() && arguments.motion == Motion::Result {
        return Err(Error::input(
            folder.display().to_string(),
            "there is no config.json, so this is no result of a reconstruction",
            "give the folder that `tessuto reconstruct` wrote, or --motion gt",
        )
        .into());
    }
    let frames = saved.as_ref().map(|s| s.run.frames[0]..s.run.frames[1]);
    let default = || tessuto::Config::preset(tessuto::config::Preset::Default);
    let mut config = saved.as_ref().map_or_else(default, |saved| saved.run.settings.clone());
    let saved = saved.is_some();
    for assignment in &arguments.set {
        config.set(assignment)?;
    }
    config.seed = arguments.seed.unwrap_or(config.seed);
    arguments.threads.start()?;
    let loaded = load(&arguments.scene, &LoadOptions { frames, ..LoadOptions::default() })?;
    loaded.warnings.iter().for_each(|w| aside!("warning: {w}"));
    let scene = &loaded.scene;
    let motion = match arguments.motion {
        Motion::Result => io::npy::read_shapes(&folder.join("motion.npy"))?,
        Motion::Gt => scene.truth.vertices.clone().ok_or_else(|| {
            Error::input(
                arguments.scene.join("gt/vertices.npy").display().to_string(),
                "the scene has no true vertices",
                "leave --motion gt out",
            )
        })?,
    };
    stop_on_interrupt().context("cannot listen for Ctrl-C")?;
    let mut progress = Progress::new();
    manifest::check_manifest(folder)?;
    manifest::check_parts(&WRITTEN.map(|name| folder.join(name)), true)?;
    let outputs = Outputs::prepare(folder)?;
    let session = &mut Session::new(|epoch, motion| progress.step(epoch, motion));
    let summary = outputs.compute(scene, &motion, &config.appearance, config.seed, session)?;
    outputs.publish()?;
    // The motion's errors stay what they were.
    let evaluation = result::read_metrics(folder)?;
    result::write_metrics(folder, scene, &motion, evaluation.as_ref())?;
    if saved {
        let mut log = result::Log::read(folder)?;
        summary.times.iter().for_each(|(stage, seconds)| log.set_time(stage, *seconds));
        log.set_command(&repeat_command(arguments));
        log.write(folder)?;
        result::Summary::of(folder)?.write(folder)?;
        result::write_page(folder)?;
    }
    manifest::record_or_begin(folder, FolderKind::Appearance, &WRITTEN)?;
    say::output(format_args!("{}", summary.table));
    say!("{}", folder.join("material").display());
    say!("{}", folder.join("rerendered").display());
    if saved {
        say!("{}", folder.join("report.html").display());
    }
    Ok(())
}

/// The command line that repeats this one.
fn repeat_command(arguments: &Arguments) -> String {
    let mut command =
        format!("tessuto appearance {} {}", quoted(&arguments.scene), quoted(&arguments.result));
    if arguments.motion == Motion::Gt {
        command.push_str(" --motion gt");
    }
    for assignment in &arguments.set {
        let _ = write!(command, " --set {assignment}");
    }
    if let Some(seed) = arguments.seed {
        let _ = write!(command, " --seed {seed}");
    }
    command
}

/// What an estimate tells the user.
pub struct Summary {
    /// Lines to print.
    pub table: String,
    /// Stage and its wall time [s].
    pub times: [(&'static str, f64); 2],
}

/// The folders that the estimate is written into.
pub struct Outputs {
    material: OutputFolder,
    rerendered: OutputFolder,
}

impl Outputs {
    /// Starts both inside `folder`; older ones stay until [`publish`](Self::publish).
    pub fn prepare(folder: &Path) -> Result<Self, Error> {
        let part = |name: &str| OutputFolder::prepare_part(&folder.join(name));
        Ok(Self { material: part("material")?, rerendered: part("rerendered")? })
    }

    /// Estimates, re-renders all frames and writes everything; returns what to tell the user.
    pub fn compute(
        &self,
        scene: &Scene,
        motion: &[Positions],
        settings: &AppearanceSettings,
        seed: u64,
        session: &mut Session,
    ) -> Result<Summary, Error> {
        let start = Instant::now();
        if let Some(n) = motion.iter().position(|shape| shape.len() != scene.template.positions.len()) {
            return Err(Error::input(
                format!("motion for {}, frame {n}", scene.folder.display()),
                format!("{} vertices, template.obj has {}", motion[n].len(), scene.template.positions.len()),
                "give a result of this scene",
            ));
        }
        let geometry = Geometry::new(&scene.template, motion);
        let found = appearance::fit(scene, motion, &geometry, settings, seed, session)?;
        let fitted = start.elapsed().as_secs_f64();
        appearance::write_material(self.material.partial(), &found)?;
        let history = result::history_csv(&found.history);
        io::atomic_write(&self.material.partial().join("history.csv"), history.as_bytes())?;
        let rasterizer = Rasterizer::new(&scene.template);
        let maps = found.maps();
        let mut csv = String::from("frame,psnr_db\n");
        let mut sum = 0.0;
        for (n, shape) in motion.iter().enumerate() {
            let passes = settings.render_passes;
            let drawn = appearance::rerender(
                scene,
                &rasterizer,
                &geometry,
                (n, shape),
                (&maps, &found.environment),
                passes,
            )?;
            let frame = scene.first_frame + n;
            let file = |kind: &str| self.rerendered.partial().join(format!("{kind}_{frame:03}.png"));
            io::image::write_png(&file("rgb"), &drawn.rgb)?;
            io::image::write_png(&file("difference"), &drawn.difference)?;
            let _ = writeln!(csv, "{frame},{:.3}", drawn.psnr);
            sum += drawn.psnr;
        }
        io::atomic_write(&self.rerendered.partial().join("psnr.csv"), csv.as_bytes())?;
        let mean = sum / motion.len().max(1) as f64;
        let times =
            [("material and light", fitted), ("re-rendering", start.elapsed().as_secs_f64() - fitted)];
        let mut table = format!("{:<16} {mean:.2} dB\n", "re-rendered PSNR");
        for (stage, seconds) in times {
            let _ = writeln!(table, "{stage:<18} {seconds:.0} s");
        }
        Ok(Summary { table, times })
    }

    /// Puts the finished folders in their places.
    pub fn publish(self) -> Result<(), Error> {
        crate::say_kept(self.material.publish()?);
        crate::say_kept(self.rerendered.publish()?);
        Ok(())
    }
}
