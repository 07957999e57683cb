//! The frames of a scene: held in memory, or read from their files each time they are asked for.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::error::Result;
use crate::image::Image;

/// One video frame, cut to the scene's crop.
#[derive(Debug, Clone)]
pub struct Frame {
    /// sRGB-encoded colour in [0, 1], shape [height, width, 3]; black where there is no fabric.
    pub rgb: Image,
    /// Fraction of the pixel that is fabric, in [0, 1], shape [height, width, 1].
    pub mask: Image,
}

/// A pixel is fabric if so large a part of it is.
pub const COVERED: f32 = 0.5;

/// Makes frame `n`.
type Reader = dyn Fn(usize) -> Result<Frame> + Send + Sync;

/// All frames, in order.
#[derive(Clone)]
pub struct Video {
    /// Where its first frame is in the source.
    start: usize,
    frame_count: usize,
    /// How many frames are worked on at once.
    together: usize,
    source: Source,
}

#[derive(Clone)]
enum Source {
    /// Scenes that differ in their template alone have them in common.
    Held(Arc<Vec<Frame>>),
    Streamed(Arc<Reader>),
}

/// Videos of more bytes than this are read again from their files instead of held.
pub const HELD_BYTES: usize = 1 << 29;
/// Bytes of one pixel of a [`Frame`].
pub const PIXEL_BYTES: usize = 16;
/// Bytes per pixel of a frame and of what is computed from it while it is worked on, about.
const WORKING_BYTES: usize = 60;

impl Video {
    /// A video of `frame_count` frames of `pixel_count` pixels that `read` makes whenever one is needed. It must
    /// make the same ones each time.
    pub fn streamed(
        frame_count: usize,
        pixel_count: usize,
        read: impl Fn(usize) -> Result<Frame> + Send + Sync + 'static,
    ) -> Self {
        let together = (HELD_BYTES / (pixel_count * WORKING_BYTES).max(1)).max(1);
        Self { start: 0, frame_count, together, source: Source::Streamed(Arc::new(read)) }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frame_count
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.frame_count == 0
    }

    /// The frames, if they are held in memory.
    pub fn held(&self) -> Option<&[Frame]> {
        match &self.source {
            Source::Held(frames) => Some(&frames[self.start..self.start + self.frame_count]),
            Source::Streamed(_) => None,
        }
    }

    /// The frames of a `range` alone; the same memory or files.
    ///
    /// Panics if there are no such frames.
    pub fn span(&self, range: Range<usize>) -> Self {
        assert!(range.start <= range.end && range.end <= self.frame_count, "frames {range:?}");
        Self { start: self.start + range.start, frame_count: range.len(), ..self.clone() }
    }

    /// As [`held`](Self::held), to change them.
    pub fn held_mut(&mut self) -> Option<&mut [Frame]> {
        match &mut self.source {
            Source::Held(frames) => {
                Some(&mut Arc::<Vec<Frame>>::make_mut(frames)[self.start..self.start + self.frame_count])
            }
            Source::Streamed(_) => None,
        }
    }

    /// Frame `n`, counted from the first one of this video.
    ///
    /// Panics if there is no such frame.
    ///
    /// # Errors
    /// None if it is held; otherwise those of reading it.
    pub fn frame(&self, n: usize) -> Result<Cow<'_, Frame>> {
        assert!(n < self.frame_count, "frame {n} of {}", self.frame_count);
        match &self.source {
            Source::Held(frames) => Ok(Cow::Borrowed(&frames[self.start + n])),
            Source::Streamed(read) => read(self.start + n).map(Cow::Owned),
        }
    }

    /// `f` of the number of every frame in `range`, on all cores; of long videos only as many frames at once as memory
    /// has room for. `init` makes what a thread keeps from one frame to the next.
    ///
    /// # Errors
    /// That of the lowest frame for which `f` fails.
    pub fn map<S, T: Send>(
        &self,
        range: Range<usize>,
        init: impl Fn() -> S + Send + Sync,
        f: impl Fn(&mut S, usize) -> Result<T> + Send + Sync,
    ) -> Result<Vec<T>> {
        let mut out = Vec::with_capacity(range.len());
        for start in range.clone().step_by(self.together) {
            let numbers = start..(start + self.together).min(range.end);
            let results: Vec<Result<T>> = numbers.into_par_iter().map_init(&init, &f).collect();
            for result in results {
                out.push(result?);
            }
        }
        Ok(out)
    }
}

impl From<Vec<Frame>> for Video {
    fn from(frames: Vec<Frame>) -> Self {
        Self {
            start: 0,
            frame_count: frames.len(),
            together: frames.len().max(1),
            source: Source::Held(Arc::new(frames)),
        }
    }
}

impl FromIterator<Frame> for Video {
    fn from_iter<I: IntoIterator<Item = Frame>>(frames: I) -> Self {
        frames.into_iter().collect::<Vec<_>>().into()
    }
}

impl std::fmt::Debug for Video {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let how = if self.held().is_some() { "held" } else { "streamed" };
        write!(f, "Video of {} frames, {how}", self.frame_count)
    }
}
