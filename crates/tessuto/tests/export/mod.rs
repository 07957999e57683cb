//! Results for other programs.

mod blender;
mod files;
mod gaps;
#[cfg(feature = "rerun")]
mod rrd;
