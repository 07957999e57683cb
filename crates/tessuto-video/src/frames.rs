//! The frames of a film, whoever decodes them.

use std::path::{Path, PathBuf};

use crate::ffmpeg::Decoder;
use crate::film::{Backend, Frame, Options, behind, by_programs};
use crate::native::{self, Native, Refused};
use crate::refusal::Refusal;
use crate::stream::Stream;
use crate::turn::turned;

/// The way out of a film whose frames change.
pub(crate) const OTHER_PART: &str = "take the frames before, or cut it there and take the other part";

/// Frames, one after the other.
pub struct Frames {
    source: Source,
    complaint: Option<String>,
    /// Number of frames given.
    given: usize,
    path: PathBuf,
    ffmpeg: PathBuf,
    bounds: (usize, u64, usize),
    end: Option<usize>,
    turn: u32,
    size: [usize; 2],
}

enum Source {
    Native(Box<Native>),
    Ffmpeg(Box<Decoder>),
    Over,
}

impl Frames {
    /// Starts decoding.
    pub(crate) fn start(
        path: &Path,
        backend: &Backend,
        stream: &Stream,
        end: Option<usize>,
        options: &Options,
    ) -> Result<Self, Refusal> {
        let source = match backend {
            Backend::Native => {
                let native = native::open_within(path, options.limits());
                let gone = |e| {
                    Refusal::new(
                        format!("{e}, although it could be read before"),
                        "leave it as it is meanwhile",
                    )
                };
                Source::Native(Box::new(native.map_err(gone)?))
            }
            Backend::Ffmpeg(programs) => {
                Source::Ffmpeg(Box::new(Decoder::start(path, programs, stream, end, options)?))
            }
        };
        Ok(Self {
            source,
            complaint: None,
            given: 0,
            path: path.to_path_buf(),
            ffmpeg: options.ffmpeg.to_path_buf(),
            bounds: (options.max_side, options.max_bytes, options.max_frames),
            end,
            turn: stream.turn,
            size: stream.size,
        })
    }

    /// What the decoder complained of without giving up, once all frames are read.
    pub fn complaint(&self) -> Option<String> {
        let of_program = || match &self.source {
            Source::Ffmpeg(decoder) => decoder.complaint().map(|said| format!("ffmpeg complains: {said}")),
            _ => None,
        };
        self.complaint.clone().or_else(of_program)
    }

    /// The frame of the film decoded here, or ffmpeg in its place from the frame on that is refused here.
    fn next_here(&mut self, native: &mut Native) -> Option<Result<Frame, Refusal>> {
        match native.next_rgb()? {
            Ok(rgb) => Some(Ok(turned(Frame { size: self.size, rgb }, self.turn))),
            Err(ref refused @ (Refused::Changed(ref what) | Refused::Turned(ref what))) => {
                let changing =
                    if matches!(refused, Refused::Turned(_)) { "rotation" } else { "pixel format" };
                let what = format!("changes its {changing} at frame {}: {what}", self.given);
                let part = (self.given > 0).then_some(0..self.given);
                Some(Err(Refusal { part, ..Refusal::new(what, OTHER_PART) }))
            }
            Err(refused) => Some(match self.go_on(&refused) {
                Ok(frame) => return frame.map(Ok),
                Err(refusal) => Err(refusal),
            }),
        }
    }

    /// Lets ffmpeg decode what is left, and gives its first frame.
    fn go_on(&mut self, refused: &Refused) -> Result<Option<Frame>, Refusal> {
        let (max_side, max_bytes, max_frames) = self.bounds;
        let ffmpeg = self.ffmpeg.clone();
        let options = Options { ffmpeg: &ffmpeg, max_side, max_bytes, max_frames, end: self.end };
        // What was read before can still be taken.
        let part = (self.given > 0).then_some(0..self.given);
        let told = |refusal: Refusal| {
            let part = refusal.part.clone().or(part.clone());
            Refusal { part, ..behind(refused, refusal) }
        };
        let film = by_programs(&self.path, &options, Some(refused.clone())).map_err(&told)?;
        let mut rest = film.frames(self.end, &options).map_err(&told)?;
        for frame in rest.by_ref().take(self.given) {
            frame?;
        }
        if matches!(refused, Refused::Damaged(_)) {
            self.complaint = Some(format!("the film {refused}; ffmpeg reads the rest"));
        }
        self.source = rest.source;
        self.next().transpose()
    }
}

impl Iterator for Frames {
    type Item = Result<Frame, Refusal>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.end.is_some_and(|end| self.given >= end) && !matches!(self.source, Source::Ffmpeg(_)) {
            return None;
        }
        let given = match std::mem::replace(&mut self.source, Source::Over) {
            Source::Over => None,
            Source::Native(mut native) => {
                let given = self.next_here(&mut native);
                // Unless ffmpeg has taken its place.
                if matches!((&self.source, &given), (Source::Over, Some(Ok(_)))) {
                    self.source = Source::Native(native);
                }
                // Counted by the decoder that has taken over.
                if matches!(self.source, Source::Ffmpeg(_)) {
                    return given;
                }
                given
            }
            Source::Ffmpeg(mut decoder) => {
                let given = decoder.next();
                self.source = Source::Ffmpeg(decoder);
                given
            }
        };
        self.given += usize::from(matches!(given, Some(Ok(_))));
        given
    }
}
