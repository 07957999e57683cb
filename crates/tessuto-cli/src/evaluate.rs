//! `tessuto evaluate`: how far a motion is from the truth of a scene.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::PathBuf;

use tessuto::appearance;
use tessuto::io::npy;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::metrics::{Evaluation, Inputs, Metrics, QUANTITIES, Quantity, evaluate};

use crate::say::{self, aside};

/// Compare a result with the scene's ground truth: Chamfer and surface distances, depth, vertices, maps.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder with gt/points/ or gt/vertices.npy.
    scene: PathBuf,
    /// Result folder (with motion.npy, and material/ if it has maps), or a .npy file of shape [frames, vertices, 3] in metres.
    result: PathBuf,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Only the frames A, A+1 … B−1 of the scene.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<Range<usize>>,
    /// Seed of the surface samples of the Chamfer distance.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let file = &arguments.result;
    let file = if file.is_dir() { file.join("motion.npy") } else { file.clone() };
    let motion = npy::read_motion(&file)?;
    let loaded =
        load(&arguments.scene, &LoadOptions { frames: arguments.frames.clone(), ..LoadOptions::default() })?;
    for warning in &loaded.warnings {
        aside!("warning: {warning}");
    }
    let scene = &loaded.scene;
    // A motion of the whole scene is cut to the frames; one of just these frames is taken as it is.
    let motion = match &arguments.frames {
        Some(range) if motion.len() != scene.frames.len() && range.end <= motion.len() => {
            &motion.frames(range.clone())
        }
        _ => &motion,
    };
    let folder = Some(&arguments.result).filter(|r| r.is_dir());
    let maps = folder.map_or(Ok(None), |folder| appearance::evaluate(scene, folder, motion))?;
    let truth = scene.truth.points.is_some() || scene.truth.vertices.is_some();
    let mut evaluation = if truth || maps.is_none() {
        evaluate(&Inputs::from(scene), motion, 0..motion.len(), arguments.seed)?
    } else {
        Evaluation::default()
    };
    evaluation.maps = maps;
    let text =
        if arguments.json { serde_json::to_string_pretty(&evaluation)? + "\n" } else { table(&evaluation) };
    say::output(format_args!("{text}"));
    Ok(())
}

/// The motion's errors: one line per frame, the means, what the columns are; then one line per value of the maps.
fn table(evaluation: &Evaluation) -> String {
    let shown: Vec<usize> = (0..QUANTITIES.len())
        .filter(|k| evaluation.frames.iter().any(|f| f.metrics.values()[*k].is_some()))
        .collect();
    let mut out = if shown.is_empty() { String::new() } else { motion_table(evaluation, &shown) };
    if let Some(maps) = &evaluation.maps {
        out.push_str(if shown.is_empty() { "" } else { "\n" });
        for (key, value, label) in maps.rows() {
            let _ = writeln!(out, "{key:<20} {value:>10.4}  {label}");
        }
        if let Some(scale) = maps.diffuse_scale {
            let scale = scale.map(|s| format!("{s:.4}")).join(" ");
            let _ = writeln!(out, "diffuse_scale        {scale}  the factors, red green blue");
        }
    }
    out
}

fn motion_table(evaluation: &Evaluation, shown: &[usize]) -> String {
    let mut out = String::from("frame");
    for k in shown {
        let _ = write!(out, " {:>14}", QUANTITIES[*k].key);
    }
    out.push_str("\n     ");
    for k in shown {
        let _ = write!(out, " {:>14}", format!("[{}]", QUANTITIES[*k].unit));
    }
    out.push('\n');
    let mut line = |name: &str, metrics: &Metrics| {
        let _ = write!(out, "{name:>5}");
        for k in shown {
            let _ =
                write!(out, " {:>14}", metrics.values()[*k].map_or("-".to_string(), |v| format!("{v:.4e}")));
        }
        out.push('\n');
    };
    for frame in &evaluation.frames {
        line(&frame.frame.to_string(), &frame.metrics);
    }
    line("mean", &evaluation.mean);
    out.push('\n');
    for k in shown {
        let Quantity { key, label, unit } = QUANTITIES[*k];
        let _ = writeln!(out, "{key:<14}  {label} [{unit}]");
    }
    out
}
