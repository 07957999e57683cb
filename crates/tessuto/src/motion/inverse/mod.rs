//! From a motion to its causes: [`stiffness`] first, then the [`accelerations`] that lead a simulation along it.

pub mod accelerations;
pub mod stiffness;
