//! What would have been otherwise, simulated before anybody asks.

use crate::result::{Folder, changes};
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::mesh::{Motion, Positions};
use tessuto_estimate::io;
use tessuto_estimate::motion::causes::{Changes, Otherwise, cut_cloth};

/// Writes changed/ into `result`, if it has causes: one motion of each of the changes that the page lets one play,
/// as `replay` makes it. One that fails is left out and reported.
///
/// # Errors
/// [`Error::Input`] for a damaged result; [`Error::Output`].
pub(super) fn write(result: &Folder) -> Result<Vec<Warning>> {
    let Some(found) = &result.found else { return Ok(Vec::new()) };
    let frames: Vec<Positions> = result.motion()?.iter().cloned().collect();
    let cut = cut_cloth(&result.mesh, &found.rest_lengths);
    let dynamics = result.run.settings.dynamics.at(result.fps);
    let folder = result.path().join("changed");
    std::fs::create_dir_all(&folder).map_err(|source| Error::Output { path: folder, source })?;
    let changes = changes(result.fps);
    let otherwise: Vec<Otherwise> = changes.iter().map(|change| change.otherwise).collect();
    let simulated = Changes::new(&cut, &dynamics, found, &frames).simulate_all(&otherwise);
    let mut warnings = Vec::new();
    for (change, guided) in changes.iter().zip(simulated) {
        match guided.failure {
            None => {
                let motion = Motion::new(guided.frames)?;
                io::npy::write_field(&result.path().join(change.file()), &motion)?;
            }
            Some(failure) => warnings.push(Warning {
                topic: "replays".into(),
                found: format!("“{}” is left out: its simulation ends. {failure}", change.label),
                hint: None,
            }),
        }
    }
    Ok(warnings)
}
