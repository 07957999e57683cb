//! `tessuto verify`.

use std::path::PathBuf;

use tessuto::Error;
use tessuto::output::manifest;

use crate::say::say;

/// Check that a folder tessuto wrote (result, scene, views) is complete and unchanged.
#[derive(clap::Args)]
#[command(after_help = "\
Compares the size and SHA-256 of every file with manifest.json, which is written last. \
Files that the manifest does not list are named, but are not an error.")]
pub struct Arguments {
    /// Result, scene or folder of views.
    result: PathBuf,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let verified = manifest::verify(&arguments.result)?;
    for name in &verified.unknown {
        say!("not in the manifest: {name}");
    }
    if let Some((name, problem)) = verified.wrong.first() {
        verified.wrong.iter().for_each(|(name, problem)| say!("{name}: {problem}"));
        return Err(Error::input(
            arguments.result.join(name).display().to_string(),
            format!(
                "{problem} ({} of {} files are wrong)",
                verified.wrong.len(),
                verified.sound + verified.wrong.len()
            ),
            "copy the folder anew, or repeat the command in its log.json",
        )
        .into());
    }
    say!("{} files, all as they were written", verified.sound);
    Ok(())
}
