//! From pixels to motion.

pub mod contour;
pub mod curvature;
mod divergence_guard;
pub mod loss;
pub mod inverse::stiffness;
pub mod observed;
pub mod photometry;
pub mod pyramid;
pub mod rollout;
pub mod strain;
pub mod surface;
pub mod texture;
pub mod inverse;
pub mod trajectory;
mod trajectory_settings;
