//! Several frames of H.264 at once, each with a thread of its own, by the crate `rust_h264`.
//!
//! What a film's frames are, and what is said of a damaged one, is settled by decoding one after the other. This way
//! is taken only as long as it cannot differ: every frame is one slice, there is one sequence parameter set, and
//! nothing fails. The decoder conceals what fails amid a frame of several slices; such are not given to it. Whoever
//! gets `None` from here decodes from the beginning, one after the other.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::thread::{available_parallelism, sleep};
use std::time::Duration;

use rust_h264::nal::{NalUnit, NalUnitType};
use rust_h264::threading::ThreadedDecoder;

use crate::format::Format;
use crate::frame::Frame;
use crate::h264;
use crate::quiet::Workers;

/// Most frames that are decoded at once.
const THREADS: u64 = 6;
/// So many more than there are cores: some wait for rows of the one before them, and the decoder waits for threads to
/// end. On two cores, two at once take as long as one by one, four 0.67 of it.
const WAITING: u64 = 2;
/// Most memory of all that are under way `[bytes]`.
const MEMORY: u64 = 512 << 20;
/// So many times the memory of its values does a frame take that is under way: its motion, and a copy for others.
const PARTS: u64 = 4;
/// Frames under way that no thread decodes: one that is read, one that waits for those before it, one that is done.
const LEAD: u64 = 3;
/// Longest time for one frame; one that takes longer is decoded without others.
const PATIENCE: Duration = Duration::from_secs(5);
const PAUSE: Duration = Duration::from_millis(1);

/// Ends a frame: the decoder takes it for a slice that begins another group of frames and cannot be read, which it
/// passes over. With every frame a group of its own, frames come in the order in which they were given; else those
/// that are shown first would come first.
const END: NalUnit = NalUnit {
    nal_ref_idc: 0,
    nal_unit_type: NalUnitType::SliceIdr,
    // Macroblock 1, slice type 0, and a number that does not end.
    rbsp: Cow::Borrowed(&[0b0101_0000]),
};
/// What the decoder has no use for, but looks for frames that are done.
const NOTHING: NalUnit =
    NalUnit { nal_ref_idc: 0, nal_unit_type: NalUnitType::Sei, rbsp: Cow::Borrowed(&[]) };

/// A decoder and the frames under way.
pub(crate) struct Ahead {
    decoder: ThreadedDecoder,
    /// Most frames under way.
    most: usize,
    /// Number of frames given to the decoder, and taken from here.
    begun: usize,
    taken: usize,
    done: VecDeque<rust_h264::decoder::Frame>,
    is_over: bool,
    // Behind the decoder: its threads have ended when this goes.
    _workers: Workers,
}

/// How many frames of a format are decoded at once on a machine with `cores`; `None` if that gains nothing.
fn threads(format: &Format, cores: usize) -> Option<usize> {
    let most = MEMORY / (PARTS * format.bytes()).max(1);
    let threads = most.saturating_sub(LEAD).min(THREADS).min(cores as u64 + WAITING);
    (cores > 1 && threads > WAITING).then_some(threads as usize)
}

impl Ahead {
    /// A decoder for frames of `format`, which the set `sequence` states, with the container's `sets`.
    pub(crate) fn new(format: &Format, sequence: &[u8], sets: &[Vec<u8>]) -> Option<Ahead> {
        let threads = threads(format, available_parallelism().map_or(1, usize::from))?;
        let mut ahead = Ahead {
            decoder: ThreadedDecoder::with_max_depth(threads, 1),
            most: threads + LEAD as usize,
            begun: 0,
            taken: 0,
            done: VecDeque::new(),
            is_over: false,
            _workers: Workers::new(),
        };
        for set in sets {
            ahead.unit(set, sequence)?;
        }
        Some(ahead)
    }

    /// Number of frames given so far.
    pub(crate) fn begun(&self) -> usize {
        self.begun
    }

    /// Whether it should be given another frame.
    pub(crate) fn wants(&self) -> bool {
        self.begun - self.taken < self.most
    }

    /// Takes the units of the next frame, in the order of the file.
    pub(crate) fn give(&mut self, units: &[&[u8]], sequence: &[u8]) -> Option<()> {
        let mut slices = 0;
        for unit in units {
            slices += self.unit(unit, sequence)?;
            if slices > 1 {
                return None;
            }
        }
        self.begun += slices;
        if slices == 1 { self.decode(&END) } else { None }
    }

    /// Takes a unit; 1 if it is a whole frame, 0 if it is beside frames.
    fn unit(&mut self, unit: &[u8], sequence: &[u8]) -> Option<usize> {
        if h264::kind(unit) == h264::SEQUENCE && unit != sequence {
            return None;
        }
        let Some(nal) = h264::unit(unit).ok()? else { return Some(0) };
        let is_slice = matches!(nal.nal_unit_type, NalUnitType::Slice | NalUnitType::SliceIdr);
        // A frame begins with macroblock 0, which is a single bit; what begins elsewhere would be taken for a part of
        // the frame before.
        if is_slice && nal.rbsp.first().is_none_or(|b| b & 0x80 == 0) {
            return None;
        }
        self.decode(&nal)?;
        Some(usize::from(is_slice))
    }

    fn decode(&mut self, nal: &NalUnit) -> Option<()> {
        self.done.extend(self.decoder.decode_nal(nal).ok()?);
        Some(())
    }

    /// The next frame, in the order in which they were given; `is_last` if no other will be given.
    pub(crate) fn next(&mut self, is_last: bool) -> Option<Frame> {
        let mut waited = Duration::ZERO;
        while self.done.is_empty() {
            if is_last && !self.is_over {
                self.is_over = true;
                self.done.extend(self.decoder.flush());
                // What failed at the very end is not told; it is missing.
                if self.taken + self.done.len() != self.begun {
                    return None;
                }
                continue;
            }
            if self.is_over || waited > PATIENCE {
                return None;
            }
            sleep(PAUSE);
            waited += PAUSE;
            self.decode(&NOTHING)?;
        }
        self.taken += 1;
        self.done.pop_front().map(h264::ours)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Colour;

    #[test]
    fn frames_at_once_are_bounded_by_cores_and_memory() {
        let format = |width: usize, height: usize, bits| Format {
            coded: [width, height],
            size: [width, height],
            chroma: 1,
            bits,
            progressive: true,
            pixel_aspect: None,
            colour: Colour::default(),
            siting: 0,
            references: 4,
        };
        assert_eq!(threads(&format(1920, 1088, 8), 64), Some(6));
        assert_eq!(threads(&format(1920, 1088, 8), 2), Some(4));
        assert_eq!(threads(&format(1920, 1088, 8), 1), None);
        assert_eq!(threads(&format(3840, 2160, 8), 64), Some(6));
        // 8K of 10 bits, and the largest that is read: too much for several.
        assert_eq!(threads(&format(7680, 4320, 10), 64), None);
        assert_eq!(threads(&format(16_384, 8_192, 8), 64), None);
        assert!(PARTS * format(3840, 2160, 8).bytes() * (6 + LEAD) <= MEMORY);
    }
}
