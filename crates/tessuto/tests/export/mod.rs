//! Results for other programs.

mod blender;
mod fabric;
mod files;
mod gaps;
#[cfg(feature = "rerun")]
mod rrd;
