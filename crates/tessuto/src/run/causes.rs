//! How good a result's causes are, against what is known of the scene's.

use std::path::Path;

use super::replay::{Changes, replay};
use crate::result::Folder;
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Motion, Positions};
use tessuto_estimate::io;
use tessuto_estimate::metrics::causes::{CauseMetrics, Foretold, Found, KnownCauses, carried_on};
use tessuto_estimate::motion::causes::{Hold, Otherwise};

/// Bend stiffness in gt/stiffer.npy over that of the clip.
const STIFFER: f64 = 10.0;

/// Number of frames of the scene in `folder`.
fn frame_count(folder: &Path) -> Result<usize> {
    let path = folder.join("scene.json");
    let manifest: serde_json::Value = serde_json::from_str(&io::read_text(&path)?)
        .map_err(|e| Error::input(path.display().to_string(), e.to_string(), "correct the file"))?;
    Ok(manifest["n_frames"].as_u64().map_or(0, |n| n as usize))
}

/// Compares the causes of `result`, the motion of all frames of the scene in `scene`, whose true vertices are
/// `truth`, with its gt/physics.json, and simulates what gt/calm.npy and gt/stiffer.npy show. How much is left
/// unexplained is reported without any truth. `None` where the result has no causes, or, of an older program, not
/// their sizes, and nothing is known.
///
/// # Errors
/// [`Error::Input`] for files that cannot be used; [`Error::Numerical`] from a simulation.
pub fn compare_causes(scene: &Path, truth: Option<&Motion>, result: &Folder) -> Result<Option<CauseMetrics>> {
    let Some(found) = &result.found else { return Ok(None) };
    let gt = scene.join("gt");
    let motion = result.motion()?;
    let field = |name: &str| -> Result<Option<Vec<Positions>>> {
        let path = gt.join(name);
        if !path.is_file() {
            return Ok(None);
        }
        let motion = io::npy::read_motion(&path)?;
        motion.check_vertices(result.mesh.positions.len(), &path.display().to_string())?;
        Ok(Some(motion.iter().cloned().collect()))
    };
    // What comes after the clip, and the clip otherwise, are of all its frames.
    let is_whole = result.run.frames == [0, frame_count(scene)?];
    let of_whole = |name: &str| if is_whole { field(name) } else { Ok(None) };
    let (calm, stiffer) = (of_whole("calm.npy")?, of_whole("stiffer.npy")?);
    let path = gt.join("physics.json");
    let known = if path.is_file() {
        let text = io::read_text(&path)?;
        let hint = "correct the file, or delete it: physics is then not compared";
        serde_json::from_str(&text)
            .map_err(|e| Error::input(path.display().to_string(), e.to_string(), hint))?
    } else if calm.is_some() || stiffer.is_some() || result.sizes.is_some() {
        KnownCauses::default()
    } else {
        return Ok(None);
    };
    let (causes, spread) = (&found.causes, &found.spread);
    let stiffness = |k: usize| Found {
        value: causes.stiffness()[k],
        sd_of_ln: spread.ln_stiffness[k],
        constraint: found.constraints.stiffness[k],
    };
    let drag = Found { value: causes.drag(), sd_of_ln: spread.ln_drag, constraint: found.constraints.drag };
    let numbers = [stiffness(0), stiffness(1), stiffness(2), drag];
    let mut metrics = CauseMetrics::new(&known, numbers, (causes.gravity(), spread.down), &found.held);
    metrics.unexplained = result.sizes.filter(|s| s.motion > 0.0).map(|s| s.residual / s.motion);
    let frames: Vec<Positions> = truth.unwrap_or(motion).iter().cloned().collect();
    let simulated = |otherwise: Otherwise| -> Result<Vec<Positions>> {
        Ok(replay(result, &Changes { otherwise, ..Changes::default() })?.motion.iter().cloned().collect())
    };
    if let Some(calm) = calm {
        let otherwise =
            Otherwise { further: calm.len(), air: 0.0, hold: Hold::Still, ..Otherwise::default() };
        let after = simulated(otherwise)?.split_off(motion.len());
        metrics.calm = Some(Foretold::new(&after, &calm, &carried_on(&frames, calm.len())));
    }
    if let Some(stiffer) = stiffer {
        let otherwise = Otherwise { scale: [1.0, STIFFER, 1.0, 1.0], ..Otherwise::default() };
        metrics.stiffer = Some(Foretold::new(&simulated(otherwise)?, &stiffer, &[frames]));
    }
    Ok(Some(metrics))
}
