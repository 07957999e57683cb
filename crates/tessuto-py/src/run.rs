//! The whole run.

use std::path::PathBuf;
use std::time::Duration;

use pyo3::prelude::*;
use tessuto::Config;
use tessuto::config::Preset;
use tessuto::run::{RunOptions, run_loaded};

use crate::error::{IntoPython as _, to_python};
use crate::observer::Listener;
use crate::scene::Scene;

/// Recovers the motion of `scene` into the folder `out`; a second value is the exception of what went wrong but cost
/// neither.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "what a run can be given")]
pub fn reconstruct(
    py: Python<'_>,
    scene: &Scene,
    out: PathBuf,
    preset: &str,
    settings: Vec<String>,
    seed: Option<u64>,
    appearance: bool,
    replace: bool,
    resume: bool,
    checkpoint: Option<f64>,
    command: String,
    on_step: Option<Py<PyAny>>,
) -> PyResult<Option<Py<PyAny>>> {
    let mut config = Config::preset(Preset::named(preset).into_python(py)?);
    config.set_all(settings.iter().map(String::as_str)).into_python(py)?;
    config.seed = seed.unwrap_or(config.seed);
    let checkpoint = match checkpoint.map(Duration::try_from_secs_f64).transpose() {
        Ok(checkpoint) => checkpoint,
        Err(error) => {
            let hint = "give seconds, or None for no checkpoints";
            return Err(to_python(py, &tessuto::Error::usage(format!("checkpoint: {error}"), hint)));
        }
    };
    let options = RunOptions { appearance, replace, resume, checkpoint, command, ..RunOptions::new(config) };
    let mut listener = Listener::new(on_step);
    let finished = py.detach(|| run_loaded(&scene.loaded, &scene.place, &out, &options, &mut listener));
    let outcome = listener.outcome(py, finished)?;
    Ok(outcome.failure.map(|failure| to_python(py, &failure).into_value(py).into_any()))
}
