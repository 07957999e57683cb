//! Results for other programs.

mod files;
mod rrd;
