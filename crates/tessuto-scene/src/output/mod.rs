//! Output folders: they appear whole or not at all, two programs never write the same one, and nothing is replaced
//! but what tessuto wrote itself and nobody changed since.
//!
//! A folder of tessuto's holds a [manifest] of all its files. Only a folder whose manifest lists every file
//! in it, with the bytes that are there, may be replaced, and only if the caller asks for it. Files appear in
//! `<target>.partial` first. A target that cannot be renamed (a mount point, the working directory) is filled from a
//! folder inside it instead.

pub mod manifest;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

pub use manifest::FolderKind;
use manifest::{Stranger, WORKING};
use tessuto_core::error::{Error, Result};

/// A folder under construction.
#[derive(Debug)]
pub struct OutputFolder {
    /// Where it goes, links resolved.
    target: PathBuf,
    partial: PathBuf,
    /// The target cannot be renamed: its entries are moved one by one.
    inside: bool,
    owner: Owner,
    /// Held while this value lives; the system lets go of it when the program ends, however it ends.
    _lock: Option<File>,
}

/// Whose manifest lists the files.
#[derive(Debug)]
enum Owner {
    /// The folder's own, without files that are carried over.
    Own(FolderKind, Vec<String>),
    /// That of a folder around it.
    Around,
}

impl OutputFolder {
    /// Starts a folder that will be at `target`. What is there is kept until [`publish`](Self::publish); it must be
    /// nothing, an empty folder, or, if `replace` is set, a folder of the same kind that tessuto wrote and nobody
    /// changed since.
    ///
    /// # Errors
    /// [`Error::Input`] if something else is at `target`; [`Error::Usage`] if another run is writing there;
    /// [`Error::Output`] if nothing can be written there.
    pub fn prepare(target: &Path, kind: FolderKind, replace: bool) -> Result<Self> {
        Self::prepare_keeping(target, kind, replace, &[])
    }

    /// [`prepare`](Self::prepare); the files `kept` may be anybody's, for the caller carries them over.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare).
    pub fn prepare_keeping(target: &Path, kind: FolderKind, replace: bool, kept: &[&str]) -> Result<Self> {
        let real = resolve(target)?;
        if real.exists() {
            manifest::check_replaceable(target, kind, replace, kept)?;
        }
        Self::start(real, Owner::Own(kind, kept.iter().map(|name| (*name).to_owned()).collect()))
    }

    /// Starts a folder at `target` whose files the manifest of a folder around it lists. What is there is replaced only
    /// if they are there as listed. The caller [records](manifest::record) the new ones.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare).
    pub fn prepare_part(target: &Path) -> Result<Self> {
        manifest::check_parts(&[target], true)?;
        Self::start(target.to_path_buf(), Owner::Around)
    }

    fn start(target: PathBuf, owner: Owner) -> Result<Self> {
        let inside = target.exists() && (is_around_us(&target) || !can_be_renamed(&target)?);
        let partial = place(&target, inside, ".partial");
        let known = partial.join(WORKING[0]).exists();
        if !known && let Some(stranger) = manifest::any_file(&partial)? {
            // Another run may have made the folder this moment, but then there is no file yet.
            return Err(manifest::refusal(&partial.join(&stranger), &Stranger::not_ours(stranger)));
        }
        io(&partial, |p| std::fs::create_dir_all(p))?;
        let lock = lock(&partial)?;
        // From here on what is there is ours, and is removed if anything fails.
        let output = Self { target, partial: partial.clone(), inside, owner, _lock: lock };
        io(&partial, clear)?;
        // Find out now, not after an hour of computing, that nothing can be written there.
        let note = "tessuto is writing this folder. It can be deleted once no run is going on.\n";
        io(&partial.join(WORKING[0]), |p| std::fs::write(p, note))?;
        Ok(output)
    }

    /// Where to write.
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// A place for work that lasts longer than this value, such as checkpoints.
    pub fn beside(&self, suffix: &str) -> PathBuf {
        place(&self.target, self.inside, suffix)
    }

    /// Writes the manifest, unless another folder's lists these files, and puts the finished folder in its place.
    /// Returns where the earlier folder is kept, if somebody has put files into it since.
    ///
    /// # Errors
    /// [`Error::Output`]; the earlier folder is there then.
    pub fn publish(self) -> Result<Option<PathBuf>> {
        if let Owner::Own(kind, _) = &self.owner {
            manifest::write(&self.partial, *kind)?;
        }
        let old = free(&self.target, self.inside, ".replaced");
        if self.inside {
            self.move_entries(&old)?;
        } else {
            self.rename(&old)?;
        }
        let note = self.target.join(WORKING[0]);
        io(&note, |p| std::fs::remove_file(p))?;
        if !old.exists() {
            return Ok(None);
        }
        let ours = match &self.owner {
            Owner::Own(_, kept) => manifest::strangers(&old)?.iter().all(|s| kept.iter().any(|k| s.is(k))),
            Owner::Around => manifest::strangers_of_part(&self.target, &old)?.is_empty(),
        };
        if ours {
            io(&old, |p| std::fs::remove_dir_all(p))?;
        }
        Ok((!ours).then_some(old))
    }

    fn rename(&self, old: &Path) -> Result<()> {
        // The older folder goes last, so that a crash at any moment leaves one whole folder at least.
        let replaced = self.target.exists();
        if replaced {
            io(&self.target, |target| std::fs::rename(target, old))?;
        }
        let placed = io(&self.target, |target| std::fs::rename(&self.partial, target));
        if replaced && placed.is_err() {
            io(&self.target, |target| std::fs::rename(old, target))?;
        }
        placed
    }

    fn move_entries(&self, old: &Path) -> Result<()> {
        let entries = |folder: &Path| -> Result<Vec<_>> {
            let names = |f: &Path| f.read_dir()?.map(|e| e.map(|e| e.file_name())).collect();
            io(folder, names)
        };
        let working =
            |name: &std::ffi::OsStr| WORKING.iter().any(|w| name == *w) || name == ".tessuto.replaced";
        let earlier: Vec<_> = entries(&self.target)?.into_iter().filter(|name| !working(name)).collect();
        if !earlier.is_empty() {
            io(old, |p| std::fs::create_dir(p))?;
        }
        for name in earlier {
            io(&self.target.join(&name), |p| std::fs::rename(p, old.join(&name)))?;
        }
        // A folder without a manifest is unfinished: it comes last.
        let mut new = entries(&self.partial)?;
        new.sort_by_key(|name| name == manifest::NAME);
        for name in new {
            io(&self.target.join(&name), |p| std::fs::rename(self.partial.join(&name), p))?;
        }
        Ok(())
    }
}

impl Drop for OutputFolder {
    /// Leaves nothing half-written behind.
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.partial);
    }
}

/// The folder that `target` names, behind all links.
fn resolve(target: &Path) -> Result<PathBuf> {
    let fail = |problem: &str| {
        Err(Error::input(target.display().to_string(), problem, "choose another folder, or move it away"))
    };
    match target.canonicalize() {
        Ok(real) if real.is_dir() => Ok(real),
        Ok(_) => fail("is a file, and a folder is to be written there"),
        Err(_) if target.symlink_metadata().is_ok() => fail("is a link that leads nowhere"),
        Err(_) if target.file_name().is_none() => fail("is not the name of a folder"),
        Err(_) => Ok(target.to_path_buf()),
    }
}

/// Whether this program works inside of `folder`, as the shell that started it probably does.
fn is_around_us(folder: &Path) -> bool {
    std::env::current_dir().and_then(|c| c.canonicalize()).is_ok_and(|current| current.starts_with(folder))
}

/// Tries it: mount points and folders of a read-only parent cannot be renamed.
fn can_be_renamed(target: &Path) -> Result<bool> {
    let aside = free(target, false, ".replaced");
    if target.file_name().is_none() || std::fs::rename(target, &aside).is_err() {
        return Ok(false);
    }
    io(target, |target| std::fs::rename(&aside, target))?;
    // The parent may let entries be renamed, but a partial folder must be possible too.
    Ok(true)
}

/// The working folder with `suffix`, beside `target` or inside of it.
fn place(target: &Path, inside: bool, suffix: &str) -> PathBuf {
    if inside { target.join(format!(".tessuto{suffix}")) } else { named(target, suffix) }
}

/// `target` with `suffix` added to its name.
fn named(target: &Path, suffix: &str) -> PathBuf {
    let mut name = target.file_name().unwrap_or_else(|| "tessuto".as_ref()).to_owned();
    name.push(suffix);
    target.with_file_name(name)
}

/// A [`place`] at which nothing is.
fn free(target: &Path, inside: bool, suffix: &str) -> PathBuf {
    let names = std::iter::once(suffix.to_owned()).chain((2..).map(|n| format!("{suffix}-{n}")));
    let mut places = names.map(|suffix| place(target, inside, &suffix));
    places.find(|path| path.symlink_metadata().is_err()).expect("names do not end")
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
            "wait for it to end, or choose another folder",
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

fn io<T>(path: &Path, f: impl FnOnce(&Path) -> std::io::Result<T>) -> Result<T> {
    f(path).map_err(|source| Error::Output { path: path.to_path_buf(), source })
}
