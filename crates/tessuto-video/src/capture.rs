//! At which rate a film was filmed, where it is stamped to be played slower or faster.
//!
//! Android phones write `com.android.capture.fps` into the metadata of the file, cameras of Sony `captureFps`
//! beside `formatFps` into XML in a box `meta` of it. iPhones stamp their slow motion with the times at which it
//! was filmed, and slow it down when it is played, so that the stamps are right already.
//!
//! Sources: Android, `MediaMuxer` and AOSP `MPEG4Writer::writeMoovLevelMetaBox` ("com.android.capture.fps"); Sony,
//! *NonRealTimeMeta* (element `VideoFrame`); Apple, *QuickTime File Format*, boxes `meta` and `xml `.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Rates that cameras have `[1/s]`; a time lapse may have a frame in some minutes.
const SANE: std::ops::RangeInclusive<f64> = 1e-3..=10_000.0;
/// Longest XML read `[bytes]`.
const LONGEST: u64 = 1 << 20;
/// Most boxes of a file that are looked at.
const MOST_BOXES: usize = 10_000;

/// The rate that the metadata `tags` or the file at `path` name; `None` where they name none, or nonsense.
pub(crate) fn rate<'a>(tags: impl Iterator<Item = &'a BTreeMap<String, String>>, path: &Path) -> Option<f64> {
    let mut values = tags.filter_map(|tags| tags.get("com.android.capture.fps"));
    rate_of(values.find_map(|value| value.trim().parse().ok()), path)
}

/// The same where Android's number is known.
pub(crate) fn rate_of(android: Option<f64>, path: &Path) -> Option<f64> {
    android.or_else(|| in_xml(&xml_of(path)?)).map(television).filter(|rate| SANE.contains(rate))
}

/// Rates of television are thousandths off round ones, and written with two or three digits.
fn television(rate: f64) -> f64 {
    let exact = (rate * 1.001).round() * 1000.0 / 1001.0;
    let is_near = (rate - exact).abs() < 0.006 && (rate - rate.round()).abs() > 0.006;
    if is_near { exact } else { rate }
}

/// The value of `captureFps`, such as `119.88p`, where whole frames were filmed.
fn in_xml(xml: &str) -> Option<f64> {
    let value = xml.split_once("captureFps=\"")?.1.split('"').next()?;
    value.strip_suffix('p')?.parse().ok()
}

/// The text in the box `xml ` in a box `meta` of the file, which is beside the film.
fn xml_of(path: &Path) -> Option<String> {
    let mut file = File::open(path).ok()?;
    let end = file.metadata().ok()?.len();
    let mut at = 0;
    for _ in 0..MOST_BOXES {
        let (kind, head, length) = box_at(&mut file, at, end)?;
        if &kind == b"meta" {
            // Version and flags stand before the first box within.
            let (mut inner, last) = (at + head + 4, at + length);
            while inner < last {
                let (kind, head, length) = box_at(&mut file, inner, last)?;
                if &kind == b"xml " {
                    file.seek(SeekFrom::Start(inner + head)).ok()?;
                    let mut text = Vec::new();
                    file.take((length - head).min(LONGEST)).read_to_end(&mut text).ok()?;
                    return Some(String::from_utf8_lossy(&text).into_owned());
                }
                inner += length;
            }
        }
        at += length;
    }
    None
}

/// Kind of the box at this place, and the lengths of its head and of all of it `[bytes]`.
fn box_at(file: &mut File, at: u64, end: u64) -> Option<([u8; 4], u64, u64)> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut bytes = [0; 16];
    file.read_exact(&mut bytes[..8]).ok()?;
    let kind = bytes[4..8].try_into().ok()?;
    let (head, length) = match u32::from_be_bytes(bytes[..4].try_into().ok()?) {
        0 => (8, end.checked_sub(at)?),
        1 => {
            file.read_exact(&mut bytes[8..]).ok()?;
            (16, u64::from_be_bytes(bytes[8..].try_into().ok()?))
        }
        length => (8, u64::from(length)),
    };
    (length >= head && at.checked_add(length)? <= end).then_some((kind, head, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_box(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat()
    }

    #[test]
    fn phones_say_it_in_tags() {
        let said = |value: &str| {
            let tags = BTreeMap::from([("com.android.capture.fps".to_owned(), value.to_owned())]);
            rate([&tags].into_iter(), Path::new("/no/such/film.mp4"))
        };
        assert_eq!((said("240.0"), said("240"), said("0.5")), (Some(240.0), Some(240.0), Some(0.5)));
        assert_eq!(
            (said("inf"), said("nan"), said("0"), said("-30"), said("2e5"), said("fast")),
            (None, None, None, None, None, None)
        );
    }

    #[test]
    fn cameras_say_it_in_xml() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("C0001.MP4");
        let said = |frame: &str| {
            let xml = format!(
                "<NonRealTimeMeta><VideoFormat><VideoFrame {frame} \
                 formatFps=\"29.97p\"/></VideoFormat></NonRealTimeMeta>"
            );
            let meta = [&[0; 4][..], &in_box(b"hdlr", &[0; 25]), &in_box(b"xml ", xml.as_bytes())].concat();
            let whole =
                [in_box(b"ftyp", b"XAVC"), in_box(b"mdat", &[7; 50]), in_box(b"meta", &meta)].concat();
            std::fs::write(&path, &whole).unwrap();
            (rate(std::iter::empty(), &path), whole)
        };
        assert_eq!(said("captureFps=\"119.88p\"").0, Some(120_000.0 / 1001.0));
        assert_eq!(said("captureFps=\"100.00p\"").0, Some(100.0));
        // Fields are no frames.
        assert_eq!(said("captureFps=\"59.94i\"").0, None);
        // Cut off anywhere, or with a length that lies: no panic.
        let whole = said("captureFps=\"100.00p\"").1;
        for end in 0..whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            let _ = rate(std::iter::empty(), &path);
            let mut lying = whole.clone();
            lying[end] ^= 0x80;
            std::fs::write(&path, &lying).unwrap();
            let _ = rate(std::iter::empty(), &path);
        }
    }
}
