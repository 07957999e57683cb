//! Where the camera is in every frame: poses.json, or the same list in scene.json.
//!
//! ```text
//! {"camera_from_world": [[16 numbers by rows], …]}     one of every frame, or one of all
//! {…, "unit": null}                                   lengths of no unit, as of COLMAP's
//! ```
//!
//! Axes as in OpenCV. What the file calls the world is any frame: poses are taken relative to that of frame 0, so the
//! world of a scene is the camera's frame in frame 0, as is that of the template and the truth.

use std::path::Path;

use serde_json::{Value, json};

use crate::io::{atomic_write, read_text};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::scene::PoseUnit;

/// How far a matrix may be from a rotation: largest element of RᵀR − 1.
const ORTHONORMAL: f64 = 1e-4;
/// A camera that moves or turns by more between two frames is doubted `[m]`, `[°]`. Lengths of no unit are not judged.
const JUMP: [f64; 2] = [1.0, 45.0];
/// Name of the file.
pub const POSES: &str = "poses.json";
const HINT: &str =
    "give the 16 numbers of camera_from_world by rows, [R t; 0 0 0 1] with x right, y down, z ahead";

/// The poses in `value`, of `frames` frames, whose lengths are of `scale` metres, as they stand; `place` is where
/// they are from. One pose is that of all frames, of a camera that stands still.
///
/// # Errors
/// [`Error::Input`] naming the frame whose pose is none.
pub(crate) fn from_json(
    value: &Value,
    frames: usize,
    scale: f64,
    place: &str,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Pose>> {
    let scaled = |pose: Pose| Pose { translation: pose.translation * scale, ..pose };
    let poses: Vec<Pose> = listed(value, place)?.into_iter().map(scaled).collect();
    if poses.len() == 1 {
        return Ok(vec![poses[0]; frames]);
    }
    if poses.len() != frames {
        let problem = format!("{} poses of {frames} frames", poses.len());
        return Err(Error::input(
            place,
            problem,
            "give one pose per frame, or one of a camera that stands still",
        ));
    }
    jumps(&poses, unit(value), place, warnings);
    Ok(poses)
}

/// Whether `value` says that its lengths have no unit.
pub(crate) fn unit(value: &Value) -> PoseUnit {
    match value.get("unit") {
        Some(Value::Null) => PoseUnit::Unknown,
        _ => PoseUnit::Metres,
    }
}

/// All poses in `value`, as they stand.
///
/// # Errors
/// [`Error::Input`] naming the pose that is none.
pub(crate) fn listed(value: &Value, place: &str) -> Result<Vec<Pose>> {
    let list = value.get("camera_from_world").unwrap_or(value).as_array();
    let list = list.ok_or_else(|| {
        Error::input(place, "has no list \"camera_from_world\"", format!("one matrix per frame: {HINT}"))
    })?;
    // One matrix, not in a list of its own.
    let one = [Value::Array(list.clone())];
    let list = if list.first().is_some_and(Value::is_number) { &one[..] } else { &list[..] };
    list.iter().enumerate().map(|(n, value)| pose(value, &format!("{place}, pose {n}"))).collect()
}

/// `poses` relative to the first one; `None` where all are the same.
pub(crate) fn moving(poses: &[Pose]) -> Option<Vec<Pose>> {
    if poses.iter().all(|pose| *pose == poses[0]) {
        return None;
    }
    let mut out = relative(poses, &poses[0]);
    out[0] = Pose::IDENTITY;
    Some(out)
}

/// `poses` in the world that is the frame of a camera at `first`.
pub(super) fn relative(poses: &[Pose], first: &Pose) -> Vec<Pose> {
    let back = first.inverse();
    poses.iter().map(|pose| pose.after(&back)).collect()
}

fn pose(value: &Value, place: &str) -> Result<Pose> {
    let fail = |problem: String| Err(Error::input(place, problem, HINT));
    let rows = value.as_array().map_or(&[][..], Vec::as_slice);
    let flat: Vec<f64> = match rows.first() {
        Some(Value::Array(_)) => {
            rows.iter().filter_map(Value::as_array).flatten().filter_map(Value::as_f64).collect()
        }
        _ => rows.iter().filter_map(Value::as_f64).collect(),
    };
    let m: [f64; 16] = match flat.len() {
        // Without the last row, which says nothing.
        12 => [&flat[..], &[0.0, 0.0, 0.0, 1.0]].concat().try_into().expect("16"),
        16 => flat.try_into().expect("16"),
        n => return fail(format!("has {n} numbers, not 16")),
    };
    if let Some(number) = m.iter().find(|number| !number.is_finite()) {
        return fail(format!("holds {number}"));
    }
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return fail(format!("has the last row {:?}: by columns, or no pose", &m[12..]));
    }
    let pose = Pose::from_rows(&m);
    let off = pose.rotation.transpose() * pose.rotation - glam::DMat3::IDENTITY;
    let off = off.to_cols_array().iter().fold(0.0, |most: f64, e| most.max(e.abs()));
    if off > ORTHONORMAL {
        return fail(format!("is no rotation: RᵀR is off by {off:.2e}"));
    }
    if pose.rotation.determinant() < 0.0 {
        return fail("is left-handed, a mirror image: its determinant is -1".to_owned());
    }
    Ok(pose)
}

fn jumps(poses: &[Pose], unit: PoseUnit, place: &str, warnings: &mut Vec<Warning>) {
    let metric = unit != PoseUnit::Unknown;
    for (n, pair) in poses.windows(2).enumerate() {
        let [angle, way] = pair[1].apart(&pair[0]);
        if (metric && way > JUMP[0]) || angle.to_degrees() > JUMP[1] {
            let found = format!(
                "{place}: from frame {n} to {} the camera moves by {way:.2} {} and turns by {:.0}°",
                n + 1,
                unit.name(),
                angle.to_degrees()
            );
            let hint = match metric {
                true => "check that there is one pose per frame, in their order, in metres",
                false => "check that there is one pose per frame, in their order",
            };
            warnings.push(Warning::new("poses", found, hint));
            return;
        }
    }
}

/// The poses in the file `path`, as [`from_json`] reads them.
///
/// # Errors
/// As [`from_json`]; [`Error::Input`] for a file that cannot be read.
pub(crate) fn read(
    path: &Path,
    frames: usize,
    scale: f64,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Pose>, PoseUnit)> {
    let place = path.display().to_string();
    let text = read_text(path)?;
    let value: Value = serde_json::from_str(text.trim_start_matches('\u{feff}'))
        .map_err(|e| Error::input(&place, format!("is not valid JSON: {e}"), HINT))?;
    Ok((from_json(&value, frames, scale, &place, warnings)?, unit(&value)))
}

/// The poses that [`write`](write_poses) left in `folder`, of `frames` frames, as they stand; `None` where the camera
/// stood still.
///
/// # Errors
/// [`Error::Input`] naming the pose that is none.
pub fn read_poses(folder: &Path, frames: usize) -> Result<Option<Vec<Pose>>> {
    let path = folder.join(POSES);
    if !path.is_file() {
        return Ok(None);
    }
    let (poses, _) = read(&path, frames, 1.0, &mut Vec::new())?;
    Ok(poses.iter().any(|pose| *pose != poses[0]).then_some(poses))
}

/// Writes poses.json into `folder`.
///
/// # Errors
/// [`Error::Output`].
pub fn write_poses(folder: &Path, poses: &[Pose], unit: PoseUnit) -> Result<()> {
    // −0 would be read as another number.
    let rows = |pose: &Pose| pose.rows().map(|number| number + 0.0);
    let mut file = json!({ "camera_from_world": poses.iter().map(rows).collect::<Vec<_>>(), "unit": "m" });
    match unit {
        PoseUnit::Metres => {}
        PoseUnit::Unknown => file["unit"] = Value::Null,
        PoseUnit::Found { length, sd } => {
            file["length_of_unit"] = json!({ "value": length, "sd": sd, "unit": "m" })
        }
    }
    atomic_write(&folder.join(POSES), (file.to_string() + "\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use tessuto_core::math::rng::Rng;

    fn seen_from(pose: &Pose, p: DVec3) -> DVec3 {
        pose.rotation * p + pose.translation
    }

    fn some() -> Vec<Pose> {
        let mut rng = Rng::new(3, 0);
        (0..4).map(|_| Pose::random(&mut rng)).collect()
    }

    #[test]
    fn what_is_written_is_read_relative_to_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let poses = some();
        write_poses(folder.path(), &poses, PoseUnit::Unknown).unwrap();
        let path = folder.path().join(POSES);
        assert_eq!(super::read(&path, 4, 1.0, &mut Vec::new()).unwrap().1, PoseUnit::Unknown);
        write_poses(folder.path(), &poses, PoseUnit::Found { length: 0.3, sd: 0.01 }).unwrap();
        assert_eq!(super::read(&path, 4, 1.0, &mut Vec::new()).unwrap().1, PoseUnit::Metres);
        let stored = read_poses(folder.path(), 4).unwrap().unwrap();
        assert_eq!(stored, poses);
        let read = moving(&stored).unwrap();
        assert_eq!(read[0], Pose::IDENTITY);
        let p = DVec3::new(0.3, -0.2, 1.0);
        // What the first camera sees at p, the third one sees where the file says.
        let expected = seen_from(&poses[2], poses[0].in_world(p));
        assert!((seen_from(&read[2], p) - expected).length() < 1e-12);
        assert_eq!(moving(&read).unwrap(), read, "again the same");
        assert!(moving(&[poses[0]; 4]).is_none(), "a camera that stands still");
        assert!(read_poses(&folder.path().join("elsewhere"), 4).unwrap().is_none());
    }

    #[test]
    fn poses_that_are_none_are_named() {
        let rows = some()[1].rows();
        let refused = |value: Value, word: &str| {
            let mut warnings = Vec::new();
            let error = from_json(&value, 2, 1.0, "poses.json", &mut warnings).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("poses.json"), "{error}");
        };
        let good = json!(rows);
        let with = |k: usize, number: f64| {
            let mut rows = rows;
            rows[k] = number;
            json!([good, rows])
        };
        refused(with(0, 3.0), "pose 1: is no rotation");
        refused(with(12, 0.5), "last row");
        refused(json!([good, rows[..9]]), "9 numbers");
        refused(json!([good, good, good]), "3 poses of 2 frames");
        refused(json!({"poses": []}), "camera_from_world");
        let mut mirrored = rows;
        mirrored[..3].iter_mut().for_each(|r| *r = -*r);
        refused(json!([good, mirrored]), "left-handed");
        let mut warnings = Vec::new();
        let mut far = rows;
        far[3] += 2.0;
        let read =
            from_json(&json!({ "camera_from_world": [good, far] }), 2, 1.0, "p", &mut warnings).unwrap();
        assert!(read.len() == 2 && warnings.len() == 1, "{warnings:?}");
        // In centimetres it is no jump.
        warnings.clear();
        let nested: Vec<&[f64]> = far.chunks(4).collect();
        from_json(&json!([good, nested]), 2, 0.01, "p", &mut warnings).unwrap();
        assert!(warnings.is_empty());
        // Without a unit nobody knows how far that is, but half a turn is one.
        let unitless = |second: &[f64; 16], warnings: &mut Vec<Warning>| {
            let value = json!({ "camera_from_world": [good, second], "unit": null });
            from_json(&value, 2, 1.0, "p", warnings).unwrap();
        };
        unitless(&far, &mut warnings);
        assert!(warnings.is_empty(), "{warnings:?}");
        let turned = std::array::from_fn(|k| if k / 4 == 0 || k / 4 == 2 { -far[k] } else { far[k] });
        unitless(&turned, &mut warnings);
        assert!(warnings[0].found.contains("units and turns by 180°"), "{warnings:?}");
        warnings.clear();
        // One of all frames: it stands still.
        assert_eq!(from_json(&json!([good]), 2, 1.0, "p", &mut warnings).unwrap(), [some()[1]; 2]);
        assert!(moving(&from_json(&good, 2, 1.0, "p", &mut warnings).unwrap()).is_none());
    }
}
