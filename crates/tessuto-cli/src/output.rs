//! Result folders appear whole or not at all, and two programs never write the same one.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use tessuto::{Error, Result};

/// A folder under construction beside its final place.
pub struct OutputFolder {
    target: PathBuf,
    partial: PathBuf,
    /// Held while this value lives; the system lets go of it when the program ends, however it ends.
    _lock: Option<File>,
}

impl OutputFolder {
    /// Starts `<target>.partial`. An older result at `target` is kept until [`publish`](Self::publish).
    ///
    /// # Errors
    /// [`Error::Usage`] if something else than a result of this program is at `target`; [`Error::Output`].
    pub fn prepare(target: &Path) -> Result<Self> {
        Self::prepare_if(target, |folder| folder.join("config.json").is_file())
    }

    /// [`prepare`](Self::prepare) for another kind of folder: only what `replaceable` accepts is replaced.
    ///
    /// # Errors
    /// [`Error::Usage`] if something else is at `target`; [`Error::Output`].
    pub fn prepare_if(target: &Path, replaceable: impl Fn(&Path) -> bool) -> Result<Self> {
        let empty = |folder: &Path| folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
        if target.exists() && !replaceable(target) && !empty(target) {
            return Err(Error::usage(
                format!("{}: something is there that tessuto did not write", target.display()),
                "choose another folder, or move it away",
            ));
        }
        let partial = beside(target, ".partial");
        io(&partial, |p| std::fs::create_dir_all(p))?;
        let lock = lock(&partial)?;
        // From here on what is there is ours, and is removed if anything fails.
        let output = Self { target: target.to_path_buf(), partial: partial.clone(), _lock: lock };
        io(&partial, clear)?;
        // Find out now, not after an hour of computing, that nothing can be written there.
        let probe = partial.join("probe");
        io(&probe, |p| std::fs::write(p, b"can be written").and_then(|()| std::fs::remove_file(p)))?;
        Ok(output)
    }

    /// Where to write.
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// Puts the finished folder in its place.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn publish(self) -> Result<()> {
        // The older result goes last, so that a crash at any moment leaves one whole result at least.
        let old = beside(&self.target, ".old");
        if old.exists() {
            io(&old, |p| std::fs::remove_dir_all(p))?;
        }
        let replaced = self.target.exists();
        if replaced {
            io(&self.target, |target| std::fs::rename(target, &old))?;
        }
        let placed = io(&self.target, |target| std::fs::rename(&self.partial, target));
        if replaced {
            match placed {
                Ok(()) => io(&old, |p| std::fs::remove_dir_all(p))?,
                Err(_) => io(&self.target, |target| std::fs::rename(&old, target))?,
            }
        }
        placed
    }
}

impl Drop for OutputFolder {
    /// Leaves nothing half-written behind.
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.partial);
    }
}

/// Keeps other programs from writing into `folder`.
///
/// # Errors
/// [`Error::Usage`] if another one does.
fn lock(folder: &Path) -> Result<Option<File>> {
    // Only on Unix can a folder be opened; elsewhere nothing is locked.
    if !cfg!(unix) {
        return Ok(None);
    }
    let file = io(folder, |p| File::open(p))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(Error::usage(
            format!("{}: another run is writing there", folder.display()),
            "wait for it to end, or choose another folder with --out",
        )),
        // Some network file systems have no locks: go on without.
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Removes what an interrupted run left in `folder`.
fn clear(folder: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => std::fs::remove_dir_all(entry.path())?,
            false => std::fs::remove_file(entry.path())?,
        }
    }
    Ok(())
}

/// The folder beside `target` with `suffix` added to its name.
pub fn beside(target: &Path, suffix: &str) -> PathBuf {
    let mut name = target.file_name().unwrap_or_else(|| "result".as_ref()).to_owned();
    name.push(suffix);
    target.with_file_name(name)
}

fn io<T>(path: &Path, f: impl FnOnce(&Path) -> std::io::Result<T>) -> Result<T> {
    f(path).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}
