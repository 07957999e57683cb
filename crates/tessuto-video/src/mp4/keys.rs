//! Metadata by name: the rate at which a slow motion was filmed.
//!
//! Source: Apple, *QuickTime File Format*, "Metadata" (boxes `meta`, `keys`, `ilst`); Android,
//! *MediaRecorder.setCaptureRate*, which writes `com.android.capture.fps`.

use super::boxes::{boxes, child};

/// Rates that cameras have `[1/s]`.
const SANE: std::ops::RangeInclusive<f64> = 1.0..=100_000.0;

/// The rate `[1/s]` at which the film was filmed, if the film says one. Damaged metadata says nothing: no frame
/// depends on it.
pub(crate) fn capture_rate(moov: &[u8]) -> Option<f64> {
    let udta = child(moov, b"udta").ok().flatten();
    rate(moov).or_else(|| rate(udta?))
}

/// That of the box `meta` inside of `content`.
fn rate(content: &[u8]) -> Option<f64> {
    let meta = child(content, b"meta").ok()??;
    // MP4 has version and flags before the first box, QuickTime has not.
    let meta = if meta.get(4..8) == Some(b"hdlr") { meta } else { meta.get(4..)? };
    let keys = child(meta, b"keys").ok()??.get(8..)?;
    let index =
        boxes(keys).ok()?.iter().position(|(_, name)| *name == b"com.android.capture.fps")? as u32 + 1;
    let values = child(meta, b"ilst").ok()??;
    let (_, item) = boxes(values).ok()?.into_iter().find(|(kind, _)| u32::from_be_bytes(*kind) == index)?;
    number(child(item, b"data").ok()??).filter(|rate| SANE.contains(rate))
}

/// A value by its type: 23 and 24 numbers with a point, 21 and 22 whole ones, 1 text.
fn number(data: &[u8]) -> Option<f64> {
    let (kind, value) = (u32::from_be_bytes(data.get(..4)?.try_into().ok()?), data.get(8..)?);
    match (kind, value.len()) {
        (23, 4) => Some(f32::from_be_bytes(value.try_into().ok()?).into()),
        (24, 8) => Some(f64::from_be_bytes(value.try_into().ok()?)),
        (21 | 22 | 67 | 77 | 78, 1..=8) => Some(value.iter().fold(0.0, |n, &b| n * 256.0 + f64::from(b))),
        (1, _) => std::str::from_utf8(value).ok()?.trim().parse().ok(),
        _ => None,
    }
}
