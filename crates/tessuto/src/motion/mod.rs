//! From pixels to motion.

pub mod contour;
pub mod photometry;
pub mod pyramid;
pub mod surface;
pub mod trajectory;
