//! `tessuto evaluate`: how far a motion is from the truth of a scene.

use std::ops::Range;
use std::path::PathBuf;

use tessuto::appearance;
use tessuto::io::npy;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::metrics::{Evaluation, Inputs, evaluate, table};
use tessuto::{Error, Motion, result};

use crate::remedy;
use crate::say::{self, aside};

/// Compare a result with the scene's ground truth: Chamfer and surface distances, depth, vertices, tracked points, maps.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder with gt/points/, gt/vertices.npy or gt/tracks.npz, of all frames or of some.
    scene: PathBuf,
    /// Result folder (with motion.npy, and material/ if it has maps), or a .npy file of shape [frames, vertices, 3] in metres.
    result: PathBuf,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Only the frames A to B − 1 of the scene [default: the result's; of a .npy file, all].
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<Range<usize>>,
    /// Seed of the surface samples of the Chamfer distance.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let result = &arguments.result;
    let motion = npy::read_motion(&if result.is_dir() { result.join("motion.npy") } else { result.clone() })?;
    let own = result::read_run(result)?.map(|run| run.frames[0]..run.frames[1]);
    let frames = arguments.frames.clone().or(own.clone());
    let loaded = load(&arguments.scene, &LoadOptions { frames: frames.clone(), ..LoadOptions::default() })?;
    loaded.warnings.iter().for_each(|warning| aside!("warning: {}", remedy::warning(warning)));
    let scene = &loaded.scene;
    let motion = &part(motion, own, frames, scene.frames.len())?;
    if motion.len() != scene.frames.len() {
        let problem = format!("has {} frames, the scene has {}", motion.len(), scene.frames.len());
        let hint = "evaluate a result of this scene, and of these frames; of a file of a part, take that part: --frames A..B";
        return Err(Error::input(arguments.result.display().to_string(), problem, hint).into());
    }
    let folder = Some(&arguments.result).filter(|r| r.is_dir());
    let maps = folder.map_or(Ok(None), |folder| appearance::evaluate(scene, folder, motion))?;
    let truth = (0..motion.len()).any(|k| scene.truth.knows(k));
    let mut evaluation = if truth || maps.is_none() {
        evaluate(&Inputs::from(scene), motion, 0..motion.len(), arguments.seed)?
    } else {
        Evaluation::default()
    };
    evaluation.maps = maps;
    if let Some(metrics) = folder.map_or(Ok(None), |folder| result::read_metrics(folder))? {
        // What the result itself says of the frames that are compared.
        let first = scene.first_frame;
        let compared = first..first + motion.len();
        evaluation.verdicts = metrics.verdicts.into_iter().filter(|v| compared.contains(&v.frame)).collect();
    }
    let text =
        if arguments.json { serde_json::to_string_pretty(&evaluation)? + "\n" } else { table(&evaluation) };
    say::output(format_args!("{text}"));
    Ok(())
}

/// The frames of `motion` that are `asked` for, of the scene's. It holds its `own` frames; one that does not say which
/// holds those that are asked for, or all of the scene's.
fn part(
    motion: Motion,
    own: Option<Range<usize>>,
    asked: Option<Range<usize>>,
    loaded: usize,
) -> tessuto::Result<Motion> {
    let Some(asked) = asked else { return Ok(motion) };
    let start = match &own {
        Some(own) if own.start <= asked.start && asked.end <= own.end => own.start,
        Some(own) => {
            let problem = format!(
                "frames {}..{} are asked for, the result has {}..{}",
                asked.start, asked.end, own.start, own.end
            );
            return Err(Error::usage(problem, "choose --frames among the result's, or leave it out"));
        }
        None if motion.len() == loaded => return Ok(motion),
        None => 0,
    };
    let part = asked.start - start..asked.end - start;
    Ok(if part.end <= motion.len() { motion.frames(part) } else { motion })
}
