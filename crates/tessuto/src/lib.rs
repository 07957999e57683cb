//! Recover a fabric's 3D motion, texture, material and light from one ordinary video, on the CPU, the same bytes
//! every time; with the stiffness, forces and standard deviations of an estimate of its physics.
//!
//! A scene is a folder of frames, masks, a camera and the fabric's shape in the first frame, made by
//! [`import`] and [`template`] or from scratch by [`synth`]. [`run::run`] goes from there to a result folder, as the
//! program `tessuto` does; [`reconstruct()`] finds the motion alone, in memory:
//!
//! ```
//! use tessuto::config::Preset;
//! use tessuto::session::Session;
//! use tessuto::{Config, reconstruct, synth};
//!
//! // A small scene with known truth; scenes on disk come from `tessuto::io::scene::load`.
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
//!
//! let truth = scene.truth.vertices.as_ref().expect("made with truth");
//! let errors = found.motion[2].iter().zip(&truth[2]).map(|(p, q)| p.distance(*q));
//! println!("largest error in the last frame: {:.1} mm", 1e3 * errors.fold(0.0, f64::max));
//! # Ok::<(), tessuto::Error>(())
//! ```
//!
//! The whole run, and what it left:
//!
//! ```no_run
//! use std::path::Path;
//!
//! use tessuto::config::Preset;
//! use tessuto::run::{RunOptions, Silent, run};
//! use tessuto::{Config, result};
//!
//! let options = RunOptions::new(Config::preset(Preset::Default));
//! let outcome = run(Path::new("scenes/curtain"), Path::new("results/curtain"), &options, &mut Silent)?;
//! if let Some(verdict) = &outcome.summary.verdict {
//!     println!("{}", verdict.sentence);
//! }
//!
//! let folder = result::Folder::open(Path::new("results/curtain"))?;
//! println!("{} frames", folder.motion()?.len());
//! # Ok::<(), tessuto::Error>(())
//! ```
//!
//! # The blocks
//!
//! [`sim`], [`raster`] and [`pbr`] are differentiable each by itself: a function f and its adjoint `f_vjp`, which
//! takes the gradient of a loss by f's results to gradients by its arguments. Each module begins with an example.
//! They are crates of their own: [`tessuto_sim`], [`tessuto_render`], on [`tessuto_core`]; the methods are
//! [`tessuto_estimate`]. Here they have shorter names, and what is not shown here is found there.
//!
//! # Conventions
//!
//! The world is the OpenCV camera frame (x right, y down, z forward) of the first frame in metres, seconds and
//! kilograms; a [`Viewpoint`] is the way from its points to pixels. The centre of pixel (column i, row j) is at
//! (i, j); images hold sRGB-encoded colour in `[0, 1]`; vectors are those of [`glam`], in f64. Errors say what is
//! wrong, where, and what to do: [`Error`].

#[doc(hidden)]
pub mod card;
#[doc(hidden)]
pub mod check;
#[doc(hidden)]
pub mod compare;
pub mod export;
#[doc(hidden)]
pub mod report;
pub mod result;
pub mod run;
#[doc(hidden)]
pub mod view;

#[doc(no_inline)]
pub use tessuto_core::glam;
#[doc(inline)]
pub use tessuto_core::{
    Back, Camera, Depths, Error, Frame, Hint, Image, Known, Mesh, Motion, Plane, Pose, PoseUnit, Positions,
    Rect, Remedy, Repair, Result, Scene, Tracks, Truth, Video, View, Viewpoint, Warning,
};
#[doc(hidden)]
pub use tessuto_core::{math, mesh, processor, settings, text};
#[doc(inline)]
pub use tessuto_estimate::{Config, Reconstruction, reconstruct, simulate};
#[doc(hidden)]
pub use tessuto_estimate::{appearance, import, masks, motion, output, template};
#[doc(no_inline)]
pub use tessuto_estimate::{config, io, metrics, session, synth};
#[doc(hidden)]
#[cfg(feature = "decoder")]
pub use tessuto_render::decoder;
#[doc(no_inline)]
pub use tessuto_render::{pbr, raster};
#[doc(no_inline)]
pub use tessuto_sim as sim;
#[doc(hidden)]
#[cfg(feature = "decoder")]
pub use tessuto_sim::training;
