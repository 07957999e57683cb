//! The colour frames of a scene folder, with or without masks and template, and the masks beside them.

use std::path::{Path, PathBuf};

use super::frames::ENDINGS;
use super::listing::numbered;
use super::manifest::Manifest;
use tessuto_core::camera::Camera;
use tessuto_core::error::Result;

/// The files of the colour frames, and their camera.
#[derive(Debug, Clone)]
pub struct ColourFiles {
    /// Camera of the full images.
    pub camera: Camera,
    /// Frames per second.
    pub fps: f64,
    /// One per frame.
    pub paths: Vec<PathBuf>,
}

/// Lists the colour frames of the scene in `folder`.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input), as when the scene is loaded.
pub fn colour_files(folder: &Path) -> Result<ColourFiles> {
    let manifest = Manifest::read(folder)?;
    let numbers = (0..manifest.n_frames, manifest.n_frames);
    let paths = numbered(folder, &manifest.rgbs, "rgb_", &ENDINGS, numbers, &mut Vec::new())?;
    Ok(ColourFiles { camera: manifest.camera(), fps: manifest.fps, paths })
}

/// The files of the frames of one camera, and that camera.
#[derive(Debug, Clone)]
pub struct FrameFiles {
    /// Camera of the full images.
    pub camera: Camera,
    /// Colours, one per frame.
    pub colours: Vec<PathBuf>,
    /// Masks, as many.
    pub masks: Vec<PathBuf>,
}

/// Lists the frames of every camera of the scene in `folder`, those of its own first.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input), as when the scene is loaded.
pub fn frame_files(folder: &Path) -> Result<Vec<FrameFiles>> {
    let manifest = Manifest::read(folder)?;
    let of_camera = |manifest: &Manifest| {
        let files = |sub: &str, prefix: &str| {
            let numbers = (0..manifest.n_frames, manifest.n_frames);
            numbered(folder, sub, prefix, &ENDINGS, numbers, &mut Vec::new())
        };
        let (colours, masks) = (files(&manifest.rgbs, "rgb_")?, files(&manifest.masks, "mask_")?);
        Ok(FrameFiles { camera: manifest.camera(), colours, masks })
    };
    std::iter::once(&manifest).chain(&manifest.more).map(of_camera).collect()
}
