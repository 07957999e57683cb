//! `tessuto export`.

use std::path::PathBuf;

use clap::Args;
use tessuto::export::{Clip, Format, export};
use tessuto::output::{FolderKind, manifest};

use crate::say::{aside, say};

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
  rrd   recording for rerun: video, camera, mesh and texture over time (camera axes)")]
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
    let clip = Clip::read(&arguments.result)?;
    if clip.camera.is_none()
        && arguments.to.iter().any(|f| matches!(f, Format::Glb | Format::Usd | Format::Npz | Format::Rrd))
    {
        aside!("warning: parameters.json holds no camera (result of an older version): exported without one");
    }
    let folder = arguments.out.clone().unwrap_or_else(|| arguments.result.join("export"));
    let paths = export(&clip, &arguments.to, &folder, arguments.force)?;
    // Beside another program's manifest.json none can be kept: what is there then is not replaced again.
    if manifest::check_manifest(&folder).is_ok() {
        let names: Vec<_> = paths.iter().filter_map(|path| path.file_name()?.to_str()).collect();
        manifest::record_or_begin(&folder, FolderKind::Export, &names)?;
    }
    for path in paths {
        say!("{}", path.display());
    }
    Ok(())
}
