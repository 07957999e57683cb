//! Results for other programs.

mod blender;
mod documented;
mod fabric;
mod files;
mod gaps;
#[cfg(feature = "rerun")]
mod rrd;
