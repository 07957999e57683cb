//! Fragments: samples listed in pieces beside the film, as recorders write that may be stopped at any moment.
//!
//! Source: ISO/IEC 14496-12 (2022), 8.8.

use super::boxes::{Kind, boxes, child, full, needed};
use super::table::Entry;
use crate::limits::Limits;
use crate::refused::{Refused, damaged};

/// What samples are if their fragment does not say otherwise (`trex`).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Defaults {
    description: u32,
    duration: u32,
    size: u32,
    flags: u32,
}

/// The defaults of a track; `None` for a film without fragments.
pub(crate) fn defaults(moov: &[u8], track: u32) -> Result<Option<Defaults>, Refused> {
    let Some(mvex) = child(moov, b"mvex")? else { return Ok(None) };
    for (kind, content) in boxes(mvex)? {
        if kind == *b"trex" {
            let (_, _, mut bytes) = full(content, "box trex")?;
            if bytes.u32()? == track {
                return Ok(Some(Defaults {
                    description: bytes.u32()?,
                    duration: bytes.u32()?,
                    size: bytes.u32()?,
                    flags: bytes.u32()?,
                }));
            }
        }
    }
    Ok(Some(Defaults { description: 1, ..Defaults::default() }))
}

/// Collects the samples of one track from fragment after fragment.
pub(crate) struct Fragments<'a> {
    track: u32,
    defaults: Defaults,
    /// When the next sample is decoded, in the units of the track.
    time: i64,
    limits: &'a Limits,
}

/// Where the bytes of a fragment's track lie, and what its samples are by default.
struct Run {
    base: u64,
    next: u64,
    defaults: Defaults,
}

impl<'a> Fragments<'a> {
    pub(crate) fn new(track: u32, defaults: Defaults, time: i64, limits: &'a Limits) -> Self {
        Fragments { track, defaults, time, limits }
    }

    /// Adds the samples of a box `moof` that begins at byte `start` of the file.
    pub(crate) fn add(&mut self, moof: &[u8], start: u64, entries: &mut Vec<Entry>) -> Result<(), Refused> {
        let mut next = start;
        for (kind, traf) in boxes(moof)? {
            if kind == *b"traf" {
                next = self.track_of(traf, start, next, entries)?;
            }
        }
        Ok(())
    }

    /// Adds the samples of a box `traf`, if it is of the track; returns where the data of the next begins if it
    /// does not say.
    fn track_of(
        &mut self,
        traf: &[u8],
        start: u64,
        next: u64,
        entries: &mut Vec<Entry>,
    ) -> Result<u64, Refused> {
        let (_, flags, mut bytes) = full(needed(traf, b"tfhd")?, "box tfhd")?;
        let ours = bytes.u32()? == self.track;
        let mut defaults = if ours { self.defaults } else { Defaults::default() };
        let base = match flags {
            f if f & 1 != 0 => bytes.u64()?,
            f if f & 0x2_0000 != 0 => start,
            _ => next,
        };
        for (flag, value) in [
            (2, &mut defaults.description),
            (8, &mut defaults.duration),
            (0x10, &mut defaults.size),
            (0x20, &mut defaults.flags),
        ] {
            if flags & flag != 0 {
                *value = bytes.u32()?;
            }
        }
        if ours && let Some(tfdt) = child(traf, b"tfdt")? {
            let (version, _, mut bytes) = full(tfdt, "box tfdt")?;
            let time = bytes.number(if version == 1 { 8 } else { 4 })?;
            self.time = i64::try_from(time).ok().filter(|t| *t < 1 << 62).ok_or_else(late)?;
        }
        let mut run = Run { base, next: base, defaults };
        for (kind, trun) in boxes(traf)? {
            if kind == *b"trun" {
                self.run(trun, &mut run, ours.then_some(&mut *entries))?;
            }
        }
        Ok(run.next)
    }

    /// Adds the samples of a box `trun` to `entries`, or only passes over their bytes.
    fn run(
        &mut self,
        trun: &[u8],
        run: &mut Run,
        mut entries: Option<&mut Vec<Entry>>,
    ) -> Result<(), Refused> {
        let (_, flags, mut bytes) = full(trun, "box trun")?;
        let count = bytes.u32()?;
        self.limits.check_count(u64::from(count) + entries.as_ref().map_or(0, |e| e.len() as u64))?;
        if flags & 1 != 0 {
            run.next = run.base.saturating_add_signed(i64::from(bytes.i32()?));
        }
        let first = if flags & 4 != 0 { Some(bytes.u32()?) } else { None };
        for number in 0..count {
            let mut field = |flag, default| if flags & flag != 0 { bytes.u32() } else { Ok(default) };
            let duration = field(0x100, run.defaults.duration)?;
            let size = field(0x200, run.defaults.size)?;
            let own = field(0x400, first.filter(|_| number == 0).unwrap_or(run.defaults.flags))?;
            let shift = field(0x800, 0)? as i32;
            if let Some(entries) = &mut entries {
                entries.push(Entry {
                    offset: run.next,
                    size,
                    time: self.time + i64::from(shift),
                    sync: own & 0x1_0000 == 0,
                    description: run.defaults.description,
                });
                self.time =
                    self.time.checked_add(duration.into()).filter(|t| *t < 1 << 62).ok_or_else(late)?;
            }
            run.next = run.next.saturating_add(size.into());
        }
        Ok(())
    }
}

fn late() -> Refused {
    damaged::<()>("a time stamp of more than 2⁶² units").unwrap_err()
}

/// Whether boxes of this kind hold fragments.
pub(crate) fn is_fragment(kind: Kind) -> bool {
    kind == *b"moof"
}
