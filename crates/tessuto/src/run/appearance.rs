//! Material and light of a scene whose motion is known, into a folder.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use super::observer::{Observer, Shared, Stage, kept_aside};
use crate::result::{self, Run};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::Motion;
use tessuto_core::scene::{Back, Scene};
use tessuto_estimate::appearance::{self, AppearanceSettings};
use tessuto_estimate::config::{Config, Preset};
use tessuto_estimate::io;
use tessuto_estimate::io::scene::{LoadOptions, Loaded, load};
use tessuto_estimate::output::{FolderKind, OutputFolder, manifest};
use tessuto_estimate::session::Session;
use tessuto_estimate::template::irregular::of_scene;
use tessuto_render::pbr::Geometry;
use tessuto_render::raster::Rasterizer;

/// Stages as they are announced.
pub(super) const FIT: &str = "material and light";
pub(super) const RERENDER: &str = "re-rendering";

/// What is written into any folder, and what is changed in a result besides.
const WRITTEN: [&str; 3] = ["material", "rerendered", "metrics.json"];
const CHANGED: [&str; 6] =
    ["material", "rerendered", "metrics.json", "log.json", "summary.json", "report.html"];

/// Frames that are drawn again at a time.
const TOGETHER: usize = 4;

/// Whose motion is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionSource {
    /// That of the result.
    Result,
    /// The scene's true vertices.
    Truth,
}

/// What to do.
#[derive(Debug, Clone)]
pub struct AppearanceOptions {
    /// Whose motion is taken.
    pub motion: MotionSource,
    /// Changes `key=value` of the result's settings.
    pub changes: Vec<String>,
    /// Seed of everything random, in place of the result's.
    pub seed: Option<u64>,
    /// The command line that repeats the estimate, for the result's log.
    pub command: String,
}

/// What was estimated.
#[derive(Debug)]
pub struct AppearanceOutcome {
    /// Mean PSNR of the re-rendered frames `[dB]`.
    pub psnr: f64,
    /// Stage and its wall time `[s]`.
    pub timings: Vec<(String, f64)>,
    /// Whether the folder is a result, whose page was written anew.
    pub is_result: bool,
}

/// Estimates material and light of the scene in `scene_folder` into `folder`, a result of the scene or, with the true
/// motion, any folder. What is there of an earlier estimate is replaced if nobody changed it since.
///
/// # Errors
/// [`Error::Input`] for a scene or result that cannot be used, and for files that are not tessuto's where it would
/// write; [`Error::Usage`] for a setting; [`Error::Output`]; whatever the observer returns.
pub fn run(
    scene_folder: &Path,
    folder: &Path,
    options: &AppearanceOptions,
    observer: &mut dyn Observer,
) -> Result<AppearanceOutcome> {
    let saved = saved(folder, options)?;
    let frames = saved.as_ref().map(|saved| saved.run.frames[0]..saved.run.frames[1]);
    let loaded = load(scene_folder, &LoadOptions { frames, ..LoadOptions::default() })?;
    work(&loaded, scene_folder, (folder, saved), options, observer)
}

/// [`run`] of a scene that is in memory, whose frames are the result's; `name` is what the result says it is of.
///
/// # Errors
/// As [`run`].
pub fn run_loaded(
    loaded: &Loaded,
    name: &Path,
    folder: &Path,
    options: &AppearanceOptions,
    observer: &mut dyn Observer,
) -> Result<AppearanceOutcome> {
    let saved = saved(folder, options)?;
    if let Some([first, end]) = saved.as_ref().map(|saved| saved.run.frames)
        && end - first != loaded.scene.frames.len()
    {
        let problem = format!("has {} frames, the scene has {}", end - first, loaded.scene.frames.len());
        let hint = "give the frames that the result is of";
        return Err(Error::input(folder.display().to_string(), problem, hint));
    }
    work(loaded, name, (folder, saved), options, observer)
}

/// The result in `folder`, if it is one.
fn saved(folder: &Path, options: &AppearanceOptions) -> Result<Option<result::Folder>> {
    let saved = folder.join("config.json").is_file().then(|| result::Folder::open(folder)).transpose()?;
    if saved.is_none() && options.motion == MotionSource::Result {
        return Err(Error::input(
            folder.display().to_string(),
            "there is no config.json, so this is not the result of a reconstruction",
            Hint::from("give the folder that a reconstruction wrote, or take the true motion")
                .with(Remedy::TrueMotion),
        ));
    }
    Ok(saved)
}

fn work(
    loaded: &Loaded,
    scene_folder: &Path,
    (folder, saved): (&Path, Option<result::Folder>),
    options: &AppearanceOptions,
    observer: &mut dyn Observer,
) -> Result<AppearanceOutcome> {
    let mut settings =
        saved.as_ref().map_or_else(|| Config::preset(Preset::Default), |saved| saved.run.settings.clone());
    settings.set_all(options.changes.iter().map(String::as_str))?;
    settings.seed = options.seed.unwrap_or(settings.seed);
    loaded.warnings.iter().for_each(|warning| observer.warning(warning));
    let scene = result::in_metres(of_scene(&loaded.scene, settings.irregular_vertices)?, folder)?;
    let scene = &*match &saved {
        Some(saved) => scene.with_back(saved.back),
        None => Cow::Borrowed(&*scene),
    };
    let motion = match (options.motion, &saved) {
        (MotionSource::Result, Some(saved)) => saved.motion()?,
        _ => scene.truth.vertices.as_ref().ok_or_else(|| {
            let place = scene_folder.join("gt/vertices.npy").display().to_string();
            Error::input(place, "the scene has no true vertices", "take the motion of a result")
        })?,
    };
    manifest::check_manifest(folder)?;
    let files = if saved.is_some() { &CHANGED[..] } else { &WRITTEN };
    manifest::check_parts(&files.iter().map(|name| folder.join(name)).collect::<Vec<_>>(), true)?;

    let run = Run {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene_folder.to_path_buf(),
        frames: [scene.first_frame, scene.first_frame + scene.frames.len()],
        settings,
    };
    let stages = [Stage { name: FIT, weight: 6.0 }, Stage { name: RERENDER, weight: 1.0 }];
    observer.begin(scene, &run, &stages, &[])?;
    let observer = RefCell::new(observer);
    let session = &mut Session::observed(Shared(&observer));
    let settings = &run.settings;
    let psnr = estimate(folder, scene, motion, &settings.appearance, settings.seed, session)?;

    // The motion's errors stay what they were.
    let evaluation = result::read_metrics(folder)?;
    result::write_metrics(folder, scene, motion, evaluation.as_ref())?;
    if saved.is_some() {
        let mut log = result::Log::read(folder)?;
        session.timings().iter().for_each(|(stage, seconds)| log.set_time(stage, *seconds));
        log.set_command(&options.command);
        log.write(folder)?;
        let changed = result::Folder::open(folder)?;
        result::Summary::of(&changed)?.write(folder)?;
        result::write_page(&changed)?;
    }
    manifest::record_or_begin(folder, FolderKind::Appearance, files)?;
    Ok(AppearanceOutcome { psnr, timings: session.timings().to_vec(), is_result: saved.is_some() })
}

/// Estimates, draws all frames again, and writes material/ and rerendered/ into `folder`, each whole or not at all;
/// returns the mean PSNR of the frames `[dB]`.
pub(super) fn estimate(
    folder: &Path,
    scene: &Scene,
    motion: &Motion,
    settings: &AppearanceSettings,
    seed: u64,
    session: &mut Session,
) -> Result<f64> {
    let [material, rerendered] =
        ["material", "rerendered"].map(|n| OutputFolder::prepare_part(&folder.join(n)));
    let (material, rerendered) = (material?, rerendered?);
    let place = format!("motion for {}", scene.folder.display());
    motion.check_vertices(scene.template.positions.len(), &place)?;

    session.begin(FIT);
    // Of as many frames as the motion has: whether these are the clip's is asked where they are compared.
    let views: Vec<Viewpoint> = (0..motion.len()).map(|n| scene.viewpoint(n)).collect();
    let geometry = Geometry::seen(&scene.template, motion, &views);
    let found = appearance::fit(scene, motion, &geometry, settings, seed, session)?;
    appearance::write_material(material.partial(), &found)?;
    let history = result::history_csv(&found.history);
    io::atomic_write(&material.partial().join("history.csv"), history.as_bytes())?;

    session.begin(RERENDER);
    let maps = found.maps();
    // Without an albedo of the other side the maps go through.
    let back = if maps.back.is_some() { Back::Plain(Some([0.0; 3])) } else { Back::Same };
    let rasterizer = Rasterizer::of_fabric(&scene.template, &scene.viewpoint(0), back);
    let mut csv = String::from("frame,psnr_db\n");
    let mut sum = 0.0;
    // Frames side by side: one is drawn while another is compressed, which takes one thread.
    let draw = |n: usize| {
        let look = (&maps, &found.environment);
        let samples_per_pixel = settings.render_samples_per_pixel;
        let drawn =
            appearance::rerender(scene, &rasterizer, &geometry, (n, &motion[n]), look, samples_per_pixel)?;
        let frame = scene.first_frame + n;
        let file = |kind: &str| rerendered.partial().join(format!("{kind}_{frame:03}.png"));
        io::image::write_png(&file("rgb"), &drawn.rgb)?;
        io::image::write_png(&file("difference"), &drawn.difference)?;
        Ok(drawn.psnr)
    };
    for start in (0..motion.len()).step_by(TOGETHER) {
        let frames = start..(start + TOGETHER).min(motion.len());
        let drawn: Vec<Result<f64>> = frames.clone().into_par_iter().map(draw).collect();
        for (n, psnr) in frames.zip(drawn) {
            let psnr = psnr?;
            let _ = writeln!(csv, "{},{psnr:.3}", scene.first_frame + n);
            sum += psnr;
            session.advance(n + 1, motion.len());
        }
    }
    io::atomic_write(&rerendered.partial().join("psnr.csv"), csv.as_bytes())?;
    session.end();
    for kept in [material.publish()?, rerendered.publish()?].into_iter().flatten() {
        session.note(&kept_aside(&kept));
    }
    Ok(sum / motion.len().max(1) as f64)
}
