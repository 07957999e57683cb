//! COLMAP's images.txt and images.bin: camera from world, as quaternion w x y z and translation; lengths of no unit.

use glam::DVec3;

use super::{CameraPath, Entry, Reader, quaternion};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Result};

pub(super) const TEXT: Reader = Reader {
    about: "images.txt, images.bin (COLMAP)",
    inside: &["images.txt", "sparse/0/images.txt", "images.bin", "sparse/0/images.bin"],
    knows: |file| file.name().ends_with(".txt") && file.text.is_some(),
    read: |file| text(file.text.as_deref().unwrap_or_default(), &file.place),
};

pub(super) const BINARY: Reader = Reader {
    about: "their folder",
    inside: &[],
    knows: |file| file.name().ends_with(".bin"),
    read: |file| binary(&file.bytes, &file.place),
};

fn entry(q: [f64; 4], t: [f64; 3], name: &str, place: &str) -> Result<Entry> {
    let [w, x, y, z] = q;
    let translation = DVec3::from_array(t);
    if !translation.is_finite() {
        return Err(Error::input(place, "a translation is not finite", "restore the file"));
    }
    let camera_from_world = Pose { rotation: quaternion([x, y, z, w], place)?, translation };
    Ok(Entry { name: Some(name.to_owned()), number: None, camera_from_world })
}

fn path(place: &str, mut entries: Vec<Entry>) -> Result<CameraPath> {
    if entries.is_empty() {
        return Err(Error::input(place, "holds no image", "let COLMAP register images first"));
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(CameraPath { place: place.to_owned(), entries, metric: false, up: None })
}

/// Two lines an image: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, and its points.
fn text(text: &str, place: &str) -> Result<CameraPath> {
    // Lines of points may be empty.
    let lines: Vec<(usize, &str)> =
        text.lines().enumerate().filter(|(_, line)| !line.starts_with('#')).collect();
    let mut entries = Vec::new();
    for (k, line) in lines.iter().step_by(2).filter(|(_, line)| !line.trim().is_empty()) {
        let place = format!("{place}:{}", k + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers: Option<Vec<f64>> =
            words.get(1..8).and_then(|w| w.iter().map(|w| w.parse().ok()).collect());
        let (Some(n), Some(_)) = (numbers, words.get(9)) else {
            let hint =
                "each image is two lines: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and its points";
            return Err(Error::input(place, "is not an image of COLMAP's", hint));
        };
        entries.push(entry([n[0], n[1], n[2], n[3]], [n[4], n[5], n[6]], &words[9..].join(" "), &place)?);
    }
    path(place, entries)
}

/// Little-endian: a count, and for each image its number, seven doubles, its camera's number, its name to a zero, and
/// a count of points of 24 bytes.
fn binary(bytes: &[u8], place: &str) -> Result<CameraPath> {
    let mut at = 0;
    let mut take = |count: usize| {
        let end = at + count;
        let part = bytes.get(at..end);
        at = end;
        part.ok_or_else(|| Error::input(place, "ends within an image", "restore the file"))
    };
    let word = |bytes: &[u8]| bytes.try_into().map_or(0, u64::from_le_bytes);
    let count = word(take(8)?);
    let mut entries = Vec::new();
    for _ in 0..count {
        take(4)?;
        let mut n = [0.0; 7];
        for number in &mut n {
            *number = f64::from_bits(word(take(8)?));
        }
        take(4)?;
        let mut name = Vec::new();
        loop {
            match take(1)?[0] {
                0 => break,
                byte => name.push(byte),
            }
        }
        let points = word(take(8)?);
        take(usize::try_from(points).unwrap_or(usize::MAX / 64).saturating_mul(24))?;
        let name = String::from_utf8_lossy(&name);
        entries.push(entry([n[0], n[1], n[2], n[3]], [n[4], n[5], n[6]], &name, place)?);
    }
    path(place, entries)
}
