//! `tessuto simulate`.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::output::{FolderKind, OutputFolder, manifest};
use tessuto::result::Folder;
use tessuto::run::replay::{self, Changes, replay};
use tessuto::{Error, io};

use crate::repeat;
use crate::say::say;

/// Replay a recovered motion from its parameters and forces alone, or with changed ones.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto simulate results/curtain                       the same motion, compared with motion.npy
  tessuto simulate results/curtain --set bend=0.01 --out results/stiffer
  tessuto simulate results/curtain --forces 1.5 --out windier.npy

A folder at --out becomes a result that render, export and report take. There is no gravity and no pin in the model:
the forces hold the cloth where the video shows it, and other forces let it drift.")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Change a stiffness: stretch [N/m], bend [J/rad²] or shear [J/rad²]. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Scale the dynamic forces by this factor.
    #[arg(long, default_value_t = 1.0, value_name = "SCALE")]
    forces: f64,
    /// Result folder to write; or, if it ends in .npy, the motion alone, [N, V, 3] f32 [default: <RESULT>/simulated.npy].
    #[arg(long, value_name = "DIR|FILE.npy")]
    out: Option<PathBuf>,
    /// Replace the array, or the result that nobody changed since, at --out.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let out = arguments.out.clone().unwrap_or_else(|| arguments.result.join("simulated.npy"));
    // Everything that can be refused is refused before the work.
    let folder = match out.extension().is_some_and(|e| e == "npy") {
        true => check_target(&out, arguments.force || arguments.out.is_none()).map(|()| None)?,
        false => Some(OutputFolder::prepare(&out, FolderKind::Result, arguments.force)?),
    };
    let original = Folder::open(&arguments.result)?;
    let mut changes = Changes { forces: arguments.forces, ..Changes::default() };
    arguments.set.iter().try_for_each(|assignment| set(&mut changes.stiffness, assignment))?;
    let replayed = replay(&original, &changes)?;
    let motion = &replayed.motion;
    match folder {
        None => {
            io::npy::write_field(&out, motion)?;
            manifest::record(&[&out])?;
        }
        Some(folder) => {
            let command = repeat::simulate(&arguments.result, &arguments.set, arguments.forces, &out);
            crate::say_kept(replay::write(&original, &replayed, folder, &command)?);
        }
    }
    let frames = original.motion()?.iter().zip(motion);
    let distances = frames.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.distance(*b)));
    say!("largest distance from motion.npy: {:.3e} m", distances.fold(0.0, f64::max));
    say!("{}", out.display());
    Ok(())
}

/// Refuses to replace a file that is not an earlier motion. One outside of folders with a manifest is replaced if it is
/// an array of positions, and if `replace` is set.
fn check_target(out: &Path, replace: bool) -> Result<(), Error> {
    let loose = out.symlink_metadata().is_ok_and(|found| found.is_file()) && !manifest::is_within_ours(out);
    match loose && replace && io::npy::read_motion(out).is_ok() {
        true => Ok(()),
        false if loose && !replace => Err(Error::input(
            out.display().to_string(),
            "already exists and would be replaced",
            "add --force if it is an earlier motion, or choose another file",
        )),
        false => manifest::check_parts(&[out], replace),
    }
}

fn set(stiffness: &mut [Option<f64>; 3], assignment: &str) -> Result<(), Error> {
    let hint = "write stretch=VALUE, bend=VALUE or shear=VALUE with a positive number";
    let wrong = || Error::usage(format!("--set {assignment}"), hint);
    let (key, value) = assignment.split_once('=').ok_or_else(wrong)?;
    let value: f64 = value.parse().map_err(|_| wrong())?;
    let index = ["stretch", "bend", "shear"].iter().position(|k| *k == key).ok_or_else(wrong)?;
    if !(value.is_finite() && value > 0.0) {
        return Err(wrong());
    }
    stiffness[index] = Some(value);
    Ok(())
}
