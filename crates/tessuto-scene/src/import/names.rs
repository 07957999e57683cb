//! Names of the images of a folder: which belong to the clip, and what their numbers count.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tessuto_core::error::{Error, Hint, Remedy, Result};

const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Images that other programs write and this one does not read.
const FOREIGN: [&str; 30] = [
    "tif", "tiff", "exr", "webp", "heic", "heif", "hif", "avif", "jxl", "jp2", "bmp", "dng", "tga", "gif",
    "cr2", "cr3", "nef", "arw", "raf", "rw2", "orf", "ppm", "pgm", "pbm", "hdr", "dpx", "psd", "svg", "npy",
    "npz",
];
/// Files and folders that a message names at most.
const NAMED: usize = 3;

/// The images in `folder`, by number where their names have one; notes say what is left out.
///
/// # Errors
/// [`Error::Input`] if there are none, or if some of the clip are of a format that is not read.
pub(super) fn list(folder: &Path, notes: &mut Vec<String>) -> Result<Vec<PathBuf>> {
    let unreadable = |e: std::io::Error| {
        Error::input(
            folder.display().to_string(),
            format!("cannot be read: {e}"),
            "check the path and its permissions",
        )
    };
    let (mut found, mut foreign, mut folders) = (Vec::new(), Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.')) {
            continue;
        }
        let ending = ending(&path);
        if path.is_dir() {
            folders.push(path);
        } else if path.is_file() && ENDINGS.contains(&ending.as_str()) {
            found.push(path);
        } else if path.is_file() && FOREIGN.contains(&ending.as_str()) {
            foreign.push(path);
        }
    }
    for files in [&mut found, &mut foreign, &mut folders] {
        files.sort_by(|a, b| natural(&name(a), &name(b)));
    }
    if found.is_empty() {
        return Err(none(folder, &foreign, &folders));
    }
    if !foreign.is_empty() {
        notes.push(left_out(folder, &found, &foreign)?);
    }
    Ok(found)
}

fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// The error of a folder without images, with what is there instead.
fn none(folder: &Path, foreign: &[PathBuf], folders: &[PathBuf]) -> Error {
    let place = folder.display().to_string();
    if let Some(first) = foreign.first() {
        let problem = format!("has no PNG or JPEG image, but {}", several(foreign));
        return Error::input(place, problem, conversion(first));
    }
    let has_images = |sub: &&PathBuf| {
        let files = std::fs::read_dir(sub).into_iter().flatten().flatten();
        files.take(1000).any(|file| ENDINGS.contains(&ending(&file.path()).as_str()))
    };
    let nested: Vec<PathBuf> = folders.iter().filter(has_images).cloned().collect();
    match nested.first() {
        Some(first) => {
            let problem =
                format!("has no PNG or JPEG image itself; folders in it have: {}", several(&nested));
            Error::input(place, problem, format!("name one of them: {}", first.display()))
        }
        None => Error::input(place, "has no PNG or JPEG image", "name the folder that holds the images"),
    }
}

/// A note on files that are not read and not of the clip.
///
/// # Errors
/// [`Error::Input`] if they are named as the images are: then some of the clip would be missing.
fn left_out(folder: &Path, found: &[PathBuf], foreign: &[PathBuf]) -> Result<String> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stems: BTreeSet<String> = found.iter().map(|path| stem(path)).collect();
    let patterns: BTreeSet<Vec<String>> = stems.iter().map(|stem| split(stem).texts).collect();
    // Cameras write a raw file beside each JPEG.
    let alone: Vec<PathBuf> = foreign.iter().filter(|path| !stems.contains(&stem(path))).cloned().collect();
    let alike = alone.iter().find(|path| {
        let parts = split(&stem(path));
        !parts.numbers.is_empty() && patterns.contains(&parts.texts)
    });
    if let Some(alike) = alike {
        let problem = format!(
            "has {} beside {} PNG or JPEG images: {}",
            files(alone.len()),
            found.len(),
            several(&alone)
        );
        return Err(Error::input(folder.display().to_string(), problem, conversion(alike)));
    }
    let twins = if alone.is_empty() { "; each has its PNG or JPEG" } else { "" };
    Ok(format!(
        "{}: {} left out, of formats that are not read: {}{twins}",
        folder.display(),
        match foreign.len() {
            1 => "1 file is".to_owned(),
            n => format!("{n} files are"),
        },
        several(foreign)
    ))
}

fn files(count: usize) -> String {
    if count == 1 { "1 file of another format".into() } else { format!("{count} files of other formats") }
}

fn several(paths: &[PathBuf]) -> String {
    let mut names: Vec<String> = paths.iter().take(NAMED).map(|path| name(path)).collect();
    if paths.len() > NAMED {
        names.push("…".into());
    }
    names.join(", ")
}

/// How to make images that are read of one like `path`.
fn conversion(path: &Path) -> String {
    let ending = ending(path);
    match ending.as_str() {
        "npy" | "npz" => "write the arrays as PNG images, white where the fabric is".into(),
        "dng" | "cr2" | "cr3" | "nef" | "arw" | "raf" | "rw2" | "orf" => {
            format!(
                "develop all of them alike, e.g. darktable-cli FILE FILE.png, or magick mogrify -format png \
                 FOLDER/*.{ending}"
            )
        }
        _ => format!(
            "convert them, e.g. magick mogrify -format png FOLDER/*.{ending}, or with ffmpeg; PNG and JPEG are read"
        ),
    }
}

/// The file name, for messages and comparison.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The name without its endings and what marks a mask: `a.png`, `a.jpg.png`, `a.mask.png`, `a_mask.png` are all `a`.
pub(super) fn bare(path: &Path) -> String {
    let mut stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    for ending in [".png", ".jpg", ".jpeg", ".mask", "_mask", "-mask"] {
        if let Some(shorter) = stem.strip_suffix(ending) {
            stem = shorter.to_owned();
        }
    }
    stem
}

/// A name in numbers and what is between them.
pub(super) struct Parts {
    /// One more than numbers.
    pub texts: Vec<String>,
    /// Digits.
    pub numbers: Vec<String>,
}

/// Takes a name apart.
pub(super) fn split(stem: &str) -> Parts {
    let mut out = Parts { texts: vec![String::new()], numbers: Vec::new() };
    let mut in_number = false;
    for c in stem.chars() {
        if c.is_ascii_digit() {
            if !in_number {
                out.numbers.push(String::new());
                out.texts.push(String::new());
            }
            out.numbers.last_mut().expect("pushed").push(c);
        } else {
            out.texts.last_mut().expect("never empty").push(c);
        }
        in_number = c.is_ascii_digit();
    }
    out
}

/// All names apart, where they differ in their numbers only.
pub(super) fn alike(files: &[PathBuf]) -> Option<Vec<Parts>> {
    let parts: Vec<Parts> = files.iter().map(|file| split(&bare(file))).collect();
    let first = parts.first()?;
    (!first.numbers.is_empty() && parts.iter().all(|p| p.texts == first.texts)).then_some(parts)
}

/// Positions of the numbers that are not the same in all names.
pub(super) fn changing(parts: &[Parts]) -> Vec<usize> {
    let differs = |k: &usize| parts.iter().any(|p| p.numbers[*k] != parts[0].numbers[*k]);
    (0..parts[0].numbers.len()).filter(differs).collect()
}

/// The number of every file: the one that changes from name to name; a camera, size or take that is the same in
/// all of them is none. The last one of a single name. `None` if the names differ in more than numbers, or have
/// none.
pub(super) fn numbers(files: &[PathBuf]) -> Option<Vec<u64>> {
    let parts = alike(files)?;
    let column = |k: usize| -> Option<Vec<u64>> { parts.iter().map(|p| p.numbers[k].parse().ok()).collect() };
    let changing = changing(&parts);
    match changing[..] {
        [] => column(parts[0].numbers.len() - 1),
        [one] => column(one),
        // A counter beside a time or a camera: the one with most values, of several the one with even steps.
        _ => {
            let columns: Vec<Vec<u64>> = changing.iter().map(|k| column(*k)).collect::<Option<_>>()?;
            let distinct = |column: &Vec<u64>| column.iter().collect::<BTreeSet<_>>().len();
            let even = |column: &Vec<u64>| {
                column.windows(2).all(|p| p[1].wrapping_sub(p[0]) == column[1].wrapping_sub(column[0]))
            };
            columns.into_iter().max_by_key(|column| (distinct(column), even(column)))
        }
    }
}

/// Order of names in which numbers count by value: a2 before a10.
pub(super) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        let digits = |s: &[u8]| s.iter().take_while(|c| c.is_ascii_digit()).count();
        let (m, n) = (digits(a), digits(b));
        if m > 0 && n > 0 {
            // Without leading zeros the longer number is the larger.
            let value = |s: &[u8], n: usize| {
                let zeros = s[..n].iter().take_while(|c| **c == b'0').count();
                (n - zeros, s[zeros..n].to_vec())
            };
            match value(a, m).cmp(&value(b, n)) {
                Ordering::Equal => (a, b) = (&a[m..], &b[n..]),
                other => return other,
            }
            continue;
        }
        match (a.first(), b.first()) {
            (Some(x), Some(y)) if x == y => (a, b) = (&a[1..], &b[1..]),
            (x, y) => return x.cmp(&y),
        }
    }
}

/// Refuses images whose numbers are not evenly spaced: a gap is a jump in time.
pub(super) fn check_gaps(images: &[PathBuf], folder: &Path, notes: &mut Vec<String>) -> Result<()> {
    let Some(numbers) = numbers(images).filter(|n| n.len() > 1) else { return Ok(()) };
    if let Some((first, second)) = twice(&numbers) {
        return Err(Error::input(
            folder.display().to_string(),
            format!(
                "holds several images of one number, {} and {}: several takes or cameras",
                name(&images[first]),
                name(&images[second])
            ),
            "give one folder for each",
        ));
    }
    let steps: Vec<u64> = numbers.windows(2).map(|p| p[1].saturating_sub(p[0])).collect();
    let step = steps.iter().copied().min().unwrap_or(1);
    if let Some(k) = steps.iter().position(|s| *s != step) {
        return Err(gap(images, folder, k));
    }
    if step > 1 {
        notes.push(format!(
            "images are numbered in steps of {step}; the frame rate must be that of the images that are there"
        ));
    }
    Ok(())
}

/// The error of a jump in time behind image `k`.
pub(super) fn gap(images: &[PathBuf], folder: &Path, k: usize) -> Error {
    let problem = format!(
        "the numbers of the images have a gap: {} is followed by {}",
        name(&images[k]),
        name(&images[k + 1])
    );
    let hint =
        "add what is missing, take a part without gap, or allow gaps if they are evenly spaced in time";
    let hint = Hint::from(hint).with(Remedy::Frames(Some(0..k + 1))).with(Remedy::AllowGaps);
    Error::input(folder.display().to_string(), problem, hint)
}

/// Two positions of one number.
pub(super) fn twice(numbers: &[u64]) -> Option<(usize, usize)> {
    let mut seen = std::collections::BTreeMap::new();
    numbers.iter().enumerate().find_map(|(k, n)| seen.insert(*n, k).map(|first| (first, k)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn numbers_count_by_value() {
        let mut names = vec!["f10.png", "f9.png", "f010b.png", "f1.png", "e99.png"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["e99.png", "f1.png", "f9.png", "f10.png", "f010b.png"]);
    }

    #[test]
    fn the_number_that_changes_counts() {
        let of = |names: &[&str]| numbers(&paths(names));
        assert_eq!(of(&["take2_frame007.png"]), Some(vec![7]));
        assert_eq!(of(&["été0012é.jpg", "été0013é.jpg"]), Some(vec![12, 13]));
        assert_eq!(of(&["15.png"]), Some(vec![15]));
        assert_eq!(of(&["frame0003_cam2.jpg", "frame0007_cam2.jpg"]), Some(vec![3, 7]));
        assert_eq!(of(&["f1_1080p_8bit.png", "f2_1080p_8bit.jpg.png"]), Some(vec![1, 2]));
        // A counter beside times, and beside cameras.
        assert_eq!(of(&["f0_17.png", "f1_50.png", "f2_84.png"]), Some(vec![0, 1, 2]));
        assert_eq!(of(&["f0_c1.png", "f0_c2.png", "f1_c1.png", "f1_c2.png", "f2_c1.png"]).unwrap()[4], 2);
        assert_eq!(of(&["cloth.png"]), None);
        assert_eq!(of(&["cloth1.png", "cover1.png"]), None);
    }

    #[test]
    fn names_of_masks() {
        for name in ["a7.png", "A7.jpg.png", "a7.mask.png", "a7_mask.jpeg"] {
            assert_eq!(bare(Path::new(name)), "a7");
        }
    }

    #[test]
    fn gaps_behind_any_number() {
        let check = |names: &[&str]| check_gaps(&paths(names), Path::new("in"), &mut Vec::new());
        let told = check(&["f3_c2.png", "f4_c2.png", "f7_c2.png"]).unwrap_err().to_string();
        assert!(told.contains("gap: f4_c2.png is followed by f7_c2.png"), "{told}");
        let told = check(&["f3_c1.png", "f3_c2.png", "f4_c1.png", "f4_c2.png", "f5_c1.png"]).unwrap_err();
        assert!(told.to_string().contains("f3_c1.png and f3_c2.png: several takes or cameras"), "{told}");
        check(&["f3_c2.png", "f4_c2.png", "f5_c2.png"]).unwrap();
    }
}
