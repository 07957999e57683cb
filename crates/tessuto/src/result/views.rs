//! The further cameras of a result: views.json.
//!
//! ```text
//! [{"name": "right", "width": …, "height": …, "fx": …, "fy": …, "cx": …, "cy": …,
//!   "crop": {"x0": …, "y0": …, "x1": …, "y1": …}, "time_offset": 0.004, "camera_from_world": [[16], …]}, …]
//! ```
//!
//! Lengths in metres, in the world of the scene's own camera, whose poses are in poses.json. `crop` is the part of its
//! images that was used; `time_offset` says how many seconds later it takes its frames, where it does.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{read_json, write_json};
use tessuto_core::camera::{Camera, Pose, Rect, Viewpoint};
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::Scene;

/// Name of the file.
const FILE: &str = "views.json";

/// A further camera.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherCamera {
    /// Name of its view.
    pub name: String,
    /// Of its whole image.
    pub camera: Camera,
    /// Where it is in every frame of the result.
    pub poses: Vec<Pose>,
    /// The part of its image that was used, in pixels.
    pub crop: Rect,
    /// How much later than the scene's own camera it takes each frame `[s]`.
    pub late: f64,
}

#[derive(Serialize, Deserialize)]
struct Listed {
    name: String,
    #[serde(flatten)]
    camera: Camera,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    crop: Option<Rect>,
    #[serde(default, skip_serializing_if = "is_zero")]
    time_offset: f64,
    camera_from_world: Vec<Vec<f64>>,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl OtherCamera {
    /// The way from a point to a pixel of its whole image in frame `n`, counted from the result's first.
    pub fn viewpoint(&self, n: usize) -> Viewpoint {
        Viewpoint { camera: self.camera, camera_from_world: Some(self.poses[n]) }
    }

    /// Those of `scene`.
    pub fn of(scene: &Scene) -> Vec<Self> {
        let of = |view: &tessuto_core::View| {
            let ([width, height], (x, y)) = (view.full_size, (view.crop.x0 as f64, view.crop.y0 as f64));
            let Camera { cx, cy, .. } = view.camera;
            let camera = Camera { cx: cx + x, cy: cy + y, width, height, ..view.camera };
            let (name, poses) = (view.name.clone(), view.poses.clone());
            Self { name, camera, poses, crop: view.crop, late: view.late }
        };
        scene.more.iter().map(of).collect()
    }
}

/// Writes views.json into `folder`; nothing where there is no further camera.
pub(super) fn write(folder: &Path, scene: &Scene) -> Result<()> {
    let rows = |pose: &Pose| pose.rows().map(|number| number + 0.0).to_vec();
    let listed = |other: OtherCamera| Listed {
        camera_from_world: other.poses.iter().map(rows).collect(),
        name: other.name,
        camera: other.camera,
        crop: Some(other.crop),
        time_offset: other.late,
    };
    let all: Vec<Listed> = OtherCamera::of(scene).into_iter().map(listed).collect();
    if all.is_empty() { Ok(()) } else { write_json(&folder.join(FILE), &all) }
}

/// The further cameras of the result in `folder`, of this many `frames`.
pub(super) fn read(folder: &Path, frames: usize) -> Result<Vec<OtherCamera>> {
    let path = folder.join(FILE);
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let listed: Vec<Listed> = read_json(&path)?;
    let other = |Listed { name, camera, crop, time_offset, camera_from_world }: Listed| {
        let fail =
            |problem: String| Error::input(format!("{}, {name}", path.display()), problem, super::UNCHANGED);
        if camera_from_world.len() != frames {
            return Err(fail(format!("{} poses of {frames} frames", camera_from_world.len())));
        }
        let pose = |rows: &Vec<f64>| {
            let rows: [f64; 16] =
                rows[..].try_into().map_err(|_| fail(format!("a pose of {} numbers, not 16", rows.len())))?;
            Ok(Pose::from_rows(&rows))
        };
        let poses = camera_from_world.iter().map(pose).collect::<Result<_>>()?;
        let Camera { width, height, .. } = camera;
        let crop = crop.unwrap_or(Rect { x0: 0, y0: 0, x1: width, y1: height });
        if crop.x0 >= crop.x1 || crop.y0 >= crop.y1 || crop.x1 > width || crop.y1 > height {
            return Err(fail(format!("the crop is {crop:?} of {width}×{height} px")));
        }
        if !time_offset.is_finite() {
            return Err(fail(format!("the time offset is {time_offset} s")));
        }
        Ok(OtherCamera { name, camera, poses, crop, late: time_offset })
    };
    listed.into_iter().map(other).collect()
}
