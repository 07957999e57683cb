//! What a video or photo says of its lens: the focal length in 35 mm terms.
//!
//! Phones of Apple write it among the metadata of the file or of its video track, cameras into EXIF. A recording
//! that says 26 mm has the diagonal field of view of a 26 mm lens on 35 mm film, whose diagonal is 43.27 mm.
//!
//! Sources: Apple, *QuickTime File Format*, "Metadata" (boxes `meta`, `keys`, `ilst`); CIPA DCG-001, "35mm film
//! equivalent focal length"; JEITA CP-3451, *Exif*, tag 0xA405.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::calibration::{Calibration, Focal};
use super::video::options;
use crate::io::expect_file;

/// Names of the entry, in small letters without punctuation, at their ends:
/// `com.apple.quicktime.camera.focal_length.35mm_equivalent`, and EXIF's `FocalLengthIn35mmFilm` as programs write
/// it.
const NAMES: [&str; 3] = ["focallength35mmequivalent", "focallengthin35mmfilm", "focallengthin35mmformat"];
/// Values that a lens has `[mm]`; EXIF has 0 where it is unknown.
const SANE: std::ops::RangeInclusive<f64> = 5.0..=2000.0;
/// Standard deviation of such a value, as a fraction: it is rounded to a millimetre and said of photos, and videos
/// show less at their borders, most of all stabilised ones.
pub(super) const UNCERTAINTY: f64 = 0.06;
/// Longest box `moov` read, and longest beginning of a photo `[bytes]`.
const LONGEST: u64 = 256 << 20;
const HEAD: u64 = 1 << 18;

/// The camera that `input`, a video or a folder of images, says it was recorded with; `None` if it does not say.
/// Files that cannot be read say nothing: who reads the frames names their faults.
pub fn camera_of(input: &Path, ffmpeg: &Path) -> Option<Calibration> {
    expect_file(input).ok()?;
    let file = if input.is_dir() { first_photo(input)? } else { input.to_path_buf() };
    let sane = |(name, mm): (String, f64)| SANE.contains(&mm).then_some((name, mm));
    let found = in_boxes(&file).and_then(sane);
    let found = found.or_else(|| {
        in_exif(&beginning(&file)?).map(|mm| ("FocalLengthIn35mmFilm".to_owned(), mm)).and_then(sane)
    });
    let (name, mm) =
        found.or_else(|| if input.is_dir() { None } else { said_by(ffmpeg, &file).and_then(sane) })?;
    let place = input.display().to_string();
    Some(Calibration {
        uncertainty: Some(UNCERTAINTY),
        notes: vec![format!(
            "says of its lens {mm} mm in 35-mm terms ({name}); true to about {:.0} %, as videos often show \
             less than photos: a calibration is better",
            100.0 * UNCERTAINTY
        )],
        ..Calibration::new(place, Focal::Film(mm))
    })
}

fn first_photo(folder: &Path) -> Option<std::path::PathBuf> {
    let photo = |path: &std::path::PathBuf| {
        path.extension().is_some_and(|e| ["jpg", "jpeg"].contains(&&*e.to_string_lossy().to_lowercase()))
    };
    std::fs::read_dir(folder).ok()?.filter_map(|e| Some(e.ok()?.path())).filter(photo).min()
}

fn beginning(path: &Path) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(HEAD).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Whether metadata of this name is the focal length in 35 mm terms.
fn is_named(name: &str) -> bool {
    let plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
    NAMES.iter().any(|n| plain.ends_with(n))
}

/// Number at the beginning of a text such as `26 mm`.
fn number(text: &str) -> Option<f64> {
    let end = text.trim().find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.trim().len());
    text.trim()[..end].parse().ok()
}

/// From what ffprobe reads of the file, for containers other than MP4 and QuickTime.
fn said_by(ffmpeg: &Path, path: &Path) -> Option<(String, f64)> {
    let tags = tessuto_video::tags(path, &options(ffmpeg, None))?;
    let (name, value) = tags.into_iter().find(|(name, _)| is_named(name))?;
    Some((name, number(&value)?))
}

/// From the metadata of an MP4 or QuickTime file, or of its tracks.
fn in_boxes(path: &Path) -> Option<(String, f64)> {
    let mut file = File::open(path).ok()?;
    let end = file.metadata().ok()?.len();
    let mut at = 0;
    // The boxes of the file are skipped up to the one that describes it, which may be at its end.
    while at + 8 <= end {
        file.seek(SeekFrom::Start(at)).ok()?;
        let mut header = [0u8; 16];
        file.read_exact(&mut header[..8]).ok()?;
        let kind: [u8; 4] = header[4..8].try_into().ok()?;
        let (length, head) = match u32::from_be_bytes(header[..4].try_into().ok()?) {
            0 => (end - at, 8),
            1 => {
                file.read_exact(&mut header[8..]).ok()?;
                (u64::from_be_bytes(header[8..].try_into().ok()?), 16)
            }
            length => (u64::from(length), 8),
        };
        if length < head {
            return None;
        }
        if &kind == b"moov" {
            let mut bytes = Vec::new();
            file.take((length - head).min(LONGEST)).read_to_end(&mut bytes).ok()?;
            return in_movie(&bytes, 0);
        }
        at = at.checked_add(length)?;
    }
    None
}

/// The boxes in `bytes`: kind and content.
fn boxes(bytes: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        let length = usize::try_from(u32_at(rest, 0)?).ok()?;
        let content = rest.get(8..length)?;
        let kind = &rest[4..8];
        rest = &rest[length..];
        Some((kind, content))
    })
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn in_movie(bytes: &[u8], depth: usize) -> Option<(String, f64)> {
    boxes(bytes).find_map(|(kind, content)| match kind {
        b"meta" => in_meta(content),
        b"trak" | b"udta" if depth < 3 => in_movie(content, depth + 1),
        _ => None,
    })
}

/// `keys` has the names, `ilst` the values, numbered from 1.
fn in_meta(content: &[u8]) -> Option<(String, f64)> {
    // MP4 has version and flags before the first box, QuickTime has not.
    let content = if content.get(4..8) == Some(b"hdlr") { content } else { content.get(4..)? };
    let part = |wanted: &[u8]| boxes(content).find(|(kind, _)| *kind == wanted).map(|(_, content)| content);
    // Length, namespace, name: laid out as boxes are.
    let (index, name) = boxes(part(b"keys")?.get(8..)?)
        .map(|(_, name)| String::from_utf8_lossy(name).into_owned())
        .enumerate()
        .find(|(_, name)| is_named(name))?;
    let number = u32::try_from(index + 1).ok()?.to_be_bytes();
    let (_, item) = boxes(part(b"ilst")?).find(|(kind, _)| *kind == number)?;
    let (_, data) = boxes(item).find(|(kind, _)| *kind == b"data")?;
    Some((name, value(u32_at(data, 0)?, data.get(8..)?)?))
}

/// A value of Apple's well-known types: text, whole numbers of any length, floating-point numbers.
fn value(kind: u32, bytes: &[u8]) -> Option<f64> {
    let whole = || {
        (1..=8)
            .contains(&bytes.len())
            .then(|| bytes.iter().fold(0u64, |sum, b| sum << 8 | u64::from(*b)) as f64)
    };
    match kind {
        1 => number(std::str::from_utf8(bytes).ok()?),
        23 => Some(f64::from(f32::from_be_bytes(bytes.try_into().ok()?))),
        24 => Some(f64::from_be_bytes(bytes.try_into().ok()?)),
        // Negative ones are no focal lengths, and too large read this way.
        21 | 22 | 65..=67 | 74..=78 => whole(),
        _ => None,
    }
}

/// Tag 0xA405 of the EXIF block in a JPEG file.
fn in_exif(bytes: &[u8]) -> Option<f64> {
    if !bytes.starts_with(&[0xFF, 0xD8]) {
        return None;
    }
    let start = bytes.windows(6).position(|w| w == b"Exif\0\0")? + 6;
    let tiff = &bytes[start..];
    let little = match tiff.get(..2)? {
        b"II" => true,
        b"MM" => false,
        _ => return None,
    };
    let short = |at: usize| {
        let raw: [u8; 2] = tiff.get(at..at + 2)?.try_into().ok()?;
        Some(if little { u16::from_le_bytes(raw) } else { u16::from_be_bytes(raw) })
    };
    let long = |at: usize| {
        let raw: [u8; 4] = tiff.get(at..at.checked_add(4)?)?.try_into().ok()?;
        usize::try_from(if little { u32::from_le_bytes(raw) } else { u32::from_be_bytes(raw) }).ok()
    };
    // Where the value of a tag is in the directory at a place.
    let entry = |directory: usize, tag: u16| {
        let count = usize::from(short(directory)?);
        (0..count).map(|k| directory + 2 + 12 * k).find(|at| short(*at) == Some(tag)).map(|at| at + 8)
    };
    let details = long(entry(long(4)?, 0x8769)?)?;
    short(entry(details, 0xA405)?).map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_box(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat()
    }

    /// A box `meta` with two entries; the second has the focal length.
    fn meta(kind: u32, value: &[u8], full: bool) -> Vec<u8> {
        let name = b"com.apple.quicktime.camera.focal_length.35mm_equivalent";
        let keys = [
            &[0, 0, 0, 0, 0, 0, 0, 2][..],
            &in_box(b"mdta", b"com.apple.quicktime.model"),
            &in_box(b"mdta", name),
        ];
        let data =
            |kind: u32, value: &[u8]| in_box(b"data", &[&kind.to_be_bytes()[..], &[0; 4], value].concat());
        let items =
            [in_box(&[0, 0, 0, 1], &data(1, b"Phone")), in_box(&[0, 0, 0, 2], &data(kind, value))].concat();
        let boxes =
            [in_box(b"hdlr", &[0; 25]), in_box(b"keys", &keys.concat()), in_box(b"ilst", &items)].concat();
        in_box(b"meta", &[if full { &[0; 4][..] } else { &[] }, &boxes].concat())
    }

    fn file(moov: &[u8]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        let bytes = [in_box(b"ftyp", b"qt  "), in_box(b"mdat", &[7; 50]), in_box(b"moov", moov)].concat();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    #[test]
    fn phones_write_it_for_the_file_or_its_track_in_any_type() {
        for (kind, value) in [
            (1, &b"26"[..]),
            (1, b"26 mm"),
            (21, &[26]),
            (22, &[0, 26]),
            (67, &[0, 0, 0, 26]),
            (23, &26f32.to_be_bytes()),
            (24, &26f64.to_be_bytes()),
        ] {
            for full in [false, true] {
                let plain = meta(kind, value, full);
                let in_track = [in_box(b"mvhd", &[0; 30]), in_box(b"trak", &plain)].concat();
                for moov in [&plain, &in_track] {
                    let camera = camera_of(file(moov).path(), Path::new("no such program")).unwrap();
                    assert_eq!((camera.focal, camera.uncertainty), (Focal::Film(26.0), Some(UNCERTAINTY)));
                    assert!(camera.notes[0].contains("26 mm") && camera.notes[0].contains("35mm_equivalent"));
                }
            }
        }
    }

    #[test]
    fn what_says_nothing_or_nonsense_is_no_camera() {
        let none = |moov: &[u8]| camera_of(file(moov).path(), Path::new("no such program")).is_none();
        assert!(none(&[]));
        assert!(none(&meta(1, b"", false)) && none(&meta(21, &[0], false)) && none(&meta(99, &[26], false)));
        // Cut off anywhere, or with a length that lies: no panic.
        let whole = meta(1, b"26", false);
        for end in 0..whole.len() {
            let _ = camera_of(file(&whole[..end]).path(), Path::new("no such program"));
            let mut lying = whole.clone();
            lying[end] ^= 0x80;
            let _ = camera_of(file(&lying).path(), Path::new("no such program"));
        }
        assert!(camera_of(Path::new("/no/such/file"), Path::new("no such program")).is_none());
    }

    #[test]
    fn photos_say_it_in_exif() {
        for little in [true, false] {
            let s = |v: u16| if little { v.to_le_bytes() } else { v.to_be_bytes() };
            let l = |v: u32| if little { v.to_le_bytes() } else { v.to_be_bytes() };
            let entry = |tag: u16, kind: u16, value: [u8; 4]| [&s(tag)[..], &s(kind), &l(1), &value].concat();
            let short = [s(35)[0], s(35)[1], 0, 0];
            let tiff = [
                if little { b"II" } else { b"MM" },
                &s(42)[..],
                &l(8),
                &s(1),
                &entry(0x8769, 4, l(26)),
                &l(0),
                &s(2),
                &entry(0x9000, 7, [0; 4]),
                &entry(0xA405, 3, short),
                &l(0),
            ]
            .concat();
            let jpeg = [&[0xFF, 0xD8, 0xFF, 0xE1, 0, 80][..], b"Exif\0\0", &tiff].concat();
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join("IMG_1.JPG"), &jpeg).unwrap();
            let camera = camera_of(folder.path(), Path::new("no such program")).unwrap();
            assert_eq!(camera.focal, Focal::Film(35.0));
            for end in 0..jpeg.len() {
                assert_eq!(in_exif(&jpeg[..end]).is_some(), end > jpeg.len() - 7, "{end} of {}", jpeg.len());
            }
        }
    }

    #[test]
    fn the_diagonal_decides() {
        let camera = Calibration::new("test", Focal::Film(43.266_615_305_567_87));
        let camera = camera.scaled_to([1600, 1200], &mut Vec::new()).unwrap();
        assert!((camera.fx - 2000.0).abs() < 1e-9 && camera.fx == camera.fy && camera.cx == 799.5);
    }
}
