//! The list of a scene's poses.json.

use super::{CameraPath, Contents, Entry, Reader};
use crate::io::scene::listed_poses;
use tessuto_core::error::Result;

pub(super) const READER: Reader = Reader {
    about: "poses.json {\"camera_from_world\": …}",
    inside: &["poses.json"],
    knows: |file| file.json.as_ref().is_some_and(|file| file.get("camera_from_world").is_some()),
    read,
};

fn read(file: &Contents) -> Result<CameraPath> {
    let json = file.json.as_ref().unwrap_or(&serde_json::Value::Null);
    let poses = listed_poses(json, &file.place)?;
    let entries = poses
        .into_iter()
        .map(|camera_from_world| Entry { name: None, number: None, camera_from_world })
        .collect();
    Ok(CameraPath { place: file.place.clone(), entries, metric: true, up: None })
}
