//! Results for other programs.

mod blender;
mod documented;
mod fabric;
mod files;
mod gaps;
mod path;
#[cfg(feature = "rerun")]
mod rrd;
mod sides;
mod simulators;
