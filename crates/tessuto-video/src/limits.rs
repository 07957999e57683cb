//! What a file may ask for before anything is taken.

use crate::refused::{Refused, not_handled};

/// Bounds that hold before memory is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest side of a frame `[px]`.
    pub side: usize,
    /// Largest decoded frame, its three planes `[bytes]`.
    pub frame_bytes: u64,
    /// Most frames of a film.
    pub frames: usize,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits { side: 16_384, frame_bytes: 256 << 20, frames: 1_000_000 }
    }
}

impl Limits {
    /// Refuses frames of `size` with `samples` stored values of `bits` bits each.
    pub(crate) fn check_frame(&self, size: [usize; 2], samples: u64, bits: u32) -> Result<(), Refused> {
        let [width, height] = size;
        if width == 0 || height == 0 || width > self.side || height > self.side {
            return too_large(format!("frames of {width}×{height} px; sides of 1 to {} are read", self.side));
        }
        let bytes = samples.saturating_mul(if bits > 8 { 2 } else { 1 });
        if bytes > self.frame_bytes {
            return too_large(format!("frames of {bytes} bytes; up to {} are read", self.frame_bytes));
        }
        Ok(())
    }

    /// Refuses more frames than are read.
    pub(crate) fn check_count(&self, count: u64) -> Result<(), Refused> {
        if count > self.frames as u64 {
            return not_handled(format!("{count} frames; up to {} are read", self.frames));
        }
        Ok(())
    }
}

fn too_large(what: String) -> Result<(), Refused> {
    Err(Refused::TooLarge(what))
}
