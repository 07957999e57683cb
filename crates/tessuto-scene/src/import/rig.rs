//! Several cameras that are fixed to each other: OpenCV's stereo calibration and Kalibr's chain of cameras.
//!
//! ```text
//! R, T                 OpenCV: x₂ = R x₁ + T; cameras as M1, D1, M2, D2 or cameraMatrix1, distCoeffs1 …
//! cam0, cam1 …         Kalibr: T_cn_cnm1 of every camera but the first, from the frame of the one before
//! ```

use std::path::PathBuf;

use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::calibration::Calibration;
use super::opencv::{numbers, parse_json, yaml};
use crate::io::read_text;
use crate::io::scene::listed_poses;
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Names of camera matrix and distortion, before the camera's number.
const MATRIX: [&str; 7] = ["M", "K", "cameraMatrix", "camera_matrix", "camera_matrix_", "mtx", "CM"];
const COEFFICIENTS: [&str; 6] =
    ["D", "distCoeffs", "dist_coeffs", "distortion_coefficients", "dist", "dist_"];
/// Names of rotation and translation.
const ROTATION: [&str; 4] = ["R", "Rot", "rotation", "rot"];
const TRANSLATION: [&str; 4] = ["T", "Trans", "translation", "trans"];

/// Cameras fixed to each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Intrinsics of each, where the files have them.
    pub cameras: Vec<Option<Calibration>>,
    /// Where each is seen from the first one, whose pose is the identity; in the files' unit of length.
    pub poses: Vec<Pose>,
}

/// Reads the rig in `files`, of which each may hold a part, as OpenCV's samples write intrinsics and extrinsics.
///
/// # Errors
/// [`Error::Input`] naming the file that cannot be read, and for files without the pose of a second camera.
pub fn read_rig(files: &[PathBuf]) -> Result<Rig> {
    let mut all = serde_json::Map::new();
    let mut places = Vec::new();
    for path in files {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let value = match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            true => serde_json::from_str(&text)
                .map_err(|e| Error::input(&place, format!("is not valid JSON: {e}"), "correct the file"))?,
            false => yaml(&text, &place)?,
        };
        if let Value::Object(map) = value {
            all.extend(map);
        }
        places.push(place);
    }
    let (all, place) = (Value::Object(all), places.join(" and "));
    if all["cam0"].is_object() { chain(&all, &place) } else { stereo(&all, &place) }
}

/// Kalibr's camchain.
fn chain(file: &Value, place: &str) -> Result<Rig> {
    let mut rig = Rig { cameras: Vec::new(), poses: Vec::new() };
    for n in 0.. {
        let (key, camera) = (format!("cam{n}"), &file[format!("cam{n}")]);
        if !camera.is_object() {
            break;
        }
        let of = format!("{place}, {key}");
        rig.cameras.push(Some(parse_json(camera, &of)?));
        let pose = match rig.poses.last() {
            None => Pose::IDENTITY,
            Some(before) => {
                checked(&numbers(&camera["T_cn_cnm1"]), &format!("{of}, T_cn_cnm1"))?.after(before)
            }
        };
        rig.poses.push(pose);
    }
    match rig.poses.len() {
        1 => Err(Error::input(place, "holds one camera, cam0", "give the chain of all cameras of the rig")),
        _ => Ok(rig),
    }
}

/// OpenCV's stereo calibration.
fn stereo(file: &Value, place: &str) -> Result<Rig> {
    let found = |names: &[&str]| names.iter().map(|name| &file[*name]).find(|value| !value.is_null());
    let (Some(r), Some(t)) = (found(&ROTATION).map(numbers), found(&TRANSLATION).map(numbers)) else {
        let hint = Hint::from("give OpenCV's R and T, or Kalibr's camchain").with(Remedy::Poses);
        return Err(Error::input(place, "has no pose of a second camera", hint));
    };
    let rotation = match r[..] {
        // By rows.
        [a, b, c, d, e, f, g, h, i] => DMat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]).transpose(),
        [x, y, z] => DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(x, y, z))),
        _ => {
            return Err(Error::input(place, format!("R has {} numbers, not 9", r.len()), "give 3×3 numbers"));
        }
    };
    let [x, y, z] = t[..] else {
        return Err(Error::input(place, format!("T has {} numbers, not 3", t.len()), "give 3 numbers"));
    };
    let pose = Pose { rotation, translation: DVec3::new(x, y, z) };
    let second = checked(&pose.rows(), &format!("{place}, R and T"))?;
    let numbered = |names: &[&str], k: usize| {
        let key = names.iter().map(|name| format!("{name}{k}")).find(|key| !file[key].is_null())?;
        Some(file[key].clone())
    };
    let camera = |k: usize| -> Result<Option<Calibration>> {
        let Some(matrix) = numbered(&MATRIX, k) else { return Ok(None) };
        let mut camera = file.clone();
        camera["camera_matrix"] = matrix;
        camera["distortion_coefficients"] = numbered(&COEFFICIENTS, k).unwrap_or_else(|| json!([]));
        parse_json(&camera, &format!("{place}, camera {k}")).map(Some)
    };
    Ok(Rig { cameras: vec![camera(1)?, camera(2)?], poses: vec![Pose::IDENTITY, second] })
}

/// The pose of 16 numbers by rows.
fn checked(rows: &[f64], place: &str) -> Result<Pose> {
    Ok(listed_poses(&json!([rows]), place)?[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(files: &[(&str, &str)]) -> Result<Rig> {
        let folder = tempfile::tempdir().unwrap();
        let write = |(name, text): &(&str, &str)| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        read_rig(&files.iter().map(write).collect::<Vec<_>>())
    }

    /// A matrix as OpenCV's FileStorage writes it.
    fn matrix(name: &str, [rows, columns]: [usize; 2], data: &str) -> String {
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n"
        )
    }

    fn extrinsics() -> String {
        let r = matrix("R", [3, 3], "0., 0., 1., 0., 1., 0., -1., 0., 0.");
        format!("%YAML:1.0\n---\n{r}{}", matrix("T", [3, 1], "-0.5, 0., 0.1"))
    }

    #[test]
    fn opencvs_two_files_make_one_rig() {
        let m1 = matrix("M1", [3, 3], "600., 0., 320., 0., 610., 240., 0., 0., 1.");
        let m2 = matrix("M2", [3, 3], "700., 0., 321., 0., 710., 241., 0., 0., 1.");
        let d1 = matrix("D1", [1, 5], "0.1, 0., 0., 0., 0.");
        let (intrinsics, extrinsics) = (format!("%YAML:1.0\n---\n{m1}{d1}{m2}"), extrinsics());
        let rig = read(&[("intrinsics.yml", &intrinsics), ("extrinsics.yml", &extrinsics)]).unwrap();
        let centres: Vec<_> =
            rig.cameras.iter().map(|camera| camera.as_ref().unwrap().centre.unwrap()).collect();
        assert_eq!(centres, [[320.0, 240.0], [321.0, 241.0]]);
        assert!(!rig.cameras[0].as_ref().unwrap().distortion.is_none());
        assert!(rig.cameras[1].as_ref().unwrap().distortion.is_none());
        // What lies ahead of the first camera is to the right of the second, which stands to the right and looks back.
        assert_eq!(rig.poses[1].rotation * DVec3::Z + rig.poses[1].translation, DVec3::new(0.5, 0.0, 0.1));
        let alone = read(&[("extrinsics.yml", &extrinsics)]).unwrap();
        assert_eq!((alone.cameras, alone.poses), (vec![None, None], rig.poses));
    }

    #[test]
    fn kalibrs_chain_is_followed() {
        let camera = |t: &str| {
            format!(
                "  intrinsics: [600.0, 601.0, 320.0, 240.0]\n  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]\n  \
                 distortion_model: radtan\n  resolution: [640, 480]\n{t}"
            )
        };
        let step = "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.2]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  \
                    - [0.0, 0.0, 0.0, 1.0]\n";
        let all = format!("cam0:\n{}cam1:\n{}cam2:\n{}", camera(""), camera(step), camera(step));
        let rig = read(&[("camchain.yaml", &all)]).unwrap();
        assert_eq!(rig.poses.iter().map(|pose| pose.translation.x).collect::<Vec<_>>(), [0.0, -0.2, -0.4]);
        assert_eq!(rig.cameras[2].as_ref().unwrap().size, Some([640, 480]));
        let lame = all.replacen("0.0, 0.0, 1.0, 0.0]", "0.0, 0.0, 2.0, 0.0]", 1);
        let error = read(&[("camchain.yaml", &lame)]).unwrap_err().to_string();
        assert!(error.contains("cam1, T_cn_cnm1") && error.contains("no rotation"), "{error}");
        let one = read(&[("camchain.yaml", &format!("cam0:\n{}", camera("")))]).unwrap_err().to_string();
        assert!(one.contains("one camera"), "{one}");
    }

    #[test]
    fn a_rig_without_a_second_camera_is_refused() {
        let error =
            read(&[("a.yml", "camera_matrix: [1, 0, 1, 0, 1, 1, 0, 0, 1]\n")]).unwrap_err().to_string();
        assert!(error.contains("a.yml") && error.contains("no pose of a second camera"), "{error}");
    }
}
