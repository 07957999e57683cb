//! Whether the poses of a camera that moves are those of the clip, before masks are made with them.

use std::path::Path;

use super::refuse::other_poses;
use crate::import::{Known, pose_fit};
use crate::io::image;
use crate::io::scene::{ColourFiles, read_poses};
use tessuto_core::error::Result;
use tessuto_core::image::Image;

/// Poses that are doubted are refused if another kind explains the clip, or if what stands still is farther from where
/// they have it by this factor.
const REFUSED: f64 = 3.0;

/// Compares the poses in `folder` with what stands still around the fabric, which has this `coverage` in the first
/// frame, shape [height · width], and is about there in the others. What is to be noted about them.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) naming the frame that they do not explain; those of reading frames.
pub(super) fn expect_fit(folder: &Path, clip: &ColourFiles, coverage: &[f32]) -> Result<Option<String>> {
    let Some(poses) = read_poses(folder, clip.paths.len())? else { return Ok(None) };
    let (width, height) = (clip.camera.width, clip.camera.height);
    let fabric = Image { width, height, channels: 1, data: coverage.to_vec() };
    let look = |n: usize| Ok((image::read(&clip.paths[n])?, fabric.clone()));
    let fit = pose_fit(&clip.camera, &poses, Known::First, &look)?;
    let (Some(worst), Some(why)) = (fit.worst(), fit.doubt()) else { return Ok(None) };
    if fit.mistake.is_some() || worst.off > REFUSED * fit.doubted {
        return Err(other_poses(worst.frame, &fit.sentence(), why));
    }
    Ok(Some(format!("the poses are not quite this clip's: {}; masks and motion suffer", fit.sentence())))
}
