//! Matroska and WebM films: the track that a player shows, its blocks, their times.
//!
//! Written here, not taken from a crate: blocks are listed by their places before one of them is read, with bounds
//! on what is taken.
//!
//! Source: RFC 8794 (EBML), RFC 9559 (Matroska).

mod ebml;
mod tracks;

use std::io::{BufReader, Read, Seek};

use ebml::{Head, variable};
use tracks::{TrackEntry, choose};

use crate::limits::Limits;
use crate::refused::{Refused, damaged, not_handled};
use crate::source::Source;
use crate::track::{Sample, Track};

/// Identifiers of elements.
mod id {
    pub(super) const EBML: u32 = 0x1A45_DFA3;
    pub(super) const SEGMENT: u32 = 0x1853_8067;
    pub(super) const INFO: u32 = 0x1549_A966;
    pub(super) const TIMESTAMP_SCALE: u32 = 0x002A_D7B1;
    pub(super) const TRACKS: u32 = 0x1654_AE6B;
    pub(super) const CLUSTER: u32 = 0x1F43_B675;
    pub(super) const TIMESTAMP: u32 = 0xE7;
    pub(super) const SIMPLE_BLOCK: u32 = 0xA3;
    pub(super) const BLOCK_GROUP: u32 = 0xA0;
    pub(super) const BLOCK: u32 = 0xA1;
    pub(super) const REFERENCE: u32 = 0xFB;
}

/// Longest element that is read as a whole `[bytes]`: the list of tracks.
const LONGEST: u64 = 16 << 20;

/// Whether a file that begins with `head` is of this format.
pub(crate) fn is_matroska(head: &[u8]) -> bool {
    head.starts_with(&id::EBML.to_be_bytes())
}

/// Reads where the frames of a file of `length` bytes lie.
pub(crate) fn read(file: &mut dyn Source, length: u64, limits: &Limits) -> Result<Track, Refused> {
    let mut scan = Scan {
        file: BufReader::new(file),
        at: 0,
        length,
        limits,
        track: None,
        nanoseconds: 1_000_000,
        cluster: 0,
        samples: Vec::new(),
    };
    while scan.at < length {
        scan.element()?;
    }
    let Some(track) = scan.track else { return not_handled("a file without a video track") };
    if scan.samples.is_empty() {
        return damaged("the video track has no frames");
    }
    Ok(Track {
        samples: scan.samples,
        tick: scan.nanoseconds as f64 / 1e9,
        prefix: track.prefix?,
        pixel_aspect: track.pixel_aspect,
        colour: track.colour,
        turn: 0,
        capture_rate: None,
        configuration: track.configuration?,
    })
}

/// Goes through a file from its beginning to its end.
struct Scan<'a> {
    file: BufReader<&'a mut dyn Source>,
    at: u64,
    length: u64,
    limits: &'a Limits,
    track: Option<TrackEntry>,
    /// Unit of the time stamps `[ns]`.
    nanoseconds: u64,
    /// Time stamp of the cluster.
    cluster: i64,
    samples: Vec<Sample>,
}

impl Scan<'_> {
    /// Reads or passes over one element. Of clusters and groups only the heads are read here, so that what is
    /// inside of them comes next: their sizes may be unknown.
    fn element(&mut self) -> Result<(), Refused> {
        let head = Head::read(&mut self.file, self.length - self.at)?;
        self.at += head.length;
        let first = self.at;
        match head.id {
            id::SEGMENT | id::CLUSTER | id::BLOCK_GROUP => return Ok(()),
            _ => {}
        }
        let Some(size) = head.size else {
            return damaged(format!("element {:X} at byte {first} has no size", head.id));
        };
        if size > self.length - first {
            let (id, length) = (head.id, self.length);
            return damaged(format!(
                "element {id:X} at byte {first} says {size} bytes; the file ends at byte {length}"
            ));
        }
        match head.id {
            id::EBML if first > 12 => return not_handled("several films in one file"),
            id::INFO => {
                let info = self.content(size)?;
                for (id, value) in ebml::elements(&info)? {
                    if id == id::TIMESTAMP_SCALE {
                        self.nanoseconds = ebml::number(value)?.max(1);
                    }
                }
            }
            id::TRACKS if self.track.is_none() => self.track = choose(&self.content(size)?)?,
            id::TIMESTAMP => {
                let time = ebml::number(&self.content(size.min(9))?)?;
                self.cluster = i64::try_from(time).ok().filter(|t| *t < 1 << 62).ok_or_else(late)?;
            }
            id::SIMPLE_BLOCK | id::BLOCK => self.block(first, size, head.id == id::BLOCK)?,
            id::REFERENCE => self.samples.iter_mut().next_back().into_iter().for_each(|s| s.sync = false),
            _ => {}
        }
        self.at = first + size;
        let now = self.file.stream_position()?;
        self.file.seek_relative(self.at as i64 - now as i64)?;
        Ok(())
    }

    fn content(&mut self, size: u64) -> Result<Vec<u8>, Refused> {
        if size > LONGEST {
            return damaged(format!("an element of {size} bytes; up to {LONGEST} are read"));
        }
        let mut bytes = vec![0; size as usize];
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Lists a block, if it is of the track.
    fn block(&mut self, first: u64, size: u64, group: bool) -> Result<(), Refused> {
        let mut head = [0; 12];
        let head = &mut head[..size.min(12) as usize];
        self.file.read_exact(head)?;
        let Some(track) = &self.track else { return not_handled("frames before the list of tracks") };
        let Some((number, width)) = variable(head) else { return damaged("a block without a track") };
        if Some(number) != track.number {
            return Ok(());
        }
        let Some(&[high, low, flags]) = head.get(width..width + 3) else {
            return damaged("a block ends early");
        };
        if flags & 6 != 0 {
            return not_handled("several frames in one block");
        }
        let begin = width as u64 + 3;
        let size = u32::try_from(size - begin).or_else(|_| damaged("a block of more than 4 GB"))?;
        if size == 0 {
            return Ok(());
        }
        self.limits.check_count(self.samples.len() as u64 + 1)?;
        let units = self.cluster + i64::from(i16::from_be_bytes([high, low]));
        self.samples.push(Sample {
            offset: first + begin,
            size,
            shown: (flags & 8 == 0).then_some(units as f64 * self.nanoseconds as f64 / 1e9),
            sync: group || flags & 0x80 != 0,
        });
        Ok(())
    }
}

fn late() -> Refused {
    Refused::Damaged("a time stamp of more than 2⁶² units".into())
}
