//! Videos: what a file says of its film and its time stamps, made frames of a constant rate, one after the other.

use std::path::Path;

use tessuto_video::rate::{Course, Late, Pace, nearest, pace};
use tessuto_video::{Fields, Film, Frames, Options, Refusal, Stream as Said, Transfer};

use crate::io::image::{MAX_BYTES, MAX_SIDE};
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// A rate so close to that of the film `[fraction]` is the same except for rounding: 30 instead of 29.97.
const SAME: f64 = 0.002;
/// A camera that filmed at a rate so far from that of the time stamps `[fraction]` filmed slow motion, or a time lapse.
const OTHER: f64 = 0.01;
/// Phones film at this rate `[1/s]` or a lower one, and in dim light at still lower ones with true stamps: no slow
/// motion.
const ORDINARY: f64 = 30.5;
/// Where stamps vary, a camera that filmed at this many times their mean rate filmed slow motion.
const VARIED: f64 = 1.5;
/// A camera that filmed at less than this many times the rate of the stamps filmed a time lapse.
const LAPSE: f64 = 0.9;
/// Stamps of a rate so far below what was meant `[fraction]` are worth a note.
const DIM: f64 = 0.05;
/// Rates and lengths of two films that differ by less `[fraction]` are the same except for a frame too many.
const ALIKE: f64 = 0.1;
/// Most frames, stored or after resampling.
const MAX_FRAMES: usize = 1_000_000;
/// Most frames that a note names.
const NAMED: usize = 5;
/// Bounds of width over height of a pixel.
const ASPECTS: std::ops::RangeInclusive<f64> = 0.25..=4.0;

/// How a video is read.
#[derive(Clone, Copy)]
pub(super) struct Reading<'a> {
    /// The program that decodes videos.
    pub ffmpeg: &'a Path,
    /// Frames per second that it is resampled to.
    pub fps: Option<f64>,
    /// Frames per second at which the stored frames were filmed, whatever the file says.
    pub rate: Option<f64>,
    /// Number of the first frame that is not wanted.
    pub end: Option<usize>,
}

/// A video file, looked at.
pub(super) struct Video {
    place: String,
    film: Film,
    max_end: Option<usize>,
    /// Frames per second of what [`stream`](Self::stream) gives.
    pub fps: f64,
    /// The decoded frame behind each frame that is given, in rising order; all of them, each once, where `None`.
    chosen: Option<Vec<usize>>,
}

/// One frame, 8-bit colour, shape [height, width, 3].
pub(super) type Raw = tessuto_video::Frame;

impl Video {
    /// Looks at the file, and makes a constant rate of its time stamps.
    ///
    /// # Errors
    /// [`Error::Input`] if it holds no film or does not state its rate, and of what `tessuto_video::open` refuses.
    pub fn probe(path: &Path, reading: Reading, notes: &mut Vec<String>) -> Result<Self> {
        let mut video = Self::every_frame(path, reading)?;
        let said = &video.film.stream;
        let place = video.place.clone();
        let mut note = |text: String| notes.push(format!("{place}: {text}"));
        video.film.notes.iter().filter(|_| reading.rate.is_none()).cloned().for_each(&mut note);
        about(said).into_iter().for_each(&mut note);
        let per_frame = said.moments_per_frame();
        let mut moments = said.moments();
        if let Some(rate) = reading.rate {
            video.fps = rate * per_frame as f64;
            moments = (0..video.film.stored * per_frame).map(|k| k as f64 / video.fps).collect();
        } else {
            expect_stamps(&place, &moments)?;
            // The second moments of frames lie between ticks.
            let tick = said.tick / per_frame as f64;
            let found = pace(&moments, tick);
            let filmed = said.capture_rate.filter(|_| moments.len() > 1).map(|rate| rate * per_frame as f64);
            let (slowed, text) = filmed.map_or((None, None), |filmed| at_another_rate(filmed, &found));
            text.into_iter().for_each(&mut note);
            video.fps = slowed.unwrap_or(found.fps);
            if let Some(filmed) = slowed {
                let scale = found.fps / filmed;
                moments = match found.course {
                    // Stamps that slow down only a part say nothing of when it was filmed.
                    Course::Varying => (0..moments.len()).map(|k| k as f64 / filmed).collect(),
                    _ => moments.iter().map(|time| time * scale).collect(),
                };
            }
            let fps = reading.fps.unwrap_or(video.fps);
            let even = match &found.course {
                Course::Constant => true,
                Course::Varying => slowed.is_some(),
                Course::Late(_) => false,
            };
            match &found.course {
                Course::Late(late) => note(late_words(late, found.fps, fps)),
                Course::Varying if slowed.is_none() => {
                    let mean = (moments.len() - 1) as f64 / (moments[moments.len() - 1] - moments[0]);
                    note(format!(
                        "its frame rate varies ({} per second on average); brought to {fps:.4} per second by \
                         its time stamps, frames repeat or are left out: another rate can be given (fps)",
                        rounded(mean)
                    ));
                }
                _ => {}
            }
            if !even {
                video.resample(&moments, fps)?;
            }
        }
        if let Some(fps) =
            reading.fps.filter(|fps| video.chosen.is_none() && (fps / video.fps - 1.0).abs() > SAME)
        {
            video.resample(&moments, fps)?;
        }
        video.fps = reading.fps.unwrap_or(video.fps);
        Ok(video)
    }

    /// Looks at the file, for every frame of it, whatever its time.
    ///
    /// # Errors
    /// [`Error::Input`] as [`probe`](Self::probe), but of no time stamps.
    pub fn every_frame(path: &Path, reading: Reading) -> Result<Self> {
        let place = path.display().to_string();
        let options = options(reading.ffmpeg, reading.end);
        let film = tessuto_video::open(path, &options).map_err(|refusal| refused(&place, refusal))?;
        let aspect = film.stream.upright_aspect();
        if !ASPECTS.contains(&aspect) {
            let [a, b] = film.stream.pixel_aspect;
            return Err(Error::input(
                place,
                format!("has pixels of {a}:{b}, {aspect:.3} times as wide as high"),
                "no camera has such pixels: set it right, e.g. ffmpeg -i IN -c copy -aspect 16:9 OUT.mp4",
            ));
        }
        Ok(Self { place, film, max_end: reading.end, fps: 1.0, chosen: None })
    }

    /// Masks that follow the frames of `colour`: one by one where there are as many as it has stored, else by
    /// their time stamps.
    ///
    /// # Errors
    /// As [`probe`](Self::probe).
    pub fn masks(
        path: &Path,
        ffmpeg: &Path,
        colour: Option<&Video>,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let reading = Reading { ffmpeg, fps: None, rate: None, end: None };
        let masks = Self::every_frame(path, reading)?;
        let Some(colour) = colour else { return Ok(masks) };
        let own = masks.moments();
        let given = colour.chosen.as_ref().map_or(colour.moments(), Vec::len);
        let is_stamped = !masks.film.stream.times.is_empty();
        if own == given && (colour.chosen.is_none() || !is_stamped) {
            return Ok(masks);
        }
        // Of interlaced film one mask may be for both moments of a frame.
        let per_mask = if own == colour.film.stored { colour.film.stream.moments_per_frame() } else { 1 };
        if own != given && own * per_mask == colour.moments() {
            let every = || (0..colour.moments()).collect();
            let chosen = colour.chosen.clone().unwrap_or_else(every).iter().map(|k| k / per_mask).collect();
            return Ok(Self { chosen: Some(chosen), fps: colour.fps, ..masks });
        }
        let other_rate = if colour.chosen.is_none() { masks.other_rate(colour)? } else { None };
        if let Some(fps) = other_rate {
            notes.push(format!(
                "{}: {own} masks for {} frames of the same length; paired by their time stamps",
                masks.place,
                colour.moments()
            ));
            return Self::probe(path, Reading { fps: Some(fps), ..reading }, &mut Vec::new());
        }
        if colour.chosen.is_none() || !is_stamped {
            return Ok(masks);
        }
        Self::probe(path, Reading { fps: Some(colour.fps), ..reading }, &mut Vec::new())
    }

    /// Refuses masks that are far more than `frames`, images that do not say when they were taken.
    ///
    /// # Errors
    /// [`Error::Input`] with both counts.
    pub fn expect_one_each(&self, frames: usize) -> Result<()> {
        let masks = self.moments();
        if masks as f64 <= (1.0 + ALIKE) * frames as f64 + 1.0 {
            return Ok(());
        }
        Err(Error::input(
            &self.place,
            format!("holds {masks} masks for {frames} images: nothing shows which mask belongs to which"),
            "make one mask for each image, in their order",
        ))
    }

    /// The rate of the frames of `colour`, if these masks have another one and last as long.
    ///
    /// # Errors
    /// [`Error::Input`] if they have another rate and last longer or shorter.
    fn other_rate(&self, colour: &Video) -> Result<Option<f64>> {
        let interval = |video: &Self| {
            let moments = video.film.stream.moments();
            let last = moments.last().copied().filter(|last| *last > 0.0)?;
            Some((last / (moments.len() - 1) as f64, moments.len()))
        };
        let (Some((own, masks)), Some((other, frames))) = (interval(self), interval(colour)) else {
            return Ok(None);
        };
        let alike = |a: f64, b: f64| (a / b - 1.0).abs() < ALIKE;
        if alike(own, other) {
            return Ok(None);
        }
        let [lasts, film] = [own * masks as f64, other * frames as f64];
        if alike(lasts, film) {
            return Ok(Some(1.0 / other));
        }
        Err(Error::input(
            &self.place,
            format!(
                "holds {masks} masks in {lasts:.2} s, the film {frames} frames in {film:.2} s: nothing shows \
                 which mask belongs to which"
            ),
            "make one mask for each frame of the film, in its order",
        ))
    }

    /// Width over height of a pixel.
    pub fn pixel_aspect(&self) -> f64 {
        self.film.stream.upright_aspect()
    }

    /// Number of moments that are stored.
    fn moments(&self) -> usize {
        self.film.stored * self.film.stream.moments_per_frame()
    }

    fn resample(&mut self, moments: &[f64], fps: f64) -> Result<()> {
        let tick = self.film.stream.tick / self.film.stream.moments_per_frame() as f64;
        self.fps = fps;
        self.chosen = nearest(moments, fps, tick, MAX_FRAMES);
        if self.chosen.is_some() {
            return Ok(());
        }
        let span = moments.last().zip(moments.first()).map_or(0.0, |(last, first)| last - first);
        Err(Error::input(
            &self.place,
            format!(
                "its {} frames last {span:.1} s; at {fps} per second these are more than {MAX_FRAMES}",
                moments.len()
            ),
            Hint::from("a time stamp may be wrong; give the rate at which it was filmed").with(Remedy::Rate),
        ))
    }

    /// Starts decoding the frames up to `end`.
    ///
    /// # Errors
    /// [`Error::Input`] if the decoder cannot be started.
    pub fn stream(&self, end: Option<usize>, ffmpeg: &Path) -> Result<Stream> {
        let chosen =
            self.chosen.as_ref().map(|chosen| &chosen[..end.unwrap_or(chosen.len()).min(chosen.len())]);
        let decoded_end = chosen.map_or(end, |chosen| Some(chosen.last()? + 1));
        let frames = self.film.frames(decoded_end, &options(ffmpeg, self.max_end));
        let frames = frames.map_err(|refusal| refused(&self.place, refusal))?;
        let chosen = chosen.map(<[usize]>::to_vec);
        Ok(Stream { place: self.place.clone(), frames, chosen, given: 0, decoded: 0, held: None })
    }

    /// The error of a video without frames.
    pub fn empty(&self) -> Error {
        Error::input(
            &self.place,
            "holds no frame that can be decoded",
            "play it to see whether it is whole; copy it again",
        )
    }
}

pub(super) fn options(ffmpeg: &Path, end: Option<usize>) -> Options<'_> {
    Options { ffmpeg, max_side: MAX_SIDE, max_bytes: MAX_BYTES, max_frames: MAX_FRAMES, end }
}

fn refused(place: &str, refusal: Refusal) -> Error {
    let hint = Hint::from(refusal.way_out);
    let hint = match refusal.part {
        Some(part) => hint.with(Remedy::Frames(Some(part))),
        None => hint,
    };
    Error::input(place, refusal.what, hint)
}

/// What is to be said of a film before its time.
fn about(said: &Said) -> Vec<String> {
    let mut notes = Vec::new();
    if said.turn != 0 {
        notes
            .push(format!("the recording is marked as turned by {}°; frames are written upright", said.turn));
    }
    if said.transfer != Transfer::Standard {
        notes.push(
            "high dynamic range (HLG or PQ); its colours will look flat: record in standard range, or \
             convert it first"
                .to_owned(),
        );
    }
    let first = match said.fields {
        Fields::Progressive => None,
        Fields::TopFirst => Some("the even rows"),
        Fields::BottomFirst => Some("the odd rows"),
    };
    if let Some(first) = first {
        notes.push(format!(
            "is interlaced ({first} first): each frame shows two moments and became two frames, at twice the rate; \
             of film that is marked so by mistake, first ffmpeg -i IN -vf setfield=prog OUT.mp4"
        ));
    }
    let aspect = said.upright_aspect();
    if aspect != 1.0 {
        let [a, b] = said.pixel_aspect;
        notes.push(format!(
            "its pixels are not square ({a}:{b}): fy is {aspect:.4} fx, unless the camera has its own"
        ));
    }
    notes
}

/// The rate at which a film was filmed that the file says, where it counts more than that of the stamps, and a
/// note where they differ.
fn at_another_rate(filmed: f64, stamped: &Pace) -> (Option<f64>, Option<String>) {
    let (ratio, varies) = (filmed / stamped.fps, stamped.course == Course::Varying);
    let rates = format!(
        "says that it was filmed at {} per second, but is stamped {} per second",
        rounded(filmed),
        rounded(stamped.fps)
    );
    if ratio < LAPSE || ratio > 1.0 + OTHER && filmed > ORDINARY && (ratio > VARIED || !varies) {
        let note = format!(
            "{rates}: slow motion or a time lapse; the former counts: another rate can be given (rate)"
        );
        return (Some(filmed), Some(note));
    }
    let note = format!(
        "{rates}, as phones film fewer frames in dim light; the latter counts: another rate can be given (rate)"
    );
    (None, (ratio > 1.0 + DIM).then_some(note))
}

/// Refuses films whose stamps do not say when frames were filmed.
fn expect_stamps(place: &str, moments: &[f64]) -> Result<()> {
    let hint = |text: &str| Hint::from(text).with(Remedy::Rate);
    if moments.is_empty() {
        return Err(Error::input(
            place,
            "has no time stamps, as a raw stream of a codec has none: its frame rate is not known",
            hint("give the rate at which its frames were filmed"),
        ));
    }
    if moments.len() > 1 && moments[0] == moments[moments.len() - 1] {
        let hint = hint("give the rate at which its frames were filmed");
        return Err(Error::input(place, "has one time stamp for all of its frames", hint));
    }
    match moments.windows(2).position(|pair| pair[1] < pair[0]) {
        None => Ok(()),
        Some(k) => Err(Error::input(
            place,
            format!(
                "its clock jumps back at frame {}, from {:.3} s to {:.3} s",
                k + 1,
                moments[k],
                moments[k + 1]
            ),
            hint(
                "it seems to be joined from parts: take one of them, or give the rate at which all frames were filmed",
            ),
        )),
    }
}

fn late_words(late: &[Late], own: f64, fps: f64) -> String {
    let names: Vec<String> = late.iter().take(NAMED).map(|late| late.frame.to_string()).collect();
    let more = if late.len() > NAMED { format!(" and {} more", late.len() - NAMED) } else { String::new() };
    let (noun, verb) = if late.len() == 1 { ("frame", "comes") } else { ("frames", "come") };
    let after = late[0].intervals as f64 / own;
    format!(
        "{noun} {}{more} {verb} late (the first {after:.3} s after the frame before, instead of {:.3} s): \
         frames are missing in the recording; brought to {} per second by its time stamps, the frame before repeats",
        names.join(", "),
        1.0 / own,
        rounded(fps)
    )
}

fn rounded(fps: f64) -> f64 {
    (fps * 1e4).round() / 1e4
}

/// Frames as they are decoded, repeated or left out as the rate demands.
pub(super) struct Stream {
    place: String,
    frames: Frames,
    chosen: Option<Vec<usize>>,
    /// Number of frames given, and decoded, so far.
    given: usize,
    decoded: usize,
    /// The frame decoded last, where it is given again.
    held: Option<Raw>,
}

impl Stream {
    /// What ffmpeg complained of without giving up.
    pub fn complaints(&mut self) -> Option<String> {
        let first = self.frames.complaint()?;
        Some(format!("{}: frames may be damaged: {first}", self.place))
    }

    fn decode(&mut self) -> Option<Result<Raw>> {
        let frame = self.frames.next()?;
        self.decoded += 1;
        Some(frame.map_err(|refusal| refused(&self.place, refusal)))
    }
}

impl Iterator for Stream {
    type Item = Result<Raw>;

    fn next(&mut self) -> Option<Self::Item> {
        let Some(chosen) = &self.chosen else { return self.decode() };
        let Some(wanted) = chosen.get(self.given).copied() else {
            // The decoder ends by itself after the last frame asked for; what it complained of is then known.
            return self.decode().filter(Result::is_err);
        };
        let again = chosen.get(self.given + 1) == Some(&wanted);
        while self.held.is_none() || self.decoded <= wanted {
            match self.decode()? {
                Ok(frame) => self.held = Some(frame),
                Err(e) => return Some(Err(e)),
            }
        }
        self.given += 1;
        let frame = if again { self.held.clone() } else { self.held.take() };
        frame.map(Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_motion_is_none_where_stamps_are_true() {
        let counts = |filmed: f64, fps: f64, course: Course| at_another_rate(filmed, &Pace { fps, course });
        for (filmed, stamped) in [(240.0, 30.0), (120.0, 24.0), (60.0, 30.0), (0.5, 30.0), (1.0, 30.0)] {
            let (rate, note) = counts(filmed, stamped, Course::Constant);
            assert!(rate == Some(filmed) && note.is_some(), "{filmed} {stamped}");
        }
        assert_eq!(counts(30.0, 29.97, Course::Constant), (None, None));
        assert_eq!(counts(240.0, 239.7, Course::Constant), (None, None));
        // Dim light.
        for (filmed, stamped, course) in
            [(30.0, 24.0, Course::Constant), (30.0, 15.0, Course::Varying), (60.0, 50.0, Course::Varying)]
        {
            let (rate, note) = counts(filmed, stamped, course);
            assert!(rate.is_none() && note.unwrap().contains("dim light"), "{filmed} {stamped}");
        }
    }
}
