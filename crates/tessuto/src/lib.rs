//! Recover the 3D motion of a piece of fabric from one video, with effective forces and stiffness that replay it.
//!
//! Conventions, everywhere: the world is the OpenCV camera frame (x right, y down, z forward) in
//! metres, seconds and kilograms; the centre of pixel (column i, row j) is at (i, j); images hold
//! sRGB-encoded colour in [0, 1].

pub mod appearance;
pub mod camera;
pub mod check;
pub mod config;
#[cfg(feature = "decoder")]
pub mod decoder;
pub mod error;
pub mod export;
pub mod image;
pub mod import;
pub mod io;
pub mod math;
pub mod mesh;
pub mod metrics;
pub mod motion;
pub mod optim;
pub mod output;
pub mod pbr;
pub mod raster;
pub mod reconstruct;
pub mod report;
pub mod result;
pub mod run;
pub mod scene;
pub mod session;
pub mod settings;
pub mod sim;
pub mod synth;
pub mod template;
pub mod text;
pub mod video;
pub mod view;

pub use camera::{Camera, Rect};
pub use config::Config;
pub use error::{Error, Result};
pub use image::Image;
pub use mesh::{Mesh, Motion, Positions};
pub use reconstruct::{Reconstruction, reconstruct};
pub use scene::{Scene, Truth};
pub use video::{Frame, Video};
