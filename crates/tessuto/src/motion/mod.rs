//! From pixels to motion.

pub mod contour;
pub mod curvature;
mod divergence_guard;
pub mod loss;
pub mod material_fit;
pub mod observed;
pub mod photometry;
pub mod pyramid;
pub mod rollout_fit;
pub mod strain;
pub mod surface;
pub mod texture_fit;
pub mod tied_simulation;
pub mod trajectory;
mod trajectory_settings;
