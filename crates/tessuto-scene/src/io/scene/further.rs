//! A further camera of a scene: its frames, masks and depth, and where it is.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::manifest::Manifest;
use super::poses::relative;
use super::{depths, frames, template};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::{PoseUnit, Scene, View};
use tessuto_render::raster::coverage::{overlap, template_coverage};

/// The view that `manifest` says, of the frames and with as many bytes held as asked; the scene's own camera is at
/// `first` in frame 0, where both are listed, and sees the `template` there.
///
/// # Errors
/// [`Error::Input`] naming the file that cannot be used; for a view without poses.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    (range, held_bytes): (&Range<usize>, usize),
    (first, template): (&Pose, Option<&Mesh>),
    warnings: &mut Vec<Warning>,
) -> Result<(View, PoseUnit)> {
    let missing = || {
        let hint = "give \"poses\", one of the camera or one per frame, in the world of the first view's";
        Error::input(folder.join("scene.json").display().to_string(), "it has no poses", hint)
    };
    let (poses, unit) = manifest.poses(folder, false, warnings)?.ok_or_else(missing)?;
    let (crop, frames) = frames::read(folder, manifest, range.clone(), held_bytes, warnings)?;
    let poses = relative(&poses[range.clone()], first);
    let template = template.filter(|_| unit == PoseUnit::Metres).map(|mesh| (mesh, poses[0]));
    let depths = depths::read(folder, manifest, range.clone(), template, warnings)?;
    let view = View {
        name: manifest.name.clone(),
        camera: manifest.camera().cropped(crop),
        poses,
        crop,
        full_size: [manifest.camera().width, manifest.camera().height],
        frames,
        depths: depths.map(Arc::new),
        late: manifest.late,
    };
    Ok((view, unit))
}

/// Refuses views whose first mask is far from where they would see the template. Of poses whose lengths have no unit
/// nobody knows that yet.
pub(super) fn check_overlap(scene: &Scene, errors: &mut Vec<Error>, warnings: &mut Vec<Warning>) {
    if scene.pose_unit == PoseUnit::Unknown {
        return;
    }
    let (mesh, frame) = (&scene.template, scene.first_frame);
    for (v, view) in scene.more.iter().enumerate() {
        let seen = scene.seen_by(v + 1);
        let covered = template_coverage(mesh, &mesh.positions, seen.viewpoint(0));
        let iou = match view.frames.frame(0) {
            Ok(first) => overlap(&covered, &first.mask),
            Err(error) => {
                errors.push(error);
                continue;
            }
        };
        let hint = "check its poses (camera_from_world; x right, y down, z ahead; metres) and fx, fy, cx, cy";
        let found = format!(
            "the template's overlap with the mask of frame {frame} is {iou:.2} (intersection over union)"
        );
        if iou < template::OVERLAP_REFUSED {
            errors.push(Error::input(format!("view {}", view.name), found, hint));
        } else if iou < template::OVERLAP_DOUBTED {
            warnings.push(Warning::new("overlap", format!("view {}: {found}", view.name), hint));
        }
    }
}
