//! Ground truth of a scene, where its folder has any.

use std::ops::Range;
use std::path::Path;

use tessuto_core::parallel;

use super::inside;
use super::listing::some_numbered;
use super::manifest::Manifest;
use super::tracks;
use crate::io::npy;
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Motion, Positions};
use tessuto_core::scene::Truth;

/// Reads the truth of the frames `range`, scaled to metres. Files that cannot be used add to `errors`.
pub(crate) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
    errors: &mut Vec<Error>,
) -> Truth {
    let points = points(folder, manifest, range.clone()).unwrap_or_else(|e| {
        errors.push(e);
        None
    });
    let vertices = vertices(folder, manifest, range.clone(), template).unwrap_or_else(|e| {
        errors.push(e);
        None
    });
    let tracks = tracks::read(folder, manifest, range, template).unwrap_or_else(|e| {
        errors.push(e);
        None
    });
    Truth { points, vertices, tracks }
}

fn points(folder: &Path, manifest: &Manifest, range: Range<usize>) -> Result<Option<Vec<Positions>>> {
    if !folder.join("gt/points").is_dir() {
        return Ok(None);
    }
    let numbers = (range.clone(), manifest.n_frames);
    let paths = some_numbered(folder, "gt/points", "points_", &["npy"], numbers)?;
    let one = |n: usize| paths.get(&n).map_or(Ok(Positions::new()), |path| npy::read_points(path));
    let mut points: Vec<Positions> = parallel::try_map(range.len(), |k| one(range.start + k))?;
    scale(&mut points, manifest);
    Ok(Some(points))
}

fn vertices(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
) -> Result<Option<Motion>> {
    let path = folder.join("gt/vertices.npy");
    if !path.exists() {
        return Ok(None);
    }
    let shapes = npy::read_motion(&inside(folder, &path)?)?;
    let found = [shapes.len(), shapes.vertex_count()];
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
    let mut frames = shapes.frames(range).into_frames();
    scale(&mut frames, manifest);
    Motion::new(frames).map(Some)
}

/// Metres from the units of the scene.
fn scale(frames: &mut [Positions], manifest: &Manifest) {
    let scale = manifest.units.scale();
    frames.iter_mut().flatten().for_each(|p| *p *= scale);
}
