//! transforms.json of nerfstudio and instant-ngp: world from camera, which looks along −z.

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::{CameraPath, Contents, Entry, Reader, from_camera, number};
use tessuto_core::error::{Error, Result};

/// How far a transform may be from a rotation: they are printed with few digits.
const ORTHONORMAL: f64 = 1e-3;

pub(super) const READER: Reader = Reader {
    about: "transforms.json (nerfstudio, instant-ngp)",
    inside: &["transforms.json"],
    knows: |file| file.json.as_ref().is_some_and(|file| file["frames"][0].get("transform_matrix").is_some()),
    read,
};

fn read(file: &Contents) -> Result<CameraPath> {
    let frames = file.json.as_ref().and_then(|json| json["frames"].as_array()).map_or(&[][..], Vec::as_slice);
    let entry = |(n, frame): (usize, &Value)| {
        let place = format!("{}, frame {n}", file.place);
        let mut rows = [[0.0; 4]; 3];
        for (i, row) in rows.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = number(&frame["transform_matrix"][i][j], "an element of transform_matrix", &place)?;
            }
        }
        let turn = DMat3::from_cols_array(&std::array::from_fn(|k| rows[k % 3][k / 3]));
        let off = (turn.transpose() * turn - DMat3::IDENTITY).to_cols_array();
        if off.iter().any(|e| e.abs() > ORTHONORMAL) || turn.determinant() < 0.0 {
            let hint = "instant-ngp scales worlds, not cameras: restore the file, or export it again";
            return Err(Error::input(place, "its transform_matrix is no rotation", hint));
        }
        let turn = DMat3::from_quat(glam::DQuat::from_mat3(&turn).normalize());
        let at = DVec3::from_array(std::array::from_fn(|k| rows[k][3]));
        let name = frame["file_path"].as_str().map(str::to_owned);
        Ok(Entry { name, number: None, camera_from_world: from_camera(turn, at, true) })
    };
    let mut entries: Vec<Entry> = frames.iter().enumerate().map(entry).collect::<Result<_>>()?;
    // Of frames of a video, whose names are its numbers, in their order.
    entries.sort_by(|a, b| {
        let key = |entry: &Entry| entry.name.clone().unwrap_or_default();
        key(a).len().cmp(&key(b).len()).then_with(|| key(a).cmp(&key(b)))
    });
    Ok(CameraPath { place: file.place.clone(), entries, metric: true, up: None })
}
