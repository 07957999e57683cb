//! The [`accelerations`] that lead a simulation along a motion.

pub(crate) mod accelerations;
