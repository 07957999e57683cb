//! Edit lists: which parts of a track are shown, and when.
//!
//! Source: ISO/IEC 14496-12 (2022), 8.6.6. Which frames of a cut are shown is as ffmpeg has it: those whose own time lies within.

use super::boxes::{child, full};
use crate::refused::{Refused, damaged, not_handled};

/// A part of the track that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edit {
    /// Beginning and end in the units of the track.
    media: [i64; 2],
    /// When it begins `[s]`.
    start: f64,
}

/// The edit list of a track; one that shows everything where there is none.
///
/// `open` leaves the end open: in files of fragments the list is written before the frames are.
pub(crate) fn edits(trak: &[u8], scale: u32, movie_scale: u32, open: bool) -> Result<Vec<Edit>, Refused> {
    let all = vec![Edit { media: [i64::MIN, i64::MAX], start: 0.0 }];
    let Some(edts) = child(trak, b"edts")? else { return Ok(all) };
    let Some(elst) = child(edts, b"elst")? else { return Ok(all) };
    let (version, _, mut bytes) = full(elst, "box elst")?;
    let count = bytes.u32()?;
    let width = if version == 1 { 8 } else { 4 };
    bytes.rest = bytes.take((count as usize).saturating_mul(2 * width + 4))?;
    let mut edits: Vec<Edit> = Vec::new();
    let mut start = 0.0;
    for number in 0..count {
        let duration = bytes.number(width)?;
        let media = bytes.number(width)?;
        let media = if version == 1 { media as i64 } else { i64::from(media as u32 as i32) };
        let rate = bytes.u32()?;
        let seconds = duration as f64 / f64::from(movie_scale);
        if media == -1 {
            start += seconds;
            continue;
        }
        if rate != 0x1_0000 {
            return not_handled("an edit list with another rate than 1");
        }
        if media < 0 || media > 1 << 62 {
            return damaged(format!("an edit begins at time {media}"));
        }
        let last = number + 1 == count;
        let units = (u128::from(duration) * u128::from(scale) + u128::from(movie_scale) / 2) / u128::from(movie_scale);
        let end = if last && (open || duration == 0) {
            i64::MAX
        } else {
            media.saturating_add(i64::try_from(units).unwrap_or(i64::MAX))
        };
        if edits.iter().any(|e| e.media[0] < end && media < e.media[1]) {
            return not_handled("an edit list that shows a part twice");
        }
        edits.push(Edit { media: [media, end], start });
        start += seconds;
    }
    // Long lists are of editing programs; every frame is looked up in them.
    if edits.len() > 1000 {
        return not_handled(format!("an edit list of {} parts", edits.len()));
    }
    Ok(if edits.is_empty() { all } else { edits })
}

/// When a frame of time `time` is shown `[s]`.
pub(crate) fn shown(edits: &[Edit], time: i64, scale: u32) -> Option<f64> {
    let edit = edits.iter().find(|e| e.media[0] <= time && time < e.media[1])?;
    let from = if edit.media[0] == i64::MIN { 0 } else { edit.media[0] };
    Some(edit.start + (time - from) as f64 / f64::from(scale))
}
