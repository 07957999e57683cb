//! The frames of the input: numbered images of a folder, or a video.

use std::cmp::Ordering;
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::Settings;
use super::stage::{Colours, Stage};
use super::video::{Reading, Video};
use crate::error::{Error, Hint, Remedy, Result};
use crate::io::{expect_file, image};

const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Images that other programs write and this one does not read.
const FOREIGN: [&str; 9] = ["tif", "tiff", "exr", "webp", "heic", "bmp", "dng", "tga", "gif"];

/// The input, before anything of it is decoded.
pub(super) struct Source {
    /// Frames per second of the input, all frames taken.
    pub fps: f64,
    pub kind: Kind,
}

pub(super) enum Kind {
    /// The images of a folder in the order of time.
    Images(Vec<PathBuf>),
    Video(Box<Video>),
}

impl Source {
    /// Looks at the input.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame rate of images is not given; [`Error::Input`].
    pub fn open(settings: &Settings, notes: &mut Vec<String>) -> Result<Self> {
        let input = &settings.input;
        expect_file(input)?;
        if !input.exists() {
            let hint = "name a video file, or a folder of PNG or JPEG images";
            return Err(Error::input(input.display().to_string(), "does not exist", hint));
        }
        if !input.is_dir() {
            let reading = Reading {
                ffmpeg: &settings.ffmpeg,
                fps: settings.fps,
                rate: settings.rate,
                end: settings.frames.as_ref().map(|r| r.end),
            };
            let video = Video::probe(input, reading, notes)?;
            return Ok(Self { fps: video.fps, kind: Kind::Video(Box::new(video)) });
        }
        let Some(fps) = settings.fps.or(settings.rate) else {
            return Err(Error::usage(
                "images do not tell their frame rate",
                Hint::from("give the frames per second of the recording, before frames are left out")
                    .with(Remedy::Fps),
            ));
        };
        let images = list(input)?;
        if !settings.allow_gaps {
            check_gaps(&images, input, notes)?;
        }
        Ok(Self { fps, kind: Kind::Images(images) })
    }

    /// Writes the colour frames.
    ///
    /// # Errors
    /// That of the lowest frame; [`Error::Usage`] if the frames asked for do not exist.
    pub fn write(&self, stage: &Stage, notes: &mut Vec<String>) -> Result<Colours> {
        let settings = stage.settings;
        match &self.kind {
            Kind::Images(images) => {
                let chosen = choose(settings, images.len())?;
                let size = image::size(&images[chosen[0]])?;
                let colours = Colours::new(settings, size, 1.0, chosen.len(), notes)?;
                in_order(chosen.into_par_iter().enumerate(), |(k, n)| {
                    stage.colour_file(&colours, k, &images[n])
                })?;
                Ok(colours)
            }
            Kind::Video(video) => {
                let end = settings.frames.as_ref().map(|r| r.end);
                let mut stream = video.stream(end, &settings.ffmpeg)?;
                let Some(first) = stream.next() else { return Err(video.empty()) };
                let first = first?;
                let mut colours = Colours::new(settings, first.size, video.pixel_aspect(), 0, notes)?;
                let begin = settings.frames.as_ref().map_or(0, |r| r.start);
                let mut count = 0;
                let frames =
                    std::iter::once(Ok(first)).chain(&mut stream).enumerate().inspect(|_| count += 1);
                let chosen =
                    frames.filter(|(n, _)| *n >= begin && (n - begin).is_multiple_of(settings.stride));
                // One thread at a time reads; all of them undistort and compress.
                let written = in_order(chosen.enumerate().par_bridge(), |(k, (_, frame))| {
                    stage.colour(&colours, k, frame?)
                })?;
                colours.frames = 0..written;
                notes.extend(stream.complaints());
                choose(settings, count)?;
                Ok(colours)
            }
        }
    }
}

/// `f` of every item on all cores; the number of items, or the first error in their order.
pub(super) fn in_order<T: Send>(
    items: impl ParallelIterator<Item = (usize, T)>,
    f: impl Fn((usize, T)) -> Result<()> + Send + Sync,
) -> Result<usize> {
    let mut results: Vec<(usize, Result<()>)> = items.map(|(k, item)| (k, f((k, item)))).collect();
    results.sort_by_key(|(k, _)| *k);
    let count = results.len();
    results.into_iter().map(|(_, result)| result).collect::<Result<Vec<()>>>()?;
    Ok(count)
}

/// The numbers of the frames to take of `count`.
pub(super) fn choose(settings: &Settings, count: usize) -> Result<Vec<usize>> {
    let range: Range<usize> = settings.frames.clone().unwrap_or(0..count);
    if range.start >= range.end || range.end > count {
        return Err(Error::usage(
            format!("frames {}..{} of {count} frames", range.start, range.end),
            Hint::from(format!("ask for frames A..B with 0 ≤ A < B ≤ {count}")).with(Remedy::Frames(None)),
        ));
    }
    Ok(range.step_by(settings.stride).collect())
}

/// The images in `folder`, by number where their names have one.
pub(super) fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = |e: std::io::Error| {
        Error::input(
            folder.display().to_string(),
            format!("cannot be read: {e}"),
            "check the path and its permissions",
        )
    };
    let mut found = Vec::new();
    let mut foreign = None;
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if hidden || !path.is_file() {
            continue;
        }
        if ENDINGS.contains(&ending.as_str()) {
            found.push(path);
        } else if FOREIGN.contains(&ending.as_str()) {
            foreign = Some(path);
        }
    }
    if found.is_empty() {
        let problem = match &foreign {
            Some(path) => format!("has no PNG or JPEG image, but {}", name(path)),
            None => "has no PNG or JPEG image".to_owned(),
        };
        let hint = "convert them, e.g. magick mogrify -format png FOLDER/*; or name the folder that holds the images";
        return Err(Error::input(folder.display().to_string(), problem, hint));
    }
    found.sort_by(|a, b| natural(&name(a), &name(b)));
    Ok(found)
}

/// The file name, for messages and comparison.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The last number in the name without ending, and the text before it.
pub(super) fn number(path: &Path) -> Option<(String, usize)> {
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |k| k + stem[k..].chars().next().map_or(1, char::len_utf8));
    Some((stem[..start].to_owned(), stem[start..end].parse().ok()?))
}

/// Order of names in which numbers count by value: a2 before a10.
fn natural(a: &str, b: &str) -> Ordering {
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
fn check_gaps(images: &[PathBuf], folder: &Path, notes: &mut Vec<String>) -> Result<()> {
    let numbered: Option<Vec<(String, usize)>> = images.iter().map(|p| number(p)).collect();
    let Some(numbered) = numbered.filter(|n| n.len() > 1 && n.iter().all(|(text, _)| *text == n[0].0)) else {
        return Ok(());
    };
    let steps: Vec<usize> = numbered.windows(2).map(|p| p[1].1.saturating_sub(p[0].1)).collect();
    let step = steps.iter().copied().min().unwrap_or(1);
    if let Some(k) = steps.iter().position(|s| *s != step) {
        return Err(Error::input(
            folder.display().to_string(),
            format!(
                "the numbers of the images have a gap: {} is followed by {}",
                name(&images[k]),
                name(&images[k + 1])
            ),
            Hint::from("add what is missing, take a part without gap, or allow gaps if they are evenly spaced in time")
                .with(Remedy::Frames(Some(0..k + 1)))
                .with(Remedy::AllowGaps),
        ));
    }
    if step > 1 {
        notes.push(format!(
            "images are numbered in steps of {step}; the frame rate must be that of the images that are there"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_by_value() {
        let mut names = vec!["f10.png", "f9.png", "f010b.png", "f1.png", "e99.png"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["e99.png", "f1.png", "f9.png", "f10.png", "f010b.png"]);
    }

    #[test]
    fn the_last_number_of_a_name() {
        let parts = |name: &str| number(Path::new(name));
        assert_eq!(parts("take2_frame007.png"), Some(("take2_frame".into(), 7)));
        assert_eq!(parts("été0012é.jpg"), Some(("été".into(), 12)));
        assert_eq!(parts("15.png"), Some((String::new(), 15)));
        assert_eq!(parts("cloth.png"), None);
    }
}
