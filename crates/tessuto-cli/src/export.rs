//! `tessuto export`.

use std::path::PathBuf;

use clap::Args;
use tessuto::export::{Clip, Format, export};
use tessuto::result::Folder;

use crate::say::say;

/// Write a result for other programs: Blender, Houdini, Unreal, the web, NumPy, rerun.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto export results/curtain --to glb
  tessuto export results/curtain --to obj,pc2,npz --out /tmp/curtain

Formats:
  glb   animated mesh with a morph target per frame, normals, uv, material (y up)
  usd   text: points as time samples, UsdPreviewSurface, camera (y up)
  obj   one file per frame, with material (y up)
  ply   one binary file per frame, with normals and uv (y up)
  pc2   point cache, and the mesh it belongs to (y up)
  npz   motion, faces, uv, camera, forces, parameters (camera axes: x right, y down, z forward)
  rrd   recording for rerun: video, camera, mesh and texture over time (camera axes);
        in builds with --features full")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Formats, separated by commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', required = true)]
    to: Vec<Format>,
    /// Folder to write to [default: <RESULT>/export].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace earlier exports. Files that tessuto did not write, or that have changed, are never replaced.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let clip = Clip::of(&Folder::open(&arguments.result)?)?;
    let folder = arguments.out.clone().unwrap_or_else(|| arguments.result.join("export"));
    for path in export(&clip, &arguments.to, &folder, arguments.force)? {
        say!("{}", path.display());
    }
    Ok(())
}
