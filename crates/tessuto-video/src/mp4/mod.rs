//! MP4 and QuickTime films: the track that a player shows, its samples, their times.
//!
//! Written here, not taken from a crate: edit lists, fragments, QuickTime's boxes and bounds on what is treated as
//! a table are what phones' and strangers' files need, and a reader of boxes is short.
//!
//! Source: ISO/IEC 14496-12 (2022), ISO base media file format; Apple, *QuickTime File Format*.

mod boxes;
mod description;
mod edits;
mod fragments;
mod keys;
mod table;

use boxes::{Kind, boxes as inside, child, full, name, needed};
use description::{Description, description};
use fragments::{Fragments, defaults, is_fragment};

use crate::limits::Limits;
use crate::refused::{Refused, damaged, not_handled};
use crate::source::Source;
use crate::track::{Sample, Track, turn};

/// Longest box `moov` or `moof` read `[bytes]`; a million frames need half.
const LONGEST: u64 = 64 << 20;
/// Kinds that files of this format begin with.
const FIRST: [&Kind; 9] = [b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot", b"styp", b"uuid"];

/// Whether a file that begins with `head` is of this format.
pub(crate) fn is_mp4(head: &[u8]) -> bool {
    head.get(4..8).is_some_and(|kind| FIRST.iter().any(|first| *first == kind))
}

/// A video track, before its samples are listed.
struct Candidate<'a> {
    trak: &'a [u8],
    number: u32,
    enabled: bool,
    /// Width and height at which it is shown `[px]`, in 1/65536.
    shown: [u32; 2],
    matrix: [i32; 4],
    /// Units of its times `[1/s]`.
    scale: u32,
    stbl: &'a [u8],
    description: Description,
    /// Whether it is one image, such as that of a title.
    still: bool,
}

/// Reads where the frames of a file of `length` bytes lie.
pub(crate) fn read(file: &mut dyn Source, length: u64, limits: &Limits) -> Result<Track, Refused> {
    let top = boxes::of_file(file, length, 2 * limits.frames + 1000)?;
    let Some(place) = top.iter().find(|b| b.kind == *b"moov") else {
        return damaged(
            "box moov is missing, which lists the frames: the recording was not finished, or the file is cut off",
        );
    };
    let moov = boxes::content(file, place, LONGEST)?;
    if child(&moov, b"cmov")?.is_some() {
        return not_handled("a compressed box moov");
    }
    let (version, _, mut bytes) = full(needed(&moov, b"mvhd")?, "box mvhd")?;
    bytes.take(if version == 1 { 16 } else { 8 })?;
    let movie_scale = scale(bytes.u32()?)?;
    let chosen = choose(&moov)?;
    let mut entries = table::entries(chosen.stbl, length, limits)?;
    let fragmented = defaults(&moov, chosen.number)?;
    if let Some(defaults) = fragmented {
        let time = entries.last().map_or(0, |e| e.time);
        let mut fragments = Fragments::new(chosen.number, defaults, time, limits);
        for place in top.iter().filter(|b| is_fragment(b.kind)) {
            fragments.add(&boxes::content(file, place, LONGEST)?, place.start, &mut entries)?;
        }
    }
    entries.retain(|e| e.size > 0);
    if entries.is_empty() {
        return damaged("the video track has no frames");
    }
    if entries.iter().any(|e| e.description != 1) && chosen.description.count > 1 {
        return not_handled("a track whose parameters change");
    }
    let edits = edits::edits(chosen.trak, chosen.scale, movie_scale, fragmented.is_some())?;
    let samples = entries.iter().map(|e| Sample {
        offset: e.offset,
        size: e.size,
        shown: edits::shown(&edits, e.time, chosen.scale),
        sync: e.sync,
    });
    let samples = samples.collect();
    Ok(Track {
        samples,
        tick: 1.0 / f64::from(chosen.scale),
        prefix: Vec::new(),
        pixel_aspect: chosen.pixel_aspect(),
        colour: chosen.description.colour,
        turn: turn(chosen.matrix)?,
        capture_rate: keys::capture_rate(&moov),
        configuration: chosen.description.configuration?,
    })
}

impl Candidate<'_> {
    /// As ffmpeg has it: the box `pasp`, else the size at which the track is shown against the size of its frames.
    fn pixel_aspect(&self) -> Option<[u32; 2]> {
        let [width, height] = self.description.size.map(u64::from);
        let [shown_width, shown_height] = self.shown.map(|n| u64::from(n >> 16));
        if self.description.pixel_aspect.is_some() || [width, height] == [shown_width, shown_height] {
            return self.description.pixel_aspect;
        }
        let (a, b) = (height * shown_width, width * shown_height);
        let mut divisor = [a, b];
        while divisor[1] > 0 {
            divisor = [divisor[1], divisor[0] % divisor[1]];
        }
        let reduced = [a.checked_div(divisor[0])?, b.checked_div(divisor[0])?];
        let reduced = [u32::try_from(reduced[0]).ok()?, u32::try_from(reduced[1]).ok()?];
        Some(reduced).filter(|r| r[0] > 0 && r[1] > 0)
    }

    /// Enabled tracks come first, larger ones before smaller ones; images of a title do not count.
    fn score(&self) -> (bool, bool, u64) {
        let [width, height] = self.description.size.map(u64::from);
        (!self.still, self.enabled, width * height)
    }
}

/// The track that a player shows.
fn choose(moov: &[u8]) -> Result<Candidate<'_>, Refused> {
    let mut chosen: Option<Candidate> = None;
    for (kind, trak) in inside(moov)? {
        if kind == *b"trak"
            && let Some(found) = candidate(trak)?
            && chosen.as_ref().is_none_or(|c| found.score() > c.score())
        {
            chosen = Some(found);
        }
    }
    match chosen {
        Some(chosen) if !chosen.still => Ok(chosen),
        _ => not_handled("a file without a video track"),
    }
}

/// The track if it is a film.
fn candidate(trak: &[u8]) -> Result<Option<Candidate<'_>>, Refused> {
    let mdia = needed(trak, b"mdia")?;
    let (_, _, mut handler) = full(needed(mdia, b"hdlr")?, "box hdlr")?;
    handler.take(4)?;
    if handler.take(4)? != b"vide" {
        return Ok(None);
    }
    let (version, flags, mut bytes) = full(needed(trak, b"tkhd")?, "box tkhd")?;
    bytes.take(if version == 1 { 16 } else { 8 })?;
    let number = bytes.u32()?;
    bytes.take(if version == 1 { 12 } else { 8 } + 16)?;
    let [a, b, _, c, d, _, _, _, _] = {
        let mut matrix = [0; 9];
        for value in &mut matrix {
            *value = bytes.i32()?;
        }
        matrix
    };
    let shown = [bytes.u32()?, bytes.u32()?];
    let (version, _, mut bytes) = full(needed(mdia, b"mdhd")?, "box mdhd")?;
    bytes.take(if version == 1 { 16 } else { 8 })?;
    let minf = needed(mdia, b"minf")?;
    if let Some(dinf) = child(minf, b"dinf")? {
        elsewhere(dinf)?;
    }
    let stbl = needed(minf, b"stbl")?;
    let description = description(needed(stbl, b"stsd")?)?;
    let one = child(stbl, b"stsz")?.is_some_and(|stsz| stsz.get(8..12) == Some(&[0, 0, 0, 1]));
    Ok(Some(Candidate {
        trak,
        number,
        enabled: flags & 1 != 0,
        shown,
        matrix: [a, b, c, d],
        scale: scale(bytes.u32()?)?,
        stbl,
        still: description.still && one,
        description,
    }))
}

/// Refuses tracks whose samples are in another file.
fn elsewhere(dinf: &[u8]) -> Result<(), Refused> {
    let Some(dref) = child(dinf, b"dref")? else { return Ok(()) };
    for (kind, content) in inside(dref.get(8..).unwrap_or_default())? {
        let (_, flags, _) = full(content, "box dref")?;
        if flags & 1 == 0 {
            return not_handled(format!("frames that are in another file (box dref, {})", name(kind)));
        }
    }
    Ok(())
}

fn scale(units: u32) -> Result<u32, Refused> {
    if units == 0 { damaged("times in units of 0 per second") } else { Ok(units) }
}
