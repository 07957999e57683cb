//! A video file, looked at and ready to be decoded.

use std::path::{Path, PathBuf};

use crate::doors::{expect_file, expect_no_list};
use crate::ffmpeg::{Frames, Programs};
use crate::ffprobe;
use crate::refusal::Refusal;
use crate::stream::Stream;

/// How a file is opened.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The program ffmpeg; ffprobe is looked for beside it.
    pub ffmpeg: &'a Path,
    /// Longest side of a frame `[px]`.
    pub max_side: usize,
    /// Most memory that one frame may take, three bytes a pixel `[bytes]`.
    pub max_bytes: u64,
    /// Most time stamps that are read; longer films are refused unless only their first [`end`](Self::end) frames are wanted.
    pub max_frames: usize,
    /// Number of the first frame, as stored, that is not wanted; all are where `None`.
    pub end: Option<usize>,
}

impl Options<'_> {
    /// Refuses frames of a size that takes too much memory, before any is taken.
    ///
    /// # Errors
    /// [`Refusal`] with both sizes.
    pub fn expect_size(&self, [width, height]: [usize; 2]) -> Result<(), Refusal> {
        let bytes = (width as u64).saturating_mul(height as u64).saturating_mul(3);
        if bytes > self.max_bytes {
            return Err(Refusal::new(
                format!("{width}×{height} pixels take {bytes} bytes; at most {} are read", self.max_bytes),
                "make the film smaller first, e.g. ffmpeg -i IN -vf scale=1920:-2 OUT.mp4",
            ));
        }
        if width.max(height) > self.max_side || width.min(height) < 2 {
            return Err(Refusal::new(
                format!("{width}×{height} pixels; sides of 2 to {} are read", self.max_side),
                "make the film smaller first, e.g. ffmpeg -i IN -vf scale=1920:-2 OUT.mp4",
            ));
        }
        Ok(())
    }

    /// Most pixels of a frame.
    pub(crate) fn max_pixels(&self) -> u64 {
        // As large as the programs take it.
        (self.max_bytes / 3).min(i32::MAX as u64)
    }
}

/// One frame, 8-bit sRGB as encoded, shape [height, width, 3], upright.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Width and height `[px]`.
    pub size: [usize; 2],
    /// The colours.
    pub rgb: Vec<u8>,
}

/// What decodes a film. Readers that need no other program find their place here.
#[derive(Clone, Debug)]
enum Backend {
    Ffmpeg(Programs),
}

/// The film in a video file.
#[derive(Clone, Debug)]
pub struct Film {
    /// What the container says of it.
    pub stream: Stream,
    /// Number of stored frames that a player shows; those of a damaged file may be fewer.
    pub stored: usize,
    /// What a user should know of the file.
    pub notes: Vec<String>,
    path: PathBuf,
    backend: Backend,
}

/// Looks at the video file at `path`. Of several films in it the one that a player shows is taken.
///
/// # Errors
/// [`Refusal`] of what is no regular file or a list of files, holds no film, is too large, changes its size where that can be told
/// without decoding, or needs a program that is not there.
pub fn open(path: &Path, options: &Options) -> Result<Film, Refusal> {
    expect_file(path)?;
    expect_no_list(path)?;
    // The one place to choose who reads and decodes.
    let programs = Programs::beside(options.ffmpeg);
    let look = ffprobe::look(path, programs, options)?;
    let backend = Backend::Ffmpeg(look.programs);
    Ok(Film {
        stream: look.stream,
        stored: look.stored,
        notes: look.notes,
        path: path.to_path_buf(),
        backend,
    })
}

/// Names and values of the metadata of a video file and of its tracks; `None` where it cannot be read.
pub fn tags(path: &Path, options: &Options) -> Option<Vec<(String, String)>> {
    expect_file(path).and_then(|()| expect_no_list(path)).ok()?;
    ffprobe::tags(path, &Programs::beside(options.ffmpeg), options)
}

impl Film {
    /// The frames up to `end`, in the order in which they are shown, each once; of interlaced film each moment is one.
    ///
    /// # Errors
    /// [`Refusal`] if the decoder cannot be started.
    pub fn frames(&self, end: Option<usize>, options: &Options) -> Result<Frames, Refusal> {
        match &self.backend {
            Backend::Ffmpeg(programs) => Frames::start(&self.path, programs, &self.stream, end, options),
        }
    }
}
