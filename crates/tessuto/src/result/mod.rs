//! The folder that a reconstruction leaves behind, and reading it back.
//!
//! ```text
//! motion.npy       [N, V, 3] f32  positions, camera frame [m]
//! mesh.obj                        the template, bit for bit
//! deviation.npy    [N, V] f32     standard deviation of the positions [m] (default method)
//! forces.npy       [(N−1)·parts, V, 3] f32  dynamic part D of force per mass [m/s²]
//! forces.npz                      the forces by their causes [N−1, V, 3] (preset default)
//! rest_lengths.npy [edges] f32    lengths of the edges without load [m] (preset default)
//! changed/                        motions as they would have been, for the page [M, V, 3] f32 [m] (preset default)
//! parameters.json                 stiffnesses and causes with units and standard deviations, time stepping, other side
//! config.json                     scene, frames and all settings: what repeats the run
//! summary.json                    whether the result is good, in numbers and one sentence: see `summary`
//! metrics.json                    every frame's agreement with the video and verdict; errors, where there is truth
//! texture.png      history.csv    colours from all frames, in the first frame's light
//! seen_vertices.npy [V], seen_texels.npy [S, S], seen_directions.npy [24, 48] f32
//!                                 how often each was seen: see [`tessuto_estimate::appearance::Seen`]
//! depth_error.npy  vertex_error.npy  [N, V] f32  errors at every vertex [m] (where there is truth)
//! views.json                      further cameras and where they were (several views)
//! log.json                        commands, times, warnings
//! pictures/        report.html
//! manifest.json                   sizes and hashes of all of these, written last
//! ```

mod cause_page;
mod causes;
mod changed;
mod curves;
mod fabric;
mod folder;
mod history;
mod images;
mod light;
mod live;
mod log;
mod metres;
mod page;
mod replay;
mod shutter;
mod summary;
mod views;

pub(crate) use changed::changes;
pub use fabric::Measured;
pub use folder::{Folder, read_metrics};
pub(crate) use history::history_csv;
pub(crate) use images::of_other;
pub use live::{live_page, live_state};
pub use log::Log;
pub(crate) use metres::in_metres;
pub use page::write_page;
pub use replay::write_replay;
pub use summary::Summary;
pub use views::OtherCamera;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use tessuto_core::camera::{Camera, Rect};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::Motion;
use tessuto_core::scene::{Back, Scene};
use tessuto_estimate::Reconstruction;
use tessuto_estimate::appearance::{DIRECTION_ROWS, Seen, gather};
use tessuto_estimate::config::{Config, DynamicsSettings};
use tessuto_estimate::io;
use tessuto_estimate::metrics::{Evaluation, judge_frames};
use tessuto_estimate::motion::causes::Explained;
use tessuto_estimate::motion::parameters::{Parameters, StiffnessRange};
use tessuto_sim::Model;

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
        let preset = self.settings.preset.name();
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

/// A stiffness, and how free its search was.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct FoundStiffness {
    value: f64,
    unit: String,
    /// Where the search had to stay.
    bounds: [f64; 2],
    /// It went as far as it could: the value says less about the fabric than about the bound.
    at_bound: bool,
    /// Standard deviation, and whether the video constrains it (preset default).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sd: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    informed: Option<bool>,
    #[serde(flatten)]
    said: causes::Said,
}

fn found_stiffness(value: f64, log_k: f64, range: StiffnessRange, unit: &str) -> FoundStiffness {
    let bounds = [range.low, range.high].map(|k| 10f64.powf(k));
    let at_bound = range.bound_at(log_k).is_some();
    FoundStiffness { value, unit: unit.to_owned(), bounds, at_bound, ..FoundStiffness::default() }
}

/// What helps if a file of a result cannot be used.
const UNCHANGED: &str = "use the folder as tessuto wrote it";

/// What the numbers of parameters.json are.
const REMARK: &str = "Stiffnesses and forces are effective values: with them the simulation replays the \
                      motion. They are not measurements of the fabric. All of them are relative to \
                      area_density, which is assumed.";

/// The same where causes were found.
const REMARK_OF_CAUSES: &str = "Stiffnesses, gravity and air are found from the motion, with standard \
                                deviations (sd) and a constraint: what the video says of them; \
                                where informed is false, the value is mostly what was assumed before. \
                                On real clips they were not compared with measurements. With them and \
                                forces.npy the simulation replays the motion. All of them are relative to \
                                area_density, which is assumed.";

/// parameters.json.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct ParameterFile {
    remark: String,
    /// The elastic model.
    #[serde(default)]
    model: Model,
    /// Its properties, by their keys.
    #[serde(flatten)]
    properties: BTreeMap<String, FoundStiffness>,
    /// log10 of them, in the order of the model's table, to the last bit: a replay must not differ by a rounding.
    log10_stiffness: Vec<f64>,
    /// Constant part C of force per mass.
    constant_force: Quantity<[f64; 3]>,
    /// Dynamic part D of force per mass: forces.npy.
    dynamic_force: Quantity<String>,
    /// Entries of D per frame interval.
    dynamic_parts: usize,
    /// Velocity of the air, where there is any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wind: Option<Quantity<[f64; 3]>>,
    area_density: Quantity<f64>,
    frame_rate: Quantity<f64>,
    /// Camera of the whole image.
    camera: Camera,
    /// The part of the whole image that was used.
    crop: Rect,
    /// What the other side looks like, if not the same, as scene.json names it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    back: Option<String>,
    /// What the forces are of (preset default).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    causes: Option<causes::CauseFile>,
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

/// Writes what [`Folder::open`] reads into the existing `folder`: the motion and what makes it.
///
/// # Errors
/// [`Error::Output`].
pub fn write_motion(folder: &Path, scene: &Scene, run: &Run, result: &Reconstruction) -> Result<()> {
    io::npy::write_field(&folder.join("motion.npy"), &result.motion)?;
    if let Some(deviations) = &result.deviations {
        let shape = [deviations.len(), scene.template.positions.len()];
        let numbers: Vec<f32> = deviations.iter().flatten().map(|s| *s as f32).collect();
        io::npy::write(&folder.join("deviation.npy"), &shape, &numbers)?;
    }
    io::npy::write_field(&folder.join("forces.npy"), &result.parameters.accelerations.dynamic)?;
    io::atomic_write(
        &folder.join("mesh.mtl"),
        b"newmtl fabric\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nmap_Kd texture.png\n",
    )?;
    let material = io::obj::Material { library: "mesh.mtl", name: "fabric" };
    io::obj::write(&folder.join("mesh.obj"), &scene.template, Some(material))?;
    let mut parameters = parameter_file(&result.parameters, scene, &run.settings.dynamics);
    parameters.back = (result.back != Back::Same).then(|| io::scene::back::name(result.back));
    if let Some(explained) = &result.causes {
        parameters.explain(explained, result.motion.len(), scene.fps);
        causes::write_forces(folder, explained, scene.template.positions.len())?;
    }
    write_json(&folder.join("parameters.json"), &parameters)?;
    write_json(&folder.join("config.json"), run)?;
    if let Some(poses) = &scene.poses {
        io::scene::write_poses(folder, poses, scene.pose_unit)?;
    }
    views::write(folder, scene)?;
    io::atomic_write(&folder.join("history.csv"), history_csv(&result.history).as_bytes())
}

/// Writes print, images, metrics and log into `folder`, after [`write_motion`]; summary and page are made once it
/// is complete, by [`Summary::of`] and [`write_page`].
///
/// # Errors
/// [`Error::Output`]; those of reading the frames.
pub fn write_pictures(folder: &Path, context: &Context, result: &Reconstruction) -> Result<()> {
    let scene = &*context.scene.with_back(result.back);
    let deviations = result.deviations.as_deref();
    let print = gather(scene, &result.motion, deviations, context.run.settings.texture.size)?;
    io::image::write_png(&folder.join("texture.png"), &print.texture.to_image())?;
    let Seen { size, texels, vertices, directions } = &print.seen;
    io::npy::write(&folder.join("seen_vertices.npy"), &[vertices.len()], vertices)?;
    io::npy::write(&folder.join("seen_texels.npy"), &[*size, *size], texels)?;
    io::npy::write(&folder.join("seen_directions.npy"), &[DIRECTION_ROWS, 2 * DIRECTION_ROWS], directions)?;
    let agreement = images::write(folder, scene, result)?;
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
pub(crate) fn write_metrics(
    folder: &Path,
    scene: &Scene,
    motion: &Motion,
    errors: Option<&Evaluation>,
) -> Result<()> {
    let maps = tessuto_estimate::appearance::evaluate(scene, folder, motion)?;
    if errors.is_none() && maps.is_none() {
        return Ok(());
    }
    let mut evaluation = Evaluation { maps, ..errors.cloned().unwrap_or_default() };
    if evaluation.agreement.is_empty() {
        evaluation.agreement = read_metrics(folder)?.unwrap_or_default().agreement;
    }
    evaluation.verdicts = judge_frames(&evaluation.agreement, &scene.template);
    write_json(&folder.join("metrics.json"), &evaluation)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value).expect("plain data");
    text.push('\n');
    io::atomic_write(path, text.as_bytes())
}

fn parameter_file(p: &Parameters, scene: &Scene, dynamics: &DynamicsSettings) -> ParameterFile {
    let [width, height] = scene.full_size;
    let (crop, camera) = (scene.crop, scene.camera);
    let camera =
        Camera { cx: camera.cx + crop.x0 as f64, cy: camera.cy + crop.y0 as f64, width, height, ..camera };
    let file = ParameterFile {
        remark: REMARK.to_owned(),
        model: p.model,
        properties: BTreeMap::new(),
        log10_stiffness: Vec::new(),
        constant_force: quantity(p.accelerations.constant.to_array(), "m/s^2"),
        dynamic_force: quantity("forces.npy".to_owned(), "m/s^2"),
        dynamic_parts: p.accelerations.entries_per_frame,
        wind: p.accelerations.wind.map(|wind| quantity(wind.to_array(), "m/s")),
        area_density: quantity(tessuto_sim::cloth::AREA_DENSITY, "kg/m^2"),
        frame_rate: quantity(scene.fps, "1/s"),
        camera,
        crop,
        back: None,
        causes: None,
    };
    parameters_in(file, p, dynamics)
}

impl ParameterFile {
    /// Adds causes of a motion of `frames` frames.
    fn explain(&mut self, explained: &Explained, frames: usize, fps: f64) {
        for (k, property) in self.model.properties().iter().enumerate() {
            let (sd, constraint) = causes::certainty(&explained.found, k);
            if let Some(stiffness) = self.properties.get_mut(property.key) {
                (stiffness.sd, stiffness.informed) = (Some(sd), Some(constraint.is_constrained()));
                stiffness.said = causes::Said::new(&constraint, stiffness.value);
            }
        }
        REMARK_OF_CAUSES.clone_into(&mut self.remark);
        self.causes = Some(causes::CauseFile::new(explained, frames, fps));
    }
}

/// `file` with the stiffnesses of `p`.
fn parameters_in(file: ParameterFile, p: &Parameters, dynamics: &DynamicsSettings) -> ParameterFile {
    let found = p.properties().zip(&p.log_stiffness).zip(dynamics.ranges());
    let properties = found.map(|(((property, value), log_k), (_, range))| {
        (property.key.to_owned(), found_stiffness(value, *log_k, range, &property.plain_unit()))
    });
    ParameterFile { properties: properties.collect(), log10_stiffness: p.log_stiffness.clone(), ..file }
}

/// Which run left `folder`; `None` where there is no config.json, as beside a motion from elsewhere.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn read_run(folder: &Path) -> Result<Option<Run>> {
    let path = folder.join("config.json");
    path.is_file().then(|| read_json(&path)).transpose()
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T> {
    let place = || path.display().to_string();
    if !path.exists() {
        let hint = "give the folder of a reconstruction";
        return Err(Error::input(place(), "cannot be read: it does not exist", hint));
    }
    let text = io::read_text(path)?;
    serde_json::from_str(&text)
        .map_err(|e| Error::input(place(), e.to_string(), "give a folder of this version of tessuto"))
}
