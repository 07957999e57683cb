//! A result for other programs: animated GLB and USD with material, sequences of OBJ and PLY, a PC2
//! point cache, and NPZ with everything numeric.
//!
//! All but NPZ and RRD have y up: (x, y, z) of the camera frame becomes (x, −y, −z), a rotation, so that windings
//! and handedness stay. The camera is at the origin and looks along −z, as glTF and USD have it.
//!
//! A clip may lack frames ([`Clip::without_lost`]); all others keep their times and numbers. The samples of USD, the files of the
//! sequences and the arrays of NPZ have gaps there; played, GLB and USD go straight between the neighbours in time. PC2, which
//! cannot have gaps, holds samples on that line. RRD shows the frame before. Each file says what it lacks, but RRD.

mod blender;
mod clip;
mod cloth_preset;
mod glb;
mod npz;
mod pc2;
#[cfg(feature = "rerun")]
pub mod rrd;
mod sequence;
mod usd;
mod usd_fabric;

use std::path::{Path, PathBuf};

pub use clip::{Clip, Material};
use tessuto_core::error::{Error, Result};
use tessuto_estimate::io::atomic_write;
use tessuto_estimate::output::{FolderKind, OutputFolder, manifest};

/// A kind of output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// glTF 2.0, binary: one mesh with a morph target per frame.
    Glb,
    /// USD as text: points as time samples, material, camera.
    Usd,
    /// One OBJ file per frame.
    Obj,
    /// One binary PLY file per frame.
    Ply,
    /// Point cache, with the mesh it belongs to as OBJ.
    Pc2,
    /// NumPy archive of motion, faces, uv, camera, forces and parameters, in the camera frame.
    Npz,
    /// Recording for the viewer of rerun: video, camera, mesh and texture over time, in the camera frame. Needs the cargo
    /// feature `rerun`.
    Rrd,
}

impl Format {
    const KNOWN: [Self; 7] = [Self::Glb, Self::Usd, Self::Obj, Self::Ply, Self::Pc2, Self::Npz, Self::Rrd];
    /// All that this build can write.
    pub const ALL: &[Self] = match Self::KNOWN.split_last() {
        Some((_, without_rrd)) if !cfg!(feature = "rerun") => without_rrd,
        _ => &Self::KNOWN,
    };

    /// What `--to` calls it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Usd => "usd",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Pc2 => "pc2",
            Self::Npz => "npz",
            Self::Rrd => "rrd",
        }
    }
}

impl std::str::FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        Self::KNOWN
            .into_iter()
            .find(|f| f.key() == text.to_ascii_lowercase())
            .ok_or_else(|| format!("the formats are: {}", Self::KNOWN.map(Self::key).join(", ")))
    }
}

/// What one format leaves in the target folder: a file, or a folder of files. Appears whole or not at all.
enum Output {
    File(String, Vec<u8>),
    Folder(String, Vec<(String, Vec<u8>)>),
}

impl Output {
    fn name(&self) -> &str {
        match self {
            Self::File(name, _) | Self::Folder(name, _) => name,
        }
    }
}

/// Writes `clip` in each of `formats` into `folder`, which is made if need be; returns what was written. The manifest of
/// the folder or of the result around it lists the files, so that they can be replaced later. With GLB or USD come a script that
/// sets up a scene of Blender, a preset of its cloth modifier and the light, where they were estimated; those that are there as they would be written stay.
///
/// # Errors
/// [`Error::Input`] if one of the files already exists, unless `force` is set and a manifest lists it as it is;
/// nothing is written then.
/// [`Error::Output`].
pub fn export(clip: &Clip, formats: &[Format], folder: &Path, force: bool) -> Result<Vec<PathBuf>> {
    let mut formats = formats.to_vec();
    formats.sort_unstable();
    formats.dedup();
    let mut outputs = Vec::new();
    for format in &formats {
        outputs.extend(files(clip, *format)?);
    }
    if formats.iter().any(|format| [Format::Glb, Format::Usd].contains(format)) {
        outputs.extend(companions(clip, folder));
    }
    manifest::check_parts(&outputs.iter().map(|o| folder.join(o.name())).collect::<Vec<_>>(), force)?;
    std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    let names: Vec<String> = outputs.iter().map(|output| output.name().to_owned()).collect();
    let paths = outputs.into_iter().map(|output| write(folder, output)).collect::<Result<_>>()?;
    // Beside another program's manifest.json none can be kept: what is there then is not replaced again.
    if manifest::check_manifest(folder).is_ok() {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        manifest::record_or_begin(folder, FolderKind::Export, &names)?;
    }
    Ok(paths)
}

fn files(clip: &Clip, format: Format) -> Result<Vec<Output>> {
    let name = &clip.name;
    Ok(match format {
        Format::Glb => vec![Output::File(format!("{name}.glb"), glb::encode(clip))],
        Format::Usd => {
            let textures = format!("{name}_textures");
            let text = usd::encode(clip, &textures);
            vec![Output::Folder(textures, clip.material.files()), Output::File(format!("{name}.usda"), text)]
        }
        Format::Obj => vec![Output::Folder(format!("{name}_obj"), sequence::obj(clip))],
        Format::Ply => vec![Output::Folder(format!("{name}_ply"), sequence::ply(clip))],
        Format::Pc2 => vec![
            Output::File(format!("{name}_pc2.obj"), sequence::still(clip)),
            Output::File(format!("{name}.pc2"), pc2::encode(clip)),
        ],
        Format::Npz => vec![Output::File(format!("{name}.npz"), npz::encode(clip))],
        #[cfg(feature = "rerun")]
        Format::Rrd => vec![Output::File(format!("{name}.rrd"), rrd::encode(clip)?)],
        #[cfg(not(feature = "rerun"))]
        Format::Rrd => return Err(Error::left_out("format rrd", "rerun")),
    })
}

/// What several formats share. Whatever formats follow each other, it is the same.
fn companions(clip: &Clip, folder: &Path) -> Vec<Output> {
    let script = Output::File(blender::name(clip), blender::encode(clip, folder));
    let preset = cloth_preset::encode(clip).map(|text| Output::File(cloth_preset::name(clip), text));
    let light = clip.environment.as_ref().map(|exr| Output::File(clip.environment_file(), exr.clone()));
    let differs = |output: &Output| match output {
        Output::File(name, bytes) => std::fs::read(folder.join(name)).ok().as_ref() != Some(bytes),
        Output::Folder(..) => true,
    };
    std::iter::once(script).chain(preset).chain(light).filter(differs).collect()
}

fn write(folder: &Path, output: Output) -> Result<PathBuf> {
    let target = folder.join(output.name());
    match output {
        Output::File(_, bytes) => atomic_write(&target, &bytes)?,
        Output::Folder(_, files) => {
            let output = OutputFolder::prepare_part(&target)?;
            for (file, bytes) in files {
                let path = output.partial().join(file);
                std::fs::write(&path, bytes).map_err(|e| failed(&path, e))?;
            }
            output.publish()?;
        }
    }
    Ok(target)
}

fn failed(path: &Path, source: std::io::Error) -> Error {
    Error::Output { path: path.to_path_buf(), source }
}
