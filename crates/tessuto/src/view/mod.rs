//! The cloth from other viewpoints and under other environment maps.

mod film;
mod looks;
mod render;

pub use film::{Turn, View};
pub(crate) use looks::{depth_range, draw_depth, draw_shaded, draw_texture};
pub use render::{Look, RenderOptions, Rendered, render};
