//! What is in the project that one can begin with, and which work that is.

use std::path::Path;
use std::time::SystemTime;

use serde::Serialize;

use super::form::Form;
use super::place::{Project, is_name};
use super::work::{SCENES, Work};

/// Endings of videos, in lower case.
const VIDEOS: [&str; 10] = ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts", "m2ts", "mpg", "3gp"];
/// Folders that are looked into, besides the project itself.
const FOLDERS: [&str; 4] = ["clips", SCENES, "results", "tessuto-out"];
/// Longest name of a scene that is taken from its clip [bytes].
const LONGEST_STEM: usize = 150;
/// Most entries that are listed.
const MOST: usize = 200;

/// Something to begin with.
#[derive(Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Its name in the project.
    pub name: String,
    /// `clip`, `scene`, `result`, or `begun`: a scene that is not there yet.
    pub kind: &'static str,
    /// Seconds since 1970 when it was last changed.
    pub changed: u64,
}

/// Whether a file of this name is treated as a video.
pub fn is_video(name: &str) -> bool {
    let ending = Path::new(name).extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|e| VIDEOS.contains(&e.as_str()))
}

/// The clips, scenes and results of the project, newest first.
pub fn list(project: &Project) -> Vec<Entry> {
    let mut entries = in_folder(project, "");
    for folder in FOLDERS {
        entries.extend(in_folder(project, &format!("{folder}/")));
    }
    entries.sort_by(|a, b| b.changed.cmp(&a.changed).then_with(|| a.name.cmp(&b.name)));
    entries.truncate(MOST);
    entries
}

fn in_folder(project: &Project, prefix: &str) -> Vec<Entry> {
    let folder = if prefix.is_empty() {
        Some(project.root().to_path_buf())
    } else {
        project.find(prefix.trim_end_matches('/'))
    };
    let Some(entries) = folder.and_then(|folder| folder.read_dir().ok()) else { return Vec::new() };
    let entry = |found: std::fs::DirEntry| {
        let name = format!("{prefix}{}", found.file_name().to_str()?);
        let path = project.find(&name)?;
        let changed =
            path.metadata().ok()?.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?.as_secs();
        let (name, kind) = match name.strip_suffix(".studio") {
            Some(work) if path.join("form.json").is_file() && project.find(work).is_none() => {
                (work.to_owned(), "begun")
            }
            _ => (name.clone(), kind(&path, &name)?),
        };
        Some(Entry { name, kind, changed })
    };
    entries.flatten().filter_map(entry).collect()
}

fn kind(path: &Path, name: &str) -> Option<&'static str> {
    if path.is_file() {
        return is_video(name).then_some("clip");
    }
    let holds = |file: &str| path.join(file).is_file();
    if holds("motion.npy") { Some("result") } else { holds("scene.json").then_some("scene") }
}

/// The work that beginning with `name` means; of a clip it is made now.
///
/// # Errors
/// A sentence for the user.
pub fn work<'a>(project: &'a Project, name: &str) -> Result<Work<'a>, String> {
    let known = |name: &str| Work::new(project, name).ok_or_else(|| format!("{name} is not in the project"));
    let Some(path) = project.find(name) else {
        let work = known(name)?;
        return if work.has(&work.beside("form.json")) {
            Ok(work)
        } else {
            Err(format!("{name} does not exist"))
        };
    };
    match kind(&path, name) {
        Some("scene") => known(name),
        Some("result") => {
            let last = name.rsplit('/').next().unwrap_or(name);
            let scene = known(&format!("{SCENES}/{last}"))?;
            if scene.has(scene.scene()) && scene.result() == name { Ok(scene) } else { known(name) }
        }
        Some(_) => of_clip(project, name),
        None => Err(format!("{name} is no video, scene folder or result folder")),
    }
}

/// The work that began with this clip, or a new one.
fn of_clip<'a>(project: &'a Project, clip: &str) -> Result<Work<'a>, String> {
    let stem = Path::new(clip).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let plain: String =
        stem.chars().map(|c| if c.is_alphanumeric() || "._-".contains(c) { c } else { '_' }).collect();
    let plain = plain.trim_start_matches(['.', '-']);
    let end = (0..=plain.len().min(LONGEST_STEM)).rev().find(|k| plain.is_char_boundary(*k)).unwrap_or(0);
    let plain = &plain[..end];
    let stem = if is_name(plain) { plain } else { "clip" };
    let names = std::iter::once(stem.to_owned()).chain((2..).map(|n| format!("{stem}-{n}")));
    for name in names.map(|name| format!("{SCENES}/{name}")) {
        let work = Work::new(project, &name).ok_or_else(|| format!("{name} leads out of the project"))?;
        if work.form().clip.as_deref() == Some(clip) {
            return Ok(work);
        }
        if !work.has(work.scene()) && !work.has(&work.beside("form.json")) {
            work.save(&Form { clip: Some(clip.to_owned()), ..Form::default() })?;
            return Ok(work);
        }
    }
    unreachable!("names do not end")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_scenes_and_results_are_found_and_opened() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (name, file) in [
            ("scenes/a", "scene.json"),
            ("results/a", "motion.npy"),
            ("results/b", "motion.npy"),
            ("clips", "My film.MOV"),
        ] {
            std::fs::create_dir_all(path(name)).unwrap();
            std::fs::write(path(name).join(file), "").unwrap();
        }
        std::fs::write(path("notes.txt"), "").unwrap();
        let project = Project::open(folder.path()).unwrap();
        let mut found: Vec<_> = list(&project).into_iter().map(|e| (e.kind, e.name)).collect();
        found.sort();
        let expected = [
            ("clip", "clips/My film.MOV"),
            ("result", "results/a"),
            ("result", "results/b"),
            ("scene", "scenes/a"),
        ];
        assert_eq!(found, expected.map(|(kind, name)| (kind, name.to_owned())));
        let open = |name: &str| work(&project, name).map(|w| w.scene().to_owned());
        assert_eq!(open("results/a").unwrap(), "scenes/a");
        assert_eq!(open("results/b").unwrap(), "results/b");
        // The same clip is the same work; another one of the same name is not.
        assert_eq!(open("clips/My film.MOV").unwrap(), "scenes/My_film");
        assert_eq!(open("clips/My film.MOV").unwrap(), "scenes/My_film");
        std::fs::write(path("My film.mov"), "").unwrap();
        assert_eq!(open("My film.mov").unwrap(), "scenes/My_film-2");
        assert!(list(&project).iter().any(|e| e.kind == "begun" && e.name == "scenes/My_film"));
        let long = format!("{}.mp4", "ü".repeat(120));
        std::fs::write(path(&long), "").unwrap();
        assert_eq!(open(&long).unwrap(), format!("scenes/{}", "ü".repeat(75)));
        assert!(open(&format!("scenes/{}", "a".repeat(201))).unwrap_err().contains("is not in the project"));
        assert!(open("notes.txt").is_err() && open("../x").is_err() && open("scenes/none").is_err());
    }
}
