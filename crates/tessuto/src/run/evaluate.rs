//! How far a motion is from the truth of a scene.

use std::ops::Range;
use std::path::Path;

use crate::result::{self, Folder};
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::mesh::Motion;
use tessuto_estimate::appearance;
use tessuto_estimate::io::npy;
use tessuto_estimate::io::scene::{LoadOptions, Loaded, load};
use tessuto_estimate::metrics::{self, Evaluation, Inputs};
use tessuto_estimate::template::irregular::of_scene;

use super::causes::compare_causes;

/// Compares `result`, a result folder or a .npy file of a motion, shape [N, V, 3] `[m]`, with the truth of the
/// scene in `scene_folder`, in `frames` of the scene: the result's, or all of a file's, where `None`. `warn`
/// receives what is odd about the scene.
///
/// # Errors
/// [`Error::Input`] for files that cannot be used, and for a motion of other frames; [`Error::Usage`] for frames
/// that the result does not have.
pub fn evaluate(
    scene_folder: &Path,
    result: &Path,
    frames: Option<Range<usize>>,
    seed: u64,
    warn: &mut dyn FnMut(&Warning),
) -> Result<Evaluation> {
    let motion = motion_of(result)?;
    let own = result::read_run(result)?.map(|run| run.frames[0]..run.frames[1]);
    let frames = frames.or(own.clone());
    let loaded = load(scene_folder, &LoadOptions { frames: frames.clone(), ..LoadOptions::default() })?;
    loaded.warnings.iter().for_each(warn);
    let motion = part(motion, own, frames, loaded.scene.frames.len())?;
    compare(&loaded, result, &motion, seed)
}

/// [`evaluate`] of a scene that is in memory, all of its frames.
///
/// # Errors
/// As [`evaluate`].
pub fn evaluate_loaded(loaded: &Loaded, result: &Path, seed: u64) -> Result<Evaluation> {
    compare(loaded, result, &motion_of(result)?, seed)
}

fn motion_of(result: &Path) -> Result<Motion> {
    npy::read_motion(&if result.is_dir() { result.join("motion.npy") } else { result.to_path_buf() })
}

fn compare(loaded: &Loaded, result: &Path, motion: &Motion, seed: u64) -> Result<Evaluation> {
    let vertices = result::read_run(result)?.map_or(0, |run| run.settings.irregular_vertices);
    let scene = &*result::in_metres(of_scene(&loaded.scene, vertices)?, result)?;
    if motion.len() != scene.frames.len() {
        let problem = format!("has {} frames, the scene has {}", motion.len(), scene.frames.len());
        let hint =
            "evaluate a result of this scene, and of these frames; of a file of a part, take that part";
        let hint = Hint::from(hint).with(Remedy::Frames(None));
        return Err(Error::input(result.display().to_string(), problem, hint));
    }
    let folder = Some(result).filter(|r| r.is_dir());
    let maps = folder.map_or(Ok(None), |folder| appearance::evaluate(scene, folder, motion))?;
    let truth = (0..motion.len()).any(|k| scene.truth.knows(k));
    let mut evaluation = if truth || maps.is_none() {
        metrics::evaluate(&Inputs::from(scene), motion, 0..motion.len(), seed)?
    } else {
        Evaluation::default()
    };
    evaluation.maps = maps;
    // Causes are of the motion as a whole.
    if let Some(folder) = folder.filter(|r| {
        r.join("rest_lengths.npy").is_file() && motion.len() == motion_of(r).map_or(0, |m| m.len())
    }) {
        evaluation.causes =
            compare_causes(&scene.folder, scene.truth.vertices.as_ref(), &Folder::open(folder)?)?;
    }
    if let Some(metrics) = folder.map_or(Ok(None), result::read_metrics)? {
        // What the result itself says of the frames that are compared.
        let first = scene.first_frame;
        let compared = first..first + motion.len();
        evaluation.verdicts = metrics.verdicts.into_iter().filter(|v| compared.contains(&v.frame)).collect();
    }
    Ok(evaluation)
}

/// The frames of `motion` that are `asked` for, of the scene's. It holds its `own` frames; one that does not say which
/// holds those that are asked for, or all of the scene's.
fn part(
    motion: Motion,
    own: Option<Range<usize>>,
    asked: Option<Range<usize>>,
    loaded: usize,
) -> Result<Motion> {
    let Some(asked) = asked else { return Ok(motion) };
    let start = match &own {
        Some(own) if own.start <= asked.start && asked.end <= own.end => own.start,
        Some(own) => {
            let problem = format!(
                "frames {}..{} are asked for, the result has {}..{}",
                asked.start, asked.end, own.start, own.end
            );
            let hint = Hint::from("choose frames among the result's, or leave them out")
                .with(Remedy::Frames(Some(own.clone())));
            return Err(Error::usage(problem, hint));
        }
        None if motion.len() == loaded => return Ok(motion),
        None => 0,
    };
    let part = asked.start - start..asked.end - start;
    Ok(if part.end <= motion.len() { motion.frames(part) } else { motion })
}
