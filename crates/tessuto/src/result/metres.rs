//! A scene whose camera's poses have no unit, beside a result, which has found how long one is.

use std::borrow::Cow;
use std::path::Path;

use super::read_run;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::{PoseUnit, Scene};
use tessuto_estimate::io::scene::read_poses;

/// `scene` with the poses of the result in `folder`, where its own have no unit; as it is where they have.
///
/// # Errors
/// [`Error::Input`] if they have none and no result of these frames says how long one is.
pub(crate) fn in_metres<'a>(scene: Cow<'a, Scene>, folder: &Path) -> Result<Cow<'a, Scene>> {
    if scene.pose_unit != PoseUnit::Unknown {
        return Ok(scene);
    }
    let refused = || {
        let problem = "the poses of its camera have no unit, and no result says how long one is";
        let hint = "name the folder of a result of these frames, whose poses.json is in metres";
        Error::input(scene.folder.display().to_string(), problem, hint)
    };
    let run = read_run(folder)?.ok_or_else(refused)?;
    let found = read_poses(folder, run.frames[1] - run.frames[0])?.ok_or_else(refused)?;
    let first = scene.first_frame.checked_sub(run.frames[0]).ok_or_else(refused)?;
    let poses = found.get(first..first + scene.frames.len()).ok_or_else(refused)?.to_vec();
    Ok(Cow::Owned(Scene { poses: Some(poses), pose_unit: PoseUnit::Metres, ..scene.into_owned() }))
}
