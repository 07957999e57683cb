//! scene.json as it is written, and changed.

use std::path::Path;

use glam::DVec3;
use serde_json::{Value, json};

use super::manifest::Manifest;
use super::poses::POSES;
use crate::io::atomic_write;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::Plane;

/// Writes the scene.json of a folder with `frames` frames, seen by `camera`, lengths in metres; `notes` may be
/// anything.
///
/// # Errors
/// [`Error::Output`].
pub fn write_manifest(
    folder: &Path,
    name: &str,
    fps: f64,
    frames: usize,
    camera: &Camera,
    notes: Value,
) -> Result<()> {
    let manifest = json!({
        "name": name,
        "fps": fps,
        "n_frames": frames,
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "units": "m",
        "notes": notes,
    });
    let text = serde_json::to_string_pretty(&manifest).expect("plain data") + "\n";
    atomic_write(&folder.join("scene.json"), text.as_bytes())
}

/// Gives the scene in `folder` another camera, of images of the same size; all else in scene.json stays. `source`
/// says where it is from, `uncertainty` is the standard deviation of its focal length, as a fraction.
///
/// # Errors
/// [`Error::Input`] if scene.json cannot be used; [`Error::Output`].
pub fn replace_camera(folder: &Path, camera: &Camera, source: &str, uncertainty: Option<f64>) -> Result<()> {
    Manifest::read(folder)?;
    change(folder, |scene| {
        for (key, value) in [("fx", camera.fx), ("fy", camera.fy), ("cx", camera.cx), ("cy", camera.cy)] {
            scene[key] = json!(value);
        }
        if !scene["notes"].is_object() {
            let before = scene["notes"].take();
            scene["notes"] = if before.is_null() { json!({}) } else { json!({ "text": before }) };
        }
        scene["notes"]["camera"] = json!({ "source": source, "uncertainty": uncertainty });
    })
}

/// Tells the scene in `folder` which way is down, in the frame of the camera in frame 0.
///
/// # Errors
/// As [`replace_camera`].
pub(crate) fn set_gravity(folder: &Path, down: DVec3) -> Result<()> {
    change(folder, |scene| scene["gravity"] = json!(down.normalize().to_array()))
}

/// Tells the scene in `folder` of planes that the fabric lies on, in the frame of the camera in frame 0 `[m]`.
///
/// # Errors
/// As [`replace_camera`].
pub fn set_planes(folder: &Path, planes: &[Plane]) -> Result<()> {
    let scale = Manifest::read(folder)?.units.scale();
    let of = |plane: &Plane| {
        let point = plane.normal * (plane.height / scale);
        json!({ "point": point.to_array(), "normal": plane.normal.to_array() })
    };
    change(folder, |scene| scene["planes"] = json!(planes.iter().map(of).collect::<Vec<_>>()))
}

/// A further camera, as scene.json lists it. Its files are in a folder of its name: rgbs, masks, poses.json, and depth
/// where it has any.
#[derive(Debug, Clone)]
pub struct ListedView {
    /// Its name.
    pub name: String,
    /// Camera of its full image.
    pub camera: Camera,
    /// Whether it has depth maps.
    pub depth: bool,
    /// How much later than the scene's own camera it takes its frames `[s]`.
    pub late: f64,
}

/// Tells the scene in `folder` of the cameras `more`, beside its own.
///
/// # Errors
/// As [`replace_camera`].
pub fn write_views(folder: &Path, more: &[ListedView]) -> Result<()> {
    let of = |view: &ListedView| {
        let Camera { fx, fy, cx, cy, width, height } = view.camera;
        let inside = |name: &str| format!("{}/{name}", view.name);
        let mut listed = json!({
            "name": view.name, "width": width, "height": height, "fx": fx, "fy": fy, "cx": cx, "cy": cy,
            "rgbs": inside("rgbs"), "masks": inside("masks"), "poses": inside(POSES),
        });
        if view.late != 0.0 {
            listed["time_offset"] = json!(view.late);
        }
        if view.depth {
            listed["depth"] = json!(inside(super::depths::FOLDER));
        }
        listed
    };
    let all: Vec<Value> = std::iter::once(json!({ "name": "first" })).chain(more.iter().map(of)).collect();
    change(folder, |scene| scene["views"] = json!(all))
}

fn change(folder: &Path, by: impl FnOnce(&mut Value)) -> Result<()> {
    let path = folder.join("scene.json");
    let place = path.display().to_string();
    let text = crate::io::read_text(&path)?;
    let unusable = |problem: String| Error::input(&place, problem, "correct the file");
    let mut scene: Value = serde_json::from_str(text.trim_start_matches('\u{feff}'))
        .map_err(|e| unusable(format!("is not valid JSON: {e}")))?;
    by(&mut scene);
    let text = serde_json::to_string_pretty(&scene).expect("plain data") + "\n";
    atomic_write(&path, text.as_bytes())
}
