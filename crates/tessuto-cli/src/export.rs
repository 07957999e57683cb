//! `tessuto export`.

use std::path::PathBuf;

use clap::Args;
use tessuto::export::{Clip, Format, export};
use tessuto::metrics::State;
use tessuto::result::Folder;

use crate::say::{aside, say};

/// Write a result for other programs: Blender, Houdini, Unreal, the web, NumPy, rerun.
#[derive(Args)]
#[command(after_help = help())]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Formats, separated by commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', required = true)]
    to: Vec<Format>,
    /// Folder to write to [default: <RESULT>/export].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Leave out the frames whose verdict is `lost`; the others keep their times and numbers.
    ///
    /// glb and usd go straight over a gap when they are played, pc2 holds samples on that line, rrd shows the frame
    /// before; obj, ply and npz lack the frames. The files say which.
    #[arg(long)]
    without_lost: bool,
    /// Replace earlier exports. Files that tessuto did not write, or that have changed, are never replaced.
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  tessuto export results/curtain --to glb
  tessuto export results/curtain --to obj,pc2,npz --out /tmp/curtain
  tessuto export results/curtain --to glb --without-lost --force

Formats:";

/// Examples, and the formats that there are.
fn help() -> String {
    let widest = Format::KNOWN.iter().map(|format| format.key().len()).max().unwrap_or(0);
    Format::KNOWN.iter().fold(EXAMPLES.to_owned(), |help, format| {
        let indent = " ".repeat(widest + 4);
        let needs = format
            .feature()
            .map_or_else(String::new, |_| format!(";\n{indent}in builds with --features full"));
        format!("{help}\n  {:<widest$}  {}{needs}", format.key(), format.content())
    }) + "\n\nCamera axes are x right, y down, z forward."
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut clip = Clip::of(&Folder::open(&arguments.result)?)?;
    let lost = clip.verdicts.iter().filter(|v| v.state == State::Lost).count();
    if arguments.without_lost {
        clip = clip.without_lost()?;
    } else if lost > 0 {
        aside!("warning: {lost} of {} frames are lost; --without-lost leaves them out", clip.frame_count);
    }
    let folder = arguments.out.clone().unwrap_or_else(|| arguments.result.join("export"));
    for path in export(&clip, &arguments.to, &folder, arguments.force)? {
        say!("{}", path.display());
    }
    if arguments.without_lost {
        aside!("{lost} of {} frames are lost and left out", clip.frame_count);
    }
    Ok(())
}
