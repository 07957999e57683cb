//! Recordings of phones by ARKit: metres, y up. Stray Scanner's odometry.csv, Record3D's metadata and Polycam's
//! keyframes.
//!
//! Source: docs.strayrobots.io, *Stray Scanner: data specification*; record3d.app; Polycam, *polyform*.

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::{CameraPath, Contents, Entry, Reader, from_camera, number, quaternion};
use crate::io::read_text;
use tessuto_core::error::{Error, Result};

pub(super) const STRAY: Reader = Reader {
    about: "odometry.csv (Stray Scanner)",
    inside: &["odometry.csv"],
    knows: |file| {
        let first = file.text.as_deref().and_then(|text| text.lines().next()).unwrap_or_default();
        file.name().ends_with(".csv") && first.contains("qw")
    },
    read: odometry,
};

pub(super) const RECORD3D: Reader = Reader {
    about: "metadata (Record3D)",
    inside: &["metadata", "metadata.json"],
    knows: |file| {
        file.json.as_ref().is_some_and(|json| json["poses"][0].as_array().is_some_and(|p| p.len() == 7))
    },
    read: record3d,
};

pub(super) const POLYCAM: Reader = Reader {
    about: "keyframes (Polycam)",
    inside: &["keyframes/corrected_cameras", "keyframes/cameras", "corrected_cameras", "cameras"],
    knows: |file| file.path.is_dir() && !keyframes(file).is_empty(),
    read: polycam,
};

/// A first camera that is turned by less is the world itself `[rad]`.
const OWN: f64 = 0.01;

fn path(place: &str, entries: Vec<Entry>) -> CameraPath {
    CameraPath { place: place.to_owned(), entries, metric: true, up: Some(DVec3::Y) }
}

/// `timestamp, frame, x, y, z, qx, qy, qz, qw, …` of a camera that looks along +z with y down.
fn odometry(file: &Contents) -> Result<CameraPath> {
    let mut lines = file.text.as_deref().unwrap_or_default().lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let column = |key: &str| {
        let missing = || Error::input(&file.place, format!("has no column {key}"), "restore the file");
        header.iter().position(|h| *h == key).ok_or_else(missing)
    };
    let mut columns = [0; 8];
    for (column_of, key) in columns.iter_mut().zip(["frame", "x", "y", "z", "qx", "qy", "qz", "qw"]) {
        *column_of = column(key)?;
    }
    let entry = |(k, line): (usize, &str)| {
        let place = format!("{}:{}", file.place, k + 2);
        let words: Vec<&str> = line.split(',').map(str::trim).collect();
        let number =
            |c: usize| words.get(columns[c]).and_then(|w| w.parse::<f64>().ok()).filter(|v| v.is_finite());
        let numbers: Option<Vec<f64>> = (0..8).map(number).collect();
        let Some(n) = numbers else {
            return Err(Error::input(place, "lacks a number", "restore the file"));
        };
        let turn = quaternion([n[4], n[5], n[6], n[7]], &place)?;
        let camera_from_world = from_camera(turn, DVec3::new(n[1], n[2], n[3]), false);
        Ok(Entry { name: None, number: Some(n[0] as usize), camera_from_world })
    };
    let rows = lines.filter(|line| !line.trim().is_empty()).enumerate();
    Ok(path(&file.place, rows.map(entry).collect::<Result<_>>()?))
}

/// `poses`: qx qy qz qw x y z of a camera that looks along −z. Where the world is the first camera's frame, as some
/// versions of the app have it, y is not up.
fn record3d(file: &Contents) -> Result<CameraPath> {
    let poses = file.json.as_ref().and_then(|json| json["poses"].as_array()).map_or(&[][..], Vec::as_slice);
    let entry = |(n, pose): (usize, &Value)| {
        let place = format!("{}, pose {n}", file.place);
        let mut v = [0.0; 7];
        for (k, value) in v.iter_mut().enumerate() {
            *value = number(&pose[k], "a number of the pose", &place)?;
        }
        let turn = quaternion([v[0], v[1], v[2], v[3]], &place)?;
        let camera_from_world = from_camera(turn, DVec3::new(v[4], v[5], v[6]), true);
        Ok(Entry { name: None, number: Some(n), camera_from_world })
    };
    let found = path(&file.place, poses.iter().enumerate().map(entry).collect::<Result<_>>()?);
    let level = from_camera(DMat3::IDENTITY, DVec3::ZERO, true);
    let own = |first: &Entry| first.camera_from_world.apart(&level)[0] < OWN;
    let up = found.up.filter(|_| !found.entries.first().is_some_and(own));
    Ok(CameraPath { up, ..found })
}

fn keyframes(file: &Contents) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(&file.path).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    files.sort();
    files
}

/// A file for each image, which has its name: t_00 … t_23 by rows, world from a camera that looks along −z.
fn polycam(file: &Contents) -> Result<CameraPath> {
    let entry = |path: &std::path::PathBuf| {
        let place = path.display().to_string();
        let json: Value = serde_json::from_str(&read_text(path)?)
            .map_err(|e| Error::input(&place, format!("is not valid JSON: {e}"), "restore the file"))?;
        let at = |i: usize, j: usize| number(&json[format!("t_{i}{j}")], &format!("t_{i}{j}"), &place);
        let mut rows = [[0.0; 4]; 3];
        for (i, row) in rows.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = at(i, j)?;
            }
        }
        let turn = DMat3::from_cols_array(&std::array::from_fn(|k| rows[k % 3][k / 3]));
        let turn = DMat3::from_quat(glam::DQuat::from_mat3(&turn).normalize());
        let place = DVec3::from_array(std::array::from_fn(|k| rows[k][3]));
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        Ok(Entry { name, number: None, camera_from_world: from_camera(turn, place, true) })
    };
    let entries = keyframes(file).iter().map(entry).collect::<Result<_>>()?;
    Ok(path(&file.place, entries))
}
