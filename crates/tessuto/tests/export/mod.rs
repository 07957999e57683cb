//! Results for other programs.

mod files;
#[cfg(feature = "rerun")]
mod rrd;
