//! What cannot be evaluated is refused, with its place.

use std::ops::Range;

use glam::DVec3;

use super::Inputs;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::Motion;
use tessuto_core::scene::Tracks;

/// Refuses a truth that does not belong to `motion`, is none or is none of the frames `range`.
pub(super) fn validate(inputs: &Inputs, motion: &Motion, range: &Range<usize>) -> Result<()> {
    let Inputs { template, truth, first_frame, .. } = inputs;
    let count = template.positions.len();
    if truth.points.is_none() && truth.vertices.is_none() && truth.tracks.is_none() {
        return Err(Error::input(
            "ground truth",
            "the scene has neither measured points nor true vertices nor tracked points",
            "add gt/points/points_000.npy …, gt/vertices.npy or gt/tracks.npz to the scene folder",
        ));
    }
    if range.is_empty() || range.end > motion.len() {
        return Err(Error::input(
            "frames",
            format!(
                "frames {}..{} were asked for, the motion has {} frames",
                range.start,
                range.end,
                motion.len()
            ),
            "choose a range A..B with A < B inside the motion",
        ));
    }
    let lengths = [
        ("gt/points", truth.points.as_ref().map(Vec::len)),
        ("gt/vertices.npy", truth.vertices.as_deref().map(<[_]>::len)),
    ];
    for (name, length) in lengths {
        if let Some(length) = length.filter(|l| *l != motion.len()) {
            return Err(Error::input(
                "motion",
                format!("it has {} frames, {name} has {length}", motion.len()),
                Hint::from("evaluate a result of this scene, and of these frames; of a file of a part, take that part")
                    .with(Remedy::Frames(None)),
            ));
        }
    }
    motion.check_vertices(count, "motion")?;
    truth.vertices.iter().try_for_each(|vertices| vertices.check_vertices(count, "gt/vertices.npy"))?;
    for (k, points) in truth.points.iter().flatten().enumerate() {
        let place = format!("gt/points, frame {}", first_frame + k);
        if let Some(i) = points.iter().position(|p| !p.is_finite() || inputs.view(k).depth(*p) <= 0.0) {
            let problem = format!("point {i} is {}, not in front of the camera", points[i]);
            return Err(Error::input(place, problem, "remove such points from the file"));
        }
    }
    truth.tracks.iter().try_for_each(|tracks| check_tracks(tracks, motion, count))?;
    if !range.clone().any(|k| truth.knows(k)) {
        let [start, end] = [range.start, range.end].map(|k| first_frame + k);
        return Err(Error::input(
            "ground truth",
            format!("none of the frames {start}..{end} has any"),
            Hint::from("choose frames with truth").with(Remedy::Frames(None)),
        ));
    }
    let frames = 0..motion.len();
    check_scale(
        "gt/vertices.npy",
        motion,
        2,
        frames.clone().map(|k| truth.vertices.as_ref().map(|v| &v[k][..])),
    )?;
    check_scale("gt/points", motion, 20, frames.clone().map(|k| truth.points_in(k)))?;
    let tracked = |k: usize| truth.tracks.as_ref().and_then(|t| t.points.get(&k)).map(Vec::as_slice);
    check_scale("gt/tracks.npz", motion, 20, frames.map(tracked))?;
    let area = template.area();
    if area <= 0.0 || !area.is_finite() {
        return Err(Error::input("template", format!("its area is {area} m²"), "give a mesh with faces"));
    }
    Ok(())
}

/// Tracks read from a file are checked there; this is for those made in memory.
fn check_tracks(tracks: &Tracks, motion: &Motion, vertex_count: usize) -> Result<()> {
    let Tracks { vertices, weights, points } = tracks;
    let problem = if weights.len() != vertices.len() {
        format!("{} points have vertices, {} have weights", vertices.len(), weights.len())
    } else if let Some(v) = vertices.as_flattened().iter().find(|v| **v as usize >= vertex_count) {
        format!("they name vertex {v}, the mesh has {vertex_count}")
    } else if let Some((k, _)) = points.iter().find(|(k, _)| **k >= motion.len()) {
        format!("they are of frame {k} of the motion, which has {} frames", motion.len())
    } else if let Some((k, row)) = points.iter().find(|(_, row)| row.len() != vertices.len()) {
        format!("frame {k} of the motion has {} points of {}", row.len(), vertices.len())
    } else if points.values().flatten().any(|p| !p.is_finite())
        || weights.as_flattened().iter().any(|w| !w.is_finite())
    {
        "a position or a weight is not finite".to_owned()
    } else {
        return Ok(());
    };
    Err(Error::input("tracked points", problem, "give the tracks of this mesh and motion"))
}

/// Refuses a truth that is of another size than the motion by far: a wrong unit. Fewer than `least` points have no
/// size.
fn check_scale<'a>(
    place: &str,
    motion: &Motion,
    least: usize,
    truth: impl Iterator<Item = Option<&'a [DVec3]>>,
) -> Result<()> {
    let mut frames = truth.enumerate().filter_map(|(k, points)| Some((k, points?)));
    let Some((k, points)) = frames.find(|(_, points)| points.len() >= least) else { return Ok(()) };
    let diagonal = |positions: &[DVec3]| {
        let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        (high - low).length()
    };
    let ratio = diagonal(points) / diagonal(&motion[k]);
    if (0.1..=10.0).contains(&ratio) || !ratio.is_finite() {
        return Ok(());
    }
    let problem = format!("in its first frame it is {ratio:.3e} times as large as the motion");
    Err(Error::input(
        place,
        problem,
        "give the truth in the unit of the template, see \"units\" in scene.json",
    ))
}
