//! Tracked points: `gt/tracks.npz`.
//!
//! ```text
//! frames    [F]        numbers of the frames, from 0, in any order
//! vertices  [P, 4]     vertices of the template that each point lies between, from 0
//! weights   [P, 4]     their weights, of sum 1; 0 for the fourth corner of a triangle, whose vertex then means nothing
//! points    [F, P, 3]  measured positions, camera axes, in the scene's units
//! ```

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use super::inside;
use super::manifest::Manifest;
use crate::io::npy::{self, Array};
use crate::io::{read_bounded, zip};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::Tracks;

/// Largest file read `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// The weights' sum may differ from 1 by this.
const SUM: f64 = 1e-3;

/// The tracked points of the frames `range`, in metres; None if the scene in `folder` has none.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
) -> Result<Option<Tracks>> {
    let path = folder.join("gt/tracks.npz");
    if !path.exists() {
        return Ok(None);
    }
    let bytes = read_bounded(&inside(folder, &path)?, MAX_BYTES)?;
    let entries = zip::read(&bytes).map_err(|problem| {
        let hint = "write it with numpy.savez(path, frames=…, vertices=…, weights=…, points=…)";
        Error::input(path.display().to_string(), problem, hint)
    })?;
    let file = File { path: &path, entries };
    let vertex_count = template.map(|t| t.positions.len());
    let tracks = places(&file, vertex_count)?;
    let frames = frames(&file, manifest.n_frames)?;
    let positions = positions(&file, [frames.len(), tracks.vertices.len()])?;
    let scale = manifest.units.scale();
    let rows = frames.into_iter().zip(positions.chunks_exact(tracks.vertices.len()));
    let inside_range = rows.filter(|(n, _)| range.contains(n));
    let points: BTreeMap<usize, Vec<DVec3>> =
        inside_range.map(|(n, row)| (n - range.start, row.iter().map(|p| *p * scale).collect())).collect();
    Ok(Some(Tracks { points, ..tracks }))
}

/// The archive's arrays by name.
struct File<'a> {
    path: &'a Path,
    entries: Vec<(String, Vec<u8>)>,
}

impl File<'_> {
    fn error(&self, array: &str, problem: impl Into<String>, hint: &str) -> Error {
        Error::input(format!("{}, array \"{array}\"", self.path.display()), problem, hint)
    }

    fn array(&self, name: &str, form: &str) -> Result<Array> {
        let file_name = format!("{name}.npy");
        let Some((_, bytes)) = self.entries.iter().find(|(entry, _)| *entry == file_name) else {
            let shown =
                |(entry, _): &(String, Vec<u8>)| entry.trim_end_matches(".npy").chars().take(30).collect();
            let names: Vec<String> = self.entries.iter().take(10).map(shown).collect();
            let problem = format!("is missing; the file has {}", names.join(", "));
            return Err(self.error(name, problem, "add frames, vertices, weights and points to the archive"));
        };
        let array = npy::decode(bytes, true);
        let array = array.map_err(|problem| self.error(name, problem, "write floats or integers"))?;
        let expected: Vec<&str> = form.split(", ").collect();
        let fits = array.shape.len() == expected.len()
            && array
                .shape
                .iter()
                .zip(&expected)
                .all(|(n, e)| e.parse().map_or(*n > 0, |length: usize| length == *n));
        match fits {
            true => Ok(array),
            false => {
                let problem = format!("has shape {:?}, expected [{form}]", array.shape);
                Err(self.error(name, problem, "reshape it; F frames and P points are one at least"))
            }
        }
    }
}

/// The tracks without their measured positions.
fn places(file: &File, vertex_count: Option<usize>) -> Result<Tracks> {
    let vertices = file.array("vertices", "P, 4")?;
    let weights = file.array("weights", &format!("{}, 4", vertices.shape[0]))?;
    let mut tracks = Tracks::default();
    let rows = vertices.data.as_chunks::<4>().0.iter().zip(weights.data.as_chunks::<4>().0);
    for (p, (corners, weights)) in rows.enumerate() {
        let sum: f64 = weights.iter().sum();
        // Also where a weight is not a number.
        if (sum - 1.0).abs().is_nan() || (sum - 1.0).abs() > SUM {
            let problem = format!("those of point {p} are {weights:?}, of sum {sum}");
            return Err(file.error("weights", problem, "give finite weights whose sum is 1"));
        }
        let end = vertex_count.unwrap_or(u32::MAX as usize) as f64;
        let mut row = [0; 4];
        for k in 0..4 {
            let corner = corners[k];
            if weights[k] == 0.0 {
                continue;
            }
            if corner.fract() != 0.0 || !(0.0..end).contains(&corner) {
                let problem = format!("point {p} names vertex {corner}; template.obj has 0 to {}", end - 1.0);
                return Err(file.error(
                    "vertices",
                    problem,
                    "count vertices in the order of template.obj, from 0",
                ));
            }
            row[k] = corner as u32;
        }
        tracks.vertices.push(row);
        tracks.weights.push(*weights);
    }
    Ok(tracks)
}

/// Numbers of the frames, each once.
fn frames(file: &File, n_frames: usize) -> Result<Vec<usize>> {
    let array = file.array("frames", "F")?;
    let mut frames: Vec<usize> = Vec::with_capacity(array.data.len());
    let hint = "count frames as the images do, from 0, each once";
    for number in array.data {
        if number.fract() != 0.0 || !(0.0..n_frames as f64).contains(&number) {
            let problem = format!("names frame {number}; the scene has 0 to {}", n_frames - 1);
            return Err(file.error("frames", problem, hint));
        }
        frames.push(number as usize);
    }
    let mut sorted = frames.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(file.error("frames", format!("names frame {} twice", pair[0]), hint)),
        None => Ok(frames),
    }
}

/// Measured positions, shape [F · P].
fn positions(file: &File, [frames, points]: [usize; 2]) -> Result<Vec<DVec3>> {
    let array = file.array("points", &format!("{frames}, {points}, 3"))?;
    if let Some(k) = array.data.iter().position(|v| !v.is_finite()) {
        let (row, point) = (k / (3 * points), k / 3 % points);
        let problem = format!("point {point} in row {row} is {}", array.data[k]);
        let hint = "leave out frames or points that were lost: all have a place in every row";
        return Err(file.error("points", problem, hint));
    }
    Ok(array.data.chunks_exact(3).map(DVec3::from_slice).collect())
}
