//! A scene folder, read whole and checked before anything is computed on it.
//!
//! ```text
//! scene.json             name, fps, n_frames, width, height, fx, fy, cx, cy; crop, units, poses, notes if wanted
//! poses.json             camera_from_world of every frame, of a camera that moves
//! (any folder)           frames, masks, poses and depth of a further camera, which "views" in scene.json names
//! template.obj           polygons of the fabric in frame 0, camera coordinates, with uv
//! depth/depth_000.png …  optional: 16 bits, or .npy, .exr
//! rgbs/rgb_000.png …     masks/mask_000.png …   (or .jpg, .jpeg; any zero padding)
//! gt/points/points_000.npy …   gt/vertices.npy   gt/tracks.npz  (truth, where known)
//! ```

pub mod back;
mod colours;
mod depths;
mod edit;
mod first_frame;
mod frames;
mod further;
mod listing;
mod manifest;
mod memory;
mod planes;
mod poses;
mod record;
mod rectangle;
#[doc(hidden)]
pub mod template;
mod tracks;
mod truth;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use colours::{ColourFiles, FrameFiles, colour_files, frame_files};
pub use depths::first as first_depth;
pub(crate) use edit::set_gravity;
pub use edit::{ListedView, replace_camera, set_planes, write_manifest, write_views};
pub use first_frame::{FirstFrame, first_frame};
use manifest::Manifest;
pub use memory::{RecordedView, Recording, assemble};
pub use poses::{POSES, read_poses, write_poses};
pub(crate) use poses::{listed as listed_poses, moving};
pub use record::{CameraRecord, DepthRecord, TableRecord, TemplateKind, TemplateRecord};
pub use rectangle::{template_misfit, write_template};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::{Known, PoseUnit, Scene};
use tessuto_core::video::HELD_BYTES;

/// A standard deviation of the focal length above this fraction is doubted.
const CAMERA_DOUBTED: f64 = 0.1;

/// What to load.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Only these frames of the folder; all where `None`.
    pub frames: Option<Range<usize>>,
    /// Frames of more bytes than this in all are not held in memory, but read from their files each time.
    pub held_bytes: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { frames: None, held_bytes: HELD_BYTES }
    }
}

/// A scene, and what is odd but bearable about its files.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// In a fixed order.
    pub warnings: Vec<Warning>,
}

/// Reads the scene in `folder`; the first of its errors, in a fixed order, where it has any.
pub fn load(folder: &Path, options: &LoadOptions) -> Result<Loaded> {
    let Attempt { loaded, errors, .. } = attempt(folder, options);
    match (errors.into_iter().next(), loaded) {
        (None, Some(loaded)) => Ok(loaded),
        (Some(error), _) => Err(error),
        (None, None) => unreachable!("a scene that is not loaded has an error"),
    }
}

/// All that can be said of a folder.
#[doc(hidden)]
pub struct Attempt {
    /// The scene, if its frames are readable; it may still have errors.
    pub loaded: Option<Loaded>,
    /// The template cannot be read: `loaded` has one without vertices in its place.
    pub template_missing: bool,
    /// Errors in the order of manifest, template, frames, truth, overlap.
    pub errors: Vec<Error>,
}

/// Reads as much of the scene in `folder` as can be read.
#[doc(hidden)]
pub fn attempt(folder: &Path, options: &LoadOptions) -> Attempt {
    let start = Manifest::read(folder).and_then(|m| Ok((frame_range(&m, options)?, m)));
    let (range, manifest) = match start {
        Ok(start) => start,
        Err(error) => return Attempt { loaded: None, template_missing: true, errors: vec![error] },
    };
    let mut errors = Vec::new();
    let mut warnings = Vec::new();
    let mesh = template::read(folder, &manifest, &mut errors, &mut warnings);
    let video = frames::read(folder, &manifest, range.clone(), options.held_bytes, &mut warnings);
    let video = video.map_err(|e| errors.push(e)).ok();
    let truth = truth::read(folder, &manifest, range.clone(), mesh.as_ref(), &mut errors);
    let depths = depths::read(
        folder,
        &manifest,
        range.clone(),
        mesh.as_ref().map(|mesh| (mesh, Pose::IDENTITY)),
        &mut warnings,
    );
    let depths = depths.map_err(|e| errors.push(e)).ok().flatten();
    let poses = manifest.poses(folder, true, &mut warnings);
    let poses = poses.map_err(|e| errors.push(e)).ok().flatten();
    let first = poses.as_ref().map_or(Pose::IDENTITY, |(poses, _)| poses[0]);
    let mut unit = poses.as_ref().map_or(PoseUnit::Metres, |(_, unit)| *unit);
    let poses = poses.and_then(|(poses, _)| moving(&poses));
    let mut more = Vec::new();
    for view in &manifest.more {
        let read =
            further::read(folder, view, (&range, options.held_bytes), (&first, mesh.as_ref()), &mut warnings);
        match read.map_err(|e| e.within(&format!("view {}", view.name))) {
            Ok((view, its_unit)) => {
                unit = if its_unit == PoseUnit::Unknown { its_unit } else { unit };
                more.push(view);
            }
            Err(error) => errors.push(error),
        }
    }
    // A camera that stands still has no lengths.
    let unit = if poses.is_none() && more.is_empty() { PoseUnit::Metres } else { unit };

    let template_missing = mesh.is_none();
    let stand_in = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    let known = mesh.as_ref().map_or(Ok(Known::default()), |mesh| {
        manifest.known(mesh.positions.len(), &folder.join("scene.json").display().to_string())
    });
    let known = known.unwrap_or_else(|e| {
        errors.push(e);
        Known::default()
    });
    let loaded = Some(mesh.unwrap_or(stand_in)).zip(video).map(|(template, (crop, frames))| {
        let scene = Scene {
            name: manifest.name.clone(),
            folder: folder.to_path_buf(),
            fps: manifest.fps,
            camera: manifest.camera().cropped(crop),
            pose_unit: unit,
            poses: poses.map(|poses| poses[range.clone()].to_vec()),
            crop,
            depths: depths.map(Arc::new),
            more,
            full_size: [manifest.camera().width, manifest.camera().height],
            first_frame: range.start,
            template,
            frames,
            known,
            truth,
        };
        intrinsics_warnings(&manifest, &mut warnings);
        // A template behind the camera, say, cannot be projected; its own error is enough.
        if errors.is_empty() {
            errors.extend(template::check_overlap(&scene, &mut warnings).err());
            further::check_overlap(&scene, &mut errors, &mut warnings);
        }
        Loaded { scene, warnings }
    });
    Attempt { loaded, template_missing, errors }
}

/// The frames asked for, which must exist.
fn frame_range(manifest: &Manifest, options: &LoadOptions) -> Result<Range<usize>> {
    let range = options.frames.clone().unwrap_or(0..manifest.n_frames);
    if range.start >= range.end || range.end > manifest.n_frames {
        return Err(Error::usage(
            format!("frames {}..{} of a scene with {} frames", range.start, range.end, manifest.n_frames),
            format!("ask for frames A..B with 0 ≤ A < B ≤ {}", manifest.n_frames),
        ));
    }
    Ok(range)
}

fn intrinsics_warnings(manifest: &Manifest, warnings: &mut Vec<Warning>) {
    let camera = manifest.camera();
    let width = camera.width as f64;
    let mut add = |found: String, hint: Hint| warnings.push(Warning::new("intrinsics", found, hint));
    if let Some(doubt) = manifest.camera_doubt().filter(|doubt| *doubt > CAMERA_DOUBTED) {
        let found = format!(
            "the focal length is known to {:.0} % only, and depths are off by as much",
            100.0 * doubt
        );
        let hint =
            "estimate it from the corners of a flat sheet that is seen at an angle, or give the camera";
        add(found, Hint::from(hint).with(Remedy::EstimateCamera));
    }
    for (key, focal) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(0.3..=10.0).contains(&(focal / width)) {
            add(
                format!("{key} = {focal} is {:.2} image widths, expected 0.3 to 10", focal / width),
                "focal lengths are in pixels of these images, not in mm or degrees".into(),
            );
        }
    }
    if !(0.8..=1.25).contains(&(camera.fx / camera.fy)) {
        add(format!("fx = {} and fy = {} differ by over 20 %", camera.fx, camera.fy), "check both".into());
    }
    for (key, centre, side) in [("cx", camera.cx, camera.width), ("cy", camera.cy, camera.height)] {
        if !(0.2..=0.8).contains(&(centre / side as f64)) {
            add(
                format!("{key} = {centre} is far from the middle of {side} pixels"),
                "check that cx and cy are not swapped and belong to this image size".into(),
            );
        }
    }
}

/// The real path of `path`, which links must not lead out of `folder`.
fn inside(folder: &Path, path: &Path) -> Result<PathBuf> {
    let real = |p: &Path| {
        p.canonicalize().map_err(|e| {
            let hint = "put the file there, or correct the link";
            Error::input(path.display().to_string(), format!("cannot be read: {e}"), hint)
        })
    };
    let target = real(path)?;
    if target.starts_with(real(folder)?) {
        return Ok(path.to_path_buf());
    }
    Err(Error::input(
        path.display().to_string(),
        format!("is a link out of the scene folder, to {}", target.display()),
        "copy the file into the scene folder",
    ))
}
