//! Where the bytes come from.

use std::io::{Read, Seek};

/// A file, or what stands for one.
pub(crate) trait Source: Read + Seek + Send {}

impl<T: Read + Seek + Send> Source for T {}
