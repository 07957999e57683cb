//! The project folder, and names of what is in it. A name has its parts separated by slashes; it comes from
//! outside and may lead nowhere else, not by `..`, not as an absolute path, not through a link.

use std::fs::{File, Metadata};
use std::path::{Component, Path, PathBuf};

use tessuto::{Error, Result};

/// Longest name [bytes], and longest part of one: file systems take 255.
const LONGEST: usize = 1000;
const LONGEST_PART: usize = 255;
/// Longest part of what is made [bytes]: the program adds endings such as `.checkpoints`, and numbers.
pub const LONGEST_NEW: usize = 200;

/// The folder that everything happens in.
pub struct Project {
    root: PathBuf,
}

impl Project {
    /// The project in `folder`.
    ///
    /// # Errors
    /// [`Error::Input`] if it is no folder.
    pub fn open(folder: &Path) -> Result<Self> {
        let root = folder.canonicalize().ok().filter(|root| root.is_dir());
        let hint = "name an existing folder with --dir, or leave it out for the present one";
        let problem = || Error::input(folder.display().to_string(), "is not a folder", hint);
        Ok(Self { root: root.ok_or_else(problem)? })
    }

    /// Where it is, links resolved.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The name of a path that the user gave on the command line, from the present folder or from the project's.
    ///
    /// # Errors
    /// [`Error::Input`] if it does not exist or is not in the project.
    pub fn name_of(&self, path: &Path) -> Result<String> {
        let place = path.display().to_string();
        // A scene that was begun has no folder of its own yet.
        if let Some(name) =
            path.to_str().filter(|name| is_name(name) && self.find(&format!("{name}.studio")).is_some())
        {
            return Ok(name.to_owned());
        }
        let found = [path.canonicalize(), self.root.join(path).canonicalize()].into_iter().flatten();
        let mut found = found.peekable();
        if found.peek().is_none() {
            return Err(Error::input(
                place,
                "does not exist",
                "name a video, a scene folder or a result folder",
            ));
        }
        let inside = found.find_map(|real| Some(real.strip_prefix(&self.root).ok()?.to_path_buf()));
        let name = inside.map(|path| {
            let parts = path.components().map(|c| c.as_os_str().to_string_lossy().into_owned());
            parts.collect::<Vec<_>>().join("/")
        });
        name.filter(|name| is_name(name)).ok_or_else(|| {
            let problem = format!("is not in the project folder {}", self.root.display());
            Error::input(place, problem, "start in the folder that holds it, or name that folder with --dir")
        })
    }

    /// Where something of this name is; `None` if it is not there, or not in the project.
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        let real = is_name(name).then(|| self.root.join(name).canonicalize().ok()).flatten()?;
        real.starts_with(&self.root).then_some(real)
    }

    /// The regular file of this name, opened, and where it is; `None` if it is not in the project. Between looking and
    /// opening somebody may have put a link in its place: what was opened must be what is found once it is open.
    pub fn open_file(&self, name: &str) -> Option<(File, PathBuf)> {
        let path = self.find(name)?;
        // A pipe would be waited for.
        if !path.metadata().ok()?.is_file() {
            return None;
        }
        let file = File::open(&path).ok()?;
        self.is_still(&file, name).then_some((file, path))
    }

    /// Whether `file` is a regular file and the one that has this name in the project now.
    fn is_still(&self, file: &File, name: &str) -> bool {
        let found = self.find(name).and_then(|path| path.symlink_metadata().ok());
        let (Some(found), Ok(opened)) = (found, file.metadata()) else { return false };
        opened.is_file() && same_file(&found, &opened)
    }

    /// Where something of this name may be made, or is; `None` if that is not in the project.
    pub fn place(&self, name: &str) -> Option<PathBuf> {
        if !is_name(name) {
            return None;
        }
        let path = self.root.join(name);
        // The innermost part that exists decides: what does not exist is no link.
        let existing = path.ancestors().find(|p| p.symlink_metadata().is_ok())?;
        existing.canonicalize().ok()?.starts_with(&self.root).then_some(path)
    }
}

#[cfg(unix)]
fn same_file(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Where files have no numbers that the standard library knows.
#[cfg(not(unix))]
fn same_file(a: &Metadata, b: &Metadata) -> bool {
    a.len() == b.len() && a.modified().ok() == b.modified().ok()
}

/// Whether `name` is relative, goes only downwards, and names nothing hidden.
pub fn is_name(name: &str) -> bool {
    let bad = |c: char| c == '\\' || c.is_control() || cfg!(windows) && c == ':';
    let part = |p: &str| !p.is_empty() && p.len() <= LONGEST_PART && !p.starts_with('.') && !p.contains(bad);
    let normal = |c: Component| matches!(c, Component::Normal(_));
    name.len() <= LONGEST && name.split('/').all(part) && Path::new(name).components().all(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_outside_is_found_or_made() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("project");
        std::fs::create_dir_all(inside.join("scenes/a")).unwrap();
        std::fs::write(folder.path().join("secret"), "s").unwrap();
        std::fs::write(inside.join(".hidden"), "s").unwrap();
        std::fs::write(inside.join("scenes/a/file"), "f").unwrap();
        let project = Project::open(&inside).unwrap();
        assert!(project.find("scenes/a/file").is_some() && project.place("scenes/b/c").is_some());
        let secret = folder.path().join("secret").display().to_string();
        for bad in [
            "../secret",
            "scenes/../../secret",
            &secret,
            "",
            ".",
            "/",
            "scenes//a",
            "scenes/a/",
            ".hidden",
            "a\\b",
            "a\0b",
            "./scenes",
        ] {
            assert!(project.find(bad).is_none() && project.place(bad).is_none(), "{bad}");
        }
        assert!(project.find("scenes/missing").is_none());
        let (mut file, _) = project.open_file("scenes/a/file").unwrap();
        let mut text = String::new();
        std::io::Read::read_to_string(&mut file, &mut text).unwrap();
        assert_eq!(text, "f");
        assert!(project.open_file("scenes").is_none() && project.open_file("../secret").is_none());
        #[cfg(unix)]
        {
            // What was opened while another file, or a way out, stood in its place.
            let stranger = File::open(folder.path().join("secret")).unwrap();
            assert!(
                project.is_still(&file, "scenes/a/file") && !project.is_still(&stranger, "scenes/a/file")
            );
            std::os::unix::fs::symlink(folder.path().join("secret"), inside.join("scenes/swapped")).unwrap();
            assert!(
                !project.is_still(&stranger, "scenes/swapped")
                    && project.open_file("scenes/swapped").is_none()
            );
            std::os::unix::fs::symlink(folder.path(), inside.join("out")).unwrap();
            std::os::unix::fs::symlink(folder.path().join("nowhere"), inside.join("dangling")).unwrap();
            std::os::unix::fs::symlink(inside.join("scenes"), inside.join("within")).unwrap();
            for bad in ["out", "out/secret", "out/new", "dangling", "dangling/x"] {
                assert!(project.find(bad).is_none() && project.place(bad).is_none(), "{bad}");
            }
            assert!(project.find("within/a/file").is_some());
        }
        assert_eq!(project.name_of(&inside.join("scenes/a")).unwrap(), "scenes/a");
        assert_eq!(project.name_of(Path::new("scenes/a")).unwrap(), "scenes/a");
        let told = project.name_of(&folder.path().join("secret")).unwrap_err().to_string();
        assert!(told.contains("is not in the project folder") && told.contains("--dir"), "{told}");
        assert!(project.name_of(Path::new("missing")).unwrap_err().to_string().contains("does not exist"));
        assert_eq!(Project::open(&inside.join("scenes/a/file")).err().unwrap().exit_code(), 3);
    }
}
