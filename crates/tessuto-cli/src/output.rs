//! Result folders appear whole or not at all.

use std::path::{Path, PathBuf};

use tessuto::{Error, Result};

/// A folder under construction beside its final place.
pub struct OutputFolder {
    target: PathBuf,
    partial: PathBuf,
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
        if partial.exists() {
            io(&partial, |p| std::fs::remove_dir_all(p))?;
        }
        io(&partial, |p| std::fs::create_dir_all(p))?;
        Ok(Self { target: target.to_path_buf(), partial })
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
        if self.target.exists() {
            io(&self.target, |p| std::fs::remove_dir_all(p))?;
        }
        io(&self.target, |target| std::fs::rename(&self.partial, target))
    }
}

impl Drop for OutputFolder {
    /// Leaves nothing half-written behind.
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.partial);
    }
}

/// The folder beside `target` with `suffix` added to its name.
pub fn beside(target: &Path, suffix: &str) -> PathBuf {
    let mut name = target.file_name().unwrap_or_else(|| "result".as_ref()).to_owned();
    name.push(suffix);
    target.with_file_name(name)
}

fn io(path: &Path, f: impl FnOnce(&Path) -> std::io::Result<()>) -> Result<()> {
    f(path).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}
