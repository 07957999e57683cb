//! The result of a simulation: a folder like that of the reconstruction which it came from, with another motion.

use std::path::Path;

use super::{Folder, Log, ParameterFile, parameters_in, read_json, write_json};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::Motion;
use tessuto_estimate::io;
use tessuto_estimate::motion::parameters::Parameters;

/// Writes into the existing `folder` what [`Folder::open`] reads: `motion`, the `parameters` that make it, and mesh,
/// texture, material and settings of `original`. What compares `original` with its video is left out.
///
/// # Errors
/// [`Error::Input`] naming the file of `original` that cannot be read; [`Error::Output`].
pub fn write_replay(
    folder: &Path,
    original: &Folder,
    parameters: &Parameters,
    motion: &Motion,
    command: &str,
) -> Result<()> {
    let from = original.path();
    for name in ["mesh.obj", "mesh.mtl", "texture.png", "config.json"] {
        copy(&from.join(name), &folder.join(name))?;
    }
    if original.material()?.is_some() {
        copy_folder(&from.join("material"), &folder.join("material"))?;
    }
    io::npy::write_field(&folder.join("motion.npy"), motion)?;
    io::npy::write_field(&folder.join("forces.npy"), &parameters.accelerations.dynamic)?;
    let mut file: ParameterFile = read_json(&from.join("parameters.json"))?;
    file.constant_force.value = parameters.accelerations.constant.to_array();
    if let Some(found) = &original.found {
        copy(&from.join("rest_lengths.npy"), &folder.join("rest_lengths.npy"))?;
        let changed = [0, 1, 2].map(|k| parameters.log_stiffness[k] - original.parameters.log_stiffness[k]);
        if let Some(causes) = &mut file.causes {
            causes.scale(found, changed);
        }
    }
    let file = parameters_in(file, parameters, &original.run.settings.dynamics);
    write_json(&folder.join("parameters.json"), &file)?;
    let remark = format!("motion: simulated from {}, not found in a video", from.display());
    Log { commands: vec![command.to_owned()], warnings: vec![remark], timings: Vec::new() }.write(folder)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let bytes = std::fs::read(from).map_err(|e| {
        Error::input(from.display().to_string(), format!("cannot be read: {e}"), super::UNCHANGED)
    })?;
    io::atomic_write(to, &bytes)
}

/// The files of a folder, none of which is a folder.
fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    std::fs::create_dir_all(to).map_err(|source| Error::Output { path: to.to_path_buf(), source })?;
    for entry in from.read_dir().into_iter().flatten().flatten().filter(|entry| entry.path().is_file()) {
        // Its history is that of the estimation, which belongs to the other folder.
        if entry.file_name() != "history.csv" {
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
    }
    Ok(())
}
