//! The folder that a reconstruction leaves behind, and reading it back.
//!
//! ```text
//! motion.npy       [N, V, 3] f32  positions, camera frame [m]
//! mesh.obj                        the template, bit for bit
//! forces.npy       [(N−1)·parts, V, 3] f32  dynamic part D of force per mass [m/s²]
//! parameters.json                 stiffnesses and constant force with units, time stepping
//! config.json                     scene, frames and all settings: what repeats the run
//! texture.png      history.csv    metrics.json (where there is truth)
//! pictures/        report.html
//! ```

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Image;
use crate::camera::Camera;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::io;
use crate::mesh::Mesh;
use crate::metrics::Evaluation;
use crate::motion::progress::Epoch;
use crate::motion::rollout_fit::Parameters;
use crate::raster::{Rasterizer, Rendering};
use crate::reconstruct::Reconstruction;
use crate::report::pictures::{FramePictures, Kind, Scales, measured_depth_image};
use crate::report::sheet::{chosen_frames, contact_sheet};
use crate::report::{self, HistoryRow, KeyNumber, Parameter, ReportData};
use crate::scene::{Scene, Shape};
use crate::sim::Forces;

/// Which run it was.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Version of this program.
    pub version: String,
    /// The scene's folder, as it was given.
    pub scene: PathBuf,
    /// First frame and one past the last.
    pub frames: [usize; 2],
    /// All settings.
    pub settings: Config,
}

/// A number with its unit.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Quantity<T> {
    value: T,
    unit: String,
}

fn quantity<T>(value: T, unit: &str) -> Quantity<T> {
    Quantity { value, unit: unit.to_owned() }
}

/// parameters.json.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct ParameterFile {
    stretch: Quantity<f64>,
    bend: Quantity<f64>,
    shear: Quantity<f64>,
    /// log10 of the three, in this order, to the last bit: a replay must not differ by a rounding.
    log10_stiffness: [f64; 3],
    /// Constant part C of force per mass.
    constant_force: Quantity<[f64; 3]>,
    /// Dynamic part D of force per mass: forces.npy.
    dynamic_force: Quantity<String>,
    /// Entries of D per frame interval.
    dynamic_parts: usize,
    area_density: Quantity<f64>,
    frame_rate: Quantity<f64>,
    /// Camera of the whole picture; results of older versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera: Option<Camera>,
}

/// A result folder in memory, as far as a simulation needs it.
#[derive(Debug)]
pub struct Saved {
    /// The run.
    pub run: Run,
    /// The template.
    pub mesh: Mesh,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// Frames per second.
    pub fps: f64,
    /// Camera of the whole picture; results of older versions lack it.
    pub camera: Option<Camera>,
}

/// What goes into the folder besides the reconstruction.
pub struct Context<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The run.
    pub run: &'a Run,
    /// Metrics, where there is truth.
    pub evaluation: Option<&'a Evaluation>,
    /// Remarks on input and result.
    pub warnings: &'a [String],
    /// Command line that repeats the run.
    pub command: &'a str,
}

/// Writes everything into the existing `folder`.
///
/// # Errors
/// [`Error::Output`].
pub fn write(folder: &Path, context: &Context, result: &Reconstruction) -> Result<()> {
    let scene = context.scene;
    let texture = result.texture.to_image();
    io::npy::write_shapes(&folder.join("motion.npy"), &result.motion)?;
    io::npy::write_shapes(&folder.join("forces.npy"), &result.parameters.forces.dynamic)?;
    io::image::write_png(&folder.join("texture.png"), &texture)?;
    io::atomic_write(
        &folder.join("mesh.mtl"),
        b"newmtl fabric\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nmap_Kd texture.png\n",
    )?;
    let material = io::obj::Material { library: "mesh.mtl", name: "fabric" };
    io::obj::write(&folder.join("mesh.obj"), &scene.template, Some(material))?;
    write_json(&folder.join("parameters.json"), &parameter_file(&result.parameters, scene))?;
    write_json(&folder.join("config.json"), context.run)?;
    io::atomic_write(&folder.join("history.csv"), history_csv(&result.history).as_bytes())?;
    write_metrics(folder, scene, &result.motion, context.evaluation)?;
    write_pictures(folder, scene, result)?;
    report::html::write(&folder.join("report.html"), &report_data(context, result))
}

/// Writes metrics.json: the errors of the motion `shapes`, shape [N, V], and the likeness of the maps where `folder` holds
/// `material/` or `rerendered/`. Nothing is written where there is neither. Call it again once maps are there.
///
/// # Errors
/// [`Error::Input`] for a map that cannot be read; [`Error::Output`].
pub fn write_metrics(
    folder: &Path,
    scene: &Scene,
    shapes: &[Shape],
    motion: Option<&Evaluation>,
) -> Result<()> {
    let maps = crate::appearance::evaluate(scene, folder, shapes)?;
    if motion.is_none() && maps.is_none() {
        return Ok(());
    }
    let evaluation = Evaluation { maps, ..motion.cloned().unwrap_or_default() };
    write_json(&folder.join("metrics.json"), &evaluation)
}

/// metrics.json of a result folder, where there is one.
///
/// # Errors
/// [`Error::Input`] if it cannot be read.
pub fn read_metrics(folder: &Path) -> Result<Option<Evaluation>> {
    let path = folder.join("metrics.json");
    if !path.is_file() {
        return Ok(None);
    }
    let fail = |problem: String| {
        Error::input(
            path.display().to_string(),
            problem,
            "delete the file, or restore it; it is written anew",
        )
    };
    let text = std::fs::read_to_string(&path).map_err(|e| fail(e.to_string()))?;
    serde_json::from_str(&text).map(Some).map_err(|e| fail(e.to_string()))
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value).expect("plain data");
    text.push('\n');
    io::atomic_write(path, text.as_bytes())
}

fn parameter_file(p: &Parameters, scene: &Scene) -> ParameterFile {
    let [width, height] = scene.full_size;
    let (crop, camera) = (scene.crop, scene.camera);
    let camera =
        Camera { cx: camera.cx + crop.x0 as f64, cy: camera.cy + crop.y0 as f64, width, height, ..camera };
    let [stretch, bend, shear] = p.stiffness();
    ParameterFile {
        stretch: quantity(stretch, "N/m"),
        bend: quantity(bend, "J/rad^2"),
        shear: quantity(shear, "J/rad^2"),
        log10_stiffness: p.log_stiffness,
        constant_force: quantity(p.forces.constant.to_array(), "m/s^2"),
        dynamic_force: quantity("forces.npy".to_owned(), "m/s^2"),
        dynamic_parts: p.forces.parts,
        area_density: quantity(crate::sim::cloth::AREA_DENSITY, "kg/m^2"),
        frame_rate: quantity(scene.fps, "1/s"),
        camera: Some(camera),
    }
}

/// Reads what [`write`] wrote.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn read(folder: &Path) -> Result<Saved> {
    let run: Run = read_json(&folder.join("config.json"))?;
    let file: ParameterFile = read_json(&folder.join("parameters.json"))?;
    let mesh = io::obj::read(&folder.join("mesh.obj"))?;
    let path = folder.join("forces.npy");
    let dynamic = io::npy::read_shapes(&path)?;
    let bad = |problem: String| {
        Error::input(path.display().to_string(), problem, "use the folder as `tessuto reconstruct` wrote it")
    };
    if let Some(entry) = dynamic.iter().find(|d| d.len() != mesh.positions.len()) {
        return Err(bad(format!("{} vertices, mesh.obj has {}", entry.len(), mesh.positions.len())));
    }
    let stiffness = [file.stretch.value, file.bend.value, file.shear.value];
    if stiffness.iter().any(|k| !k.is_finite() || *k <= 0.0) || file.dynamic_parts == 0 {
        return Err(bad(format!("stiffnesses {stiffness:?}, parts {}", file.dynamic_parts)));
    }
    let constant = DVec3::from_array(file.constant_force.value);
    if !constant.is_finite() || dynamic.iter().flatten().any(|d| !d.is_finite()) {
        return Err(bad("a force is not finite".to_owned()));
    }
    let forces = Forces { constant, dynamic, parts: file.dynamic_parts };
    let mut parameters = Parameters { log_stiffness: file.log10_stiffness, forces };
    // Whoever edits the values means the values.
    if parameters.stiffness() != stiffness {
        parameters.log_stiffness = stiffness.map(f64::log10);
    }
    Ok(Saved { run, mesh, parameters, fps: file.frame_rate.value, camera: file.camera })
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T> {
    let place = || path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| {
        Error::input(
            place(),
            format!("cannot be read: {e}"),
            "give the folder that `tessuto reconstruct` wrote",
        )
    })?;
    serde_json::from_str(&text)
        .map_err(|e| Error::input(place(), e.to_string(), "give a folder of this version of tessuto"))
}

/// One row per step; columns are the union of all names.
fn history_csv(history: &[Epoch]) -> String {
    let mut columns: Vec<&str> = Vec::new();
    for epoch in history {
        for (name, _) in epoch.losses.iter().chain(&epoch.parameters) {
            if !columns.contains(name) {
                columns.push(name);
            }
        }
    }
    let mut out = format!("stage,step,active_frames,{}\n", columns.join(","));
    for epoch in history {
        let _ = write!(out, "{},{},{}", epoch.stage, epoch.step, epoch.active_frames);
        for column in &columns {
            let value = epoch.losses.iter().chain(&epoch.parameters).find(|(name, _)| name == column);
            let _ = match value {
                Some((_, value)) => write!(out, ",{value:e}"),
                None => write!(out, ","),
            };
        }
        out.push('\n');
    }
    out
}

/// Images of one frame of the result.
struct Rendered {
    rgb: Image,
    mask: Image,
    depth: Image,
    measured: Option<Image>,
}

fn render(scene: &Scene, result: &Reconstruction) -> Vec<Rendered> {
    let rasterizer = Rasterizer::new(&scene.template);
    let of = |rendering: &mut Rendering, (n, shape): (usize, &crate::Shape)| {
        rasterizer.render(&scene.camera, shape, &result.texture, rendering);
        let (width, height) = (rendering.width, rendering.height);
        let channel = |range: std::ops::Range<usize>| Image {
            width,
            height,
            channels: range.len(),
            data: rendering.rgba.iter().flat_map(|c| c[range.clone()].to_vec()).collect(),
        };
        let points = scene.truth.points.as_ref();
        Rendered {
            rgb: channel(0..3),
            mask: channel(3..4),
            depth: rendering.depth_image(),
            measured: points.map(|p| measured_depth_image(&p[n], &scene.camera)),
        }
    };
    result.motion.par_iter().enumerate().map_init(Rendering::new, of).collect()
}

fn write_pictures(folder: &Path, scene: &Scene, result: &Reconstruction) -> Result<()> {
    let rendered = render(scene, result);
    let scales = Scales::fitting(rendered.iter().map(|r| (&r.depth, r.measured.as_ref())));
    let pictures: Vec<FramePictures> = rendered
        .iter()
        .zip(&scene.frames)
        .map(|(r, observed)| FramePictures {
            rgb: &r.rgb,
            mask: &r.mask,
            depth: &r.depth,
            observed,
            measured_depth: r.measured.as_ref(),
        })
        .collect();
    let target = folder.join("pictures");
    pictures
        .par_iter()
        .enumerate()
        .map(|(n, p)| p.write(&target, scene.first_frame + n, &scales))
        .collect::<Result<Vec<()>>>()?;
    let chosen: Vec<_> =
        chosen_frames(pictures.len()).into_iter().map(|n| (scene.first_frame + n, pictures[n])).collect();
    io::image::write_png(&target.join("contact_sheet.png"), &contact_sheet(&chosen, &scales))
}

fn report_data(context: &Context, result: &Reconstruction) -> ReportData {
    let scene = context.scene;
    let settings = &context.run.settings;
    let [stretch, bend, shear] = result.parameters.stiffness();
    let c = result.parameters.forces.constant;
    let note = |k: usize| {
        let d = &settings.dynamics;
        let range = [d.stretch, d.bend, d.shear][k];
        let value = result.parameters.log_stiffness[k];
        let at = |bound: f64| (value - bound).abs() < 1e-9;
        if at(range.low) || at(range.high) { "at its bound".to_owned() } else { String::new() }
    };
    let parameter = |name: &str, label: &str, value, unit: &str, note| Parameter {
        name: name.to_owned(),
        label: label.to_owned(),
        value,
        unit: unit.to_owned(),
        note,
    };
    // The errors are added by the page.
    let total: f64 = result.timings.iter().map(|(_, s)| s).sum();
    let key_numbers = vec![
        KeyNumber::new("frames", result.motion.len().to_string(), ""),
        KeyNumber::new("vertices", scene.template.positions.len().to_string(), ""),
        KeyNumber::new("time", format!("{total:.0}"), "s"),
    ];
    let row = |(epoch, e): (usize, &Epoch)| HistoryRow {
        epoch,
        active_frames: e.active_frames,
        losses: e.losses.iter().map(|(n, v)| (format!("{} {n}", e.stage), *v)).collect(),
        parameters: e.parameters.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect(),
    };
    ReportData {
        title: scene.name.clone(),
        subtitle: format!("{:?} preset, tessuto {}", settings.preset, context.run.version),
        command: context.command.to_owned(),
        key_numbers,
        frames: (scene.first_frame..scene.first_frame + result.motion.len()).collect(),
        kinds: Kind::ALL
            .into_iter()
            .filter(|k| *k != Kind::DepthDifference || scene.truth.points.is_some())
            .collect(),
        pictures: "pictures".to_owned(),
        contact_sheet: "pictures/contact_sheet.png".to_owned(),
        history: result.history.iter().enumerate().map(row).collect(),
        parameters: vec![
            parameter("stretch", "stretch stiffness", stretch, "N/m", note(0)),
            parameter("bend", "bend stiffness", bend, "J/rad²", note(1)),
            parameter("shear", "shear stiffness", shear, "J/rad²", note(2)),
            parameter("constant_x", "constant force per mass, x (right)", c.x, "m/s²", String::new()),
            parameter("constant_y", "constant force per mass, y (down)", c.y, "m/s²", String::new()),
            parameter("constant_z", "constant force per mass, z (away)", c.z, "m/s²", String::new()),
        ],
        evaluation: context.evaluation.cloned(),
        timings: result.timings.clone(),
        warnings: context.warnings.to_vec(),
        config: serde_json::to_string_pretty(context.run).expect("plain data"),
    }
}
