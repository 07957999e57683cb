//! Python hears of a run, and may end it.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tessuto::run::{Observer, Stage};
use tessuto::session::{self, Epoch};
use tessuto::{Error, Image, Positions, Result, Scene, Warning};

use crate::error::to_python;
use crate::remedy;

/// Reports every step to the callback, what is odd to Python's `warnings`, and looks for Ctrl-C at every step.
pub struct Listener {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
    stages: Vec<Stage>,
    current: usize,
}

impl Listener {
    /// `callback(stage, step, of, progress, losses, parameters)` is called with every step.
    pub fn new(callback: Option<Py<PyAny>>) -> Self {
        Self { callback, raised: None, stages: Vec::new(), current: 0 }
    }

    /// The result of a run that this heard of: what Python raised during it goes before what the library made of it.
    pub fn outcome<T>(&mut self, py: Python<'_>, result: Result<T>) -> PyResult<T> {
        match self.raised.take() {
            Some(raised) => Err(raised),
            None => result.map_err(|error| to_python(py, &error)),
        }
    }

    /// Calls back, unless something was raised before.
    fn report(&mut self, epoch: &Epoch) {
        if self.raised.is_some() {
            return;
        }
        let of_stage = epoch.step as f64 / epoch.of.max(1) as f64;
        let progress = self.fraction(of_stage);
        let called = Python::attach(|py| {
            py.check_signals()?;
            let Some(callback) = &self.callback else { return Ok(()) };
            let [losses, parameters] = [PyDict::new(py), PyDict::new(py)];
            epoch.losses.iter().try_for_each(|(name, value)| losses.set_item(&**name, value))?;
            epoch.parameters.iter().try_for_each(|(name, value)| parameters.set_item(&**name, value))?;
            callback.call1(py, (&*epoch.stage, epoch.step, epoch.of, progress, losses, parameters))?;
            Ok(())
        });
        self.raised = called.err();
    }

    /// Part of the run that is done.
    fn fraction(&self, of_stage: f64) -> f64 {
        let total: f64 = self.stages.iter().map(|stage| stage.weight).sum();
        let before: f64 = self.stages.iter().take(self.current).map(|stage| stage.weight).sum();
        let present = self.stages.get(self.current).map_or(0.0, |stage| stage.weight);
        if total > 0.0 { (before + of_stage * present) / total } else { 0.0 }
    }
}

impl session::Observer for Listener {
    fn stage(&mut self, name: &str) {
        if let Some(k) = self.stages.iter().position(|stage| stage.name == name) {
            self.current = k;
        }
    }

    fn advance(&mut self, done: usize, of: usize) {
        let stage = self.stages.get(self.current).map_or("", |stage| stage.name);
        self.report(&Epoch { stage: stage.into(), step: done, of, ..Epoch::default() });
    }

    fn step(&mut self, epoch: &Epoch, _motion: &[Positions]) -> Result<()> {
        self.report(epoch);
        match self.raised {
            Some(_) => {
                let Epoch { stage, step, of, .. } = epoch;
                Err(Error::Interrupted(format!("stopped in stage {stage}, step {step} of {of}")))
            }
            None => Ok(()),
        }
    }
}

impl Observer for Listener {
    fn warning(&mut self, warning: &Warning) {
        let text = remedy::warning(warning);
        let told = Python::attach(|py| {
            py.import("tessuto._errors")?.call_method1("warn", (text,))?;
            Ok(())
        });
        if let Err(error) = told {
            self.raised.get_or_insert(error);
        }
    }

    fn begin(&mut self, _: &Scene, _: &tessuto::result::Run, stages: &[Stage], _: &[Epoch]) -> Result<()> {
        self.stages = stages.to_vec();
        // A warning may have been made an error.
        match self.raised {
            Some(_) => Err(Error::Interrupted("before the first stage".to_owned())),
            None => Ok(()),
        }
    }

    fn motion(&mut self, _motion: &[Positions], _texture: &Image) {}
}
