//! Numbered files of a folder, such as `rgb_000.png …`, paired by number and never by order.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::inside;
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};

/// The files `sub`/`prefix`N.`ending` for every N of `range`, any zero padding. A missing or twofold
/// number is an error; files numbered `n_frames` or more give a warning.
pub(crate) fn numbered(
    folder: &Path,
    sub: &str,
    prefix: &str,
    endings: &[&str],
    (range, n_frames): (Range<usize>, usize),
    warnings: &mut Vec<Warning>,
) -> Result<Vec<PathBuf>> {
    let directory = folder.join(sub);
    let mut found = scan(folder, &directory, prefix, endings)?;
    let surplus: Vec<PathBuf> = found.split_off(&n_frames).into_values().collect();
    if let Some(first) = surplus.first() {
        let text = format!(
            "{} files in {sub}/ from {} on are beyond n_frames = {n_frames}",
            surplus.len(),
            show(first)
        );
        warnings.push(Warning::new("frames", text, "raise n_frames in scene.json, or remove them"));
    }
    let missing: Vec<usize> = range.clone().filter(|n| !found.contains_key(n)).collect();
    if !missing.is_empty() {
        let mut names: Vec<String> =
            missing.iter().take(5).map(|n| format!("{prefix}{n:03}.{}", endings[0])).collect();
        if missing.len() > names.len() {
            names.push("…".into());
        }
        return Err(Error::input(
            directory.display().to_string(),
            format!("{} of {} files are missing: {}", missing.len(), range.len(), names.join(", ")),
            Hint::from(
                "add them, or correct n_frames in scene.json (frames are numbered from 0), or take a part",
            )
            .with(Remedy::Frames(None)),
        ));
    }
    range.map(|n| inside(folder, &found[&n])).collect()
}

/// The files of the form of [`numbered`] with a number of `range`, of which some may be missing. None at all, or
/// missing ones together with some numbered `n_frames` or more, are an error: they are numbered otherwise.
pub(crate) fn some_numbered(
    folder: &Path,
    sub: &str,
    prefix: &str,
    endings: &[&str],
    (range, n_frames): (Range<usize>, usize),
) -> Result<BTreeMap<usize, PathBuf>> {
    let directory = folder.join(sub);
    let mut found = scan(folder, &directory, prefix, endings)?;
    let surplus = found.split_off(&n_frames);
    let fail =
        |problem: String, hint: String| Err(Error::input(directory.display().to_string(), problem, hint));
    let example = format!("{prefix}000.{}", endings[0]);
    if found.is_empty() && surplus.is_empty() {
        let hint = format!("name the files {example} …, by the frames they belong to, or remove the folder");
        return fail(format!("it has no file like {example}"), hint);
    }
    if let (Some(beyond), Some(missing)) =
        (surplus.values().next(), (0..n_frames).find(|n| !found.contains_key(n)))
    {
        return fail(
            format!(
                "{} is beyond n_frames = {n_frames}, while {prefix}{missing:03}.{} is missing",
                show(beyond),
                endings[0]
            ),
            "number the files by the frames they belong to, from 0".to_owned(),
        );
    }
    let wanted = found.into_iter().filter(|(n, _)| range.contains(n));
    wanted.map(|(n, path)| Ok((n, inside(folder, &path)?))).collect()
}

/// Path by number of every file of this name form.
fn scan(folder: &Path, directory: &Path, prefix: &str, endings: &[&str]) -> Result<BTreeMap<usize, PathBuf>> {
    let example = format!("{prefix}000.{}", endings[0]);
    let unreadable = |e: std::io::Error| {
        Error::input(
            directory.display().to_string(),
            format!("cannot be read as a folder: {e}"),
            format!("make the folder and put {example} … into it"),
        )
    };
    let mut found: BTreeMap<usize, PathBuf> = BTreeMap::new();
    for entry in std::fs::read_dir(inside(folder, directory).and(Ok(directory))?).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let Some(number) = number(&path, prefix, endings) else { continue };
        if let Some(other) = found.insert(number, path.clone()) {
            let (a, b) = if other < path { (&other, &path) } else { (&path, &other) };
            return Err(Error::input(
                directory.display().to_string(),
                format!("{} and {} are both frame {number}", show(a), show(b)),
                "remove one of them",
            ));
        }
    }
    Ok(found)
}

/// The number in a name of this form; names that cannot be one are none.
fn number(path: &Path, prefix: &str, endings: &[&str]) -> Option<usize> {
    let (stem, ending) = (path.file_stem()?.to_str()?, path.extension()?.to_str()?);
    let digits = stem.strip_prefix(prefix)?;
    let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let known = endings.iter().any(|e| e.eq_ignore_ascii_case(ending));
    if plain && known { digits.parse().ok() } else { None }
}

fn show(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
