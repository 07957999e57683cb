//! Recordings for the viewer of rerun (<https://rerun.io>), written while a reconstruction runs or from its result.
//!
//! Metres, camera axes (x right, y down, z forward). Timelines: `frame` (number in the video), `time` `[s]` of the
//! same rows, `step` (counts the finished steps of all stages). Entities:
//!
//! | entity | rows | content |
//! |---|---|---|
//! | `world/camera` | static | pinhole of the images below |
//! | `world/camera` | `frame` | where it is, if it moves |
//! | `world/camera/image` | `frame` | the video, JPEG |
//! | `world/cameras/NAME`, `world/cameras/NAME/image` | as above | the same of every further camera, at its own `time` |
//! | `world/fabric` | `frame` | mesh; triangles, texture coordinates and texture are static |
//! | `world/fabric` | `step` | the last frame so far, a few times in every stage |
//! | `world/truth` | `frame` | measured points, some of them |
//! | `losses/STAGE/NAME`, `parameters/STAGE/NAME` | `step` | curves |
//!
//! The first V vertices of the mesh are those of the template; a vertex on a seam follows again for each of its
//! other texture coordinates. Every message goes to the writer as soon as it is made, and a stream may end after
//! any, so a killed run leaves a recording of what it has done. Nothing depends on the clock: the same input gives
//! the same bytes.

mod chunk;
mod index;
mod recording;
mod subject;
mod wire;
mod xxh32;

pub use recording::Recording;
pub use subject::{FrameImage, OtherEye, Subject};

use std::path::Path;

use sha2::{Digest, Sha256};

use super::Clip;
use tessuto_core::error::Result;

/// The recording of a finished motion.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) naming an image of the result that cannot be used.
pub(super) fn encode(clip: &Clip) -> Result<Vec<u8>> {
    let mut hash = Sha256::new();
    hash.update(format!("{} {:?} {:?} {}", clip.version, clip.mesh, clip.camera, clip.fps));
    if clip.frames.len() < clip.frame_count {
        hash.update(format!("{:?}", clip.frames));
    }
    if !clip.others.is_empty() {
        hash.update(format!("{:?}", clip.others));
    }
    clip.motion.iter().for_each(|positions| hash.update(bytemuck::cast_slice::<_, u8>(positions)));
    let id = format!("{}-{:x}", clip.name, hash.finalize());
    let mut out = Vec::new();
    let mut recording = Recording::begin(&mut out, Path::new(&clip.name), &id, &Subject::of_clip(clip)?)?;
    recording.motion_at(&clip.frames, &clip.motion)?;
    recording.texture(&clip.material.base_colour)?;
    recording.end()?;
    Ok(out)
}

/// Whether `start`, the first bytes of a file, are those of a recording that this module wrote.
pub fn is_ours(start: &[u8]) -> bool {
    // The name stands in the first message, after the recording's id.
    let name = wire::APPLICATION.as_bytes();
    start.starts_with(b"RRF2") && start.windows(name.len()).any(|w| w == name)
}
