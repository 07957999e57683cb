//! A result folder, opened: each part is read when it is first asked for, and once.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::causes::CauseFile;
use super::{Log, OtherCamera, ParameterFile, Run, UNCHANGED, history, read_json};
use tessuto_core::camera::{Camera, Pose, Rect, Viewpoint};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Motion};
use tessuto_core::scene::Back;
use tessuto_estimate::appearance;
use tessuto_estimate::io;
use tessuto_estimate::metrics::Evaluation;
use tessuto_estimate::motion::causes::{Found, Sizes};
use tessuto_estimate::motion::parameters::Parameters;
use tessuto_estimate::session::Epoch;
use tessuto_render::pbr::Material;
use tessuto_render::raster::Rasterizer;
use tessuto_sim::Accelerations;
use tessuto_sim::per_width::PerWidth;

/// See the module. What a simulation needs is read at once.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// The run.
    pub run: Run,
    /// The template.
    pub mesh: Mesh,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// What the forces are of; `None` from the other method.
    pub found: Option<Found>,
    /// How large the causes are, there.
    pub sizes: Option<Sizes>,
    /// The stiffnesses whatever the mesh, there.
    pub per_width: Option<PerWidth>,
    /// Frames per second.
    pub fps: f64,
    /// Camera of the whole image.
    pub camera: Camera,
    /// Where it was in every frame, if it moved; at the world's origin else.
    pub poses: Option<Vec<Pose>>,
    /// Further cameras.
    pub others: Vec<OtherCamera>,
    /// The part of the whole image that was used.
    pub crop: Rect,
    /// What the fabric's other side looks like.
    pub back: Back,
    motion: OnceCell<Motion>,
    material: OnceCell<Option<Material>>,
    metrics: OnceCell<Option<Evaluation>>,
    log: OnceCell<Log>,
    history: OnceCell<Vec<Epoch>>,
}

impl Folder {
    /// Opens what [`write_motion`](super::write_motion) and [`write_pictures`](super::write_pictures) wrote.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file that cannot be used.
    pub fn open(path: &Path) -> Result<Self> {
        let run: Run = read_json(&path.join("config.json"))?;
        let file: ParameterFile = read_json(&path.join("parameters.json"))?;
        run.settings.validate().map_err(|e| {
            Error::input(
                path.join("config.json").display().to_string(),
                e.to_string().replace("\n  hint: ", "; "),
                "restore the file, or run the command in log.json again",
            )
        })?;
        check_view(&file, &path.join("parameters.json"))?;
        let mesh = io::obj::read(&path.join("mesh.obj"))?;
        let parameters = parameters(&file, &mesh, &path.join("forces.npy"))?;
        let frames = run.frames[1] - run.frames[0];
        let found = file.causes.as_ref().map(|c| c.found(path, &mesh)).transpose()?;
        Ok(Self {
            path: path.to_path_buf(),
            found,
            sizes: file.causes.as_ref().map(CauseFile::sizes),
            per_width: file.causes.as_ref().and_then(CauseFile::per_width),
            run,
            mesh,
            parameters,
            fps: file.frame_rate.value,
            camera: file.camera,
            poses: io::scene::read_poses(path, frames)?,
            others: super::views::read(path, frames)?,
            crop: file.crop,
            back: back(&file, &path.join("parameters.json"))?,
            motion: OnceCell::new(),
            material: OnceCell::new(),
            metrics: OnceCell::new(),
            log: OnceCell::new(),
            history: OnceCell::new(),
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The way from a point to a pixel of the whole image in frame `n`, counted from the result's first.
    pub fn viewpoint(&self, n: usize) -> Viewpoint {
        Viewpoint { camera: self.camera, camera_from_world: self.poses.as_ref().map(|poses| poses[n]) }
    }

    /// The same of every frame.
    pub fn viewpoints(&self) -> Vec<Viewpoint> {
        (0..self.run.frames[1] - self.run.frames[0]).map(|n| self.viewpoint(n)).collect()
    }

    /// The same of the further camera `name`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming those that there are.
    pub fn viewpoints_of(&self, name: &str) -> Result<Vec<Viewpoint>> {
        let Some(other) = self.others.iter().find(|other| other.name == name) else {
            let names: Vec<&str> = self.others.iter().map(|other| other.name.as_str()).collect();
            let hint = match names.is_empty() {
                true => "the result has one camera: original".to_owned(),
                false => format!("the cameras are original, {}", names.join(", ")),
            };
            return Err(Error::usage(format!("no camera is named {name}"), hint));
        };
        Ok((0..other.poses.len()).map(|n| other.viewpoint(n)).collect())
    }

    /// Positions at every frame, of the vertices of [`mesh`](Self::mesh).
    ///
    /// # Errors
    /// [`Error::Input`] if motion.npy cannot be used.
    pub fn motion(&self) -> Result<&Motion> {
        once(&self.motion, || {
            let path = self.path.join("motion.npy");
            let motion = io::npy::read_motion(&path)?;
            motion.check_vertices(self.mesh.positions.len(), &path.display().to_string())?;
            Ok(motion)
        })
    }

    /// The maps in material/, where they were estimated.
    ///
    /// # Errors
    /// [`Error::Input`] naming the map that cannot be used.
    pub fn material(&self) -> Result<Option<&Material>> {
        let folder = self.path.join("material");
        let read = || folder.join("environment.exr").is_file().then(|| appearance::read_material(&folder));
        once(&self.material, || read().transpose()).map(Option::as_ref)
    }

    /// What draws the fabric: the other side in its one colour in the first frame's light, or told apart where the
    /// `material` is drawn and has an albedo for it.
    ///
    /// # Errors
    /// Those of [`material`](Self::material).
    pub fn rasterizer(&self, material: bool) -> Result<Rasterizer> {
        let back = match (material, self.back) {
            (false, back) => back,
            (true, _) if self.material()?.is_some_and(|m| m.back.is_some()) => Back::Plain(Some([0.0; 3])),
            (true, _) => Back::Same,
        };
        Ok(Rasterizer::of_fabric(&self.mesh, &self.viewpoint(0), back))
    }

    /// metrics.json, where there is one.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be read.
    pub fn metrics(&self) -> Result<Option<&Evaluation>> {
        once(&self.metrics, || read_metrics(&self.path)).map(Option::as_ref)
    }

    /// Commands, times and warnings.
    ///
    /// # Errors
    /// [`Error::Input`] if log.json cannot be read.
    pub fn log(&self) -> Result<&Log> {
        once(&self.log, || Log::read(&self.path))
    }

    /// Every step of every stage, those of material and light last.
    ///
    /// # Errors
    /// [`Error::Input`] naming the line that cannot be read.
    pub fn history(&self) -> Result<&[Epoch]> {
        let read = || {
            let of = |name: &str| history::read(&self.path.join(name));
            Ok([of("history.csv")?, of("material/history.csv")?].concat())
        };
        once(&self.history, read).map(Vec::as_slice)
    }
}

/// The value in `cell`, made at the first time.
fn once<T>(cell: &OnceCell<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    if let Some(value) = cell.get() {
        return Ok(value);
    }
    let value = make()?;
    Ok(cell.get_or_init(|| value))
}

/// metrics.json of a folder, where there is one.
///
/// # Errors
/// [`Error::Input`] if it cannot be read.
pub fn read_metrics(folder: &Path) -> Result<Option<Evaluation>> {
    let path = folder.join("metrics.json");
    if !path.is_file() {
        return Ok(None);
    }
    let fail = |problem: String| {
        let hint = "delete the file, or restore it; it is written anew";
        Error::input(path.display().to_string(), problem, hint)
    };
    let text = io::read_text(&path)?;
    serde_json::from_str(&text).map(Some).map_err(|e| fail(e.to_string()))
}

/// Stiffnesses, and forces from the file `forces`.
fn parameters(file: &ParameterFile, mesh: &Mesh, forces: &Path) -> Result<Parameters> {
    let bad = |problem: String| Err(Error::input(forces.display().to_string(), problem, UNCHANGED));
    let dynamic = io::npy::read_field(forces)?;
    if let Some(entry) = dynamic.iter().find(|d| d.len() != mesh.positions.len()) {
        return bad(format!("{} vertices, mesh.obj has {}", entry.len(), mesh.positions.len()));
    }
    let known = file.model.properties();
    let stiffness: Vec<f64> =
        known.iter().filter_map(|p| file.properties.get(p.key)).map(|found| found.value).collect();
    if [stiffness.len(), file.log10_stiffness.len()] != [known.len(); 2]
        || stiffness.iter().any(|k| !k.is_finite() || *k <= 0.0)
        || file.dynamic_parts == 0
    {
        return bad(format!("stiffnesses {stiffness:?}, parts {}", file.dynamic_parts));
    }
    let constant = DVec3::from_array(file.constant_force.value);
    let wind = file.wind.as_ref().map(|wind| DVec3::from_array(wind.value));
    if !constant.is_finite() || wind.is_some_and(|wind| !wind.is_finite()) {
        return bad("a force is not finite".to_owned());
    }
    let accelerations = Accelerations { constant, dynamic, entries_per_frame: file.dynamic_parts, wind };
    let mut parameters =
        Parameters { model: file.model, log_stiffness: file.log10_stiffness.clone(), accelerations };
    // Whoever edits the values means the values.
    if parameters.stiffness() != stiffness {
        parameters.log_stiffness = stiffness.into_iter().map(f64::log10).collect();
    }
    Ok(parameters)
}

/// What the other side looks like; the same where nothing else was told or found.
fn back(file: &ParameterFile, path: &Path) -> Result<Back> {
    let place = || path.display().to_string();
    file.back.as_ref().map_or(Ok(Back::Same), |name| io::scene::back::parse(name, &place()))
}

/// Refuses a frame rate, camera or crop that no video has.
fn check_view(file: &ParameterFile, path: &Path) -> Result<()> {
    let fail = |problem: String| Err(Error::input(path.display().to_string(), problem, UNCHANGED));
    let fps = file.frame_rate.value;
    if !(fps > 0.0 && fps <= 1e5) {
        return fail(format!("the frame rate is {fps} per second"));
    }
    let c = &file.camera;
    let sides = [c.width, c.height].iter().all(|n| (1..=io::image::MAX_SIDE).contains(n));
    if !sides || [c.fx, c.fy].iter().any(|f| *f <= 0.0) {
        return fail(format!("the camera has {}×{} px, fx {}, fy {}", c.width, c.height, c.fx, c.fy));
    }
    let r = &file.crop;
    if r.x0 >= r.x1 || r.y0 >= r.y1 || r.x1 > c.width || r.y1 > c.height {
        return fail(format!("the crop is {r:?} of {}×{} px", c.width, c.height));
    }
    Ok(())
}
