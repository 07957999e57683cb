//! Material and light of a motion that is known.

use std::path::PathBuf;

use pyo3::prelude::*;
use tessuto::run::appearance::{AppearanceOptions, MotionSource, run_loaded};

use crate::observer::Listener;
use crate::scene::Scene;

/// Estimates material and light of `scene` into `folder`; returns the mean PSNR of the re-rendered frames `[dB]`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "what an estimate can be given")]
pub fn appearance(
    py: Python<'_>,
    scene: &Scene,
    folder: PathBuf,
    true_motion: bool,
    settings: Vec<String>,
    seed: Option<u64>,
    command: String,
    on_step: Option<Py<PyAny>>,
) -> PyResult<f64> {
    let motion = if true_motion { MotionSource::Truth } else { MotionSource::Result };
    let options = AppearanceOptions { motion, changes: settings, seed, command };
    let mut listener = Listener::new(on_step);
    let finished = py.detach(|| run_loaded(&scene.loaded, &scene.place, &folder, &options, &mut listener));
    listener.outcome(py, finished).map(|outcome| outcome.psnr)
}
