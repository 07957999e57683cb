//! Masks beside the frames: found by name or number, never by order alone; brought to the size of the frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::frames::{Kind, Source, in_order, list, name, number};
use super::stage::{Colours, Stage};
use super::video::Video;
use super::{Masks, Settings};
use crate::error::{Error, Hint, Remedy, Result};
use crate::image::Image;
use crate::io::{expect_file, image};

/// Compression leaves traces of this size [fraction of white] in black and white.
const TRACES: f32 = 0.1;

/// Writes a mask for every frame.
pub(super) fn write(
    settings: &Settings,
    source: &Source,
    stage: &Stage,
    colours: &Colours,
    notes: &mut Vec<String>,
) -> Result<()> {
    let start = settings.frames.as_ref().map_or(0, |r| r.start);
    // Numbers, in the input, of the frames that were written.
    let wanted: Vec<usize> = colours.frames.clone().map(|k| start + k * settings.stride).collect();
    match (&settings.masks, &source.kind) {
        (Masks::Alpha, Kind::Images(images)) => {
            let files = wanted.iter().map(|n| images[*n].clone()).enumerate();
            in_order(files.collect::<Vec<_>>().into_par_iter(), |(k, path)| {
                let mask = image::open(&path)?.alpha().ok_or_else(|| {
                    let hint =
                        Hint::from("write the frames as PNG with transparency (alpha), or give the masks")
                            .with(Remedy::Masks);
                    Error::input(path.display().to_string(), "has no alpha channel", hint)
                })?;
                if mask.data.iter().all(|v| *v >= 0.5) {
                    let hint = Hint::from("make what is not fabric transparent, or give the masks")
                        .with(Remedy::Masks);
                    return Err(Error::input(path.display().to_string(), "is opaque everywhere", hint));
                }
                stage.mask(colours, k, &mask)
            })?;
        }
        (Masks::Later, _) => {}
        (Masks::Alpha, Kind::Video(_)) => unreachable!("validated: alpha is read from images only"),
        (Masks::Path(path), kind) if path.is_dir() => {
            let files = pair(kind, path, &wanted, notes)?;
            let resized = std::sync::atomic::AtomicUsize::new(0);
            in_order(files.into_par_iter().enumerate(), |(k, path)| {
                let (mask, _) = image::read_mask(&path)?;
                let lossy = path.extension().is_some_and(|e| !e.eq_ignore_ascii_case("png"));
                let mask = if lossy { without_traces(mask) } else { mask };
                if [mask.width, mask.height] != colours.size() {
                    resized.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                }
                stage.mask(colours, k, &resize(mask, colours.size(), &path)?)
            })?;
            let resized = resized.into_inner();
            if resized > 0 {
                notes.push(format!(
                    "{}: {resized} masks have another size than the frames and were scaled",
                    path.display()
                ));
            }
        }
        (Masks::Path(path), _) => from_video(path, settings, source, stage, colours, &wanted, notes)?,
    }
    Ok(())
}

fn from_video(
    path: &Path,
    settings: &Settings,
    source: &Source,
    stage: &Stage,
    colours: &Colours,
    wanted: &[usize],
    notes: &mut Vec<String>,
) -> Result<()> {
    expect_file(path)?;
    if !path.exists() {
        let hint = "name a folder of mask images or a video of masks, white where the fabric is";
        return Err(Error::input(path.display().to_string(), "does not exist", hint));
    }
    let colour = match &source.kind {
        Kind::Video(colour) => Some(colour.as_ref()),
        Kind::Images(_) => None,
    };
    let video = Video::masks(path, &settings.ffmpeg, colour)?;
    let mut stream = video.stream(wanted.last().map(|n| n + 1), &settings.ffmpeg)?;
    let mut count = 0;
    let chosen =
        (&mut stream).enumerate().inspect(|_| count += 1).filter(|(n, _)| wanted.binary_search(n).is_ok());
    let scaled = std::sync::atomic::AtomicBool::new(false);
    let written = in_order(chosen.enumerate().par_bridge(), |(k, (_, frame))| {
        let frame = frame?;
        let grey = frame.rgb.chunks_exact(3).map(|p| f32::from(p[1]) / 255.0).collect();
        let mask = Image { width: frame.size[0], height: frame.size[1], channels: 1, data: grey };
        scaled.fetch_or(frame.size != colours.size(), std::sync::atomic::Ordering::Relaxed);
        stage.mask(colours, k, &resize(without_traces(mask), colours.size(), path)?)
    })?;
    notes.extend(stream.complaints());
    if written < wanted.len() {
        return Err(Error::input(
            path.display().to_string(),
            format!("holds {count} masks, but frame {} has none", wanted[written]),
            Hint::from("segment the whole video (one of variable frame rate is best made constant first: ffmpeg -i IN -vf fps=30 OUT.mp4), or take the part with masks").with(Remedy::Frames(None)),
        ));
    }
    if scaled.into_inner() {
        notes
            .push(format!("{}: the masks have another size than the frames and were scaled", path.display()));
    }
    Ok(())
}

/// The mask file of every frame of `wanted`.
fn pair(kind: &Kind, folder: &Path, wanted: &[usize], notes: &mut Vec<String>) -> Result<Vec<PathBuf>> {
    let files = list(folder)?;
    let by_name: BTreeMap<String, &PathBuf> = files.iter().map(|f| (bare(f), f)).collect();
    let found: Vec<Option<&PathBuf>> = match kind {
        Kind::Images(images) => {
            let named: Vec<_> = wanted.iter().map(|n| by_name.get(&bare(&images[*n])).copied()).collect();
            if named.iter().any(Option::is_some) {
                named
            } else {
                let numbers = by_number(&files, folder)?;
                let own =
                    |n: &usize| number(&images[*n]).and_then(|(_, number)| numbers.get(&number).copied());
                wanted.iter().map(own).collect()
            }
        }
        Kind::Video(_) => {
            let numbers = by_number(&files, folder)?;
            let offset = usize::from(!numbers.contains_key(&0) && numbers.contains_key(&1));
            if offset == 1 {
                notes.push(format!(
                    "{}: masks are numbered from 1; mask 1 belongs to the first frame",
                    folder.display()
                ));
            }
            wanted.iter().map(|n| numbers.get(&(n + offset)).copied()).collect()
        }
    };
    let missing: Vec<usize> = (0..wanted.len()).filter(|k| found[*k].is_none()).collect();
    if missing.is_empty() {
        return Ok(found.into_iter().flatten().cloned().collect());
    }
    let frame = |k: usize| match kind {
        Kind::Images(images) => name(&images[wanted[k]]),
        Kind::Video(_) => format!("frame {}", wanted[k]),
    };
    let mut names: Vec<String> = missing.iter().take(5).map(|k| frame(*k)).collect();
    if missing.len() > 5 {
        names.push("…".into());
    }
    let hint = match longest(&found) {
        Some(run) => Hint::from("segment these frames too, or take the longest part that has masks")
            .with(Remedy::Frames(Some(wanted[run.start]..wanted[run.end - 1] + 1))),
        None => "masks need the names of the frames, or the same numbers; white is fabric".into(),
    };
    Err(Error::input(
        folder.display().to_string(),
        format!("has no mask for {} of {} frames: {}", missing.len(), wanted.len(), names.join(", ")),
        hint,
    ))
}

/// The longest run of frames that have masks.
fn longest(found: &[Option<&PathBuf>]) -> Option<std::ops::Range<usize>> {
    let mut best = 0..0;
    let mut start = 0;
    for k in 0..=found.len() {
        if found.get(k).is_none_or(|f| f.is_none()) {
            if k - start > best.len() {
                best = start..k;
            }
            start = k + 1;
        }
    }
    (!best.is_empty()).then_some(best)
}

/// The name without its endings and what marks a mask: `a.png`, `a.jpg.png`, `a.mask.png`, `a_mask.png` are all `a`.
fn bare(path: &Path) -> String {
    let mut stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    for ending in [".png", ".jpg", ".jpeg", ".mask", "_mask", "-mask"] {
        if let Some(shorter) = stem.strip_suffix(ending) {
            stem = shorter.to_owned();
        }
    }
    stem
}

fn by_number<'a>(files: &'a [PathBuf], folder: &Path) -> Result<BTreeMap<usize, &'a PathBuf>> {
    let mut numbers: BTreeMap<usize, &PathBuf> = BTreeMap::new();
    for file in files {
        let Some((_, n)) = number(file) else { continue };
        if let Some(other) = numbers.insert(n, file) {
            return Err(Error::input(
                folder.display().to_string(),
                format!("{} and {} are both mask {n}", name(other), name(file)),
                "give masks the names of their frames, or one number each",
            ));
        }
    }
    Ok(numbers)
}

/// Black and white again where compression has spoilt them.
fn without_traces(mut mask: Image) -> Image {
    mask.data.iter_mut().for_each(|v| *v = ((*v - TRACES) / (1.0 - 2.0 * TRACES)).clamp(0.0, 1.0));
    mask
}

/// The mask in the size of the frames, if it has their shape.
fn resize(mask: Image, [width, height]: [usize; 2], path: &Path) -> Result<Image> {
    if [mask.width, mask.height] == [width, height] {
        return Ok(mask);
    }
    let scale = [mask.width as f64 / width as f64, mask.height as f64 / height as f64];
    // One pixel of rounding in either side.
    if (scale[0] / scale[1] - 1.0).abs() > 1.5 / width.min(height).min(mask.width).min(mask.height) as f64 {
        return Err(Error::input(
            path.display().to_string(),
            format!(
                "is {}×{} pixels, but the frames {width}×{height}: another shape",
                mask.width, mask.height
            ),
            "make masks of the frames' size; segmenters that cut or pad images must put them back",
        ));
    }
    let mut out = Image::new(width, height, 1);
    let at = |k: usize, scale: f64, n: usize| {
        let v = ((k as f64 + 0.5) * scale - 0.5).clamp(0.0, (n - 1) as f64);
        (v as usize, (v as usize + 1).min(n - 1), v.fract() as f32)
    };
    for y in 0..height {
        let (y0, y1, t) = at(y, scale[1], mask.height);
        for x in 0..width {
            let (x0, x1, s) = at(x, scale[0], mask.width);
            let mix = |y: usize| {
                let (a, b) = (mask.data[y * mask.width + x0], mask.data[y * mask.width + x1]);
                a + s * (b - a)
            };
            out.data[y * width + x] = mix(y0) + t * (mix(y1) - mix(y0));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_masks() {
        for name in ["a7.png", "A7.jpg.png", "a7.mask.png", "a7_mask.jpeg"] {
            assert_eq!(bare(Path::new(name)), "a7");
        }
    }

    #[test]
    fn a_mask_of_half_the_size_is_scaled() {
        let small =
            Image { width: 4, height: 2, channels: 1, data: vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0] };
        let large = resize(small.clone(), [8, 4], Path::new("m.png")).unwrap();
        assert_eq!(large.data[..8], [0.0, 0.0, 0.0, 0.25, 0.75, 1.0, 1.0, 1.0]);
        assert!(resize(small, [8, 8], Path::new("m.png")).is_err());
    }
}
