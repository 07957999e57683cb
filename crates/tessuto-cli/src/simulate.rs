//! `tessuto simulate`.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::output::manifest;
use tessuto::reconstruct::simulate;
use tessuto::result::Folder;
use tessuto::sim::Cloth;
use tessuto::{Error, io};

use crate::say::say;

/// Replay a recovered motion from its parameters and forces alone, or with changed ones.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto simulate results/curtain                       the same motion, compared with motion.npy
  tessuto simulate results/curtain --set bend=0.01 --out stiffer.npy
  tessuto simulate results/curtain --forces 1.5 --out windier.npy")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Change a stiffness: stretch [N/m], bend [J/rad²] or shear [J/rad²]. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Scale the dynamic forces by this factor.
    #[arg(long, default_value_t = 1.0, value_name = "SCALE")]
    forces: f64,
    /// Write the motion here, [N, V, 3] f32 [default: <RESULT>/simulated.npy].
    #[arg(long, value_name = "FILE.npy")]
    out: Option<PathBuf>,
    /// Replace an existing array at --out.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let out = arguments.out.clone().unwrap_or_else(|| arguments.result.join("simulated.npy"));
    check_target(&out, arguments.force || arguments.out.is_none())?;
    let mut saved = Folder::open(&arguments.result)?;
    for assignment in &arguments.set {
        set(&mut saved.parameters.log_stiffness, assignment)?;
    }
    if !arguments.forces.is_finite() {
        return Err(Error::usage(
            format!("--forces {}: not a finite number", arguments.forces),
            "give a factor such as 0.5 or 2",
        )
        .into());
    }
    saved.parameters.accelerations.dynamic.iter_mut().flatten().for_each(|d| *d *= arguments.forces);
    let cloth = Cloth::new(&saved.mesh);
    let settings = &saved.run.settings;
    let motion = simulate(&cloth, settings, saved.fps, &saved.mesh.positions, &saved.parameters)?;
    io::npy::write_shapes(&out, &motion)?;
    manifest::record(&[&out])?;
    let original = saved.motion()?;
    let frames = original.iter().zip(&motion);
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

fn set(log_stiffness: &mut [f64; 3], assignment: &str) -> Result<(), Error> {
    let hint = "write stretch=VALUE, bend=VALUE or shear=VALUE with a positive number";
    let wrong = || Error::usage(format!("--set {assignment}"), hint);
    let (key, value) = assignment.split_once('=').ok_or_else(wrong)?;
    let value: f64 = value.parse().map_err(|_| wrong())?;
    let index = ["stretch", "bend", "shear"].iter().position(|k| *k == key).ok_or_else(wrong)?;
    if !(value.is_finite() && value > 0.0) {
        return Err(wrong());
    }
    log_stiffness[index] = value.log10();
    Ok(())
}
