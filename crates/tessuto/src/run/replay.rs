//! A recovered motion, simulated again from its parameters and forces alone, or with changed ones.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::mesh::Motion;
use crate::motion::parameters::Parameters;
use crate::output::OutputFolder;
use crate::reconstruct::simulate;
use crate::result::{self, Folder, Summary};
use crate::sim::Cloth;

/// What shall be different.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Changes {
    /// Other stretch `[N/m]`, bend and shear `[J/rad²]` stiffness.
    pub stiffness: [Option<f64>; 3],
    /// Factor on the dynamic forces.
    pub forces: f64,
}

impl Default for Changes {
    fn default() -> Self {
        Self { stiffness: [None; 3], forces: 1.0 }
    }
}

/// A simulated motion and what makes it.
#[derive(Debug)]
pub struct Replay {
    /// Positions at every frame, shape [N, V].
    pub motion: Motion,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
}

/// Simulates `original` with `changes`.
///
/// # Errors
/// [`Error::Usage`] for a stiffness or factor that cannot be; [`Error::Numerical`] from the simulation.
pub fn replay(original: &Folder, changes: &Changes) -> Result<Replay> {
    let mut parameters = original.parameters.clone();
    for (k, value) in changes.stiffness.iter().enumerate() {
        let Some(value) = *value else { continue };
        if !(value.is_finite() && value > 0.0) {
            let problem = format!("{} = {value}", ["stretch", "bend", "shear"][k]);
            return Err(Error::usage(problem, "give a stiffness above 0"));
        }
        parameters.log_stiffness[k] = value.log10();
    }
    if !changes.forces.is_finite() {
        let problem = format!("forces scaled by {}: not a finite number", changes.forces);
        return Err(Error::usage(problem, "give a factor such as 0.5 or 2"));
    }
    parameters.accelerations.dynamic.iter_mut().flatten().for_each(|d| *d *= changes.forces);
    let (mesh, settings) = (&original.mesh, &original.run.settings);
    let motion = simulate(&Cloth::new(mesh), settings, original.fps, &mesh.positions, &parameters)?;
    Ok(Replay { motion, parameters })
}

/// Makes a result of `replay` in `folder`, with a page; `command` is what repeats it. Returns where an earlier folder is
/// kept because somebody put files into it meanwhile.
///
/// # Errors
/// [`Error::Input`] naming the file of `original` that cannot be read; [`Error::Output`].
pub fn write(
    original: &Folder,
    replay: &Replay,
    folder: OutputFolder,
    command: &str,
) -> Result<Option<PathBuf>> {
    result::write_replay(folder.partial(), original, &replay.parameters, &replay.motion, command)?;
    let written = Folder::open(folder.partial())?;
    Summary::of(&written)?.write(folder.partial())?;
    result::write_page(&written)?;
    folder.publish()
}
