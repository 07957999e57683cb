//! Depth maps of a whole clip: those of the frames that are taken, as arrays in metres.

use std::path::{Path, PathBuf};

use tessuto_core::parallel;

use super::Settings;
use super::names::{name, natural};
use crate::io::depth::DepthMap;
use crate::io::npy;
use tessuto_core::error::{Error, Result};

const ENDINGS: [&str; 3] = ["png", "npy", "exr"];
/// Folders of a capture that hold its maps, and those that say how far each pixel is to be trusted.
const INSIDE: [[&str; 2]; 2] = [["depth", "confidence"], ["keyframes/depth", "keyframes/confidence"]];

/// Writes the maps in the folder `path`, or in that of a capture, of the frames `chosen` of the input's `count`,
/// where that is known, into depth/ of the scene in `folder`. They pair with the frames one by one.
///
/// # Errors
/// [`Error::Input`] if there are not as many as frames, and naming the map that cannot be used; [`Error::Usage`] where
/// the images are straightened, which the maps would not be; [`Error::Output`].
pub(super) fn write(
    settings: &Settings,
    path: &Path,
    chosen: &[usize],
    count: Option<usize>,
    folder: &Path,
) -> Result<()> {
    if !settings.calibration.distortion.is_none() {
        return Err(Error::usage(
            "depth maps of a lens with distortion",
            "straighten images and depth maps alike first, and give the camera without distortion",
        ));
    }
    let inside = INSIDE.iter().map(|names| names.map(|name| path.join(name))).find(|[maps, _]| maps.is_dir());
    let [maps, confidence] = match inside {
        Some([maps, confidence]) => [list(&maps)?, list(&confidence).unwrap_or_default()],
        None => [list(path)?, Vec::new()],
    };
    let needed = count.unwrap_or_else(|| chosen.last().map_or(0, |n| n + 1));
    if maps.len() < needed || count.is_some_and(|count| maps.len() != count) {
        let problem = format!("holds {} depth maps, the input {needed} frames", maps.len());
        return Err(Error::input(path.display().to_string(), problem, "give one map per frame of the input"));
    }
    let out = folder.join("depth");
    std::fs::create_dir_all(&out).map_err(|source| Error::Output { path: out.clone(), source })?;
    parallel::try_map(chosen.len(), |k| {
        let n = &chosen[k];
        let mut map = DepthMap::read(&maps[*n], settings.depth_scale)?;
        if let Some(confidence) = confidence.get(*n).filter(|_| confidence.len() == maps.len()) {
            map.leave_out(confidence)?;
        }
        let z: Vec<f32> = map.z.iter().map(|z| *z as f32).collect();
        npy::write(&out.join(format!("depth_{k:03}.npy")), &[map.height, map.width], &z)
    })?;
    Ok(())
}

/// The maps in a folder, in the order of the numbers in their names.
fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| {
        let problem = format!("cannot be read: {e}");
        Error::input(folder.display().to_string(), problem, "name the folder of the depth maps")
    })?;
    let is_map = |path: &PathBuf| {
        path.extension().is_some_and(|e| ENDINGS.contains(&&*e.to_string_lossy().to_lowercase()))
    };
    let mut files: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_map).collect();
    files.sort_by(|a, b| natural(&name(a), &name(b)));
    Ok(files)
}
