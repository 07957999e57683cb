//! Material and light from a video whose motion is known.
//!
//! [`fit()`] goes through the files here: `observations` (what the pixels see, once), `texels` or `decoded` (the maps as they
//! are optimised) and `environment_parameters` (the light as it is optimised), with `loss` between them, weighted by `patch_weights`.
//! [`rerender()`] draws the frames again.
//!
//! Only the product of brightness of cloth and light is in the images: the light starts at a given radiance, and
//! the maps follow.

#[cfg(feature = "decoder")]
mod decoded;
mod environment_parameters;
mod fit;
mod loss;
mod observations;
mod patch_weights;
mod read;
mod relight;
mod rerender;
mod settings;
mod texels;
mod window;
mod write;

pub use fit::{Appearance, fit};
pub use read::read_material;
pub use relight::{evaluate, studio};
pub use rerender::{Rerendered, rerender};
pub use settings::{AppearanceSettings, MapPrior};
pub use window::Window;
pub use write::write_material;
