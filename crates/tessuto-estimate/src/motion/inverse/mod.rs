//! From a motion to its causes: [`stiffness`] first, then the [`accelerations`] that lead a simulation along it.

pub(crate) mod accelerations;
pub(crate) mod stiffness;
