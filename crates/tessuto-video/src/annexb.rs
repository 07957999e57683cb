//! Streams without a container: units behind start codes (ITU-T H.264 and H.265, annex B).

use std::collections::VecDeque;
use std::io::Read;

use rust_h264::decoder::OrderedDecoder;

use crate::contained::AMID;
use crate::format::Format;
use crate::frame::Frame;
use crate::limits::Limits;
use crate::orientation::{Said, said};
use crate::refused::{Refused, damaged, not_handled};
use crate::sequence::Sequence;
use crate::source::Source;
use crate::track::Codec;
use crate::{h264, hevc};

/// Longest unit read `[bytes]`; a frame of any level is shorter.
const LONGEST: usize = 64 << 20;
/// Bytes read at once.
const PIECE: usize = 1 << 18;

/// The codec of a stream that begins with `head`, if it is one.
pub(crate) fn codec(head: &[u8]) -> Option<Codec> {
    let start = head.windows(3).position(|w| w == [0, 0, 1])?;
    if start > 1 || head[..start].iter().any(|&b| b != 0) {
        return None;
    }
    match head[start + 3..] {
        // Parameter sets or a delimiter, of layer 0 and temporal layer 0.
        [0x40 | 0x42 | 0x46, 1, ..] => Some(Codec::Hevc),
        [first, ..] if first & 0x80 == 0 && (first & 31 == 7 || first == 9 || first == 6) => {
            Some(Codec::H264)
        }
        _ => None,
    }
}

/// Cuts what is read into units.
struct Units<R> {
    source: R,
    buffer: Vec<u8>,
    /// First byte of the unit, behind its start code.
    start: usize,
    /// Where the search for the next start code goes on.
    scan: usize,
    over: bool,
}

impl<R: Read> Units<R> {
    fn new(source: R) -> Self {
        Units { source, buffer: Vec::new(), start: 0, scan: 0, over: false }
    }

    /// The next unit; the first may be empty, before the first start code.
    fn next(&mut self) -> Result<Option<Vec<u8>>, Refused> {
        loop {
            let found = self.buffer[self.scan..].windows(3).position(|w| w == [0, 0, 1]);
            if let Some(found) = found {
                let end = self.scan + found;
                let unit = trimmed(&self.buffer[self.start..end]);
                (self.start, self.scan) = (end + 3, end + 3);
                return Ok(Some(unit));
            }
            if self.over {
                let unit = trimmed(&self.buffer[self.start..]);
                self.start = self.buffer.len();
                self.scan = self.start;
                return Ok(Some(unit).filter(|u| !u.is_empty()));
            }
            self.buffer.drain(..self.start);
            self.start = 0;
            self.scan = self.buffer.len().saturating_sub(2);
            if self.buffer.len() > LONGEST {
                return damaged(format!("a unit of more than {LONGEST} bytes"));
            }
            self.over = self.source.by_ref().take(PIECE as u64).read_to_end(&mut self.buffer)? == 0;
        }
    }
}

/// Without the zeros behind it, which belong to the next start code.
fn trimmed(unit: &[u8]) -> Vec<u8> {
    let end = unit.iter().rposition(|&b| b != 0).map_or(0, |k| k + 1);
    unit[..end].to_vec()
}

enum Decoder {
    H264(Box<OrderedDecoder>),
    Hevc(Box<hevc::Frames>),
}

/// A stream that is open.
pub(crate) struct Raw {
    units: Units<Box<dyn Source>>,
    codec: Codec,
    limits: Limits,
    sequence: Sequence,
    decoder: Decoder,
    /// Units read while the parameter sets were looked for.
    begun: VecDeque<Vec<u8>>,
    done: VecDeque<Frame>,
    /// Whether the first frame has come.
    running: bool,
    over: bool,
}

impl Raw {
    pub(crate) fn new(file: Box<dyn Source>, codec: Codec, limits: Limits) -> Result<Raw, Refused> {
        let decoder = match codec {
            Codec::H264 => Decoder::H264(Box::new(OrderedDecoder::new())),
            Codec::Hevc => Decoder::Hevc(Box::new(hevc::Frames::new(true))),
        };
        let mut raw = Raw {
            units: Units::new(file),
            codec,
            limits,
            sequence: Sequence::default(),
            decoder,
            begun: VecDeque::new(),
            done: VecDeque::new(),
            running: false,
            over: false,
        };
        while raw.sequence.format.is_none() {
            let Some(unit) = raw.units.next()? else {
                return damaged("no parameter set says what the frames are");
            };
            let slice = match codec {
                Codec::H264 => h264::is_slice(h264::kind(&unit)),
                Codec::Hevc => hevc::is_slice(hevc::kind(&unit)),
            };
            if slice && !unit.is_empty() {
                return damaged("a frame comes before the parameter sets");
            }
            raw.sequence.unit(codec, &unit, &raw.limits)?;
            raw.begun.push_back(unit);
        }
        Ok(raw)
    }

    pub(crate) fn format(&self) -> &Format {
        self.sequence.format.as_ref().expect("read when the stream was opened")
    }

    /// The next frame that is shown.
    pub(crate) fn next(&mut self) -> Result<Option<Frame>, Refused> {
        loop {
            if let Some(frame) = self.done.pop_front() {
                return Ok(Some(frame));
            }
            if self.over {
                return Ok(None);
            }
            let unit = match self.begun.pop_front() {
                Some(unit) => Some(unit),
                None => self.units.next()?,
            };
            match unit {
                Some(unit) => self.unit(&unit)?,
                None => self.finish(),
            }
        }
    }

    fn unit(&mut self, unit: &[u8]) -> Result<(), Refused> {
        if unit.is_empty() {
            return Ok(());
        }
        self.sequence.unit(self.codec, unit, &self.limits)?;
        let (slice, beginning) = match self.codec {
            Codec::H264 => {
                (h264::is_slice(h264::kind(unit)), h264::beginning(&[unit]) == h264::Beginning::Clean)
            }
            Codec::Hevc => {
                let kind = hevc::kind(unit);
                (hevc::is_base(unit) && hevc::is_slice(kind), hevc::is_beginning(kind))
            }
        };
        if slice && !self.running && !beginning {
            return not_handled(AMID);
        }
        self.running |= slice;
        if matches!(said(self.codec, &[unit])?, Said::Turn(1.., _)) {
            return not_handled("a stream without time stamps that says how its frames are turned");
        }
        match &mut self.decoder {
            Decoder::H264(decoder) => self.done.extend(h264::ordered(decoder, unit)?),
            Decoder::Hevc(frames) => {
                frames.unit(unit)?;
                self.done.extend(frames.take());
            }
        }
        Ok(())
    }

    fn finish(&mut self) {
        self.over = true;
        match &mut self.decoder {
            Decoder::H264(decoder) => self.done.extend(decoder.flush().into_iter().map(h264::ours)),
            Decoder::Hevc(frames) => self.done.extend(frames.finish()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_cut_wherever_pieces_end() {
        struct Slowly<'a>(&'a [u8]);
        impl Read for Slowly<'_> {
            fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
                let Some((first, rest)) = self.0.split_first() else { return Ok(0) };
                into[0] = *first;
                self.0 = rest;
                Ok(1)
            }
        }
        let stream = [0, 0, 0, 1, 0x67, 5, 0, 0, 0, 1, 0x68, 0, 0, 1, 0x65, 7, 0, 0];
        let all = |mut units: Units<Slowly>| {
            let mut found = Vec::new();
            while let Some(unit) = units.next().unwrap() {
                found.push(unit);
            }
            found
        };
        let found = all(Units::new(Slowly(&stream)));
        assert_eq!(found, [vec![], vec![0x67, 5], vec![0x68], vec![0x65, 7]]);
    }

    #[test]
    fn codecs_are_told_by_the_first_unit() {
        assert_eq!(codec(&[0, 0, 0, 1, 0x67, 100]), Some(Codec::H264));
        assert_eq!(codec(&[0, 0, 1, 0x09, 0x10]), Some(Codec::H264));
        assert_eq!(codec(&[0, 0, 0, 1, 0x40, 1, 12]), Some(Codec::Hevc));
        // MPEG-2 program and elementary streams, MPEG-4 part 2.
        assert_eq!(codec(&[0, 0, 1, 0xBA, 0x44]), None);
        assert_eq!(codec(&[0, 0, 1, 0xB3, 0x14]), None);
        assert_eq!(codec(&[0, 0, 1, 0xB0, 0x01]), None);
        assert_eq!(codec(b"\0\0"), None);
    }
}
