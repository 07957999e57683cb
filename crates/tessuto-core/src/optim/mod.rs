//! First-order optimisation of groups of parameters.

pub mod adam;
pub mod clip;

pub use adam::Adam;
pub use clip::GradientClip;
