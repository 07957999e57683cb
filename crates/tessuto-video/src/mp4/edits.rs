//! Edit lists: which parts of a track are shown, and when.
//!
//! Source: ISO/IEC 14496-12 (2022), 8.6.6. Which frames of a cut are shown is as ffmpeg has it: those whose own
//! time lies within.

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
        if !(0..=1 << 62).contains(&media) {
            return damaged(format!("an edit begins at time {media}"));
        }
        let last = number + 1 == count;
        let units = (u128::from(duration) * u128::from(scale) + u128::from(movie_scale) / 2)
            / u128::from(movie_scale);
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
    if edits.len() > 100 {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes(), &kind[..], content].concat()
    }

    /// A track of 600 units a second in a film of 1000, with edits of (duration, media time, rate).
    fn list(edits: &[(u32, i32, u32)]) -> Result<Vec<Edit>, Refused> {
        let mut elst = vec![0; 4];
        elst.extend((edits.len() as u32).to_be_bytes());
        for (duration, media, rate) in edits {
            elst.extend([duration.to_be_bytes(), media.to_be_bytes(), rate.to_be_bytes()].concat());
        }
        super::edits(&boxed(b"edts", &boxed(b"elst", &elst)), 600, 1000, false)
    }

    #[test]
    fn parts_are_shown_one_after_the_other() {
        // Half a second of nothing, then units 300 to 600, then what is from 1200 on.
        let edits = list(&[(500, -1, 1 << 16), (500, 300, 1 << 16), (0, 1200, 1 << 16)]).unwrap();
        let at = |time| shown(&edits, time, 600);
        assert_eq!([at(299), at(300), at(599), at(600)], [None, Some(0.5), Some(0.5 + 299.0 / 600.0), None]);
        assert_eq!(
            [at(1199), at(1200), at(1 << 40)],
            [None, Some(1.0), Some(1.0 + ((1i64 << 40) - 1200) as f64 / 600.0)]
        );
    }

    #[test]
    fn no_list_shows_everything() {
        let edits = super::edits(&[], 600, 1000, false).unwrap();
        assert_eq!([shown(&edits, -60, 600), shown(&edits, 60, 600)], [Some(-0.1), Some(0.1)]);
        assert_eq!(list(&[(500, -1, 1 << 16)]).unwrap(), edits);
    }

    #[test]
    fn other_rates_and_repeated_parts_are_not_handled() {
        assert!(matches!(list(&[(500, 0, 1 << 15)]), Err(Refused::NotHandled(_))));
        assert!(matches!(list(&[(500, 0, 1 << 16), (500, 100, 1 << 16)]), Err(Refused::NotHandled(_))));
        assert!(matches!(list(&[(500, -2, 1 << 16)]), Err(Refused::Damaged(_))));
    }
}
