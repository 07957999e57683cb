//! Whole files or none: a crash or a full disk never leaves half a file under its final name.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use tessuto_core::error::{Error, Result};

/// Writes `bytes` to `path`: temporary file in the same folder, fsync, rename, fsync of the folder.
/// An existing file is replaced; on failure it stays as it was and no temporary file remains.
pub fn atomic_write(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, bytes).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}

fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // Two threads of one process must not share a temporary file.
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let Some(name) = path.file_name() else {
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "the path has no file name"));
    };
    if path.is_dir() {
        return Err(std::io::Error::new(std::io::ErrorKind::IsADirectory, "a folder has this name"));
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(name);
    let count = COUNTER.fetch_add(1, Ordering::Relaxed);
    temporary_name.push(format!(".{}-{count}.tmp", std::process::id()));
    let temporary = folder.join(temporary_name);

    let result = fill(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    if let Err(error) = result {
        // The first error is the one to report; the file may not even exist.
        let _ = std::fs::remove_file(&temporary);
        return Err(error);
    }
    // The rename itself survives a power cut only once the folder is on disk (Unix; elsewhere folders cannot be
    // opened).
    if cfg!(unix) {
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

fn fill(temporary: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = OpenOptions::new().write(true).create(true).truncate(true).open(temporary)?;
    file.write_all(bytes)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_the_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        atomic_write(&path, b"first").unwrap();
        atomic_write(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn failure_is_an_output_error_and_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taken");
        std::fs::create_dir(&path).unwrap();
        let error = atomic_write(&path, b"x").unwrap_err();
        assert_eq!(error.exit_code(), 5);
        assert!(error.to_string().contains("taken"));
        let error = atomic_write(&folder.path().join("no/such/folder"), b"x").unwrap_err();
        assert_eq!(error.exit_code(), 5);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
