//! Captures of phone apps: one folder, or file, that holds the clip, its camera, where that was, and depth.
//!
//! - Stray Scanner: `rgb.mp4` (or its frames in `rgb/`), `camera_matrix.csv`, `odometry.csv`, `depth/`, `confidence/`
//! - Polycam, raw data: `keyframes/` with `corrected_images/` or `images/`, the cameras beside them, `depth/`,
//!   `confidence/`
//! - Record3D: a `.r3d` file, or its unpacked folder, see `record3d.rs`
//!
//! Sources: see [`read_depth`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::calibration::Calibration;
use super::depth::of_app;
use super::read_depth;
use super::record3d::{Unpacked, unpacked};
use tessuto_core::error::Result;

/// What a capture holds.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The app that made it.
    pub app: &'static str,
    /// The video, or the folder of images.
    pub clip: PathBuf,
    /// The camera of the clip, where the capture says it.
    pub calibration: Option<Calibration>,
    /// What [`read_path`](super::read_path) reads the camera's poses from.
    pub poses: PathBuf,
    /// The capture itself, if it holds depth maps.
    pub depths: Option<PathBuf>,
    /// Frames per second, where the capture says it and the clip does not.
    pub fps: Option<f64>,
    /// Where the clip was unpacked; removed with the last copy of this.
    pub unpacked: Option<Arc<Unpacked>>,
}

/// App, where the poses are, and where the clip may be.
type Kind = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Camera of Stray Scanner.
const MATRIX: &str = "camera_matrix.csv";
const KINDS: [Kind; 2] = [
    ("Stray Scanner", &["odometry.csv"], &["rgb.mp4", "rgb"]),
    (
        "Polycam",
        &["keyframes/corrected_cameras", "keyframes/cameras"],
        &["keyframes/corrected_images", "keyframes/images"],
    ),
];

/// The capture at `path`; `None` of other folders and files.
///
/// # Errors
/// [`Error::Input`](tessuto_core::error::Error::Input) naming the first depth map, or the camera's file, if it cannot
/// be used, and what is wrong with a recording of Record3D.
pub fn read_capture(path: &Path) -> Result<Option<Capture>> {
    let Some(unpacked) = unpacked(path)? else { return of_folder(path) };
    let folder = &unpacked.folder;
    let depths = Some(folder.clone()).filter(|folder| folder.join("depth").is_dir());
    let poses = folder.join("metadata.json");
    let place = format!("{}: metadata", path.display());
    Ok(Some(Capture {
        app: "Record3D",
        clip: folder.join("rgb"),
        calibration: of_app(&poses)?.map(|calibration| Calibration { place, ..calibration }),
        poses,
        depths,
        fps: unpacked.fps,
        unpacked: Some(Arc::new(unpacked)),
    }))
}

fn of_folder(folder: &Path) -> Result<Option<Capture>> {
    let there = |names: &[&str]| names.iter().map(|name| folder.join(name)).find(|path| path.exists());
    let Some((app, poses, clip)) =
        KINDS.iter().find_map(|(app, poses, clips)| Some((*app, there(poses)?, there(clips)?)))
    else {
        return Ok(None);
    };
    let measured =
        there(&["depth", "keyframes/depth"]).map(|_| read_depth(folder, None, None)).transpose()?;
    let depths = measured.as_ref().map(|_| folder.to_path_buf());
    let mut calibration = measured.and_then(|found| found.calibration);
    if let Some(calibration) = calibration.as_mut().filter(|_| folder.join(MATRIX).is_file()) {
        // It is for the clip's pixels, whatever their number.
        calibration.size = None;
    }
    Ok(Some(Capture { app, clip, poses, depths, calibration, fps: None, unpacked: None }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capture_is_known_by_its_poses_and_its_clip() {
        let home = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = home.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        };
        write("a/odometry.csv");
        let read = |name: &str| read_capture(&home.path().join(name)).unwrap();
        assert!(read("a").is_none() && read("a/odometry.csv").is_none() && read("nothing").is_none());
        write("a/rgb.mp4");
        let found = read("a").unwrap();
        assert_eq!((found.app, found.depths, found.calibration), ("Stray Scanner", None, None));
        assert!(found.clip.ends_with("a/rgb.mp4") && found.poses.ends_with("a/odometry.csv"));
        write("b/keyframes/cameras/1.json");
        write("b/keyframes/images/1.jpg");
        let found = read("b").unwrap();
        assert!(found.app == "Polycam" && found.clip.ends_with("keyframes/images"));
        assert!(found.poses.ends_with("keyframes/cameras"));
    }
}
