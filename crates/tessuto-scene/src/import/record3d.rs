//! Recordings of Record3D: a .r3d file, or its unpacked folder, with `metadata`, `rgbd/N.jpg`, `rgbd/N.depth` and
//! `rgbd/N.conf`, N from 0 on.
//!
//! They are unpacked into a folder of files that other captures have, too. Depth is in metres, 32-bit floats by rows;
//! confidence is 0 to 2, one byte a pixel; both are packed by LZFSE. Images, camera and poses are taken as they are
//! stored, upright or not.
//!
//! Source: record3d.app; M. Simonik, *record3d*, its issues on GitHub.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use lzfse_rust::LzfseRingDecoder;
use serde_json::Value;
use tessuto_core::error::{Error, Result};
use tessuto_core::parallel;

use crate::io::{npy, read_bounded, zip};

/// Largest file read `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// Most pixels of a depth map.
const MAX_PIXELS: usize = 1 << 22;

/// A folder that is removed when it is no longer needed.
#[derive(Debug)]
pub struct Unpacked {
    /// With metadata.json, rgb/ and, if there is depth, depth/.
    pub folder: PathBuf,
    /// Frames per second.
    pub fps: Option<f64>,
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Name, such as rgbd/0.jpg, and bytes.
type Entries = Vec<(String, Vec<u8>)>;

/// What is in the recording at `path`; `None` of what is none.
///
/// # Errors
/// [`Error::Input`] naming what cannot be used in it; [`Error::Output`] where it cannot be unpacked.
pub(super) fn unpacked(path: &Path) -> Result<Option<Unpacked>> {
    let Some(entries) = entries(path)? else { return Ok(None) };
    let place = |name: &str| format!("{}: {name}", path.display());
    let fail = |name: &str, problem: String| Error::input(place(name), problem, "export the recording again");
    let find = |name: &str| entries.iter().find(|(n, _)| n == name).map(|(_, bytes)| bytes);
    let Some(metadata) = find("metadata") else { return Err(fail("metadata", "is missing".to_owned())) };
    let json: Value = match serde_json::from_slice(metadata) {
        Ok(json) => json,
        Err(error) => return Err(fail("metadata", format!("is no JSON: {error}"))),
    };
    let mut frames: Vec<usize> = entries.iter().filter_map(|(name, _)| number(name)).collect();
    frames.sort_unstable();
    frames.dedup();
    if frames.is_empty() {
        return Err(fail("rgbd", "holds no images 0.jpg, 1.jpg, …".to_owned()));
    }
    let folder = made(path)?;
    let out = Unpacked { folder, fps: json["fps"].as_f64().filter(|fps| *fps > 0.0) };
    write(&out.folder.join("metadata.json"), metadata)?;
    make(&out.folder.join("rgb"))?;
    let has_depth = frames.iter().any(|n| find(&format!("rgbd/{n}.depth")).is_some());
    if has_depth {
        make(&out.folder.join("depth"))?;
    }
    parallel::try_map(frames.len(), |k| {
        let n = frames[k];
        let image = format!("rgbd/{n}.jpg");
        write(&out.folder.join(format!("rgb/{n:06}.jpg")), find(&image).map_or(&[][..], Vec::as_slice))?;
        if !has_depth {
            return Ok(());
        }
        let [depth, sure] = ["depth", "conf"].map(|ending| format!("rgbd/{n}.{ending}"));
        let Some(packed) = find(&depth) else { return Err(fail(&depth, "is missing".to_owned())) };
        let bytes = match decoded(packed, 4 * MAX_PIXELS) {
            Ok(bytes) if bytes.len() % 4 == 0 => bytes,
            Ok(bytes) => {
                return Err(fail(&depth, format!("has {} bytes, no whole number of floats", bytes.len())));
            }
            Err(problem) => return Err(fail(&depth, problem)),
        };
        let mut z: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect();
        let Some([width, height]) = size(&json, z.len()) else {
            return Err(fail(
                &depth,
                format!("has {} pixels, which is not the size that metadata has", z.len()),
            ));
        };
        if let Some(packed) = find(&sure) {
            match decoded(packed, MAX_PIXELS) {
                Ok(levels) if levels.len() == z.len() => leave_out(&mut z, &levels),
                Ok(levels) => {
                    return Err(fail(&sure, format!("has {} pixels, the depth {}", levels.len(), z.len())));
                }
                Err(problem) => return Err(fail(&sure, problem)),
            }
        }
        npy::write(&out.folder.join(format!("depth/{n:06}.npy")), &[height, width], &z)
    })?;
    Ok(Some(out))
}

/// Takes out what the lowest level was given to, where any pixel has a higher one.
fn leave_out(z: &mut [f32], levels: &[u8]) {
    if levels.iter().any(|level| *level > 0) {
        z.iter_mut().zip(levels).filter(|(_, level)| **level == 0).for_each(|(z, _)| *z = 0.0);
    }
}

/// The entries of a recording, without those that say nothing of the frames.
fn entries(path: &Path) -> Result<Option<Entries>> {
    let wanted = |name: &str| name == "metadata" || of_frame(name).is_some();
    if path.is_dir() {
        let rgbd = path.join("rgbd");
        if !path.join("metadata").is_file() || !rgbd.is_dir() {
            return Ok(None);
        }
        let listed = std::fs::read_dir(&rgbd).into_iter().flatten().flatten();
        let names = listed.map(|entry| format!("rgbd/{}", entry.file_name().to_string_lossy()));
        let names = names.chain(["metadata".to_owned()]).filter(|name| wanted(name));
        let read = |name: String| Ok((name.clone(), read_bounded(&path.join(&name), MAX_BYTES)?));
        return names.map(read).collect::<Result<_>>().map(Some);
    }
    if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("r3d")) {
        return Ok(None);
    }
    let bytes = read_bounded(path, MAX_BYTES)?;
    let read = zip::read(&bytes).map_err(|problem| {
        let hint =
            "give a recording of Record3D; raw films of RED cameras, which end in .r3d too, are not read";
        Error::input(path.display().to_string(), format!("is no such recording: {problem}"), hint)
    })?;
    Ok(Some(read.into_iter().filter(|(name, _)| wanted(name)).collect()))
}

/// The number and the ending of rgbd/N.jpg, rgbd/N.depth, rgbd/N.conf.
fn of_frame(name: &str) -> Option<(usize, &str)> {
    let (number, ending) = name.strip_prefix("rgbd/")?.split_once('.')?;
    let plain = !number.is_empty() && number.len() < 7 && number.bytes().all(|b| b.is_ascii_digit());
    let known = plain && ["jpg", "depth", "conf"].contains(&ending);
    known.then(|| Some((number.parse().ok()?, ending)))?
}

fn number(name: &str) -> Option<usize> {
    of_frame(name).filter(|(_, ending)| *ending == "jpg").map(|(n, _)| n)
}

/// Width and height of a depth map of so many pixels: as the file says, or of the images' shape.
fn size(json: &Value, pixels: usize) -> Option<[usize; 2]> {
    let side = |key: &str| json[key].as_u64().map(|n| n as usize);
    if let (Some(width), Some(height)) = (side("dw"), side("dh")) {
        return (width.checked_mul(height)? == pixels).then_some([width, height]);
    }
    let (w, h) = (json["w"].as_f64()?, json["h"].as_f64()?);
    let width = (pixels as f64 * w / h).sqrt().round() as usize;
    let height = pixels.checked_div(width)?;
    (width * height == pixels).then_some([width, height])
}

/// What was packed by LZFSE, of at most `most` bytes.
fn decoded(packed: &[u8], most: usize) -> std::result::Result<Vec<u8>, String> {
    let (mut decoder, mut bytes) = (LzfseRingDecoder::default(), Vec::new());
    let read = decoder.reader_bytes(packed).take(most as u64 + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("cannot be unpacked: {error}"))?;
    if bytes.len() > most { Err(format!("is longer than {most} bytes")) } else { Ok(bytes) }
}

/// A new folder, whose name ends in that of the recording: errors of its files show it.
fn made(path: &Path) -> Result<PathBuf> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name: String = path.file_name().unwrap_or_default().to_string_lossy().chars().take(60).collect();
    loop {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("tessuto-{}-{count}-{name}", std::process::id()));
        match std::fs::create_dir(&folder) {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(source) => return Err(Error::Output { path: folder, source }),
            Ok(()) => return Ok(folder),
        }
    }
}

fn make(path: &Path) -> Result<()> {
    std::fs::create_dir(path).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}

#[cfg(test)]
mod tests {
    use super::super::{read_capture, read_path};
    use super::*;
    use tessuto_core::math::rng::Rng;

    const METADATA: &str = r#"{"w": 8, "h": 6, "fps": 30, "dw": 4, "dh": 3,
        "K": [7.5, 0, 0, 0, 7.25, 0, 3.5, 2.5, 1],
        "poses": [[0, 0, 0, 1, 0, 0, 0], [0, 0.0998334, 0, 0.9950042, 0.1, 0, 0], [0, 0, 0, 1, 0, 0.2, 0]]}"#;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        lzfse_rust::encode_bytes(bytes, &mut out).unwrap();
        out
    }

    fn recording(metadata: &str) -> Entries {
        let mut entries =
            vec![("metadata".to_owned(), metadata.as_bytes().to_vec()), ("icon".into(), vec![1])];
        for n in 0..3u8 {
            let z: Vec<u8> = (0..12).flat_map(|k| (1.0 + 0.01 * k as f32).to_le_bytes()).collect();
            let sure: Vec<u8> = (0..12).map(|k| if k == 5 { 0 } else { 2 }).collect();
            entries.push((format!("rgbd/{n}.jpg"), vec![n; 3]));
            entries.push((format!("rgbd/{n}.depth"), packed(&z)));
            entries.push((format!("rgbd/{n}.conf"), packed(&sure)));
        }
        entries
    }

    #[test]
    fn a_recording_and_its_unpacked_folder_are_captures() {
        let home = tempfile::tempdir().unwrap();
        let entries = recording(METADATA);
        let file = home.path().join("scarf.r3d");
        std::fs::write(&file, zip::write(&entries)).unwrap();
        let folder = home.path().join("unpacked");
        std::fs::create_dir_all(folder.join("rgbd")).unwrap();
        entries.iter().for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes).unwrap());
        for path in [file, folder] {
            let capture = read_capture(&path).unwrap().unwrap();
            assert_eq!((capture.app, capture.fps), ("Record3D", Some(30.0)));
            let camera = capture.calibration.as_ref().unwrap();
            assert_eq!((camera.size, camera.centre), (Some([8, 6]), Some([3.5, 2.5])));
            assert_eq!(std::fs::read(capture.clip.join("000002.jpg")).unwrap(), [2; 3]);
            let map = npy::read(&capture.depths.as_ref().unwrap().join("depth/000001.npy")).unwrap();
            assert_eq!(map.shape, [3, 4]);
            assert!((map.data[4] - 1.04).abs() < 1e-6 && map.data[5] == 0.0);
            assert_eq!(read_path(&capture.poses).unwrap().len(), 3);
            let there = capture.clip.clone();
            drop(capture);
            assert!(!there.exists(), "what was unpacked stays");
        }
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("scarf.r3d");
        let text = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            unpacked(&file).unwrap_err().to_string()
        };
        let whole = zip::write(&recording(METADATA));
        assert!(text(&whole[..whole.len() / 2]).contains("is no such recording"));
        assert!(text(&zip::write(&recording(METADATA)[1..])).contains("metadata: is missing"));
        assert!(text(&zip::write(&recording(METADATA)[..1])).contains("holds no images"));
        let other = METADATA.replace("\"dw\": 4", "\"dw\": 5");
        assert!(text(&zip::write(&recording(&other))).contains("rgbd/0.depth: has 12 pixels"));
        for (k, bytes, word) in [
            (3, vec![0x62, 0x76, 0x78, 0x32, 9, 9], "rgbd/0.depth: cannot be unpacked"),
            (3, packed(&vec![0; 4 * MAX_PIXELS + 8]), "is longer than"),
            (4, packed(&[2; 11]), "rgbd/0.conf: has 11 pixels"),
        ] {
            let mut entries = recording(METADATA);
            entries[k].1 = bytes;
            let text = text(&zip::write(&entries));
            assert!(text.contains(word) && text.contains("scarf.r3d"), "{text}");
        }
        // Without the map's size it has the images' shape.
        let unsaid = METADATA.replace("\"dw\": 4, \"dh\": 3,", "");
        std::fs::write(&file, zip::write(&recording(&unsaid))).unwrap();
        assert!(unpacked(&file).unwrap().is_some());
    }

    #[test]
    fn damaged_recordings_are_read_or_refused() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("scarf.r3d");
        let whole = zip::write(&recording(METADATA));
        let (mut rng, mut refused) = (Rng::new(1, 0), 0);
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..1 + (4.0 * rng.uniform()) as usize {
                let at = (rng.uniform() * bytes.len() as f64) as usize;
                bytes[at] = (256.0 * rng.uniform()) as u8;
            }
            std::fs::write(&file, &bytes).unwrap();
            refused += usize::from(unpacked(&file).is_err());
        }
        assert!(refused > 100, "{refused}");
    }
}
