//! manifest.json: every file of a folder that tessuto wrote, with size and hash. It is written last, so that a folder
//! without one is unfinished, and it shows whether anything in the folder is somebody else's.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tessuto_core::parallel;

use crate::io::{atomic_write, read_text};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::text::hex;

/// Name of the file.
pub(super) const NAME: &str = "manifest.json";
const FORMAT: &str = "tessuto folder 1";

/// What a run keeps in a folder while it works there: the note that says so, the unfinished folder, its checkpoints.
pub(super) const WORKING: [&str; 3] = [".tessuto-unfinished", ".tessuto.partial", ".tessuto.checkpoints"];

/// What a folder is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FolderKind {
    /// A reconstruction.
    Result,
    /// A scene that was made up or imported.
    Scene,
    /// Images of a result.
    Views,
    /// Material and light of a motion that is elsewhere. Other files may be beside them.
    Appearance,
    /// Files for other programs. Other files may be beside them.
    Export,
    /// Tables and page that compare results.
    Comparison,
}

impl FolderKind {
    fn name(self) -> &'static str {
        match self {
            Self::Result => "result",
            Self::Scene => "scene",
            Self::Views => "folder of views",
            Self::Appearance => "folder of material and light",
            Self::Export => "folder of exports",
            Self::Comparison => "folder of a comparison",
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Manifest {
    format: String,
    kind: FolderKind,
    /// By path within the folder, with slashes.
    files: Files,
}

type Files = BTreeMap<String, Entry>;

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    bytes: u64,
    sha256: String,
}

/// A file that tessuto must not replace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stranger {
    name: String,
    problem: &'static str,
}

impl Stranger {
    pub(super) fn not_ours(name: impl Into<String>) -> Self {
        Self { name: name.into(), problem: "was not written by tessuto, and would be lost" }
    }

    pub(super) fn is(&self, name: &str) -> bool {
        self.name == name
    }

    fn changed(name: String) -> Self {
        Self { name, problem: "has changed since tessuto wrote it, and would be lost" }
    }
}

/// The error that names a stranger at `path`.
pub(super) fn refusal(path: &Path, stranger: &Stranger) -> Error {
    Error::input(path.display().to_string(), stranger.problem, "move it away, or choose another folder")
}

/// Writes the manifest of all files that are in `folder` now.
pub(super) fn write(folder: &Path, kind: FolderKind) -> Result<()> {
    let files = entries(folder, |_| true)?;
    store(folder, &Manifest { format: FORMAT.to_owned(), kind, files })
}

fn store(folder: &Path, manifest: &Manifest) -> Result<()> {
    let mut text = serde_json::to_string_pretty(manifest).expect("plain data");
    text.push('\n');
    atomic_write(&folder.join(NAME), text.as_bytes())
}

/// Takes what was just written at `paths`, files or folders, into the manifest of the folder of tessuto's around it, if
/// there is one. What the manifest says of other files stays.
///
/// # Errors
/// [`Error::Input`] if the files cannot be read; [`Error::Output`].
pub fn record(paths: &[impl AsRef<Path>]) -> Result<()> {
    let mut owners: BTreeMap<PathBuf, Vec<String>> = BTreeMap::new();
    for (root, name) in paths.iter().filter_map(|path| owner_of(path.as_ref())) {
        owners.entry(root).or_default().push(name);
    }
    owners.into_iter().try_for_each(|(root, names)| match known(&root) {
        Some(manifest) => record_in(&root, manifest, &names),
        None => Ok(()),
    })
}

/// [`record`] for files `names` in `folder`; where no manifest lists what is in the folder, it gets one of `kind`.
/// Nothing happens in a folder that is being written as a whole: its manifest comes last.
///
/// # Errors
/// As [`record`]; [`Error::Input`] if the folder has a manifest.json of another program.
pub fn record_or_begin(folder: &Path, kind: FolderKind, names: &[&str]) -> Result<()> {
    check_manifest(folder)?;
    let real = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    if real.ancestors().any(|around| around.join(WORKING[0]).is_file()) {
        return Ok(());
    }
    if names.first().and_then(|name| owner_of(&folder.join(name))).is_some() {
        return record(&names.iter().map(|name| folder.join(name)).collect::<Vec<_>>());
    }
    let begun = Manifest { format: FORMAT.to_owned(), kind, files: Files::new() };
    record_in(folder, begun, &names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
}

/// Refuses a folder whose manifest.json is another program's.
///
/// # Errors
/// [`Error::Input`].
pub fn check_manifest(folder: &Path) -> Result<()> {
    if known(folder).is_none() && folder.join(NAME).symlink_metadata().is_ok() {
        return Err(refusal(&folder.join(NAME), &Stranger::not_ours(NAME)));
    }
    Ok(())
}

/// Whether the manifest of a folder around `path` is to list it.
pub fn is_within_ours(path: &Path) -> bool {
    owner_of(path).is_some()
}

fn record_in(folder: &Path, mut manifest: Manifest, written: &[String]) -> Result<()> {
    let new = |name: &str| written.iter().any(|path| is_at_or_below(name, path));
    manifest.files.retain(|name, _| !new(name));
    manifest.files.extend(entries(folder, new)?);
    store(folder, &manifest)
}

fn is_at_or_below(name: &str, path: &str) -> bool {
    name.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// The innermost folder of tessuto's around `path`, and the path within it.
fn owner_of(path: &Path) -> Option<(PathBuf, String)> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let real = parent.canonicalize().ok()?.join(path.file_name()?);
    let root = real.ancestors().skip(1).find(|folder| known(folder).is_some())?;
    let parts = real.strip_prefix(root).ok()?.components();
    let name: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
    Some((root.to_path_buf(), name.join("/")))
}

fn entries(folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<Files> {
    let mut names = list(folder)?;
    names.retain(|name| wanted(name));
    let entry = |name: String| {
        let path = folder.join(&name);
        entry_of(&path).map(|entry| (name, entry)).map_err(|e| unreadable(&path, &e))
    };
    parallel::consume(names, |_, name| entry(name)).into_iter().collect()
}

/// The manifest of a folder that tessuto wrote.
fn known(folder: &Path) -> Option<Manifest> {
    let plain = folder.join(NAME).symlink_metadata().is_ok_and(|found| found.is_file());
    read(folder).ok().filter(|_| plain)
}

fn read(folder: &Path) -> Result<Manifest> {
    let path = folder.join(NAME);
    let fail = |problem: String, hint: &str| Err(Error::input(path.display().to_string(), problem, hint));
    if !path.exists() {
        let hint = "the folder is unfinished, or not tessuto's: run the command that made it again";
        return fail("does not exist".to_owned(), hint);
    }
    let hint = "it was changed or damaged: restore it";
    match serde_json::from_str::<Manifest>(&read_text(&path)?) {
        Ok(manifest) if manifest.format == FORMAT => Ok(manifest),
        Ok(manifest) => fail(format!("the format is “{}”, not “{FORMAT}”", manifest.format), hint),
        Err(error) => fail(error.to_string(), hint),
    }
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
    let names = list(folder)?;
    let mut verified = Verified::default();
    let files: Vec<_> = manifest.files.iter().collect();
    let problems: Vec<_> = parallel::over(&files, |(name, expected)| {
        let problem = match entry_of(&folder.join(name)) {
            Err(e) => Some(e.to_string()),
            Ok(found) if found == **expected => None,
            Ok(found) if found.bytes != expected.bytes => {
                Some(format!("{} bytes, was written with {}", found.bytes, expected.bytes))
            }
            Ok(_) => Some("its bytes have changed".to_owned()),
        };
        problem.map(|problem| ((*name).clone(), problem))
    });
    verified.wrong = problems.into_iter().flatten().collect();
    verified.sound = manifest.files.len() - verified.wrong.len();
    verified.unknown = names.into_iter().filter(|name| !manifest.files.contains_key(name)).collect();
    Ok(verified)
}

/// Refuses to replace `folder` by one of `kind` unless it is empty or, if `replace` is set, wholly tessuto's.
pub(super) fn check_replaceable(folder: &Path, kind: FolderKind, replace: bool, kept: &[&str]) -> Result<()> {
    if any_file(folder)?.is_none() {
        return Ok(());
    }
    if let Some(stranger) = strangers(folder)?.iter().find(|s| !kept.iter().any(|k| s.is(k))) {
        return Err(refusal(&folder.join(&stranger.name), stranger));
    }
    let fail = |problem: String, hint: Hint| Err(Error::input(folder.display().to_string(), problem, hint));
    match known(folder) {
        Some(manifest) if manifest.kind != kind => fail(
            format!("is a {} of tessuto, no {}, and would be replaced", manifest.kind.name(), kind.name()),
            "choose another folder, or move it away".into(),
        ),
        Some(_) if !replace => fail(
            format!("a finished {} already exists and would be replaced", kind.name()),
            Hint::from("choose another folder, or allow to replace it").with(Remedy::Replace),
        ),
        // Without a manifest only what a run left while it worked can be there.
        _ => Ok(()),
    }
}

/// Refuses to replace the files or folders at `paths` unless the manifest of the folder of tessuto's around each lists
/// what is there as it is, and `replace` is set.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn check_parts(paths: &[impl AsRef<Path>], replace: bool) -> Result<()> {
    let paths = paths.iter().map(AsRef::as_ref);
    let there: Vec<&Path> = paths.filter(|path| path.symlink_metadata().is_ok()).collect();
    for path in &there {
        if let Some(stranger) = strangers_of_part(path, path)?.first() {
            let below = (!stranger.name.is_empty()).then(|| path.join(&stranger.name));
            return Err(refusal(below.as_deref().unwrap_or(path), stranger));
        }
    }
    if replace || there.is_empty() {
        return Ok(());
    }
    Err(Error::input(
        there.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "),
        "already exists and would be replaced",
        Hint::from("choose another place, or allow to replace it").with(Remedy::Replace),
    ))
}

/// Files in `folder` that its own manifest does not list as they are.
pub(super) fn strangers(folder: &Path) -> Result<Vec<Stranger>> {
    let files = known(folder).map(|manifest| manifest.files);
    let mut names = list(folder)?;
    if files.is_none() && folder.join(NAME).symlink_metadata().is_ok() {
        names.push(NAME.to_owned());
    }
    Ok(strange(folder, &files.unwrap_or_default(), "", names))
}

/// Files in `now`, a file or folder that was at `path`, that the manifest of the folder around `path` does not list as
/// they are. The name of the file itself is empty.
pub(super) fn strangers_of_part(path: &Path, now: &Path) -> Result<Vec<Stranger>> {
    let (root, name) = owner_of(path).unwrap_or_default();
    let files = known(&root).map(|manifest| manifest.files).unwrap_or_default();
    let folder = now.symlink_metadata().is_ok_and(|found| found.is_dir());
    let names = if folder { list_all(now)? } else { vec![String::new()] };
    Ok(strange(now, &files, &name, names))
}

fn strange(folder: &Path, files: &Files, prefix: &str, names: Vec<String>) -> Vec<Stranger> {
    let judge = |name: String| {
        let path = if name.is_empty() { folder.to_path_buf() } else { folder.join(&name) };
        let plain = path.symlink_metadata().is_ok_and(|found| found.is_file());
        match files.get([prefix, &name].map(str::to_owned).join("/").trim_matches('/')) {
            Some(entry) if plain && entry_of(&path).is_ok_and(|found| found == *entry) => None,
            Some(_) => Some(Stranger::changed(name)),
            None => Some(Stranger::not_ours(name)),
        }
    };
    parallel::consume(names, |_, name| judge(name)).into_iter().flatten().collect()
}

/// Any file below `folder`.
pub(super) fn any_file(folder: &Path) -> Result<Option<String>> {
    if !folder.exists() {
        return Ok(None);
    }
    let manifest = folder.join(NAME).symlink_metadata().is_ok().then(|| NAME.to_owned());
    Ok(list(folder)?.into_iter().next().or(manifest))
}

/// Paths of all files below `folder`, sorted, except the manifest and what a run keeps there while it works.
fn list(folder: &Path) -> Result<Vec<String>> {
    let mut names = list_all(folder)?;
    names.retain(|name| name != NAME);
    Ok(names)
}

fn list_all(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    list_below(folder, "", &mut names).map_err(|e| unreadable(folder, &e))?;
    names.retain(|name| !is_working(folder, name));
    Ok(names)
}

fn is_working(folder: &Path, name: &str) -> bool {
    let [note, partial, checkpoints] = WORKING;
    match name.split_once('/') {
        None => name == note,
        Some((first, _)) if first == partial => folder.join(partial).join(note).is_file(),
        Some((first, rest)) => {
            first == checkpoints && rest.trim_start_matches('.').starts_with("checkpoint-")
        }
    }
}

fn list_below(folder: &Path, prefix: &str, names: &mut Vec<String>) -> std::io::Result<()> {
    let mut entries = std::fs::read_dir(folder)?.collect::<std::io::Result<Vec<_>>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        // Links are not followed.
        if entry.file_type()?.is_dir() {
            list_below(&entry.path(), &format!("{name}/"), names)?;
        } else {
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
    Ok(Entry { bytes, sha256: hex(&hash.finalize()) })
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
        write(folder.path(), FolderKind::Result).unwrap();
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
        record(&[at("texture.png"), at("pictures")]).unwrap();
        let verified = verify(folder.path()).unwrap();
        assert_eq!(
            (verified.sound, verified.wrong[0].0.as_str(), verified.wrong.len()),
            (2, "motion.npy", 1)
        );
    }
}
