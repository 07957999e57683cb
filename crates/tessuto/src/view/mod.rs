//! The cloth from elsewhere and under another light.

mod looks;
mod viewpoint;

pub use looks::{depth_range, draw_depth, draw_shaded, draw_texture};
pub use viewpoint::Viewpoint;
