//! A synthetic scene as a scene folder.

use std::path::Path;

use serde_json::json;

use super::causes;
use super::filmed;
use super::settings::{Mover, Settings};
use crate::io;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::{Depths, Scene};

/// Who wrote a scene, in the notes of its scene.json.
const GENERATOR: &str = "tessuto synth";

/// Writes `scene`, made from `settings`, into the existing `folder`.
///
/// # Errors
/// [`Error::Output`].
pub fn write(folder: &Path, scene: &Scene, settings: &Settings) -> Result<()> {
    for name in ["rgbs", "masks", "gt/points"] {
        let path = folder.join(name);
        std::fs::create_dir_all(&path).map_err(|source| Error::Output { path, source })?;
    }
    let notes = json!({ "generator": GENERATOR, "settings": settings });
    io::scene::write_manifest(folder, &scene.name, scene.fps, scene.frames.len(), &scene.camera, notes)?;
    if let Some(Depths { camera, maps, .. }) = &scene.depths {
        let path = folder.join("depth");
        std::fs::create_dir_all(&path).map_err(|source| Error::Output { path: path.clone(), source })?;
        for (k, map) in maps.iter().enumerate() {
            io::npy::write(&path.join(format!("depth_{k:03}.npy")), &[camera.height, camera.width], map)?;
        }
    }
    if let Some(poses) = &scene.poses {
        io::scene::write_poses(folder, poses, scene.pose_unit)?;
    }
    io::obj::write(&folder.join("template.obj"), &scene.template, None)?;
    let room = if settings.surroundings { filmed(scene, settings.seed)? } else { Vec::new() };
    for k in 0..scene.frames.len() {
        let frame = scene.frames.frame(k)?;
        let rgb = room.get(k).unwrap_or(&frame.rgb);
        io::image::write_png(&folder.join(format!("rgbs/rgb_{k:03}.png")), rgb)?;
        io::image::write_png(&folder.join(format!("masks/mask_{k:03}.png")), &frame.mask)?;
    }
    if settings.mover == Mover::Hands || settings.air {
        let text = format!("{:#}\n", causes::physics(settings));
        io::atomic_write(&folder.join("gt/physics.json"), text.as_bytes())?;
    }
    if settings.air {
        let futures = causes::futures(settings)?;
        io::npy::write_field(&folder.join("gt/calm.npy"), &futures.calm)?;
        io::npy::write_field(&folder.join("gt/stiffer.npy"), &futures.stiffer)?;
    }
    for (k, points) in scene.truth.points.iter().flatten().enumerate() {
        io::npy::write_points(&folder.join(format!("gt/points/points_{k:03}.npy")), points)?;
    }
    match &scene.truth.vertices {
        Some(vertices) => io::npy::write_field(&folder.join("gt/vertices.npy"), vertices),
        None => Ok(()),
    }
}
