//! Why a file is not read, and the way out.

use std::fmt;
use std::ops::Range;

/// Why a file, or a frame of it, is not read. It does not name the file: who opened it knows its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What was found.
    pub what: String,
    /// What can be done.
    pub way_out: String,
    /// Frames that can be taken instead, counted from 0.
    pub part: Option<Range<usize>>,
    /// Whether a program is missing.
    pub(crate) lacks_program: bool,
}

impl Refusal {
    /// Of what was found and what can be done.
    pub fn new(what: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self { what: what.into(), way_out: way_out.into(), part: None, lacks_program: false }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.way_out)
    }
}

impl std::error::Error for Refusal {}
