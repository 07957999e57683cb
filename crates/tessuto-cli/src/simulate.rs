//! `tessuto simulate`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tessuto::motion::causes::{Hold, Otherwise};
use tessuto::output::{FolderKind, OutputFolder, manifest};
use tessuto::result::Folder;
use tessuto::run::replay::{self, Changes, replay};
use tessuto::sim::contact::ContactSettings;
use tessuto::{Error, io};

use crate::repeat;
use crate::say::say;

/// Simulate a result again: as found, or with another stiffness, wind, gravity or hold.
#[derive(Args)]
#[command(after_help = "\
Examples:
  # the same motion, compared with motion.npy
  tessuto simulate results/curtain

  # twice as stiff
  tessuto simulate results/curtain --scale bend=2 --out results/stiffer

  # 20 more frames, without wind
  tessuto simulate results/curtain --continue 20 --air still --out calm.npy
  tessuto simulate results/curtain --hold release --out falling.npy

  # it falls on a floor, and on itself
  tessuto simulate results/curtain --hold release --contact floor.json

A folder at --out becomes a result that render, export and report read. With \
--continue, changes to air and hold begin where the clip ends; without it, in the first \
frame.

--continue, --air, --hold, --gravity and --scale need a result with estimated physics \
(preset default). Other results have no separate causes: their forces include gravity \
and whatever holds the cloth.")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Set a property of the cloth: stretch [N/m], bend [J/rad²] or shear [J/rad²]; with the preset phi-sft warp,
    /// weft, shear [N/m], bend [J] or poisson. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Scale the dynamic forces by this factor.
    #[arg(long, default_value_t = 1.0, value_name = "SCALE")]
    forces: f64,
    /// Frames to add after the clip, with the last wind and held vertices at rest.
    #[arg(long = "continue", default_value_t = 0, value_name = "FRAMES")]
    further: usize,
    /// The wind: as found, still, or a factor such as 0.5.
    #[arg(long, default_value = "found", value_name = "found|still|FACTOR")]
    air: String,
    /// The held vertices.
    #[arg(long, value_enum, default_value_t = Held::Found)]
    hold: Held,
    /// Factors on stretch, bend and shear stiffness, and on the drag of the air.
    #[arg(long, value_name = "KEY=FACTOR,…", value_delimiter = ',')]
    scale: Vec<String>,
    /// Gravity as found, or none.
    #[arg(long, value_enum, default_value_t = Gravity::Found)]
    gravity: Gravity,
    /// What the cloth touches: its own layers alone, or also the bodies of a file (docs/formats.md, contact).
    #[arg(long, value_name = "layers|FILE.json")]
    contact: Option<PathBuf>,
    /// Result folder to write; or, if it ends in .npy, the motion alone, [N, V, 3] f32 [default:
    /// <RESULT>/simulated.npy].
    #[arg(long, value_name = "DIR|FILE.npy")]
    out: Option<PathBuf>,
    /// Replace the array at --out, or a result there that was not changed since.
    #[arg(long)]
    force: bool,
}

/// --hold.
#[derive(Clone, Copy, ValueEnum)]
enum Held {
    /// They follow their paths.
    Found,
    /// They stay where they are.
    Still,
    /// They are let go.
    Release,
}

/// --gravity.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Gravity {
    /// As found.
    Found,
    /// None.
    Off,
}

impl Arguments {
    /// The options that change anything, as they are written.
    fn changes(&self) -> Vec<String> {
        let mut out: Vec<String> = self.set.iter().map(|change| format!("--set {change}")).collect();
        let mut add = |is_changed: bool, text: String| out.extend(is_changed.then_some(text));
        add(self.forces != 1.0, format!("--forces {}", self.forces));
        add(self.further > 0, format!("--continue {}", self.further));
        add(self.air != "found", format!("--air {}", self.air));
        add(
            !matches!(self.hold, Held::Found),
            format!("--hold {}", if matches!(self.hold, Held::Still) { "still" } else { "release" }),
        );
        add(!self.scale.is_empty(), format!("--scale {}", self.scale.join(",")));
        add(self.gravity == Gravity::Off, "--gravity off".to_owned());
        if let Some(contact) = &self.contact {
            add(true, format!("--contact {}", tessuto::text::quoted(contact)));
        }
        out
    }

    fn otherwise(&self) -> Result<Otherwise, Error> {
        let mut scale = [1.0; 4];
        for assignment in &self.scale {
            let keys = ["stretch", "bend", "shear", "drag"];
            let (key, factor) = number("--scale", assignment, &keys)?;
            scale[keys.iter().position(|known| *known == key).expect("one of them")] = factor;
        }
        let air = match self.air.as_str() {
            "found" => 1.0,
            "still" => 0.0,
            factor => factor.parse().ok().filter(|f: &f64| f.is_finite()).ok_or_else(|| {
                Error::usage(format!("--air {factor}"), "write found, still or a factor such as 0.5")
            })?,
        };
        let hold = match self.hold {
            Held::Found => Hold::Found,
            Held::Still => Hold::Still,
            Held::Release => Hold::Release,
        };
        let gravity = if self.gravity == Gravity::Off { 0.0 } else { 1.0 };
        Ok(Otherwise { scale, further: self.further, air, hold, gravity, ..Otherwise::default() })
    }
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
    let otherwise = arguments.otherwise()?;
    let contact = arguments.contact.as_deref().map(contact_of).transpose()?;
    let mut changes = Changes { forces: arguments.forces, otherwise, contact, ..Changes::default() };
    let keys: Vec<&str> = original.parameters.model.properties().iter().map(|p| p.key).collect();
    for assignment in &arguments.set {
        changes.stiffness.push(number("--set", assignment, &keys)?);
    }
    let replayed = replay(&original, &changes)?;
    let motion = &replayed.motion;
    match folder {
        None => {
            io::npy::write_field(&out, motion)?;
            manifest::record(&[&out])?;
        }
        Some(folder) => {
            let command = repeat::simulate(&arguments.result, &arguments.changes(), &out);
            crate::say_kept(replay::write(&original, &replayed, folder, &command)?);
        }
    }
    let frames = original.motion()?.iter().zip(motion);
    let distances = frames.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.distance(*b)));
    say!("largest distance from motion.npy: {:.3e} m", distances.fold(0.0, f64::max));
    say!("{}", out.display());
    Ok(())
}

/// What `--contact` names.
fn contact_of(given: &Path) -> Result<ContactSettings, Error> {
    if given == Path::new("layers") {
        return Ok(ContactSettings::default());
    }
    let wrong = |problem: String| {
        let hint = "write \"layers\", or a file such as {\"bodies\": [{\"shape\": {\"plane\": {\"normal\": [0, -1, 0], \
                    \"height\": -0.5}}, \"friction\": 0.3}]}: a floor 0.5 m below the camera";
        Error::input(given.display().to_string(), problem, hint)
    };
    let text = std::fs::read_to_string(given).map_err(|e| wrong(e.to_string()))?;
    serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))
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

/// Which of `keys` the `assignment` KEY=VALUE of `option` names, and its positive value.
fn number(option: &str, assignment: &str, keys: &[&str]) -> Result<(String, f64), Error> {
    let wrong = || {
        let hint = format!("write KEY=VALUE with a positive number and one of {}", keys.join(", "));
        Error::usage(format!("{option} {assignment}"), hint)
    };
    let (key, value) = assignment.split_once('=').filter(|(key, _)| keys.contains(key)).ok_or_else(wrong)?;
    let value: f64 = value.parse().map_err(|_| wrong())?;
    if value.is_finite() && value > 0.0 { Ok((key.to_owned(), value)) } else { Err(wrong()) }
}
