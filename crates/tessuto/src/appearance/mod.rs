//! Material and light from a video whose motion is known.
//!
//! [`fit`] goes through the files here: `observations` (what the pixels see, once), `texels` or `decoded` (the maps as they
//! are optimised) and `sky` (the light as it is optimised), with `loss` between them, weighted by `trust`.
//! [`rerender`] draws the frames again.
//!
//! Only the product of brightness of cloth and light is in the pictures: the light starts at a given radiance, and
//! the maps follow.

#[cfg(feature = "decoder")]
mod decoded;
mod fit;
mod loss;
mod observations;
mod read;
mod relight;
mod rerender;
mod settings;
mod sky;
mod texels;
mod trust;
mod window;
mod write;

pub use fit::{Appearance, fit};
pub use read::read_material;
pub use relight::{evaluate, relit_psnr, studio};
pub use rerender::{Rerendered, rerender};
pub use settings::{AppearanceSettings, MapPrior};
pub use window::Window;
pub use write::write_material;
