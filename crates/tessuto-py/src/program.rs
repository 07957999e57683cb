//! The program itself.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program `tessuto` with `arguments`, the first of which is its name; returns its exit status.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| tessuto_cli::run(arguments))
}
