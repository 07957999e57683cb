//! Scenes of [tessuto](https://docs.rs/tessuto): a folder of frames, masks, a camera and the fabric's shape in the
//! first frame. Whoever wants to reconstruct them depends on `tessuto`, where all of this has the same names.
//!
//! - [`io::scene`]: reads a folder, and writes one; [`io`]: the files themselves;
//! - [`import`]: a folder from what a camera filmed; [`template`]: the first frame's shape;
//! - [`synth`]: scenes with known truth.
//!
//! ```
//! use tessuto_core::Error;
//! use tessuto_scene::{io::scene, synth};
//!
//! // A small scene with known truth.
//! let settings = synth::Settings::default().with(|s| {
//!     s.frames = 3;
//!     s.size = 64; // px
//!     s.grid = [5, 5]; // vertices
//! });
//! let made = synth::make(&settings)?;
//!
//! // As a folder, and back.
//! let folder = std::env::temp_dir().join(format!("tessuto-scene-{}", std::process::id()));
//! synth::write::write(&folder, &made, &settings)?;
//! let read = scene::load(&folder, &scene::LoadOptions::default())?;
//! assert_eq!(read.scene.frames.len(), 3);
//! # std::fs::remove_dir_all(&folder).unwrap();
//! # Ok::<(), Error>(())
//! ```

pub mod import;
pub mod io;
#[doc(hidden)]
pub mod output;
pub mod synth;
pub mod template;
