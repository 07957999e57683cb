//! The first frame of a scene folder, with or without masks or a template: enough to make one from.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::frames::{ENDINGS, of_scene};
use super::listing::numbered;
use super::manifest::Manifest;
use crate::io::{image, mask};
use tessuto_core::camera::Camera;
use tessuto_core::error::Result;
use tessuto_core::image::Image;

/// Camera of the first frame, and its mask.
#[derive(Debug, Clone)]
pub struct FirstFrame {
    /// Camera of the full image.
    pub camera: Camera,
    /// Fraction of each pixel that is fabric, shape [height, width, 1], and its file; `None` in a scene that has
    /// no masks yet.
    pub mask: Option<(Image, PathBuf)>,
    /// Metres in one unit of template.obj.
    pub metres: f64,
    /// Which way gravity pulls, of length 1, where scene.json has it.
    pub down: Option<DVec3>,
}

/// Reads camera and first mask of the scene in `folder`.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input), as when the scene is loaded.
pub fn first_frame(folder: &Path) -> Result<FirstFrame> {
    let manifest = Manifest::read(folder)?;
    let camera = manifest.camera();
    let metres = manifest.units.scale();
    let down = manifest.gravity.map(|g| DVec3::from_array(g).normalize());
    let empty = |found: std::fs::ReadDir| found.flatten().next().is_none();
    if std::fs::read_dir(folder.join(&manifest.masks)).map_or(true, empty) {
        return Ok(FirstFrame { camera, mask: None, metres, down });
    }
    let numbers = (0..1, manifest.n_frames);
    let mask_path = numbered(folder, &manifest.masks, "mask_", &ENDINGS, numbers, &mut Vec::new())?.remove(0);
    image::open(&mask_path)?.expect_size([camera.width, camera.height])?;
    let (mask, _) = mask::read_fabric(&mask_path, None).map_err(of_scene)?;
    Ok(FirstFrame { camera, mask: Some((mask, mask_path)), metres, down })
}
