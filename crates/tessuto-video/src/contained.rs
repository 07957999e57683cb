//! Frames of a container: decoded in the order of the file, given in the order in which they are shown.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};

use crate::ahead::Ahead;
use crate::bits::is_sound;
use crate::format::Format;
use crate::frame::{Frame, Planes};
use crate::limits::Limits;
use crate::orientation::{Orientation, Said, said};
use crate::quiet::caught;
use crate::refused::{Refused, damaged, not_handled};
use crate::sequence::Sequence;
use crate::source::Source;
use crate::track::{Codec, Sample, Track, units};
use crate::{h264, hevc};

/// Most frames that wait because others are shown before them; no level of either codec allows more.
const WAITING: usize = 16;
/// Most bytes of such.
const WAITING_BYTES: usize = 512 << 20;
/// Longest sample `[bytes]`; a frame of any level is shorter.
const LONGEST: u32 = 64 << 20;

/// Why a film that begins with frames which refer to missing ones is not decoded here: others leave them out or
/// show them broken.
pub(crate) const AMID: &str = "a film that begins amid a group of frames";

/// The film of a container.
pub(crate) struct Contained {
    file: Box<dyn Source>,
    length: u64,
    track: Track,
    limits: Limits,
    sequence: Sequence,
    decoder: Decoder,
    /// Decodes several frames at once, as long as that is sound.
    ahead: Option<Ahead>,
    /// Whether frames are decoded one after the other, by `decoder`.
    one_by_one: bool,
    /// Place of each sample among those that are shown.
    places: Vec<Option<usize>>,
    times: Vec<f64>,
    /// Sample where decoding begins.
    first: usize,
    /// Next sample to be decoded.
    sample: usize,
    /// Place of the next frame to be given.
    place: usize,
    waiting: BTreeMap<usize, Frame>,
    /// What the frames at places that are to come say of their orientation, and where those before have left it.
    said: BTreeMap<usize, Said>,
    orientation: Orientation,
    /// By how much the first frame says that it is turned `[degrees]`.
    turn: u32,
}

enum Decoder {
    H264(Box<h264::Frames>),
    Hevc(Box<hevc::Frames>),
}

impl Contained {
    pub(crate) fn new(
        file: Box<dyn Source>,
        length: u64,
        track: Track,
        limits: Limits,
    ) -> Result<Contained, Refused> {
        limits.check_count(track.samples.len() as u64)?;
        let decoder = match track.configuration.codec {
            Codec::H264 => Decoder::H264(Box::new(h264::Frames::new())),
            Codec::Hevc => Decoder::Hevc(Box::new(hevc::Frames::new(false))),
        };
        let mut film = Contained {
            file,
            length,
            track,
            limits,
            sequence: Sequence::default(),
            decoder,
            ahead: None,
            one_by_one: false,
            places: Vec::new(),
            times: Vec::new(),
            first: 0,
            sample: 0,
            place: 0,
            waiting: BTreeMap::new(),
            said: BTreeMap::new(),
            orientation: Orientation::default(),
            turn: 0,
        };
        film.begin()?;
        film.first = film.sample;
        film.order();
        Ok(film)
    }

    /// Has frames decoded one after the other from here on.
    pub(crate) fn decode_one_by_one(&mut self) {
        self.one_by_one |= self.sample == self.first;
    }

    pub(crate) fn track(&self) -> &Track {
        &self.track
    }

    /// By how much a player turns the frames clockwise `[degrees]`.
    pub(crate) fn turn(&self) -> u32 {
        self.upright(self.turn)
    }

    /// The same for frames that say `said`. It goes before what the container says, as in ffmpeg.
    fn upright(&self, said: u32) -> u32 {
        if said == 0 { self.track.turn } else { said }
    }

    pub(crate) fn format(&self) -> &Format {
        self.sequence.format.as_ref().expect("read when the film was opened")
    }

    /// Times of the frames that are shown `[s]`, the first at 0.
    pub(crate) fn times(&self) -> Vec<f64> {
        self.times.clone()
    }

    /// Finds the sample where decoding begins, and the parameter sets.
    fn begin(&mut self) -> Result<(), Refused> {
        for set in self.track.configuration.sets.clone() {
            self.unit(&set)?;
        }
        let samples = &self.track.samples;
        for (number, s) in samples.iter().enumerate() {
            if s.size > LONGEST {
                return damaged(format!("sample {number} has {} bytes; up to {LONGEST} are read", s.size));
            }
            if s.offset.saturating_add(s.size.into()) > self.length {
                let (offset, length) = (s.offset, self.length);
                return damaged(format!(
                    "sample {number} lies at byte {offset}; the file ends at byte {length}"
                ));
            }
        }
        let Some(first) = samples.iter().position(|s| s.shown.is_some()) else {
            return damaged("no frame is shown");
        };
        let earliest = samples.iter().filter_map(|s| s.shown).fold(f64::INFINITY, f64::min);
        // A frame that is not shown has no time: what follows it in the file may need it.
        let begins = |s: &Sample| s.sync && s.shown.is_none_or(|t| t <= earliest);
        self.sample = (0..=first).rev().find(|&k| begins(&samples[k])).unwrap_or(0);
        let start = self.read(self.sample)?;
        let start = units(&start, self.track.configuration.length)?;
        if self.sequence.format.is_none() {
            for unit in &start {
                self.sequence.unit(self.track.configuration.codec, unit, &self.limits)?;
            }
        }
        if self.sequence.format.is_none() {
            return damaged("no parameter set says what the frames are");
        }
        if let Said::Turn(turn, _) = said(self.track.configuration.codec, &start)? {
            self.turn = turn;
        }
        match self.track.configuration.codec {
            Codec::H264 => self.closed(&start, earliest),
            Codec::Hevc => self.skip_leading(&start),
        }
    }

    /// Refuses H.264 that begins with frames which refer to some before the beginning.
    fn closed(&self, start: &[&[u8]], earliest: f64) -> Result<(), Refused> {
        // Where the beginning is not shown, nothing before it is: see `begin`.
        let first = self.track.samples[self.sample].shown.is_none_or(|t| t == earliest);
        match h264::beginning(start) {
            h264::Beginning::Clean => Ok(()),
            h264::Beginning::Open if first => Ok(()),
            _ => not_handled(AMID),
        }
    }

    /// Marks HEVC's frames as not shown that refer to some before the beginning.
    fn skip_leading(&mut self, start: &[&[u8]]) -> Result<(), Refused> {
        let slice =
            |units: &[&[u8]]| units.iter().find(|unit| hevc::begins_frame(unit)).map(|unit| hevc::kind(unit));
        match slice(start) {
            Some(kind) if hevc::is_open(kind) => {}
            Some(kind) if hevc::is_beginning(kind) => return Ok(()),
            _ => return not_handled(AMID),
        }
        for number in self.sample + 1..self.track.samples.len() {
            let bytes = self.read(number)?;
            match slice(&units(&bytes, self.track.configuration.length)?) {
                Some(kind) if hevc::is_skipped(kind) => self.track.samples[number].shown = None,
                Some(kind) if hevc::is_leading(kind) => {}
                _ => break,
            }
        }
        Ok(())
    }

    /// Puts the shown samples into the order of their times.
    fn order(&mut self) {
        let samples = &self.track.samples;
        let mut shown: Vec<(f64, usize)> = Vec::new();
        for (number, sample) in samples.iter().enumerate().skip(self.sample) {
            shown.extend(sample.shown.map(|time| (time, number)));
        }
        shown.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.places = vec![None; samples.len()];
        for (place, &(_, number)) in shown.iter().enumerate() {
            self.places[number] = Some(place);
        }
        let first = shown.first().map_or(0.0, |s| s.0);
        self.times = shown.iter().map(|s| s.0 - first).collect();
    }

    fn read(&mut self, number: usize) -> Result<Vec<u8>, Refused> {
        let sample = self.track.samples[number];
        self.file.seek(SeekFrom::Start(sample.offset))?;
        let mut bytes = self.track.prefix.clone();
        let wanted = bytes.len() + sample.size as usize;
        self.file.by_ref().take(sample.size.into()).read_to_end(&mut bytes)?;
        if bytes.len() < wanted { damaged("the file was cut while it was read") } else { Ok(bytes) }
    }

    fn unit(&mut self, unit: &[u8]) -> Result<(), Refused> {
        if !is_sound(unit) {
            return damaged("bytes that no encoder writes, such as a hole of zeros");
        }
        self.sequence.unit(self.track.configuration.codec, unit, &self.limits)?;
        match &mut self.decoder {
            Decoder::H264(frames) => frames.unit(unit),
            Decoder::Hevc(frames) => frames.unit(unit),
        }
    }

    /// Decodes one sample.
    fn decode(&mut self, number: usize) -> Result<Option<Frame>, Refused> {
        let bytes = self.read(number)?;
        let units = units(&bytes, self.track.configuration.length)?;
        for unit in &units {
            self.unit(unit)?;
        }
        match (said(self.track.configuration.codec, &units)?, self.places[number]) {
            (Said::Nothing, _) => {}
            // Until one is turned, nothing can end.
            (Said::Anew, _) if self.said.is_empty() && self.orientation == Orientation::default() => {}
            (said, Some(place)) => drop(self.said.insert(place, said)),
            (said, None) => self.orientation.take(said),
        }
        match &mut self.decoder {
            Decoder::H264(frames) => Ok(frames.end()),
            Decoder::Hevc(frames) => frames.end(),
        }
    }

    /// The frame of sample `number`, which follows the one that was asked for before.
    fn frame(&mut self, number: usize) -> Result<Option<Frame>, Refused> {
        if self.one_by_one {
            return self.decode(number);
        }
        if number == self.first && self.track.configuration.codec == Codec::H264 {
            let sets = &self.track.configuration.sets;
            self.ahead = caught(|| Ahead::new(self.format(), self.sequence.bytes(), sets)).flatten();
        }
        if let Some(frame) = caught(|| self.decode_ahead()).flatten() {
            return Ok(Some(frame));
        }
        // What comes is not what frames of a sound film are: all is decoded again, to know what it is.
        self.ahead = None;
        self.one_by_one = true;
        for before in self.first..number {
            let frame = self.decode(before);
            if self.places[before].is_some() || is_told(&frame) {
                frame?;
            }
        }
        self.decode(number)
    }

    /// The next frame in the order of the file, while those behind it are decoded; `None` if anything is not sound.
    fn decode_ahead(&mut self) -> Option<Frame> {
        let mut ahead = self.ahead.take()?;
        let samples = self.track.samples.len();
        while ahead.wants() && self.first + ahead.begun() < samples {
            let bytes = self.read(self.first + ahead.begun()).ok()?;
            let units = units(&bytes, self.track.configuration.length).ok()?;
            if !units.iter().all(|unit| is_sound(unit)) {
                return None;
            }
            if matches!(said(Codec::H264, &units), Err(_) | Ok(Said::Turn(..))) {
                return None;
            }
            ahead.give(&units, self.sequence.bytes())?;
        }
        let frame = ahead.next(self.first + ahead.begun() == samples)?;
        self.ahead = Some(ahead);
        Some(frame)
    }

    /// The next frame that is shown.
    pub(crate) fn next(&mut self) -> Result<Option<Frame>, Refused> {
        loop {
            if let Some(frame) = self.waiting.remove(&self.place) {
                self.orientation.take(self.said.remove(&self.place).unwrap_or(Said::Nothing));
                let [before, after] = [self.turn, self.orientation.turn].map(|said| self.upright(said));
                if before != after {
                    return Err(Refused::Turned(format!("{before}° before, {after}° from there on")));
                }
                self.place += 1;
                return Ok(Some(frame));
            }
            if self.place == self.times.len() {
                return Ok(None);
            }
            let number = self.sample;
            self.sample += 1;
            let frame = self.frame(number);
            let Some(place) = self.places[number] else {
                if is_told(&frame) {
                    frame?;
                }
                continue;
            };
            let Some(frame) = frame? else {
                return damaged(format!("sample {number} holds no frame"));
            };
            self.waiting.insert(place, frame);
            let bytes: usize = self.waiting.values().map(bytes).sum();
            if self.waiting.len() > WAITING || bytes > WAITING_BYTES {
                return not_handled(format!(
                    "{} frames that are decoded long before they are shown",
                    self.waiting.len()
                ));
            }
        }
    }
}

/// Whether the film ends with it even if the frame is not shown. What no player shows may be undecodable: it refers to
/// what was cut off.
fn is_told(frame: &Result<Option<Frame>, Refused>) -> bool {
    matches!(frame, Err(Refused::NotHandled(_) | Refused::Unreadable(_)))
}

/// Memory of a frame.
fn bytes(frame: &Frame) -> usize {
    match &frame.planes {
        Planes::U8(planes) => planes.iter().map(Vec::len).sum(),
        Planes::U16(planes) => planes.iter().map(|p| 2 * p.len()).sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::process::Command;

    /// An MP4 of 40 frames of H.264; `None`, and said so, where ffmpeg with x264 is missing.
    fn clip(folder: &Path, arguments: &str) -> Option<Vec<u8>> {
        let path = folder.join("clip.mp4");
        let source = "-v error -nostdin -y -f lavfi -i testsrc2=s=96x64:r=30 -frames:v 40 \
                      -pix_fmt yuv420p -c:v libx264";
        let mut command = Command::new("ffmpeg");
        command.args(source.split_whitespace()).args(arguments.split(' ')).arg(&path);
        if !command.status().is_ok_and(|status| status.success()) {
            println!("NOT TESTED: several frames at once, ffmpeg with libx264 is missing");
            return None;
        }
        Some(std::fs::read(path).unwrap())
    }

    fn open(film: &[u8]) -> Contained {
        let (limits, length) = (Limits::default(), film.len() as u64);
        let mut file = std::io::Cursor::new(film.to_vec());
        let track = crate::mp4::read(&mut file, length, &limits).unwrap();
        Contained::new(Box::new(file), length, track, limits).unwrap()
    }

    /// Frames until the end or an error.
    fn read(film: &mut Contained) -> Vec<Result<Frame, Refused>> {
        let mut frames = Vec::new();
        while !matches!(frames.last(), Some(Err(_)))
            && let Some(frame) = film.next().transpose()
        {
            frames.push(frame);
        }
        frames
    }

    #[test]
    fn sound_films_are_decoded_several_frames_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let several = std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1);
        for (arguments, is_simple) in [
            ("-bf 0 -profile:v baseline", true),
            ("-bf 5 -x264-params b-pyramid=normal:ref=5", true),
            ("-bf 3 -g 12 -x264-params open-gop=1", true),
            ("-x264-params slices=3", false),
        ] {
            let Some(film) = clip(folder.path(), arguments) else { return };
            let mut single = open(&film);
            single.decode_one_by_one();
            let mut film = open(&film);
            let frames = read(&mut film);
            assert!(frames.len() == 40 && frames == read(&mut single), "{arguments}");
            // Or nothing of it would be tested.
            assert_eq!(!film.one_by_one, several && is_simple, "{arguments}");
        }
    }

    #[test]
    fn damaged_films_are_the_same_several_frames_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let Some(film) = clip(folder.path(), "-bf 2 -g 25") else { return };
        let samples = open(&film).track.samples.clone();
        let mut ends = Vec::new();
        // The first is looked at when the film is opened.
        for (number, sample) in samples.iter().enumerate().skip(1) {
            // A frame cut short, one without its slice, one that begins elsewhere, a hole, what is no header.
            for (at, bytes) in
                [(0, [0u8, 0, 0, 9]), (4, [12; 4]), (5, [0x3a; 4]), (9, [0; 4]), (5, [0xff; 4])]
            {
                let mut changed = film.clone();
                let at = sample.offset as usize + at;
                changed[at..at + 4].copy_from_slice(&bytes);
                let mut single = open(&changed);
                single.decode_one_by_one();
                let expected = read(&mut single);
                let found = read(&mut open(&changed));
                assert!(found == expected, "sample {number}, {bytes:?} at {at}");
                ends.push(expected.iter().filter(|frame| frame.is_ok()).count());
            }
        }
        // Films that end early, at many places.
        ends.sort_unstable();
        ends.dedup();
        println!("films of {ends:?} frames");
        assert!(ends.len() > 20, "{ends:?}");
    }
}
