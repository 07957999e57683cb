//! Files in and out: scenes, images, meshes, arrays. Every file is written through [`atomic_write`].

mod atomic;
mod codec;
pub mod depth;
pub mod depth_unit;
mod exr_depth;
pub mod hdr;
pub mod image;
pub mod jpeg;
pub mod model;
pub mod npy;
pub mod obj;
pub mod rgb8;
pub mod scene;
#[doc(hidden)]
pub mod table;
#[doc(hidden)]
pub mod text;
#[doc(hidden)]
pub mod zip;

pub use atomic::atomic_write;
pub use image::mask;
pub use text::read_text;

use std::path::Path;

use tessuto_core::error::{Error, Result};

/// Refuses pipes, devices and sockets, which cannot be read twice, or never end.
pub(crate) fn expect_file(path: &Path) -> Result<()> {
    tessuto_video::expect_file(path)
        .map_err(|refusal| Error::input(path.display().to_string(), refusal.what, refusal.way_out))
}

/// The whole file at `path`, refused above `limit` bytes.
///
/// # Errors
/// [`Error::Input`] naming the file.
#[doc(hidden)]
pub fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let unreadable = |source: std::io::Error| {
        Error::input(
            path.display().to_string(),
            format!("cannot be read: {source}"),
            "check the path, and that you may read the file",
        )
    };
    expect_file(path)?;
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
