//! The cloth from elsewhere and under another light.

mod looks;
mod painter;
mod viewpoint;

pub use painter::{Drawing, Lit, Painter};
pub use viewpoint::Viewpoint;
