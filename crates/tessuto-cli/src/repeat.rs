//! Command lines that repeat what was done.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tessuto::run::RunOptions;
use tessuto::run::appearance::{AppearanceOptions, MotionSource};
use tessuto::text::quoted;

/// `tessuto reconstruct` with the preset of `options` and every setting that differs from it.
pub fn reconstruct(scene: &Path, out: &Path, options: &RunOptions) -> String {
    let settings = &options.config;
    let preset = settings.preset.name();
    let mut command =
        format!("tessuto reconstruct {} --out {} --preset {preset}", quoted(scene), quoted(out));
    if let Some(frames) = &options.frames {
        let _ = write!(command, " --frames {}..{}", frames.start, frames.end);
    }
    for (key, value) in settings.changes() {
        let _ = write!(command, " --set {key}={value}");
    }
    if !options.appearance {
        command.push_str(" --no-appearance");
    }
    command
}

/// `tessuto appearance` with `options`.
pub fn appearance(scene: &Path, result: &Path, options: &AppearanceOptions) -> String {
    let mut command = format!("tessuto appearance {} {}", quoted(scene), quoted(result));
    if options.motion == MotionSource::Truth {
        command.push_str(" --motion gt");
    }
    for change in &options.changes {
        let _ = write!(command, " --set {change}");
    }
    if let Some(seed) = options.seed {
        let _ = write!(command, " --seed {seed}");
    }
    command
}

/// `tessuto simulate` with `changes`, options as they are written.
pub fn simulate(result: &Path, changes: &[String], out: &Path) -> String {
    let mut command = format!("tessuto simulate {} --out {}", quoted(result), quoted(out));
    changes.iter().for_each(|change| command.extend([" ", change]));
    command
}

/// Where the result of a scene goes if nothing else is said.
pub fn default_out(scene: &Path) -> PathBuf {
    let name = scene.canonicalize().ok().and_then(|p| p.file_name().map(PathBuf::from));
    Path::new("tessuto-out").join(name.unwrap_or_else(|| "scene".into()))
}
