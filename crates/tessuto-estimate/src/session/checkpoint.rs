//! Checkpoint files: written atomically, versioned, checksummed, the last two kept.
//!
//! A file is one line of JSON, which says what follows, and then the parts one after another, as postcard has them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::io::{atomic_write, read_bounded};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::text::hex;

/// Says what the file is, and in which layout.
const FORMAT: &str = "tessuto checkpoint 2";
/// Files kept: if the newest turns out damaged, the one before is used.
const KEPT: usize = 2;
/// Largest file that is read `[bytes]`.
const MAX_BYTES: u64 = 8 << 30;
/// Longest header that is read.
const HEADER_LIMIT: usize = 1 << 16;

#[derive(Debug, Serialize, Deserialize)]
struct Header {
    format: String,
    program: String,
    /// What the computation depends on: input and settings.
    identity: String,
    /// Stage and step.
    reached: String,
    /// Names and lengths of the parts.
    parts: Vec<(String, usize)>,
    /// SHA-256 of the fields above, as a JSON list, and of all that follows its line.
    sha256: String,
}

impl Header {
    fn checksum(&self, body: &[u8]) -> String {
        let mut hash = Sha256::new();
        let fields = (&self.format, &self.program, &self.identity, &self.reached, &self.parts);
        hash.update(serde_json::to_vec(&fields).expect("plain data"));
        hash.update(body);
        hex(&hash.finalize())
    }
}

/// The checkpoints of one computation, in a folder of their own.
#[derive(Debug)]
pub struct Checkpoints {
    folder: PathBuf,
    identity: String,
    interval: Duration,
    last: Instant,
}

/// A checkpoint that can be gone on from.
#[derive(Debug)]
pub struct Found {
    /// Stage and step, for people.
    pub reached: String,
    pub(super) parts: BTreeMap<String, Vec<u8>>,
}

impl Checkpoints {
    /// Checkpoints in `folder`, of the computation with this `identity`, at least `interval` apart. The folder is made
    /// when the first is written.
    pub fn open(folder: &Path, identity: String, interval: Duration) -> Self {
        Self { folder: folder.to_path_buf(), identity, interval, last: Instant::now() }
    }

    pub(super) fn is_due(&self) -> bool {
        self.last.elapsed() >= self.interval
    }

    /// Files with their numbers, ascending.
    fn files(&self) -> Vec<(u64, PathBuf)> {
        let number = |path: &Path| -> Option<u64> {
            path.file_name()?.to_str()?.strip_prefix("checkpoint-")?.strip_suffix(".bin")?.parse().ok()
        };
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut files: Vec<_> =
            entries.map(|e| e.path()).filter_map(|path| Some((number(&path)?, path))).collect();
        files.sort();
        files
    }

    /// The newest one that is whole; `complain` is called for those that are not. `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Input`] if it belongs to another computation, or to another version of this program.
    pub fn newest(&self, complain: &mut dyn FnMut(&str)) -> Result<Option<Found>> {
        for (_, path) in self.files().into_iter().rev() {
            match read(&path) {
                Ok((header, parts)) => {
                    self.check_origin(&path, &header)?;
                    return Ok(Some(Found { reached: header.reached, parts }));
                }
                Err(problem) => complain(&format!("{}: {problem}; the one before is used", path.display())),
            }
        }
        Ok(None)
    }

    fn check_origin(&self, path: &Path, header: &Header) -> Result<()> {
        let hint = Hint::from("choose another folder, or start afresh").with(Remedy::NoResume);
        let fail = |problem: String| Err(Error::input(path.display().to_string(), problem, hint.clone()));
        let (format, program) = (header.format.as_str(), header.program.as_str());
        if format != FORMAT || program != env!("CARGO_PKG_VERSION") {
            return fail(format!(
                "written by version {program} ({format}), this is {}",
                env!("CARGO_PKG_VERSION")
            ));
        }
        if header.identity != self.identity {
            return fail("it belongs to other settings, other frames or another scene".to_owned());
        }
        Ok(())
    }

    /// Writes `parts`; removes all but the newest two.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(super) fn save(&mut self, reached: &str, parts: &BTreeMap<String, Vec<u8>>) -> Result<()> {
        let body: Vec<u8> = parts.values().flatten().copied().collect();
        let mut header = Header {
            format: FORMAT.to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            identity: self.identity.clone(),
            reached: reached.to_owned(),
            parts: parts.iter().map(|(name, bytes)| (name.clone(), bytes.len())).collect(),
            sha256: String::new(),
        };
        header.sha256 = header.checksum(&body);
        let mut bytes = serde_json::to_vec(&header).expect("plain data");
        bytes.push(b'\n');
        bytes.extend(body);
        std::fs::create_dir_all(&self.folder)
            .map_err(|source| Error::Output { path: self.folder.clone(), source })?;
        let files = self.files();
        let number = files.last().map_or(1, |(n, _)| n + 1);
        atomic_write(&self.folder.join(format!("checkpoint-{number:06}.bin")), &bytes)?;
        for (_, old) in files.iter().rev().skip(KEPT - 1) {
            // One too many does no harm.
            let _ = std::fs::remove_file(old);
        }
        self.last = Instant::now();
        Ok(())
    }

    /// Removes the checkpoints, and the folder unless somebody else's files are in it: the computation is finished, or
    /// starts anew.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn remove(&self) -> Result<()> {
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().flatten().map(|e| e.path());
        // What a killed run had not finished writing.
        let is_half = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(".checkpoint-") && name.ends_with(".tmp")
        };
        let halves: Vec<_> = entries.filter(is_half).collect();
        for path in self.files().into_iter().map(|(_, path)| path).chain(halves) {
            std::fs::remove_file(&path).map_err(|source| Error::Output { path, source })?;
        }
        let _ = std::fs::remove_dir(&self.folder);
        Ok(())
    }
}

/// Header and parts of a file, or what is wrong with it.
fn read(path: &Path) -> std::result::Result<(Header, BTreeMap<String, Vec<u8>>), String> {
    let bytes = read_bounded(path, MAX_BYTES).map_err(|e| e.to_string().replace("\n  hint: ", "; "))?;
    parse(&bytes)
}

fn parse(bytes: &[u8]) -> std::result::Result<(Header, BTreeMap<String, Vec<u8>>), String> {
    let end = bytes.iter().take(HEADER_LIMIT).position(|b| *b == b'\n').ok_or("it has no header")?;
    let header: Header = serde_json::from_slice(&bytes[..end]).map_err(|e| format!("its header: {e}"))?;
    let mut body = &bytes[end + 1..];
    if header.checksum(body) != header.sha256 {
        return Err("it is damaged: the checksum does not match".to_owned());
    }
    let mut parts = BTreeMap::new();
    for (name, length) in &header.parts {
        let (part, rest) = body.split_at_checked(*length).ok_or("it is shorter than its header says")?;
        parts.insert(name.clone(), part.to_vec());
        body = rest;
    }
    Ok((header, parts))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(k: u8) -> BTreeMap<String, Vec<u8>> {
        [("a".to_owned(), vec![k, 10, 13]), ("b".to_owned(), vec![])].into()
    }

    #[test]
    fn the_newest_whole_one_is_found_and_two_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new");
        let mut checkpoints = Checkpoints::open(&folder, "x".into(), Duration::ZERO);
        assert!(checkpoints.newest(&mut |_| panic!()).unwrap().is_none());
        for k in 0..4 {
            checkpoints.save(&format!("step {k}"), &parts(k)).unwrap();
        }
        let files = checkpoints.files();
        assert_eq!(files.len(), 2);
        let found = checkpoints.newest(&mut |_| panic!()).unwrap().unwrap();
        assert_eq!((found.reached.as_str(), &found.parts), ("step 3", &parts(3)));
        // Every single damaged byte is noticed, and every length.
        let whole = std::fs::read(&files[1].1).unwrap();
        for k in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[k] ^= 4;
            assert!(parse(&bytes).is_err(), "byte {k}");
            assert!(parse(&whole[..k]).is_err(), "length {k}");
        }
        let mut damaged = whole.clone();
        *damaged.last_mut().unwrap() ^= 1;
        std::fs::write(&files[1].1, damaged).unwrap();
        let mut complaints = Vec::new();
        let found = checkpoints.newest(&mut |c| complaints.push(c.to_owned())).unwrap().unwrap();
        assert_eq!(found.reached, "step 2");
        assert!(complaints[0].contains("000004") && complaints[0].contains("damaged"), "{complaints:?}");
    }

    #[test]
    fn a_foreign_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let open = |identity: &str| Checkpoints::open(folder.path(), identity.into(), Duration::ZERO);
        open("one").save("step 1", &parts(1)).unwrap();
        let error = open("two").newest(&mut |_| {}).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains("another scene"), "{error}");
    }
}
