//! The folder that a reconstruction leaves behind, and reading it back.
//!
//! ```text
//! motion.npy       [N, V, 3] f32  positions, camera frame [m]
//! mesh.obj                        the template, bit for bit
//! forces.npy       [(N−1)·parts, V, 3] f32  dynamic part D of force per mass [m/s²]
//! parameters.json                 stiffnesses and constant force with units, time stepping
//! config.json                     scene, frames and all settings: what repeats the run
//! summary.json                    whether the result is good, in numbers and one sentence: see `summary`
//! metrics.json                    every frame's agreement with the video; errors, where there is truth
//! texture.png      history.csv
//! depth_error.npy  vertex_error.npy  [N, V] f32  errors at every vertex [m] (where there is truth)
//! log.json                        commands, times, warnings
//! pictures/        report.html
//! manifest.json                   sizes and hashes of all of these, written last
//! ```

mod curves;
mod folder;
mod history;
mod light;
mod live;
mod log;
mod page;
mod pictures;
mod summary;

pub use folder::{Folder, read_metrics};
pub use history::history_csv;
pub use live::{live_page, live_state};
pub use log::Log;
pub use page::write_page;
pub use summary::Summary;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::camera::{Camera, Rect};
use crate::config::{Config, Preset};
use crate::error::{Error, Result};
use crate::io;
use crate::mesh::Motion;
use crate::metrics::Evaluation;
use crate::motion::parameters::Parameters;
use crate::reconstruct::Reconstruction;
use crate::scene::Scene;

/// Which run it was.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Version of this program.
    pub version: String,
    /// The scene's folder, as it was given. Bytes of the path that are no UTF-8 are written as �.
    #[serde(serialize_with = "as_text")]
    pub scene: PathBuf,
    /// First frame and one past the last.
    pub frames: [usize; 2],
    /// All settings.
    pub settings: Config,
}

impl Run {
    /// The name of the scene's folder.
    pub fn name(&self) -> String {
        let whole = self.scene.canonicalize().unwrap_or_else(|_| self.scene.clone());
        whole.file_name().map_or_else(|| "fabric".to_owned(), |n| n.to_string_lossy().into_owned())
    }

    /// What was done, with which preset and version.
    fn subtitle(&self) -> String {
        let preset = match self.settings.preset {
            Preset::Saft => "saft",
            Preset::Default => "default",
        };
        let [first, end] = self.frames;
        format!("frames {first} to {}, preset {preset}, tessuto {}", end.saturating_sub(1), self.version)
    }
}

fn as_text<S: serde::Serializer>(path: &Path, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
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
    /// Camera of the whole image.
    camera: Camera,
    /// The part of the whole image that was used.
    crop: Rect,
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

/// Writes everything but summary and page into the existing `folder`; make these once it is complete, by
/// [`Summary::of`] and [`write_page`].
///
/// # Errors
/// [`Error::Output`].
pub fn write(folder: &Path, context: &Context, result: &Reconstruction) -> Result<()> {
    let scene = context.scene;
    let texture = result.texture.to_image();
    io::npy::write_shapes(&folder.join("motion.npy"), &result.motion)?;
    io::npy::write_shapes(&folder.join("forces.npy"), &result.parameters.accelerations.dynamic)?;
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
    let agreement = pictures::write(folder, scene, result)?;
    let evaluation = Evaluation { agreement, ..context.evaluation.cloned().unwrap_or_default() };
    write_metrics(folder, scene, &result.motion, Some(&evaluation))?;
    let log = Log {
        commands: vec![context.command.to_owned()],
        warnings: context.warnings.to_vec(),
        timings: result.timings.clone(),
    };
    log.write(folder)
}

/// Writes metrics.json: the errors of `motion`, which were measured as `errors`, and the likeness of the maps where
/// `folder` holds `material/` or `rerendered/`. Nothing is written where there is neither. Call it again once maps are
/// there; the agreement with the video then stays what it was.
///
/// # Errors
/// [`Error::Input`] for a map that cannot be read; [`Error::Output`].
pub fn write_metrics(
    folder: &Path,
    scene: &Scene,
    motion: &Motion,
    errors: Option<&Evaluation>,
) -> Result<()> {
    let maps = crate::appearance::evaluate(scene, folder, motion)?;
    if errors.is_none() && maps.is_none() {
        return Ok(());
    }
    let mut evaluation = Evaluation { maps, ..errors.cloned().unwrap_or_default() };
    if evaluation.agreement.is_empty() {
        evaluation.agreement = read_metrics(folder)?.unwrap_or_default().agreement;
    }
    write_json(&folder.join("metrics.json"), &evaluation)
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
        constant_force: quantity(p.accelerations.constant.to_array(), "m/s^2"),
        dynamic_force: quantity("forces.npy".to_owned(), "m/s^2"),
        dynamic_parts: p.accelerations.entries_per_frame,
        area_density: quantity(crate::sim::cloth::AREA_DENSITY, "kg/m^2"),
        frame_rate: quantity(scene.fps, "1/s"),
        camera,
        crop,
    }
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T> {
    let place = || path.display().to_string();
    if !path.exists() {
        let hint = "give the folder that `tessuto reconstruct` wrote";
        return Err(Error::input(place(), "cannot be read: it does not exist", hint));
    }
    let text = io::read_text(path)?;
    serde_json::from_str(&text)
        .map_err(|e| Error::input(place(), e.to_string(), "give a folder of this version of tessuto"))
}
