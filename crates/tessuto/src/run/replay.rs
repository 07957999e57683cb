//! A recovered motion, simulated again from its parameters and forces alone, or with changed ones.

use std::path::PathBuf;

use crate::result::{self, Folder, Summary};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Motion};
use tessuto_estimate::motion::causes::{self, Otherwise};
use tessuto_estimate::motion::parameters::Parameters;
use tessuto_estimate::output::OutputFolder;
use tessuto_estimate::simulate;
use tessuto_sim::Cloth;
use tessuto_sim::contact::ContactSettings;

/// What shall be different.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// Other values of properties of the elastic model, by their keys: of springs stretch `[N/m]`, bend and shear
    /// `[J/rad²]`.
    pub stiffness: Vec<(String, f64)>,
    /// Factor on the dynamic forces, whatever their cause.
    pub forces: f64,
    /// Other causes; only of results with causes.
    pub otherwise: Otherwise,
    /// What the cloth touches, in place of nothing: its own layers, bodies.
    pub contact: Option<ContactSettings>,
}

impl Default for Changes {
    fn default() -> Self {
        Self { stiffness: Vec::new(), forces: 1.0, otherwise: Otherwise::default(), contact: None }
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
    let known = parameters.model.properties();
    let mut changed = vec![None; known.len()];
    for (key, value) in &changes.stiffness {
        let Some(k) = known.iter().position(|p| p.key == key) else {
            let keys: Vec<&str> = known.iter().map(|p| p.key).collect();
            let hint = format!("the properties of this result's cloth are: {}", keys.join(", "));
            return Err(Error::usage(format!("{key} = {value}: no such property"), hint));
        };
        if !(value.is_finite() && *value > 0.0) {
            return Err(Error::usage(format!("{key} = {value}"), "give a value above 0"));
        }
        changed[k] = Some(*value);
        parameters.log_stiffness[k] = value.log10();
    }
    if !changes.forces.is_finite() {
        let problem = format!("forces scaled by {}: not a finite number", changes.forces);
        return Err(Error::usage(problem, "give a factor such as 0.5 or 2"));
    }
    let (mesh, settings) = (&original.mesh, &original.run.settings);
    let Some(found) = &original.found else {
        if changes.otherwise != Otherwise::default() {
            let place = original.path().display().to_string();
            let hint =
                "reconstruct the scene with the preset default, or change stiffnesses and forces as a whole";
            return Err(Error::input(place, "its forces are not known by their causes", hint));
        }
        parameters.accelerations.dynamic.iter_mut().flatten().for_each(|d| *d *= changes.forces);
        let cloth = touching(parameters.model.cloth(mesh), mesh, changes)?;
        let motion = simulate(&cloth, settings, original.fps, &mesh.positions, &parameters)?;
        return Ok(Replay { motion, parameters });
    };
    let cut = causes::cut_cloth(mesh, &found.rest_lengths);
    let mut otherwise = changes.otherwise;
    for (k, (value, own)) in changed.iter().zip(found.causes.stiffness()).enumerate() {
        otherwise.scale[k] *= value.map_or(1.0, |value| value / own);
    }
    check(&otherwise)?;
    if otherwise == Otherwise::default() && changes.contact.is_none() {
        parameters.accelerations.dynamic.iter_mut().flatten().for_each(|d| *d *= changes.forces);
        let motion = simulate(&cut, settings, original.fps, &mesh.positions, &parameters)?;
        return Ok(Replay { motion, parameters });
    }
    if changes.forces != 1.0 {
        let hint = "scale the wind alone, or all forces alone";
        return Err(Error::usage("forces scaled as a whole and by their causes", hint));
    }
    let dynamics = settings.dynamics.at(original.fps);
    let frames: Vec<_> = original.motion()?.iter().cloned().collect();
    let touching = touching(cut.clone(), mesh, changes)?;
    let changed = causes::Changes::new(&cut, &dynamics, found, &frames).touching(&touching);
    // With other things to touch the clip itself goes otherwise.
    let guided = match changes.contact {
        Some(_) => changed.simulate_anew(&otherwise),
        None => changed.simulate(&otherwise),
    };
    if let Some(failure) = guided.failure {
        return Err(failure);
    }
    let [stretch, bend, shear, _] = otherwise.scale.map(f64::log10);
    let log = original.parameters.log_stiffness.iter();
    parameters.log_stiffness = log.zip([stretch, bend, shear]).map(|(log, change)| log + change).collect();
    parameters.accelerations = guided.accelerations;
    Ok(Replay { motion: Motion::new(guided.frames)?, parameters })
}

/// `cloth` with what it shall touch.
fn touching(cloth: Cloth, mesh: &Mesh, changes: &Changes) -> Result<Cloth> {
    match &changes.contact {
        Some(contact) => cloth.with_contact(mesh, contact),
        None => Ok(cloth),
    }
}

/// Refuses factors that no cloth has.
fn check(otherwise: &Otherwise) -> Result<()> {
    let names = ["stretch", "bend", "shear", "drag"];
    if let Some(k) = otherwise.scale.iter().position(|s| !(s.is_finite() && *s > 0.0)) {
        let problem = format!("{} scaled by {}", names[k], otherwise.scale[k]);
        return Err(Error::usage(problem, "give a factor above 0"));
    }
    match [otherwise.air, otherwise.gravity].iter().all(|f| f.is_finite()) {
        true => Ok(()),
        false => Err(Error::usage("a factor that is no finite number", "give one such as 0.5 or 2")),
    }
}

/// Makes a result of `replay` in `folder`, with a page; `command` is what repeats it. Returns where an earlier
/// folder is kept because somebody has put files into it since.
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
