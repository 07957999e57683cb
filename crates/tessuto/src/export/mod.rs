//! A result for other programs: animated GLB and USD with material, sequences of OBJ and PLY, a PC2
//! point cache, NPZ with everything numeric, and the fabric for simulators and libraries of materials.
//!
//! All but NPZ, RRD and MuJoCo have y up: (x, y, z) of the camera frame becomes (x, −y, −z), a rotation, so that
//! windings and handedness stay. The camera is at the origin and looks along −z, as glTF and USD have it. MuJoCo has
//! z up, (x, z, −y), and looks along +y.
//!
//! A clip may lack frames ([`Clip::without_lost`]); all others keep their times and numbers. The samples of USD,
//! the files of the sequences and the arrays of NPZ have gaps there; played, GLB and USD go straight between the
//! neighbours in time. PC2, which cannot have gaps, holds samples on that line. RRD shows the frame before. Each
//! file says what it lacks, but RRD. Simulators get the first frame that is there.

mod blender;
mod clip;
mod cloth_preset;
mod format;
mod glb;
mod mujoco;
mod npz;
mod obj;
mod pc2;
mod ply;
mod ppf;
mod recording;
mod row;
#[cfg(feature = "rerun")]
pub mod rrd;
mod sequence;
mod sheet;
pub mod shell;
mod u3m;
mod usd;
mod usd_fabric;

use std::path::{Path, PathBuf};

pub use clip::{Clip, Material, PlainBack};
pub use format::Format;
use row::Output;
use tessuto_core::error::{Error, Result};
use tessuto_estimate::io::atomic_write;
use tessuto_estimate::output::{FolderKind, OutputFolder, manifest};

/// What goes with GLB and USD: ends of names, and what each file is for.
const COMPANIONS: [(&str, &str); 3] = [
    ("_blender.py", "sets up Blender: fabric, camera, video behind, light"),
    ("_blender_cloth.py", "settings for Blender's cloth simulation"),
    ("_environment.exr", "the light that was found"),
];

/// What an exported file or folder is for, by the end of its `name`; `None` of what no format leaves.
pub fn use_of(name: &str) -> Option<&'static str> {
    let of_formats = Format::KNOWN.iter().flat_map(|format| format.row().files);
    let ends = of_formats.chain(&COMPANIONS).filter(|(end, _)| name.ends_with(end));
    ends.max_by_key(|(end, _)| end.len()).map(|(_, used)| *used)
}

/// Writes `clip` in each of `formats` into `folder`, which is made if need be; returns what was written. The
/// manifest of the folder or of the result around it lists the files, so that they can be replaced later. With GLB
/// or USD come a script that sets up a scene of Blender, a preset of its cloth modifier and the light, where they
/// were estimated; those that are there as they would be written stay.
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
        outputs.extend((format.row().outputs)(clip)?);
    }
    if formats.iter().any(|format| format.row().for_blender) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_end_of_a_name_tells_what_a_file_is_for() {
        for (name, part) in [
            ("a.glb", "web"),
            ("a_pc2.obj", "point cache moves"),
            ("a.pc2", "Maya"),
            ("a_obj", "one mesh a frame"),
            ("a_blender.py", "sets up Blender"),
            ("a_blender_cloth.py", "cloth simulation"),
            ("results/a/export/a_environment.exr", "light"),
        ] {
            assert!(use_of(name).unwrap().contains(part), "{name}");
        }
        assert!(["manifest.json", "a.obj", "glb"].iter().all(|name| use_of(name).is_none()));
    }
}
