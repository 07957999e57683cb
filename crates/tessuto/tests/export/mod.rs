//! Results for other programs.

mod files;
mod gaps;
#[cfg(feature = "rerun")]
mod rrd;
