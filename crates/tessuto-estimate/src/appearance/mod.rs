//! Material and light from a video whose motion is known.
//!
//! [`fit()`] goes through the files here: `observations` (what the pixels see, once), `texels` with `surfaces` or
//! `decoded` (the maps as they are optimised) and `environment_parameters` (the light as it is optimised), with
//! `loss` between them, weighted by `patch_weights`; `sharpen` finishes the diffuse map. [`rerender()`] draws the
//! frames again. [`gather()`] lays the colours of all frames on the cloth, without taking light and cloth apart.
//!
//! Where the fabric's two sides differ, the maps are those of the front, and pixels that show the other side count
//! nothing in them; one colour there has an albedo of its own (`back`).
//!
//! Almost only the product of cloth and light is in the images. What separates them is a prior: how
//! bright fabrics are, how tinted light is (`albedo_scale`), and that one ink or yarn shines alike and is seldom
//! metal (`regions`).

mod albedo_scale;
mod back;
#[cfg(feature = "decoder")]
mod decoded;
mod environment_parameters;
mod fit;
mod gains;
mod loss;
mod metal_colour;
mod observations;
mod patch_weights;
mod print;
mod read;
mod regions;
mod relight;
mod rerender;
mod seen;
mod settings;
mod sharpen;
mod splat;
mod surfaces;
mod texels;
mod window;
mod write;

pub use albedo_scale::AlbedoScale;
pub use fit::{Appearance, fit};
pub use print::{Print, gather};
pub use read::read_material;
pub use relight::{evaluate, studio};
pub use rerender::{Rerendered, rerender};
pub use seen::{DIRECTION_ROWS, Seen};
pub use settings::{AppearanceSettings, MapPrior};
pub use window::Window;
pub use write::write_material;
