//! Ground truth of a scene, where its folder has any.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::inside;
use super::listing::numbered;
use super::manifest::Manifest;
use crate::error::{Error, Result};
use crate::io::npy;
use crate::mesh::{Mesh, Positions};
use crate::scene::Truth;

/// Reads the truth of the frames `range`, scaled to metres. Files that cannot be used add to `errors`.
pub(crate) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
    errors: &mut Vec<Error>,
) -> Truth {
    let mut keep = |result: Result<Option<Vec<Positions>>>| {
        result.unwrap_or_else(|e| {
            errors.push(e);
            None
        })
    };
    let mut truth = Truth {
        points: keep(points(folder, manifest, range.clone())),
        vertices: keep(vertices(folder, manifest, range, template)),
    };
    let scale = manifest.units.scale();
    for positions in truth.points.iter_mut().chain(&mut truth.vertices).flatten() {
        positions.iter_mut().for_each(|p| *p *= scale);
    }
    truth
}

fn points(folder: &Path, manifest: &Manifest, range: Range<usize>) -> Result<Option<Vec<Positions>>> {
    if !folder.join("gt/points").is_dir() {
        return Ok(None);
    }
    // Files beyond n_frames were already named with the frames themselves.
    let numbers = (range, manifest.n_frames);
    let paths = numbered(folder, "gt/points", "points_", &["npy"], numbers, &mut Vec::new())?;
    let read: Vec<Result<Positions>> = paths.par_iter().map(|p| npy::read_points(p)).collect();
    read.into_iter().collect::<Result<_>>().map(Some)
}

fn vertices(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
) -> Result<Option<Vec<Positions>>> {
    let path = folder.join("gt/vertices.npy");
    if !path.exists() {
        return Ok(None);
    }
    let mut frames = npy::read_shapes(&inside(folder, &path)?)?;
    let found = [frames.len(), frames.first().map_or(0, Vec::len)];
    let expected = [manifest.n_frames, template.map_or(found[1], |t| t.positions.len())];
    if found != expected {
        return Err(Error::input(
            path.display().to_string(),
            format!(
                "has {} frames of {} vertices, but scene.json and template.obj have {} of {}",
                found[0], found[1], expected[0], expected[1]
            ),
            "give the position of every template vertex in every frame, or remove the file",
        ));
    }
    Ok(Some(frames.drain(range).collect()))
}
