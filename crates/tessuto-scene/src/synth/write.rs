//! A synthetic scene as a scene folder.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::causes;
use super::settings::{Mover, Settings};
use super::surroundings::filmed_by;
use crate::io;
use crate::io::scene::ListedView;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::{Back, Depths, Scene, View};

/// Who wrote a scene, in the notes of its scene.json.
const GENERATOR: &str = "tessuto synth";

/// Writes `scene`, made from `settings`, into the existing `folder`.
///
/// # Errors
/// [`Error::Output`].
pub fn write(folder: &Path, scene: &Scene, settings: &Settings) -> Result<()> {
    let directory = |path: PathBuf| {
        std::fs::create_dir_all(&path).map_err(|source| Error::Output { path: path.clone(), source })?;
        Ok(path)
    };
    directory(folder.join("gt/points"))?;
    let notes = json!({ "generator": GENERATOR, "settings": settings });
    io::scene::write_manifest(folder, &scene.name, scene.fps, scene.frames.len(), &scene.camera, notes)?;
    for v in 0..scene.view_count() {
        let seen = scene.seen_by(v);
        // The first camera's files stand in the folder itself.
        let of_view =
            if v == 0 { folder.to_path_buf() } else { directory(folder.join(&scene.more[v - 1].name))? };
        let [rgbs, masks] = ["rgbs", "masks"].map(|name| directory(of_view.join(name)));
        let (rgbs, masks) = (rgbs?, masks?);
        if let Some(Depths { camera, maps, .. }) = seen.depths.as_deref() {
            let path = directory(of_view.join("depth"))?;
            for (k, map) in maps.iter().enumerate() {
                io::npy::write(&path.join(format!("depth_{k:03}.npy")), &[camera.height, camera.width], map)?;
            }
        }
        if let Some(poses) = &seen.poses {
            io::scene::write_poses(&of_view, poses, scene.pose_unit)?;
        }
        let room = if settings.surroundings { filmed_by(&seen, settings.seed, v)? } else { Vec::new() };
        for k in 0..seen.frames.len() {
            let frame = seen.frames.frame(k)?;
            let rgb = room.get(k).unwrap_or(&frame.rgb);
            io::image::write_png(&rgbs.join(format!("rgb_{k:03}.png")), rgb)?;
            io::image::write_png(&masks.join(format!("mask_{k:03}.png")), &frame.mask)?;
        }
    }
    if !scene.more.is_empty() {
        let listed = |view: &View| {
            let (name, camera, depth) = (view.name.clone(), view.camera, view.depths.is_some());
            ListedView { name, camera, depth, late: view.late }
        };
        io::scene::write_views(folder, &scene.more.iter().map(listed).collect::<Vec<_>>())?;
    }
    if !scene.known.planes.is_empty() {
        io::scene::set_planes(folder, &scene.known.planes)?;
    }
    io::obj::write(&folder.join("template.obj"), &scene.template, None)?;
    if settings.mover == Mover::Hands || settings.air {
        let text = format!("{:#}\n", causes::physics(settings));
        io::atomic_write(&folder.join("gt/physics.json"), text.as_bytes())?;
    }
    if settings.air {
        let futures = causes::futures(settings)?;
        io::npy::write_field(&folder.join("gt/calm.npy"), &futures.calm)?;
        io::npy::write_field(&folder.join("gt/stiffer.npy"), &futures.stiffer)?;
    }
    if settings.back.is_some() {
        // The truth of what scene.json does not tell.
        let text = format!("{:#}\n", json!({ "back": io::scene::back::name(Back::Plain(settings.back)) }));
        io::atomic_write(&folder.join("gt/back.json"), text.as_bytes())?;
    }
    for (k, points) in scene.truth.points.iter().flatten().enumerate() {
        io::npy::write_points(&folder.join(format!("gt/points/points_{k:03}.npy")), points)?;
    }
    match &scene.truth.vertices {
        Some(vertices) => io::npy::write_field(&folder.join("gt/vertices.npy"), vertices),
        None => Ok(()),
    }
}
