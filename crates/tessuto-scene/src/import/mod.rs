//! Makes a scene folder from a video or a folder of images, masks from a segmenter, and a camera of any of several
//! formats. What is written is what the rest of the program reads: a pinhole camera, numbered frames and masks.

mod calibration;
mod calibration_file;
mod capture;
mod colmap;
mod depth;
mod depths;
mod empty;
mod frames;
mod lens;
mod masks;
mod matrix;
mod metadata;
mod moving;
mod names;
mod nerfstudio;
mod opencv;
mod pairing;
mod path;
mod record3d;
mod rig;
mod stage;
mod stills;
mod target;
mod times;
mod video;
mod views;

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::io::mask::Object;
use crate::io::scene::write_manifest;
use crate::io::{model, obj};
use frames::{Kind, Source};
use moving::Moving;
use stage::Stage;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Remedy, Result};

pub use calibration::{Calibration, Focal};
pub use calibration_file::{camera_files, read_calibration};
pub use capture::{Capture, read_capture};
pub use depth::{Captured, read_depth};
pub use empty::empty_place;
pub use lens::Distortion;
pub use metadata::camera_of;
pub use path::{CameraPath, FrameFit, Known, Mistake, PoseFit, pose_files, pose_fit, read_path};
pub use rig::{Rig, read_rig};
pub use stills::{StillSettings, Stills, stills};
pub use target::{CARRIED_OVER, check_target, copy_template};
pub use views::{Place, ViewSettings};

/// Where the masks come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Masks {
    /// A folder of images, or a video; white is fabric.
    Path(PathBuf),
    /// The alpha channel of the frames.
    Alpha,
    /// None: they are made from the frames afterwards, by `masks::make`, or given later.
    Later,
}

/// What finds where the camera was, from what stands still around the fabric.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraMotion {
    /// The frames alone.
    Estimate,
    /// The program COLMAP, by its path.
    Colmap(PathBuf),
}

/// What to import, and how.
#[derive(Debug, Clone)]
pub struct Settings {
    /// A video file, or a folder of PNG and JPEG images.
    pub input: PathBuf,
    /// Where the fabric is.
    pub masks: Masks,
    /// Which of the objects in the masks is the fabric; needed where there are several.
    pub object: Option<Object>,
    /// Black is fabric.
    pub invert_masks: bool,
    /// Blacken all of a mask but its largest piece.
    pub largest_piece: bool,
    /// The lens.
    pub calibration: Calibration,
    /// Where the camera was in every frame of the input, if it moved.
    pub poses: Option<CameraPath>,
    /// Whether these, if there are any, are refined by what stands still around the fabric; needs masks.
    pub refine_poses: bool,
    /// What is to find that from the surroundings of the fabric.
    pub camera_motion: Option<CameraMotion>,
    /// Metres in one unit of its lengths, in place of what its file says.
    pub pose_scale: Option<f64>,
    /// Depth maps of the frames: a folder of them, or a capture that holds one.
    pub depths: Option<PathBuf>,
    /// Metres in one unit of them, in place of what such files usually have.
    pub depth_scale: Option<f64>,
    /// Frames per second; a video is resampled to it. Needed for images whose names do not state their times.
    pub fps: Option<f64>,
    /// Frames per second at which the frames of a video were filmed, one after the other, whatever its time stamps say.
    pub rate: Option<f64>,
    /// Only these frames of the input, counted from 0.
    pub frames: Option<Range<usize>>,
    /// Use every N-th of them.
    pub stride: usize,
    /// Pixels of the input, in each direction, that become one.
    pub downscale: usize,
    /// Treat numbered images with gaps as evenly spaced in time.
    pub allow_gaps: bool,
    /// The fabric in the first frame, in camera coordinates: OBJ, PLY or glTF.
    pub template: Option<PathBuf>,
    /// Image or video of the place without the fabric: written as `plate.png`, straightened and shrunk as the
    /// frames are.
    pub plate: Option<PathBuf>,
    /// The program that decodes videos.
    pub ffmpeg: PathBuf,
    /// Clips of further cameras.
    pub views: Vec<ViewSettings>,
}

/// What was imported.
#[derive(Debug, Clone)]
pub struct Imported {
    /// Number of frames.
    pub frames: usize,
    /// Frames per second.
    pub fps: f64,
    /// The pinhole camera of the written frames.
    pub camera: Camera,
    /// What was changed or assumed.
    pub notes: Vec<String>,
}

/// Refuses what is no file or folder of its own, before anything of it is read: pipes, devices and sockets.
///
/// # Errors
/// [`Error::Input`] naming what is there; a path at which nothing is passes.
pub fn expect_files(paths: &[Option<&Path>]) -> Result<()> {
    paths.iter().flatten().try_for_each(|path| crate::io::expect_file(path))
}

/// Writes the scene `name` into the existing, empty `folder`; `progress` receives what has just been written.
///
/// # Errors
/// [`Error::Usage`], [`Error::Input`], [`Error::Output`].
pub fn import(
    settings: &Settings,
    name: &str,
    folder: &Path,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Imported> {
    validate(settings)?;
    let mut notes = Vec::new();
    if let Some(path) = &settings.template {
        write_template(path, folder, &mut notes)?;
    }
    for sub in ["rgbs", "masks"].into_iter().take(if settings.masks == Masks::Later { 1 } else { 2 }) {
        let path = folder.join(sub);
        std::fs::create_dir_all(&path).map_err(|source| Error::Output { path, source })?;
    }
    let source = Source::open(settings, &mut notes)?;
    let stage = Stage::new(settings, folder, progress);
    let colours = source.write(&stage, &mut notes)?;
    masks::write(settings, &source, &stage, &colours, &mut notes)?;
    if let Some(plate) = &settings.plate {
        stage.plate(&colours, plate)?;
    }

    let fps = source.fps / settings.stride as f64;
    let camera = colours.camera.downsampled(settings.downscale);
    let first = settings.frames.as_ref().map_or(0, |range| range.start);
    let origin = json!({
        "generator": "tessuto import",
        "input": settings.input.file_name().map(|n| n.to_string_lossy()),
        "frames": [first, first + colours.frames.len().saturating_sub(1) * settings.stride + 1],
        "stride": settings.stride,
        "downscale": settings.downscale,
        "undistorted": !settings.calibration.distortion.is_none(),
        "camera": { "source": settings.calibration.place, "uncertainty": settings.calibration.uncertainty },
    });
    write_manifest(folder, name, fps, colours.frames.len(), &camera, origin)?;
    let first = settings.frames.as_ref().map_or(0, |range| range.start);
    let chosen: Vec<usize> = (0..colours.frames.len()).map(|k| first + k * settings.stride).collect();
    let moving = Moving {
        settings,
        source: &source,
        read: colours.read,
        camera: &camera,
        chosen: &chosen,
        folder,
        said: progress,
    };
    let poses = moving.write(&mut notes)?;
    if let Some(path) = &settings.depths {
        depths::write(settings, path, &chosen, counted(settings, &source, colours.read), folder)?;
    }
    let mut imported = Imported { frames: colours.frames.len(), fps, camera, notes };
    views::write(settings, &mut imported, poses.as_deref(), folder, progress)?;
    Ok(imported)
}

fn validate(settings: &Settings) -> Result<()> {
    let demand = |ok: bool, name: &str, value: String, hint: &str| {
        if ok { Ok(()) } else { Err(Error::usage(format!("{name} is {value}"), hint)) }
    };
    demand(settings.stride >= 1, "stride", settings.stride.to_string(), "give 1 or more")?;
    demand(
        (1..=64).contains(&settings.downscale),
        "downscale",
        settings.downscale.to_string(),
        "give a whole number from 1 to 64, the factor by which frames shrink",
    )?;
    for (name, fps) in [("fps", settings.fps), ("rate", settings.rate)] {
        if let Some(fps) = fps {
            demand(fps > 0.0 && fps <= 100_000.0, name, fps.to_string(), "give frames per second, above 0")?;
        }
    }
    if let (Some(fps), Some(rate), true) = (settings.fps, settings.rate, settings.input.is_dir()) {
        demand(
            fps == rate,
            "fps",
            format!("{fps} and rate {rate}"),
            "images are not resampled: give one of them",
        )?;
    }
    if (settings.camera_motion.is_some() || settings.refine_poses) && settings.masks == Masks::Later {
        let hint =
            "it is found from what stands still around the fabric: give masks that another program made";
        return Err(Error::usage("the camera's motion, without masks", Hint::from(hint).with(Remedy::Masks)));
    }
    if settings.masks == Masks::Alpha && !settings.input.is_dir() {
        return Err(Error::usage(
            format!("transparency as masks, of {}, which is not a folder", settings.input.display()),
            "transparency is read from PNG images: extract them first, e.g. ffmpeg -i VIDEO -pix_fmt rgba \
             frames/%04d.png",
        ));
    }
    Ok(())
}

/// Number of frames of the input, of which this many were `read`; of a video that was not read to its end nobody knows.
fn counted(settings: &Settings, source: &Source, read: usize) -> Option<usize> {
    (settings.frames.is_none() || matches!(source.kind, Kind::Images(_))).then_some(read)
}

/// Copies or converts the mesh at `path` to template.obj.
fn write_template(path: &Path, folder: &Path, notes: &mut Vec<String>) -> Result<()> {
    let model = model::read(path)?;
    let place = path.display();
    if !model.has_uv {
        return Err(Error::input(
            place.to_string(),
            "has no texture coordinates (uv), which a template needs",
            Hint::from("unwrap it in a modelling program, or import without it and re-sample it then")
                .with(Remedy::Remesh),
        ));
    }
    notes.extend(model.notes.iter().map(|n| format!("{place}: {n}")));
    obj::write(&folder.join("template.obj"), &model.mesh, None)
}
