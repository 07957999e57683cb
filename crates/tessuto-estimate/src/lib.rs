//! From one video of fabric to its 3D motion, material and light: the methods of
//! [tessuto](https://docs.rs/tessuto), and what reads, makes and measures their scenes. Whoever wants result
//! folders, reports and exports as well depends on `tessuto`, where all of this has the same names.
//!
//! - [`reconstruct()`]: positions of all frames, the forces and stiffness that replay them; [`appearance`]:
//!   material and light;
//! - [`io::scene`], [`synth`], [`import`], [`template`], [`masks`]: scenes from a folder, made up, or from what a
//!   camera filmed;
//! - [`metrics`]: errors against the truth, and without one, how far the result is to be trusted;
//! - [`config`], [`session`]: all settings; progress and checkpoints.
//!
//! ```
//! use tessuto_core::Error;
//! use tessuto_estimate::config::{Config, Preset};
//! use tessuto_estimate::session::Session;
//! use tessuto_estimate::{reconstruct, synth};
//!
//! // A small scene with known truth.
//! let settings = synth::Settings::default().with(|s| {
//!     s.frames = 3;
//!     s.size = 64; // px
//!     s.grid = [5, 5]; // vertices
//! });
//! let scene = synth::make(&settings)?;
//!
//! let mut config = Config::preset(Preset::Default);
//! config.set("spacetime.iterations=4")?;
//! config.set("texture.size=64")?;
//! let found = reconstruct(&scene, &config, &mut Session::silent())?;
//! assert_eq!(found.motion.len(), 3);
//! # Ok::<(), Error>(())
//! ```

pub mod appearance;
pub mod config;
pub mod masks;
pub mod metrics;
pub mod motion;
mod reconstruct;
pub mod session;

pub use config::Config;
pub use reconstruct::{Reconstruction, reconstruct, simulate};
#[doc(hidden)]
pub use tessuto_scene::{import, io, output, synth, template};
