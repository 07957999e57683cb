//! Films decoded here, without another program.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::annexb::{self, Raw};
use crate::contained::Contained;
use crate::format::{Colour, Format};
pub use crate::frame::{Chroma, Frame, Planes};
pub use crate::limits::Limits;
use crate::quiet::caught;
pub use crate::refused::Refused;
use crate::refused::{damaged, not_handled};
pub use crate::rgb::Colours;
use crate::source::Source;
use crate::stream::{Fields, Stream};
use crate::track::Codec;
use crate::{matroska, mp4};

/// A film that is open: what its container says, and its frames one after the other, in the order in which they
/// are shown.
///
/// Frames are decoded as they are asked for, those of H.264 a few ahead; a few are kept that are shown later than
/// others. After an error there are no more.
pub struct Native {
    stream: Stream,
    film: Film,
    colours: Colours,
    limits: Limits,
    chroma: Option<Chroma>,
    given: usize,
    over: bool,
}

enum Film {
    Contained(Box<Contained>),
    Raw(Box<Raw>),
}

/// Opens the film of a file with [`Limits::default`].
///
/// # Errors
///
/// Says what is not handled, damaged or unreadable.
pub fn open(path: &Path) -> Result<Native, Refused> {
    open_within(path, Limits::default())
}

/// Opens the film of a file.
///
/// # Errors
///
/// Says what is not handled, damaged or unreadable.
pub fn open_within(path: &Path, limits: Limits) -> Result<Native, Refused> {
    // Before it is opened: opening a pipe waits for who writes into it.
    if !std::fs::metadata(path)?.is_file() {
        return not_handled("it is no ordinary file");
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    read(file, length, limits)
}

/// Opens the film in `length` bytes that begin where `file` begins.
///
/// # Errors
///
/// Says what is not handled, damaged or unreadable.
pub fn read(file: impl Read + Seek + Send + 'static, length: u64, limits: Limits) -> Result<Native, Refused> {
    let mut file: Box<dyn Source> = Box::new(file);
    let mut head = Vec::new();
    file.by_ref().take(64).read_to_end(&mut head)?;
    file.seek(SeekFrom::Start(0))?;
    let opened = caught(|| {
        if mp4::is_mp4(&head) {
            let track = mp4::read(&mut *file, length, &limits)?;
            contained(Contained::new(file, length, track, limits)?, limits)
        } else if matroska::is_matroska(&head) {
            let track = matroska::read(&mut *file, length, &limits)?;
            contained(Contained::new(file, length, track, limits)?, limits)
        } else if let Some(codec) = annexb::codec(&head) {
            let raw = Raw::new(file, codec, limits)?;
            let format = raw.format().clone();
            let stream = stream(codec, Vec::new(), &format, Colour::default());
            Ok(Native::new(stream, &format, Film::Raw(Box::new(raw)), limits))
        } else {
            not_handled("neither MP4, QuickTime, Matroska nor a stream of H.264 or HEVC")
        }
    });
    opened.unwrap_or_else(|| damaged("the decoder gave up"))
}

fn contained(contained: Contained, limits: Limits) -> Result<Native, Refused> {
    let track = contained.track();
    let format = contained.format().clone();
    let mut stream = stream(track.configuration.codec, contained.times(), &format, track.colour);
    stream.tick = track.tick;
    stream.turn = contained.turn();
    stream.capture_rate = track.capture_rate;
    stream.pixel_aspect = track.pixel_aspect.unwrap_or(stream.pixel_aspect);
    Ok(Native::new(stream, &format, Film::Contained(Box::new(contained)), limits))
}

fn stream(codec: Codec, times: Vec<f64>, format: &Format, container: Colour) -> Stream {
    let colour = format.colour.or(container);
    Stream {
        codec: codec.name().to_owned(),
        times,
        tick: 0.0,
        size: format.size,
        pixel_aspect: format.pixel_aspect.unwrap_or([1, 1]),
        fields: Fields::Progressive,
        turn: 0,
        full_range: colour.full_range.unwrap_or(false),
        matrix: colour.matrix(),
        transfer: colour.transfer(),
        bits: format.bits,
        capture_rate: None,
    }
}

impl Native {
    fn new(stream: Stream, format: &Format, film: Film, limits: Limits) -> Native {
        let colours = Colours::new(stream.matrix, stream.full_range, stream.bits, format.siting);
        Native { stream, film, colours, limits, chroma: None, given: 0, over: false }
    }

    /// The same film with its frames decoded one after the other by the thread that asks for them, if none was asked
    /// for yet; else several at once may be. Frames and errors are the same.
    pub fn one_by_one(mut self) -> Native {
        if let Film::Contained(contained) = &mut self.film {
            contained.decode_one_by_one();
        }
        self
    }

    /// What the container says of the film.
    pub fn stream(&self) -> &Stream {
        &self.stream
    }

    /// How the frames become red, green and blue.
    pub fn colours(&self) -> &Colours {
        &self.colours
    }

    /// The next frame as red, green and blue, [height, width, 3] of 8 bits.
    pub fn next_rgb(&mut self) -> Option<Result<Vec<u8>, Refused>> {
        Some(self.next()?.map(|frame| self.colours.rgb(&frame)))
    }

    fn decoded(&mut self) -> Result<Option<Frame>, Refused> {
        let film = &mut self.film;
        let frame = caught(|| match film {
            Film::Contained(contained) => contained.next(),
            Film::Raw(raw) => raw.next(),
        });
        let Some(frame) = frame else { return damaged("the decoder gave up") };
        let Some(frame) = frame? else { return Ok(None) };
        let kept = *self.chroma.get_or_insert(frame.chroma);
        if frame.size == self.stream.size && (frame.chroma, frame.bits) != (kept, self.stream.bits) {
            let before = format!("{kept:?} of {} bits before", self.stream.bits);
            return Err(Refused::Changed(format!(
                "{before}, {:?} of {} bits from there on",
                frame.chroma, frame.bits
            )));
        }
        if frame.size != self.stream.size {
            let [[a, b], [c, d]] = [self.stream.size, frame.size];
            return not_handled(format!("frames that change within the film ({a}×{b} px, then {c}×{d} px)"));
        }
        self.given += 1;
        self.limits.check_count(self.given as u64)?;
        frame.checked().map(Some)
    }
}

impl Iterator for Native {
    type Item = Result<Frame, Refused>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let item = self.decoded().map_err(|e| behind(e, self.given)).transpose();
        self.over = !matches!(item, Some(Ok(_)));
        item
    }
}

/// The error with the frame at which it was met.
fn behind(error: Refused, frame: usize) -> Refused {
    match error {
        Refused::Damaged(what) => Refused::Damaged(format!("frame {frame}: {what}")),
        Refused::NotHandled(what) => Refused::NotHandled(format!("frame {frame}: {what}")),
        other => other,
    }
}
