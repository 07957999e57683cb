//! Where the camera was in the frames that are imported, if it moved.

use std::path::{Path, PathBuf};

use super::frames::{Kind, Source};
use super::path::{self, CameraPath, Inputs};
use super::{CameraMotion, Settings, counted};
use crate::io::scene::{moving, set_gravity, write_poses};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::PoseUnit;

/// The frames that were written.
pub(super) struct Moving<'a> {
    pub settings: &'a Settings,
    pub source: &'a Source,
    /// Frames of the input, as far as it was read.
    pub read: usize,
    pub camera: &'a Camera,
    /// Which of these were written.
    pub chosen: &'a [usize],
    pub folder: &'a Path,
    /// Hears of every step.
    pub said: &'a (dyn Fn(&str) + Sync),
}

impl Moving<'_> {
    /// Writes where the camera was in all frames, in the frame of the first one, and which way is down where that is
    /// known. Returns the poses in the world of their file; `None` where the camera stands still.
    ///
    /// # Errors
    /// Those of reading, finding, refining and writing them.
    pub fn write(&self, notes: &mut Vec<String>) -> Result<Option<Vec<Pose>>> {
        let Some(path) = self.path(notes)? else { return Ok(None) };
        let (there, down) = path.poses(self.settings);
        if let Some(down) = down {
            set_gravity(self.folder, down)?;
        }
        let Some(poses) = moving(&there) else {
            notes.push("the camera stands still in all of its poses".to_owned());
            return Ok(Some(there));
        };
        let unit = path.unit(self.settings);
        write_poses(self.folder, &poses, unit)?;
        let far = poses
            .iter()
            .map(|pose| pose.apart(&poses[0]))
            .fold([0.0; 2], |most: [f64; 2], way| [most[0].max(way[0]), most[1].max(way[1])]);
        let found = if unit == PoseUnit::Unknown { ", whose length is found with the motion," } else { "" };
        notes.push(format!(
            "the camera moves by up to {:.3} {}{found} and turns by up to {:.1}° from where it is in the first frame",
            far[1],
            unit.name(),
            far[0].to_degrees()
        ));
        Ok(Some(there))
    }

    /// One pose of every frame, as they are given, or found.
    fn path(&self, notes: &mut Vec<String>) -> Result<Option<CameraPath>> {
        let Self { settings, camera, folder, said, .. } = *self;
        let count = self.chosen.len();
        let mut noted = |(path, text): (CameraPath, String)| {
            notes.push(text);
            path
        };
        Ok(match (&settings.camera_motion, &settings.poses) {
            (Some(CameraMotion::Colmap(program)), _) => {
                let path = path::by_colmap(program, folder, camera, count, said)?;
                let written = (0..count).map(|k| PathBuf::from(format!("rgb_{k:03}.png")));
                let names: Vec<PathBuf> = written.collect();
                let all: Vec<usize> = (0..count).collect();
                let path = path.of(&Inputs { names: Some(&names), count }, &all)?;
                Some(noted(path::refined_or_not(path, folder, camera, said)))
            }
            (Some(CameraMotion::Estimate), _) => Some(noted(path::from_clip(folder, camera, count, said)?)),
            (None, Some(path)) => {
                let path = path.of(&inputs(settings, self.source, self.read, path)?, self.chosen)?;
                if settings.refine_poses {
                    Some(noted(path::refined(path, folder, camera, said)?))
                } else {
                    Some(path)
                }
            }
            (None, None) => None,
        })
    }
}

/// The frames that a file of poses is to pair with.
pub(super) fn inputs<'a>(
    settings: &Settings,
    source: &'a Source,
    read: usize,
    path: &CameraPath,
) -> Result<Inputs<'a>> {
    let names = match &source.kind {
        Kind::Images(images) => Some(&images[..]),
        Kind::Video(_) if settings.fps.is_some() => {
            return Err(Error::usage(
                "poses of a video that is resampled",
                "leave the frame rate out: there is one pose for each frame as it was filmed",
            ));
        }
        Kind::Video(_) => None,
    };
    Ok(Inputs { names, count: counted(settings, source, read).unwrap_or(path.len()) })
}
