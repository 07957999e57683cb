//! The tables of a track: sizes, places and times of its samples.
//!
//! Source: ISO/IEC 14496-12 (2022), 8.6.1 (times), 8.7 (sizes and places).

use super::boxes::{child, full, needed};
use crate::bytes::Bytes;
use crate::limits::Limits;
use crate::refused::{Refused, damaged, not_handled};

/// A sample with its time in the units of the track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) offset: u64,
    pub(crate) size: u32,
    /// Time of presentation, before edit lists.
    pub(crate) time: i64,
    pub(crate) sync: bool,
    /// Number of the sample's description, from 1.
    pub(crate) description: u32,
}

/// The samples that a box `stbl` lists; none for a file whose samples are all in fragments.
pub(crate) fn entries(stbl: &[u8], length: u64, limits: &Limits) -> Result<Vec<Entry>, Refused> {
    let sizes = sizes(stbl, length, limits)?;
    let mut entries: Vec<Entry> = sizes
        .into_iter()
        .map(|size| Entry { offset: 0, size, time: 0, sync: true, description: 1 })
        .collect();
    if entries.is_empty() {
        return Ok(entries);
    }
    places(stbl, &mut entries)?;
    times(stbl, &mut entries)?;
    if let Some(stss) = child(stbl, b"stss")? {
        entries.iter_mut().for_each(|e| e.sync = false);
        let (_, _, mut bytes) = full(stss, "box stss")?;
        for _ in 0..bytes.u32()? {
            let number = bytes.u32()? as usize;
            if let Some(entry) = number.checked_sub(1).and_then(|k| entries.get_mut(k)) {
                entry.sync = true;
            }
        }
    }
    Ok(entries)
}

/// `stsz` and `stz2`.
fn sizes(stbl: &[u8], length: u64, limits: &Limits) -> Result<Vec<u32>, Refused> {
    if let Some(stsz) = child(stbl, b"stsz")? {
        let (_, _, mut bytes) = full(stsz, "box stsz")?;
        let (size, count) = (bytes.u32()?, bytes.u32()?);
        limits.check_count(count.into())?;
        if size > 0 {
            // No table says how many there are: the file's length does.
            if u64::from(size) * u64::from(count) > length {
                return damaged(format!("{count} frames of {size} bytes in a file of {length} bytes"));
            }
            return Ok(vec![size; count as usize]);
        }
        let mut table = Bytes::new(bytes.take(count as usize * 4)?, "box stsz");
        return (0..count).map(|_| table.u32()).collect();
    }
    let (_, _, mut bytes) = full(needed(stbl, b"stz2")?, "box stz2")?;
    let (bits, count) = (bytes.u32()? & 255, bytes.u32()?);
    limits.check_count(count.into())?;
    match bits {
        4 => {
            let table = bytes.take((count as usize).div_ceil(2))?;
            Ok((0..count as usize)
                .map(|k| u32::from(table[k / 2] >> if k % 2 == 0 { 4 } else { 0 } & 15))
                .collect())
        }
        8 | 16 => {
            let mut table = Bytes::new(bytes.take(count as usize * bits as usize / 8)?, "box stz2");
            (0..count).map(|_| Ok(table.number(bits as usize / 8)? as u32)).collect()
        }
        _ => damaged(format!("box stz2 with sizes of {bits} bits")),
    }
}

/// `stsc` with `stco` or `co64`.
fn places(stbl: &[u8], entries: &mut [Entry]) -> Result<(), Refused> {
    let (width, content) = match child(stbl, b"stco")? {
        Some(content) => (4, content),
        None => (8, needed(stbl, b"co64")?),
    };
    let (_, _, mut chunks) = full(content, "the table of chunks")?;
    let count = chunks.u32()?;
    chunks.rest = chunks.take((count as usize).saturating_mul(width))?;
    let (_, _, mut runs) = full(needed(stbl, b"stsc")?, "box stsc")?;
    let runs_left = runs.u32()?;
    runs.rest = runs.take((runs_left as usize).saturating_mul(12))?;
    let run = |rest: &mut Bytes| -> Result<Option<[u32; 3]>, Refused> {
        if rest.rest.is_empty() { Ok(None) } else { Ok(Some([rest.u32()?, rest.u32()?, rest.u32()?])) }
    };
    let mut now = run(&mut runs)?;
    let mut next = run(&mut runs)?;
    let mut at = 0;
    for chunk in 1..=count {
        if next.is_some_and(|n| n[0] <= chunk) {
            now = next;
            next = run(&mut runs)?;
            if let (Some(now), Some(next)) = (now, next)
                && next[0] <= now[0]
            {
                return damaged("the runs of box stsc are not in order");
            }
        }
        let mut offset = chunks.number(width)?;
        let Some([first, samples, description]) = now else { return damaged("box stsc is empty") };
        if first > chunk {
            return damaged("the runs of box stsc do not begin with the first chunk");
        }
        for _ in 0..samples.min((entries.len() - at) as u32) {
            let entry = &mut entries[at];
            (entry.offset, entry.description) = (offset, description);
            offset = offset.saturating_add(entry.size.into());
            at += 1;
        }
        if at == entries.len() {
            return Ok(());
        }
    }
    damaged(format!("{at} of {} frames have a place in the file", entries.len()))
}

/// `stts` and `ctts`.
fn times(stbl: &[u8], entries: &mut [Entry]) -> Result<(), Refused> {
    let (_, _, mut bytes) = full(needed(stbl, b"stts")?, "box stts")?;
    let (mut at, mut time) = (0, 0i64);
    for _ in 0..bytes.u32()? {
        let (count, delta) = (bytes.u32()?, bytes.i32()?);
        if delta < 0 {
            return not_handled("a frame of negative duration");
        }
        for _ in 0..(count as usize).min(entries.len() - at) {
            entries[at].time = time;
            time += i64::from(delta);
            at += 1;
        }
    }
    if at < entries.len() {
        return damaged(format!("{at} of {} frames have a time", entries.len()));
    }
    let Some(ctts) = child(stbl, b"ctts")? else { return Ok(()) };
    // Version 0 is unsigned, but files of version 0 with negative offsets are common, and offsets of 2³¹ and more
    // are not.
    let (_, _, mut bytes) = full(ctts, "box ctts")?;
    let mut at = 0;
    for _ in 0..bytes.u32()? {
        let (count, offset) = (bytes.u32()?, bytes.i32()?);
        for _ in 0..(count as usize).min(entries.len() - at) {
            entries[at].time += i64::from(offset);
            at += 1;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(kind: &[u8; 4], words: &[u32], tail: &[u8]) -> Vec<u8> {
        let content: Vec<u8> =
            words.iter().flat_map(|w| w.to_be_bytes()).chain(tail.iter().copied()).collect();
        [&(content.len() as u32 + 8).to_be_bytes(), &kind[..], &content].concat()
    }

    fn read(boxes: &[Vec<u8>]) -> Result<Vec<Entry>, Refused> {
        entries(&boxes.concat(), 1 << 40, &Limits { frames: 100, ..Limits::default() })
    }

    const TIMES: (&[u8; 4], &[u32]) = (b"stts", &[0, 2, 2, 10, 9, 20]);

    #[test]
    fn compact_sizes_and_far_places_are_read() {
        let places = boxed(b"co64", &[0, 2, 1, 0, 2, 50], &[]);
        let runs = boxed(b"stsc", &[0, 2, 1, 2, 1, 2, 1, 2], &[]);
        let times = boxed(TIMES.0, TIMES.1, &[]);
        for sizes in [
            boxed(b"stz2", &[0, 4, 3], &[0x79, 0x50]),
            boxed(b"stz2", &[0, 8, 3], &[7, 9, 5]),
            boxed(b"stz2", &[0, 16, 3], &[0, 7, 0, 9, 0, 5]),
            boxed(b"stsz", &[0, 0, 3, 7, 9, 5], &[]),
        ] {
            let found = read(&[sizes, places.clone(), runs.clone(), times.clone()]).unwrap();
            let seen: Vec<_> = found.iter().map(|e| (e.offset, e.size, e.time, e.description)).collect();
            let far = 1u64 << 32;
            assert_eq!(seen, [(far, 7, 0, 1), (far + 7, 9, 10, 1), (2 * far + 50, 5, 20, 2)]);
        }
    }

    #[test]
    fn offsets_of_time_may_be_negative() {
        let common = [
            boxed(b"stsz", &[0, 8, 3], &[]),
            boxed(b"stco", &[0, 1, 40], &[]),
            boxed(b"stsc", &[0, 1, 1, 3, 1], &[]),
            boxed(TIMES.0, TIMES.1, &[]),
            boxed(b"stss", &[0, 2, 1, 3], &[]),
        ];
        for version in [0, 1 << 24] {
            let offsets = boxed(b"ctts", &[version, 2, 1, 0, 2, -15i32 as u32], &[]);
            let found = read(&[common.concat(), offsets]).unwrap();
            assert_eq!(found.iter().map(|e| e.time).collect::<Vec<_>>(), [0, -5, 5]);
            assert_eq!(found.iter().map(|e| e.offset).collect::<Vec<_>>(), [40, 48, 56]);
            assert_eq!(found.iter().map(|e| e.sync).collect::<Vec<_>>(), [true, false, true]);
        }
    }

    #[test]
    fn counts_that_the_file_cannot_hold_are_refused() {
        let times = boxed(TIMES.0, TIMES.1, &[]);
        let places = boxed(b"stco", &[0, 1, 40], &[]);
        let runs = boxed(b"stsc", &[0, 1, 1, 3, 1], &[]);
        let refused = |sizes: Vec<u8>| {
            read(&[sizes, places.clone(), runs.clone(), times.clone()]).unwrap_err().to_string()
        };
        assert!(refused(boxed(b"stsz", &[0, 0, 101], &[])).contains("101 frames; up to 100"));
        assert!(refused(boxed(b"stsz", &[0, 0, 90, 1], &[])).contains("ends early"));
        let whole = boxed(b"stsz", &[0, 1 << 31, 90], &[]);
        assert!(
            entries(&whole, 1000, &Limits::default())
                .unwrap_err()
                .to_string()
                .contains("in a file of 1000 bytes")
        );
        // Four frames where the places and the times are of three.
        assert!(refused(boxed(b"stsz", &[0, 1, 4], &[])).contains("3 of 4 frames have a place"));
    }
}
