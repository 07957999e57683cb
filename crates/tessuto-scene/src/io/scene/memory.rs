//! A scene from arrays: what [`load`](super::load) makes of a folder, with the same checks.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use serde_json::json;

use super::frames::{self, Source, Sources};
use super::manifest::{Manifest, Units};
use super::poses::relative;
use super::{Loaded, further as views, intrinsics_warnings, template};
use crate::io::image::{ImageFile, Samples};
use tessuto_core::camera::{Camera, Pose, Rect};
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::{Back, Known, Scene, Truth, View};

/// A video, its masks and what was filmed, in memory.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Name of the scene; messages and results call it so.
    pub name: String,
    /// Frames per second.
    pub fps: f64,
    /// Camera of the whole image.
    pub camera: Camera,
    /// camera_from_world of every frame, of a camera that moves; the world is the camera's frame in the first one.
    pub poses: Option<Vec<Pose>>,
    /// The part of the images to keep; the masks decide where it is missing.
    pub crop: Option<Rect>,
    /// sRGB-encoded colour of every frame, shape [height, width, 3] each.
    pub frames: Vec<Samples>,
    /// Mask of every frame, white where the fabric is, shape [height, width] each.
    pub masks: Vec<Samples>,
    /// The fabric in the first frame, camera frame `[m]`.
    pub template: Mesh,
    /// Planes that the fabric lies on: a point `[m]` and the direction across, in the template's frame.
    pub planes: Vec<[DVec3; 2]>,
    /// What its other side looks like; `None`: the clip tells.
    pub back: Option<Back>,
    /// What is known of the true motion.
    pub truth: Truth,
    /// What further cameras filmed at the same times.
    pub more: Vec<RecordedView>,
}

/// What a further camera filmed.
#[derive(Debug, Clone)]
pub struct RecordedView {
    /// Its name.
    pub name: String,
    /// Camera of the whole image.
    pub camera: Camera,
    /// camera_from_world of every frame, or one of all, in the world of the recording's poses.
    pub poses: Vec<Pose>,
    /// sRGB-encoded colour of every frame, shape [height, width, 3] each.
    pub frames: Vec<Samples>,
    /// Mask of every frame, shape [height, width] each.
    pub masks: Vec<Samples>,
}

/// The scene that `recording` is: cropped, its background made black, checked as a folder would be.
///
/// # Errors
/// [`Error::Input`] naming the first thing that is wrong, in the order of a folder's.
pub fn assemble(recording: Recording) -> Result<Loaded> {
    let Recording { name, fps, camera, poses, crop, frames, masks, template, planes, back, truth, more } =
        recording;
    let frame_count = frames.len();
    if masks.len() != frame_count {
        let problem = format!("{} masks of {frame_count} frames", masks.len());
        return Err(Error::input("masks", problem, "give one mask per frame"));
    }
    let manifest = Manifest::new(name.clone(), fps, frame_count, camera, crop);
    manifest.check("scene")?;
    let folder = PathBuf::from(&name);
    let (mut errors, mut warnings) = (Vec::new(), Vec::new());
    check_numbers(&template)?;
    if let Some(poses) = &poses {
        super::listed_poses(&json!(poses.iter().map(Pose::rows).collect::<Vec<_>>()), "poses")?;
    }
    template::check(&template, Units::Metres, (&folder, "template"), None, &mut errors, &mut warnings);
    if let Some(error) = errors.pop() {
        return Err(error);
    }
    let size = [camera.width, camera.height];
    let (colours, masks) = (held("frames", size, 3, frames)?, held("masks", size, 1, masks)?);
    // They are in memory anyway.
    let sources = Sources { colours, masks, first: 0, size, crop, held_bytes: usize::MAX };
    let (crop, frames) = frames::from(sources, &mut warnings)?;
    let first = poses.as_ref().map_or(Pose::IDENTITY, |poses| poses[0]);
    let of_view = |view: RecordedView| {
        let place = format!("view {}", view.name);
        further(view, &first, frame_count, &mut warnings).map_err(|error| error.within(&place))
    };
    let more = more.into_iter().map(of_view).collect::<Result<_>>()?;
    let scene = Scene {
        name,
        folder,
        fps,
        camera: camera.cropped(crop),
        poses: poses.as_deref().and_then(super::moving),
        crop,
        pose_unit: Default::default(),
        depths: None,
        more,
        full_size: size,
        first_frame: 0,
        template,
        frames,
        known: Known { planes: super::planes::through(&planes, "planes")?, back, ..Known::default() },
        truth,
    };
    scene.check()?;
    check_truth(&scene)?;
    intrinsics_warnings(&manifest, &mut warnings);
    template::check_overlap(&scene, &mut warnings)?;
    views::check_overlap(&scene, &mut errors, &mut warnings);
    if let Some(error) = errors.into_iter().next() {
        return Err(error);
    }
    Ok(Loaded { scene, warnings })
}

/// The further camera `view` of a clip of this many frames, whose own camera is at `first` in the first one.
fn further(
    view: RecordedView,
    first: &Pose,
    frame_count: usize,
    warnings: &mut Vec<Warning>,
) -> Result<View> {
    let RecordedView { name, camera, mut poses, frames, masks } = view;
    for (what, found) in [("frames", frames.len()), ("masks", masks.len())] {
        if found != frame_count {
            let problem = format!("{found} of {frame_count} frames");
            return Err(Error::input(what, problem, "give one image per frame of the first camera"));
        }
    }
    if poses.len() == 1 {
        poses = vec![poses[0]; frame_count];
    }
    super::listed_poses(&json!(poses.iter().map(Pose::rows).collect::<Vec<_>>()), "poses")?;
    Manifest::new(name.clone(), 1.0, frame_count, camera, None).check("camera")?;
    let size = [camera.width, camera.height];
    let (colours, masks) = (held("frames", size, 3, frames)?, held("masks", size, 1, masks)?);
    let sources = Sources { colours, masks, first: 0, size, crop: None, held_bytes: usize::MAX };
    let (crop, frames) = frames::from(sources, warnings)?;
    let (camera, poses) = (camera.cropped(crop), relative(&poses, first));
    Ok(View { name, camera, poses, crop, full_size: size, frames, depths: None, late: 0.0 })
}

fn held(what: &str, size: [usize; 2], channels: usize, images: Vec<Samples>) -> Result<Vec<Source>> {
    let source = |(n, samples): (usize, Samples)| {
        let place = format!("{what}[{n}]");
        let image = ImageFile::held(&place, size, channels, samples).ok_or_else(|| {
            let [width, height] = size;
            let problem = format!("is not an image of {width}×{height} px with {channels} channels");
            Error::input(place.clone(), problem, "give all images the size of the camera's")
        })?;
        Ok(Source::Held(Arc::new(image)))
    };
    images.into_iter().enumerate().map(source).collect()
}

/// Refuses numbers that are none and corners that are not there, before anything looks at them.
fn check_numbers(mesh: &Mesh) -> Result<()> {
    if let Some(k) = mesh.positions.iter().position(|p| !p.is_finite()) {
        let problem = format!("vertex {k} is {}", mesh.positions[k]);
        return Err(Error::input("template", problem, "give finite numbers"));
    }
    if let Some(k) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
        let problem = format!("texture coordinate {k} is {}", mesh.uvs[k]);
        return Err(Error::input("template", problem, "unwrap the mesh again"));
    }
    let (vertices, uvs) = (mesh.positions.len() as u32, mesh.uvs.len() as u32);
    let wrong = mesh.faces.iter().position(|face| {
        let within = |corners: &[u32], count: u32| corners.iter().all(|c| *c < count);
        face.vertices.len() < 3
            || face.vertices.len() != face.uvs.len()
            || !within(&face.vertices, vertices)
            || !within(&face.uvs, uvs)
    });
    let problem = match wrong {
        Some(k) => format!("face {k} is {:?}, of {vertices} vertices", mesh.faces[k].vertices),
        None if mesh.faces.is_empty() => "it has no face".to_owned(),
        None => return Ok(()),
    };
    let hint = "give three or more indices of vertices per face, and of as many texture coordinates";
    Err(Error::input("template", problem, hint))
}

fn check_truth(scene: &Scene) -> Result<()> {
    let Some(truth) = &scene.truth.vertices else { return Ok(()) };
    let found = [truth.len(), truth.vertex_count()];
    let expected = [scene.frames.len(), scene.template.positions.len()];
    if found == expected {
        return Ok(());
    }
    let problem = format!("has shape {found:?}, expected {expected:?} and 3");
    Err(Error::input("truth", problem, "give the position of every vertex in every frame"))
}
