//! Depth maps as phone apps export them, with their camera and their confidence.
//!
//! - a file: PNG, NumPy or OpenEXR (see [`DepthMap::read`])
//! - Stray Scanner: a folder with `camera_matrix.csv`, `depth/000000.png` (or `.npy`), `confidence/000000.png` (0 to 2)
//! - Polycam, raw data: a folder `keyframes` with `depth/ID.png`, `cameras/ID.json` (fx, fy, cx, cy, width,
//!   height), `confidence/ID.png`
//!
//! Of a folder the first map counts; another one of its maps can be named itself. Sources: Stray Robots, *Stray
//! Scanner data specification*; the reader of Polycam's captures in nerfstudio.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::calibration::{Calibration, Focal};
use super::{matrix, read_calibration};
use crate::io::depth::DepthMap;
use crate::io::read_text;
use crate::io::table::Table;
use tessuto_core::error::{Error, Result};

/// Widths of the colour images that phones record with depth `[px]`.
const WIDTHS: [usize; 9] = [640, 960, 1024, 1280, 1440, 1920, 2016, 3840, 4032];

/// A depth map and the camera that it was recorded with.
#[derive(Debug, Clone)]
pub struct Captured {
    /// The map; what the sensor was not sure of is left out.
    pub map: DepthMap,
    /// The camera of the colour images, where it is known.
    pub calibration: Option<Calibration>,
    /// The file of the map.
    pub file: PathBuf,
}

/// Reads the depth map at `path`, a file or the folder of an app; the camera is that of the file `camera` or the app's,
/// a unit of the map `scale` `[m]` or what such files usually have.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn read_depth(path: &Path, camera: Option<&Path>, scale: Option<f64>) -> Result<Captured> {
    let file = if path.is_dir() { first_map(path)? } else { path.to_path_buf() };
    let mut map = DepthMap::read(&file, scale)?;
    // What the apps write is known.
    map.unit.told |= path.is_dir();
    // The app's folder, and the number or name of the map in it.
    let home = file.parent().and_then(Path::parent).unwrap_or(Path::new("."));
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let confidence = home.join("confidence").join(format!("{name}.png"));
    if file.parent().is_some_and(|folder| folder.ends_with("depth")) && confidence.is_file() {
        map.leave_out(&confidence)?;
    }
    let cameras = ["corrected_cameras", "cameras"].map(|sub| home.join(sub).join(format!("{name}.json")));
    let matrix = home.join("camera_matrix.csv");
    let calibration = match camera {
        Some(file) => Some(given(file)?),
        None => match cameras.iter().find(|file| file.is_file()) {
            Some(file) => Some(given(file)?),
            None if matrix.is_file() => Some(from_matrix(&matrix, [map.width, map.height])?),
            None => None,
        },
    };
    Ok(Captured { map, calibration, file })
}

/// The first depth map in an app's folder.
fn first_map(folder: &Path) -> Result<PathBuf> {
    let is_map = |path: &PathBuf| {
        path.extension()
            .is_some_and(|e| ["png", "npy", "exr"].contains(&&*e.to_string_lossy().to_lowercase()))
    };
    let first = |sub: &str| {
        std::fs::read_dir(folder.join(sub)).ok()?.filter_map(|e| Some(e.ok()?.path())).filter(is_map).min()
    };
    let found = ["depth", "keyframes/depth"].into_iter().find_map(first);
    found.ok_or_else(|| {
        let hint = "name the folder of a capture of Stray Scanner, the raw data of Polycam, or the file of a depth map";
        Error::input(folder.display().to_string(), "has no depth maps in depth/ or keyframes/depth/", hint)
    })
}

/// A camera file: JSON of an app, or what [`read_calibration`] reads.
fn given(path: &Path) -> Result<Calibration> {
    if path.extension().is_some_and(|e| e == "csv") {
        return Err(Error::input(
            path.display().to_string(),
            "does not say for which size of image it is",
            "name the capture's folder, whose depth maps are numbered",
        ));
    }
    let json = path.extension().is_some_and(|e| e == "json");
    match if json { of_app(path)? } else { None } {
        Some(calibration) => Ok(calibration),
        None => read_calibration(path, None),
    }
}

/// The camera in an app's JSON, if it is there.
pub(super) fn of_app(path: &Path) -> Result<Option<Calibration>> {
    let value: Option<Value> = serde_json::from_str(&read_text(path)?).ok();
    value.as_ref().map_or(Ok(None), |value| from_json(value, path))
}

/// fx, fy, cx, cy or a matrix, and the size of the image, under the names that apps give them; `None` of what is
/// none of these.
fn from_json(value: &Value, path: &Path) -> Result<Option<Calibration>> {
    let number = |names: &[&str]| names.iter().find_map(|name| value.get(name)?.as_f64());
    let listed = ["imageResolution", "image_resolution", "resolution"].iter().find_map(|name| {
        let list = value.get(name)?.as_array()?;
        Some([list.first()?.as_f64()?, list.get(1)?.as_f64()?])
    });
    let sides = number(&["width", "w", "imageWidth"]).zip(number(&["height", "h", "imageHeight"]));
    let Some(size) = listed.or(sides.map(|(w, h)| [w, h])) else { return Ok(None) };
    let place = path.display().to_string();
    let matrix = ["intrinsics", "intrinsicMatrix", "cameraIntrinsics", "K"].iter().find_map(|name| {
        let rows = value.get(name)?.as_array()?;
        let flat: Vec<f64> = rows
            .iter()
            .flat_map(|row| row.as_array().cloned().unwrap_or_else(|| vec![row.clone()]))
            .map(|v| v.as_f64())
            .collect::<Option<_>>()?;
        Some(flat).filter(|flat| flat.len() == 9)
    });
    let numbers = || {
        let fx = number(&["fx"])?;
        Some([fx, number(&["fy"]).unwrap_or(fx), number(&["cx"])?, number(&["cy"])?])
    };
    let Some([fx, fy, cx, cy]) = matrix.map(|m| matrix::intrinsics(&m, &place)).transpose()?.or_else(numbers)
    else {
        return Ok(None);
    };
    Ok(Some(Calibration {
        centre: Some([cx, cy]),
        size: Some(size.map(|n| n.round() as usize)),
        ..Calibration::new(place, Focal::Pixels([fx, fy]))
    }))
}

/// Three rows of three numbers. They are for the colour images, whose size the file does not state: they have the
/// map's shape, and the width, the map's or that of phones' videos, whose middle is nearest to the principal
/// point.
fn from_matrix(path: &Path, map: [usize; 2]) -> Result<Calibration> {
    let place = path.display().to_string();
    let bad = |problem: &str| {
        Error::input(&place, problem, "write three lines of three numbers: fx 0 cx, 0 fy cy, 0 0 1")
    };
    // Cells between commas, semicolons or tabs, or words between spaces.
    let table = Table::read(path)?;
    let cells = table.rows.iter().flat_map(|row| &row.cells).flat_map(|cell| cell.split_whitespace());
    let numbers: Option<Vec<f64>> = cells.map(|word| table.number(word)).collect();
    let numbers = numbers.ok_or_else(|| bad("is no matrix"))?;
    let m = <[f64; 9]>::try_from(numbers).map_err(|_| bad("has not nine numbers"))?;
    let [fx, fy, cx, cy] = matrix::intrinsics(&m, &place)?;
    // A matrix for the map itself is one, too.
    let widths = WIDTHS.into_iter().chain([map[0]]);
    let off = |w: &usize| ((*w as f64 - 1.0) / 2.0 - cx).abs();
    let width = widths.min_by(|a, b| off(a).total_cmp(&off(b))).expect("there are several");
    let height = (width * map[1]).div_ceil(map[0]);
    Ok(Calibration {
        centre: Some([cx, cy]),
        size: Some([width, height]),
        ..Calibration::new(place, Focal::Pixels([fx, fy]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_json(text: &str) -> Option<[f64; 4]> {
        let camera = from_json(&serde_json::from_str(text).unwrap(), Path::new("c.json")).unwrap()?;
        let camera = camera.scaled_to(camera.size.unwrap(), &mut Vec::new()).unwrap();
        Some([camera.fx, camera.fy, camera.cx, camera.cy])
    }

    #[test]
    fn cameras_as_apps_write_them() {
        let expected = Some([1450.0, 1451.0, 960.5, 721.0]);
        for text in [
            r#"{"fx": 1450, "fy": 1451, "cx": 960.5, "cy": 721, "width": 1920, "height": 1440, "t_00": 1}"#,
            r#"{"intrinsics": [1450, 0, 0, 0, 1451, 0, 960.5, 721, 1], "imageResolution": [1920, 1440]}"#,
            r#"{"intrinsics": [1450, 0, 960.5, 0, 1451, 721, 0, 0, 1], "w": 1920, "h": 1440}"#,
            r#"{"cameraIntrinsics": [[1450, 0, 960.5], [0, 1451, 721], [0, 0, 1]], "resolution": [1920, 1440]}"#,
        ] {
            assert_eq!(read_json(text), expected, "{text}");
        }
        assert_eq!(read_json(r#"{"fx": 1450}"#), None);
        assert_eq!(read_json(r#"{"intrinsics": [1, "a"], "w": 5, "h": 5}"#), None);
    }

    #[test]
    fn a_matrix_without_a_size_is_for_a_phone_s_video() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera_matrix.csv");
        std::fs::write(&path, "1444.2, 0.0, 957.1\n0.0, 1444.2, 715.8\n0.0, 0.0, 1.0\n").unwrap();
        let camera = from_matrix(&path, [256, 192]).unwrap();
        assert_eq!((camera.size, camera.centre), (Some([1920, 1440]), Some([957.1, 715.8])));
        for text in [
            "\u{feff}1444.2, 0.0, 957.1\r\n0.0, 1444.2, 715.8\r\n0.0, 0.0, 1.0\r\n",
            "1444,2;0;957,1\n0;1444,2;715,8\n0;0;1\n",
            "\"1444.2\",\"0\",\"957.1\"\n\"0\",\"1444.2\",\"715.8\"\n\"0\",\"0\",\"1\"\n",
            "1444.2 0 957.1\n0 1444.2 715.8\n0 0 1\n",
        ] {
            std::fs::write(&path, text).unwrap();
            let other = from_matrix(&path, [256, 192]).unwrap();
            assert_eq!((other.centre, other.focal), (camera.centre, camera.focal), "{text}");
        }
        std::fs::write(&path, "400,0,159.5\n0,400,119.5\n0,0,1\n").unwrap();
        assert_eq!(from_matrix(&path, [320, 240]).unwrap().size, Some([320, 240]));
        std::fs::write(&path, "1,2,3").unwrap();
        assert!(from_matrix(&path, [256, 192]).unwrap_err().to_string().contains("not nine numbers"));
    }
}
