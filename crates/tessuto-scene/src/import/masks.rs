//! Masks beside the frames: read alike, brought to the size of the frames, and none of them empty.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use rayon::prelude::*;
use tessuto_core::parallel;

use super::frames::{Kind, Source, in_order};
use super::names::name;
use super::stage::{Colours, Stage};
use super::video::Video;
use super::{Masks, Settings, pairing};
use crate::io::mask::{self, Reading};
use crate::io::{expect_file, image};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::Image;
use tessuto_core::video::COVERED;

/// Compression leaves traces of this size [fraction of white] in black and white.
const TRACES: f32 = 0.1;
/// Channels that differ by more [of 255] are a colour; and the fraction of such pixels that masks have at most.
const VIVID: u8 = 64;
const COLOURED: f64 = 0.01;

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
    let mut reading = Reading::luminance();
    let writer = Writer { stage, colours, wanted: &wanted, empty: Mutex::default() };
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
                writer.put(k, &mask, &path, mask::brightest(&mask))
            })?;
        }
        (Masks::Later, _) => {}
        (Masks::Alpha, Kind::Video(_)) => unreachable!("validated: alpha is read from images only"),
        (Masks::Path(path), kind) if path.is_dir() => {
            let whole = settings.frames.is_none();
            let files = pairing::pair(kind, path, &wanted, whole, notes)?;
            reading = writer.folder(path, &files, notes)?;
        }
        (Masks::Path(path), _) => from_video(path, settings, source, &writer, notes)?,
    }
    writer.refuse_empty(&reading, if settings.masks == Masks::Alpha { "transparent everywhere" } else { "" })
}

/// Writes masks, and keeps which are empty.
struct Writer<'a> {
    stage: &'a Stage<'a>,
    colours: &'a Colours,
    /// Numbers, in the input, of the frames.
    wanted: &'a [usize],
    /// Masks without fabric: which, from which file, and the brightest value in that.
    empty: Mutex<BTreeMap<usize, (PathBuf, f32)>>,
}

impl Writer<'_> {
    /// Writes mask `k`, which is what the file at `path`, of this brightest value, says.
    fn put(&self, k: usize, mask: &Image, path: &Path, brightest: f32) -> Result<()> {
        let invert = self.stage.settings.invert_masks;
        let fabric = |v: &f32| if invert { 1.0 - v >= COVERED } else { *v >= COVERED };
        if !mask.data.iter().any(fabric) {
            let mut empty = self.empty.lock().expect("nobody panics with it");
            empty.insert(k, (path.to_path_buf(), brightest));
        }
        self.stage.mask(self.colours, k, mask)
    }

    /// Writes all masks of a folder. What their values mean is decided for all of them.
    fn folder(&self, folder: &Path, files: &[PathBuf], notes: &mut Vec<String>) -> Result<Reading> {
        let looks: Vec<Result<mask::Look>> = parallel::over(files, |path| Ok(image::open(path)?.look()));
        let looks = looks.into_iter().collect::<Result<Vec<_>>>()?;
        let place = folder.display().to_string();
        let reading = mask::understand(&place, &looks, self.stage.settings.object.as_ref())?;
        let size = self.colours.size();
        let noted = Mutex::new(BTreeMap::new());
        in_order(files.par_iter().enumerate(), |(k, path)| {
            let mut file = image::open(path)?;
            let full = file.full();
            let mask = file.mask_as(&reading, full);
            let brightest = file.brightest(&reading, &mask);
            let said = if [mask.width, mask.height] == size { None } else { Some(SCALED) };
            let mut noted = noted.lock().expect("nobody panics with it");
            file.notes.sort_unstable();
            file.notes.dedup();
            for note in file.notes.iter().copied().chain(said) {
                noted.entry(note).or_insert_with(Vec::new).push(k);
            }
            drop(noted);
            let mask = if file.lossy { without_traces(mask) } else { mask };
            self.put(k, &resize(mask, size, path)?, path, brightest)
        })?;
        notes.extend(reading.notes.iter().map(|note| format!("{place}: {note}")));
        for (note, which) in noted.into_inner().expect("nobody panics with it") {
            let count = which.len();
            if note == SCALED {
                notes.push(format!("{place}: {count} masks {SCALED}"));
                continue;
            }
            let first = which.into_iter().min().map_or_else(String::new, |k| name(&files[k]));
            notes.push(format!("{place}: {note} (in {count} masks, first {first})"));
        }
        Ok(reading)
    }

    /// Refuses frames without fabric, all of them at once.
    fn refuse_empty(self, reading: &Reading, what: &str) -> Result<()> {
        let empty = self.empty.into_inner().expect("nobody panics with it");
        let Some((path, brightest)) = empty.values().next() else { return Ok(()) };
        let there: Vec<bool> = (0..self.wanted.len()).map(|k| !empty.contains_key(&k)).collect();
        let count = format!(" ({} of {} masks are)", empty.len(), there.len());
        let hint = Hint::from("correct the masks (white = fabric), or leave such frames out");
        let hint = match pairing::longest(&there) {
            Some(run) => {
                hint.with(Remedy::Frames(Some(self.wanted[run.start]..self.wanted[run.end - 1] + 1)))
            }
            None => "fabric must be white; black is what is not (masks the other way round can be inverted)"
                .into(),
        };
        if !what.is_empty() {
            return Err(Error::input(path.display().to_string(), format!("is {what}{count}"), hint));
        }
        Err(mask::empty(path, *brightest, &count, reading, hint))
    }
}

/// Of masks of another size.
const SCALED: &str = "have another size than the frames and were scaled";

fn from_video(
    path: &Path,
    settings: &Settings,
    source: &Source,
    writer: &Writer,
    notes: &mut Vec<String>,
) -> Result<()> {
    let (colours, wanted) = (writer.colours, writer.wanted);
    expect_file(path)?;
    if !path.exists() {
        let hint = "name a folder of mask images or a video of masks, white where the fabric is";
        return Err(Error::input(path.display().to_string(), "does not exist", hint));
    }
    let colour = match &source.kind {
        Kind::Video(colour) => Some(colour.as_ref()),
        Kind::Images(_) => None,
    };
    let video = Video::masks(path, &settings.ffmpeg, colour, notes)?;
    if let Kind::Images(images) = &source.kind {
        video.expect_one_each(images.len())?;
    }
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
        refuse_colours(&frame.rgb, path, wanted[k])?;
        let of_frame = PathBuf::from(format!("{}, frame {}", path.display(), wanted[k]));
        let brightest = mask::brightest(&mask);
        writer.put(k, &resize(without_traces(mask), colours.size(), path)?, &of_frame, brightest)
    })?;
    notes.extend(stream.complaints());
    if written < wanted.len() {
        return Err(Error::input(
            path.display().to_string(),
            format!("holds {count} masks, but frame {} has none", wanted[written]),
            Hint::from(
                "segment the whole video (one of variable frame rate is best made constant first: \
                 ffmpeg -i IN -vf fps=30 OUT.mp4), or take the part with masks",
            )
            .with(Remedy::Frames(None)),
        ));
    }
    if scaled.into_inner() {
        notes
            .push(format!("{}: the masks have another size than the frames and were scaled", path.display()));
    }
    Ok(())
}

/// Refuses a frame of a video of masks that shows objects in colours, of which compression leaves nothing to
/// distinguish them by.
fn refuse_colours(rgb: &[u8], path: &Path, frame: usize) -> Result<()> {
    let pixels = rgb.chunks_exact(3);
    let vivid = |p: &&[u8]| {
        let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
        high - low > VIVID
    };
    let count = pixels.clone().filter(vivid).count();
    if count as f64 <= COLOURED * pixels.len() as f64 {
        return Ok(());
    }
    let part = 100.0 * count as f64 / pixels.len() as f64;
    Err(Error::input(
        path.display().to_string(),
        format!(
            "frame {frame} is coloured in {part:.1} % of its pixels; masks in a video are white on black"
        ),
        "give masks in colours or labels as a folder of PNG images, which keep them exactly, or make the \
         video white where the fabric is",
    ))
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
    fn a_mask_of_half_the_size_is_scaled() {
        let small =
            Image { width: 4, height: 2, channels: 1, data: vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0] };
        let large = resize(small.clone(), [8, 4], Path::new("m.png")).unwrap();
        assert_eq!(large.data[..8], [0.0, 0.0, 0.0, 0.25, 0.75, 1.0, 1.0, 1.0]);
        assert!(resize(small, [8, 8], Path::new("m.png")).is_err());
    }
}
