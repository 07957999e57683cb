//! `tessuto evaluate`: how far a motion is from the truth of a scene.

use std::ops::Range;
use std::path::PathBuf;

use tessuto::metrics::table;
use tessuto::run::evaluate::evaluate;

use crate::remedy;
use crate::say::{self, aside};

/// Compare a result with the scene's ground truth: Chamfer and surface distances, depth, vertices, tracked points,
/// maps.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder with gt/points/, gt/vertices.npy or gt/tracks.npz, of all frames or of some.
    scene: PathBuf,
    /// Result folder (with motion.npy, and material/ if it has maps), or a .npy file of shape [frames, vertices,
    /// 3] in metres.
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
    let warn = &mut |warning: &_| aside!("warning: {}", remedy::warning(warning));
    let Arguments { scene, result, frames, seed, .. } = arguments;
    let evaluation = evaluate(scene, result, frames.clone(), *seed, warn)?;
    let text =
        if arguments.json { serde_json::to_string_pretty(&evaluation)? + "\n" } else { table(&evaluation) };
    say::output(format_args!("{text}"));
    Ok(())
}
