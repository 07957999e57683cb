//! The external program ffmpeg.

use std::path::PathBuf;

/// The program that decodes and encodes videos: TESSUTO_FFMPEG, or ffmpeg in the search path.
pub fn ffmpeg() -> PathBuf {
    let set = std::env::var_os("TESSUTO_FFMPEG").filter(|path| !path.is_empty());
    set.map_or_else(|| PathBuf::from("ffmpeg"), PathBuf::from)
}
