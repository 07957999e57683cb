//! Files in and out: scenes, images, meshes, arrays. Every file is written through [`atomic_write`].

mod atomic;
pub mod depth;
pub mod hdr;
pub mod image;
pub mod jpeg;
pub mod model;
pub mod npy;
pub mod obj;
pub mod scene;
pub(crate) mod zip;

pub use atomic::atomic_write;
pub use image::mask;

use std::path::Path;

use crate::error::{Error, Result};

/// Largest JSON or CSV file of a result `[bytes]`.
const MAX_TEXT: u64 = 256 << 20;

/// The text in the file at `path`.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read_bounded(path, MAX_TEXT)?).map_err(|e| {
        Error::input(path.display().to_string(), format!("is not UTF-8 text: {e}"), "save it as UTF-8")
    })
}

/// The whole file at `path`, refused above `limit` bytes.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let unreadable = |source: std::io::Error| {
        Error::input(
            path.display().to_string(),
            format!("cannot be read: {source}"),
            "check the path, and that you may read the file",
        )
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(Error::input(path.display().to_string(), "is not a file", "put a regular file there"));
    }
    if metadata.len() > limit {
        return Err(Error::input(
            path.display().to_string(),
            format!("has {} bytes; at most {limit} are read", metadata.len()),
            "check that this is the right file; shrink or split it",
        ));
    }
    std::fs::read(path).map_err(unreadable)
}
