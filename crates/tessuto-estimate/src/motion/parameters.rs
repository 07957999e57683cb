//! What both methods end in: the parameters of a simulation, and how it is taken.

use serde::{Deserialize, Serialize};

use tessuto_sim::{Accelerations, Cloth, Model, Property, StepSettings, Stiffness};

/// One uniform stiffness: start and bounds as log10.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StiffnessRange {
    /// log10 of the start.
    pub start: f64,
    /// log10 of the lower bound.
    pub low: f64,
    /// log10 of the upper bound.
    pub high: f64,
}

/// A stiffness nearer than this to a bound lies at it: log10.
const AT_BOUND: f64 = 1e-4;

impl StiffnessRange {
    /// The bound at which `log_k`, log10 of a stiffness, lies: `lower` or `upper`.
    pub fn bound_at(&self, log_k: f64) -> Option<&'static str> {
        let at = |bound: f64| (log_k - bound).abs() < AT_BOUND;
        if at(self.low) { Some("lower") } else { at(self.high).then_some("upper") }
    }
}

/// How the cloth moves: integrator, sub-steps, elastic model and stiffnesses.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics {
    /// The integrator and its step.
    pub step: StepSettings,
    /// Sub-steps per frame.
    pub substeps: usize,
    /// The elastic model.
    pub model: Model,
    /// Of its properties.
    pub stiffness: Vec<StiffnessRange>,
}

impl Dynamics {
    /// Of springs: stretch, bend and shear stiffness.
    ///
    /// # Panics
    /// With another model.
    pub fn springs(&self) -> [StiffnessRange; 3] {
        assert_eq!(self.model, Model::Springs);
        [self.stiffness[0], self.stiffness[1], self.stiffness[2]]
    }
}

/// What moves the cloth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// The elastic model.
    pub model: Model,
    /// log10 of the values of its properties.
    pub log_stiffness: Vec<f64>,
    /// External accelerations.
    pub accelerations: Accelerations,
}

impl Parameters {
    /// Those of a cloth of springs, of log10 of stretch [N/m], bend [J/rad²] and shear [J/rad²].
    pub fn of_springs(log_stiffness: [f64; 3], accelerations: Accelerations) -> Self {
        Self { model: Model::Springs, log_stiffness: log_stiffness.to_vec(), accelerations }
    }

    /// The values of the model's properties.
    pub fn stiffness(&self) -> Vec<f64> {
        self.log_stiffness.iter().map(|k| 10f64.powf(*k)).collect()
    }

    /// Stretch [N/m], bend [J/rad²] and shear [J/rad²]; `None` of another model than springs.
    pub fn springs(&self) -> Option<[f64; 3]> {
        (self.model == Model::Springs).then(|| self.stiffness().try_into().expect("three of springs"))
    }

    /// The model's properties with their values.
    pub fn properties(&self) -> impl Iterator<Item = (&'static Property, f64)> {
        self.model.properties().iter().zip(self.stiffness())
    }

    /// Every element's stiffness in `cloth`, which is of the same model.
    pub fn stiffness_of(&self, cloth: &Cloth) -> Stiffness {
        self.model.stiffness(cloth, &self.stiffness())
    }
}
