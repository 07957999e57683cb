//! manifest.json: what a complete result folder holds, written last, so that a folder without one is unfinished.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::write_json;
use crate::error::{Error, Result};

const NAME: &str = "manifest.json";
const FORMAT: &str = "tessuto result 1";

#[derive(Serialize, Deserialize)]
struct Manifest {
    format: String,
    /// By path within the folder, with slashes.
    files: BTreeMap<String, Entry>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    bytes: u64,
    sha256: String,
}

/// Writes the manifest of all files that are in `folder` now.
///
/// # Errors
/// [`Error::Input`] if one cannot be read; [`Error::Output`].
pub fn write_manifest(folder: &Path) -> Result<()> {
    let files = entries(folder, |_| true)?;
    write_json(&folder.join(NAME), &Manifest { format: FORMAT.to_owned(), files })
}

/// Takes the files into the manifest whose paths begin with one of `prefixes`: they were written anew. What it says of the
/// others stays. Nothing happens in a folder without a manifest.
///
/// # Errors
/// [`Error::Input`] if manifest or files cannot be read; [`Error::Output`].
pub fn refresh_manifest(folder: &Path, prefixes: &[&str]) -> Result<()> {
    if !folder.join(NAME).is_file() {
        return Ok(());
    }
    let mut manifest = read(folder)?;
    let new = |name: &str| prefixes.iter().any(|prefix| name.starts_with(prefix));
    manifest.files.retain(|name, _| !new(name));
    manifest.files.extend(entries(folder, new)?);
    write_json(&folder.join(NAME), &manifest)
}

fn entries(folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<BTreeMap<String, Entry>> {
    let mut names = Vec::new();
    list(folder, "", &mut names).map_err(|e| unreadable(folder, &e))?;
    names.retain(|name| wanted(name));
    let entry = |name: String| {
        let path = folder.join(&name);
        entry_of(&path).map(|entry| (name, entry)).map_err(|e| unreadable(&path, &e))
    };
    names.into_par_iter().map(entry).collect()
}

fn read(folder: &Path) -> Result<Manifest> {
    let path = folder.join(NAME);
    let text = std::fs::read_to_string(&path).map_err(|e| {
        let hint = "the result is unfinished or of an older version: run the command in its log.json again";
        Error::input(path.display().to_string(), e.to_string(), hint)
    })?;
    serde_json::from_str(&text).map_err(|e| {
        Error::input(path.display().to_string(), e.to_string(), "it was changed or damaged: restore it")
    })
}

/// What [`verify`] found.
#[derive(Debug, Default)]
pub struct Verified {
    /// Files that are as they were written.
    pub sound: usize,
    /// Path and what is wrong with it: missing, or changed.
    pub wrong: Vec<(String, String)>,
    /// Files that the manifest does not know.
    pub unknown: Vec<String>,
}

/// Compares the files in `folder` with its manifest.
///
/// # Errors
/// [`Error::Input`] if there is no manifest, or none that can be read.
pub fn verify(folder: &Path) -> Result<Verified> {
    let manifest = read(folder)?;
    let mut names = Vec::new();
    list(folder, "", &mut names).map_err(|e| unreadable(folder, &e))?;
    let mut verified = Verified::default();
    let problems: Vec<_> = manifest
        .files
        .par_iter()
        .map(|(name, expected)| {
            let problem = match entry_of(&folder.join(name)) {
                Err(e) => Some(e.to_string()),
                Ok(found) if found == *expected => None,
                Ok(found) if found.bytes != expected.bytes => {
                    Some(format!("{} bytes, was written with {}", found.bytes, expected.bytes))
                }
                Ok(_) => Some("its bytes have changed".to_owned()),
            };
            problem.map(|problem| (name.clone(), problem))
        })
        .collect();
    verified.wrong = problems.into_iter().flatten().collect();
    verified.sound = manifest.files.len() - verified.wrong.len();
    verified.unknown = names.into_iter().filter(|name| !manifest.files.contains_key(name)).collect();
    Ok(verified)
}

/// Paths of all files below `folder` but the manifest, sorted.
fn list(folder: &Path, prefix: &str, names: &mut Vec<String>) -> std::io::Result<()> {
    let mut entries = std::fs::read_dir(folder)?.collect::<std::io::Result<Vec<_>>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            list(&entry.path(), &format!("{name}/"), names)?;
        } else if name != NAME {
            names.push(name);
        }
    }
    Ok(())
}

fn entry_of(path: &Path) -> std::io::Result<Entry> {
    let mut file = File::open(path)?;
    let (mut hash, mut bytes) = (Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 16];
    loop {
        let n = file.read(&mut buffer)?;
        if n == 0 {
            break;
        }
        hash.update(&buffer[..n]);
        bytes += n as u64;
    }
    Ok(Entry { bytes, sha256: hash.finalize().iter().map(|b| format!("{b:02x}")).collect() })
}

fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::input(
        path.display().to_string(),
        error.to_string(),
        "check that the folder is complete and readable",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_losses_and_additions_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("pictures")).unwrap();
        for name in ["motion.npy", "texture.png", "log.json", "pictures/a.png"] {
            std::fs::write(at(name), name).unwrap();
        }
        assert!(verify(folder.path()).unwrap_err().to_string().contains("unfinished"));
        write_manifest(folder.path()).unwrap();
        let verified = verify(folder.path()).unwrap();
        assert!(verified.sound == 4 && verified.wrong.is_empty() && verified.unknown.is_empty());
        std::fs::write(at("motion.npy"), "motion.npz").unwrap();
        std::fs::write(at("texture.png"), "").unwrap();
        std::fs::remove_file(at("pictures/a.png")).unwrap();
        std::fs::write(at("notes.txt"), "mine").unwrap();
        let verified = verify(folder.path()).unwrap();
        assert_eq!(verified.sound, 1);
        let wrong: Vec<&str> = verified.wrong.iter().map(|w| w.0.as_str()).collect();
        assert_eq!(wrong, ["motion.npy", "pictures/a.png", "texture.png"]);
        assert_eq!(verified.unknown, ["notes.txt"]);
        refresh_manifest(folder.path(), &["texture.png", "pictures/"]).unwrap();
        let verified = verify(folder.path()).unwrap();
        assert_eq!(
            (verified.sound, verified.wrong[0].0.as_str(), verified.wrong.len()),
            (2, "motion.npy", 1)
        );
    }
}
