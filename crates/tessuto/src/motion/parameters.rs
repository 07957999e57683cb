//! What both methods end in: the parameters of a simulation, and how it is taken.

use serde::{Deserialize, Serialize};

use crate::sim::{Accelerations, StepSettings};

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

/// How the cloth moves: integrator, sub-steps and stiffnesses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// The integrator and its step.
    pub step: StepSettings,
    /// Sub-steps per frame.
    pub substeps: usize,
    /// Stretch, bend and shear stiffness.
    pub stiffness: [StiffnessRange; 3],
}

/// What moves the cloth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// log10 of stretch [N/m], bend [J/rad²], shear [J/rad²].
    pub log_stiffness: [f64; 3],
    /// External accelerations.
    pub accelerations: Accelerations,
}

impl Parameters {
    /// Stretch [N/m], bend [J/rad²], shear [J/rad²].
    pub fn stiffness(&self) -> [f64; 3] {
        self.log_stiffness.map(|k| 10f64.powf(k))
    }
}
