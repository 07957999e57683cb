//! The video: colour and mask of every frame, cut to the crop. Every file is read and checked once; a short video stays
//! in memory, of a long one each frame is read again when it is needed.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use tessuto_core::parallel;

use super::listing::numbered;
use super::manifest::Manifest;
use crate::io::image::{self, ImageFile};
use crate::io::mask::{self, Look, Reading};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::image::Image;
use tessuto_core::video::{COVERED, Frame, PIXEL_BYTES, Video};

/// Most memory `[bytes]` that one frame may take.
const MAX_FRAME_BYTES: usize = 1 << 30;
pub(super) const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// What is known of a mask file once it has been read.
struct Mask {
    /// The mask is black outside this part of the image.
    region: Rect,
    /// Where it is ≥ ½ in the full image.
    bounds: Rect,
    /// What was unusual about the file.
    notes: Vec<&'static str>,
}

/// A mask file that was looked at as if it were plain, white on black; most are.
struct Looked {
    look: Look,
    mask: Result<Mask>,
}

/// Where an image comes from.
#[derive(Clone)]
pub(super) enum Source {
    File(PathBuf),
    Held(Arc<ImageFile>),
}

impl Source {
    fn open(&self) -> Result<ImageFile> {
        match self {
            Self::File(path) => image::open(path),
            Self::Held(image) => Ok((**image).clone()),
        }
    }

    /// For messages.
    fn place(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Held(image) => image.path(),
        }
    }
}

/// What the frames are made of, and what is kept of them.
pub(super) struct Sources {
    /// One per frame.
    pub colours: Vec<Source>,
    /// As many.
    pub masks: Vec<Source>,
    /// Number of the first frame.
    pub first: usize,
    /// Width and height of the images `[px]`.
    pub size: [usize; 2],
    /// The part to keep; the masks decide where it is missing.
    pub crop: Option<Rect>,
    /// Frames of more bytes than this in all are read again whenever they are needed.
    pub held_bytes: usize,
}

/// One frame's files, and what both looked like when they were read first.
struct Files {
    colour: Source,
    mask: Source,
    /// Part of the image that the mask is not black in.
    region: Rect,
    stamps: [Stamp; 2],
}

/// Length and time of the last change.
type Stamp = Option<(u64, SystemTime)>;

fn stamp(source: &Source) -> Stamp {
    let Source::File(path) = source else { return None };
    let data = std::fs::metadata(path).ok()?;
    Some((data.len(), data.modified().ok()?))
}

/// Reads the frames `range` on all cores, and the crop; holds frames of at most `held_bytes` in all. Of several errors,
/// that of the lowest frame is returned.
pub(crate) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    held_bytes: usize,
    warnings: &mut Vec<Warning>,
) -> Result<(Rect, Video)> {
    let camera = manifest.camera();
    let first = range.start;
    let numbers = (range, manifest.n_frames);
    let of_files = |paths: Vec<PathBuf>| paths.into_iter().map(Source::File).collect();
    let colours = of_files(numbered(folder, &manifest.rgbs, "rgb_", &ENDINGS, numbers.clone(), warnings)?);
    let masks = of_files(numbered(folder, &manifest.masks, "mask_", &ENDINGS, numbers, warnings)?);
    let (size, crop) = ([camera.width, camera.height], manifest.crop);
    from(Sources { colours, masks, first, size, crop, held_bytes }, warnings)
}

/// The frames that `sources` hold, and the crop.
pub(super) fn from(sources: Sources, warnings: &mut Vec<Warning>) -> Result<(Rect, Video)> {
    let Sources { colours, masks, first, size, crop, held_bytes } = sources;
    let frame_count = colours.len();
    if let Some(crop) = crop {
        check_memory(crop)?;
    }
    let (found, reading) = look_at_masks(&masks, size, crop, warnings)?;
    let crop = crop.unwrap_or_else(|| crop_around(&found, size));
    check_memory(crop)?;

    let frame_files = |((colour, mask), found): ((Source, Source), &Mask)| Files {
        stamps: [stamp(&colour), stamp(&mask)],
        region: found.region,
        colour,
        mask,
    };
    let files: Vec<Files> = colours.into_iter().zip(masks).zip(&found).map(frame_files).collect();
    let held = crop.width() * crop.height() * PIXEL_BYTES <= held_bytes / frame_count.max(1);
    let read = in_order(&files, |files| {
        let mut read = read_frame(files, size, crop, &reading)?;
        if !held {
            read.frame = None;
        }
        Ok(read)
    })?;
    let notes = found.iter().zip(&read).enumerate();
    notes_as_warnings(notes.map(|(k, (mask, frame))| (first + k, &mask.notes, &frame.notes)), warnings);
    // Decide for the whole video, so that the background cannot flicker.
    let (sum, count) =
        read.iter().fold((0.0, 0), |(sum, count), f| (sum + f.background.0, count + f.background.1));
    let mean = sum / f64::from(count.max(1) as u32);
    let filmed_background = mean > 1.0 / 255.0;
    let finished = move |mut frame: Frame| {
        if filmed_background {
            composite_over_black(&mut frame);
        }
        frame
    };
    let video = match held {
        true => {
            parallel::consume(read.into_iter().filter_map(|f| f.frame).collect(), |_, frame| finished(frame))
                .into()
        }
        false => {
            let again = move |n: usize| Ok(finished(read_again(&files[n], size, crop, &reading)?));
            Video::streamed(frame_count, crop.width() * crop.height(), again)
        }
    };
    Ok((crop, video))
}

/// `f` of every item on all cores; the first error in the order of the items.
fn in_order<T: Sync, U: Send>(items: &[T], f: impl Fn(&T) -> Result<U> + Send + Sync) -> Result<Vec<U>> {
    parallel::try_map(items.len(), |k| f(&items[k]))
}

/// What is known of every mask, and how all of them are read.
fn look_at_masks(
    masks: &[Source],
    size: [usize; 2],
    crop: Option<Rect>,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Mask>, Reading)> {
    let looked = in_order(masks, |mask| {
        let mut file = mask.open()?;
        file.expect_size(size)?;
        let look = file.look();
        let mask = look_at_mask(mask, &mut file, crop, &Reading::luminance());
        Ok(Looked { look, mask })
    })?;
    let place = match masks.first() {
        Some(Source::File(path)) => path.parent().unwrap_or(path).display().to_string(),
        _ => "masks".to_owned(),
    };
    let reading = mask::understand(&place, looked.iter().map(|l| &l.look), None).map_err(of_scene)?;
    let hint = || Hint::from("look at the masks' outlines").with(Remedy::Check);
    warnings.extend(reading.notes.iter().map(|note| Warning::new("masks", note, hint())));
    let found = match reading.is_luminance() {
        true => looked.into_iter().map(|l| l.mask).collect::<Result<Vec<_>>>()?,
        false => in_order(masks, |mask| look_at_mask(mask, &mut mask.open()?, crop, &reading))?,
    };
    Ok((found, reading))
}

/// The error of masks that hold several objects, in words of a scene, in which nothing is chosen.
pub(super) fn of_scene(error: Error) -> Error {
    match error {
        Error::Input { place, problem, hint } if hint.remedies.contains(&Remedy::Object) => {
            let hint = Hint::from(
                "a scene has one fabric: leave its object in the masks, or import them again and choose it",
            );
            Error::Input { place, problem, hint: hint.with(Remedy::Object) }
        }
        other => other,
    }
}

fn look_at_mask(mask: &Source, file: &mut ImageFile, crop: Option<Rect>, reading: &Reading) -> Result<Mask> {
    let full = file.full();
    let image = file.mask_as(reading, crop.unwrap_or(full));
    let Some(found) = bounds(&image) else {
        let (part, brightest) = match crop {
            Some(_) => (" inside the crop", mask::brightest(&image)),
            None => ("", file.brightest(reading, &image)),
        };
        let hint = Hint::from("correct the mask (white = fabric), or leave such frames out");
        let hint = hint.with(Remedy::Frames(None));
        return Err(mask::empty(mask.place(), brightest, part, reading, hint));
    };
    let notes = std::mem::take(&mut file.notes);
    Ok(match crop {
        Some(region) => Mask { region, bounds: shifted(found, region), notes },
        // Keep a margin, so that soft edges below ½ survive.
        None => Mask { region: grown(found, [full.x1, full.y1]), bounds: found, notes },
    })
}

/// A frame, its image file's oddities, and sum and number of its background values.
struct Read {
    frame: Option<Frame>,
    notes: Vec<&'static str>,
    background: (f64, usize),
}

fn read_frame(files: &Files, size: [usize; 2], crop: Rect, reading: &Reading) -> Result<Read> {
    let file = files.colour.open()?;
    file.expect_size(size)?;
    let rgb = file.rgb(crop);
    let notes = file.notes;
    let mut file = files.mask.open()?;
    file.expect_size(size)?;
    let mask = file.mask_as(reading, files.region);
    let mask = if files.region == crop { mask } else { cut(&mask, files.region, crop) };
    let background = background(&rgb, &mask);
    Ok(Read { frame: Some(Frame { rgb, mask }), notes, background })
}

fn read_again(files: &Files, size: [usize; 2], crop: Rect, reading: &Reading) -> Result<Frame> {
    let read = read_frame(files, size, crop, reading)?;
    for (source, before) in [&files.colour, &files.mask].into_iter().zip(&files.stamps) {
        if stamp(source) != *before {
            return Err(Error::input(
                source.place().display().to_string(),
                "changed while it was in use",
                "leave the scene folder alone while it is worked on, and start again",
            ));
        }
    }
    Ok(read.frame.expect("read_frame reads one"))
}

/// Sum and number of the colour values farther than 2 px from any fabric.
fn background(rgb: &Image, mask: &Image) -> (f64, usize) {
    let near = grown_by_two(mask);
    let (mut sum, mut count) = (0.0, 0);
    for (colour, near) in rgb.data.chunks_exact(3).zip(near) {
        if !near {
            sum += f64::from(colour[0]) + f64::from(colour[1]) + f64::from(colour[2]);
            count += 3;
        }
    }
    (sum, count)
}

/// Where the 5×5 neighbourhood has any fabric, shape [height · width].
fn grown_by_two(mask: &Image) -> Vec<bool> {
    let (w, h) = (mask.width, mask.height);
    let mut along_rows = vec![false; w * h];
    for y in 0..h {
        // The last column up to which the fabric seen so far reaches.
        let (row, out) = (&mask.data[y * w..(y + 1) * w], &mut along_rows[y * w..(y + 1) * w]);
        let mut reach = 0;
        for x in 0..w + 2 {
            if x < w && row[x] > 0.0 {
                reach = x + 5;
            }
            // Pixel x − 2 is near fabric if there is some in columns x − 4 … x.
            if x >= 2 && reach > x {
                out[x - 2] = true;
            }
        }
    }
    let mut near = vec![false; w * h];
    for y in 0..h {
        for row in y.saturating_sub(2)..(y + 3).min(h) {
            let source = &along_rows[row * w..(row + 1) * w];
            near[y * w..(y + 1) * w].iter_mut().zip(source).for_each(|(n, s)| *n |= s);
        }
    }
    near
}

fn composite_over_black(frame: &mut Frame) {
    for (colour, coverage) in frame.rgb.data.chunks_exact_mut(3).zip(&frame.mask.data) {
        colour.iter_mut().for_each(|c| *c *= coverage);
    }
}

/// Smallest rectangle around the pixels of fabric, if there are any.
fn bounds(mask: &Image) -> Option<Rect> {
    let covered = |v: &f32| *v >= COVERED;
    let rows = mask.data.chunks_exact(mask.width).enumerate();
    Rect::around(rows.flat_map(|(y, row)| {
        [row.iter().position(covered), row.iter().rposition(covered)]
            .into_iter()
            .flatten()
            .map(move |x| (x, y))
    }))
}

fn shifted(r: Rect, by: Rect) -> Rect {
    Rect { x0: r.x0 + by.x0, y0: r.y0 + by.y0, x1: r.x1 + by.x0, y1: r.y1 + by.y0 }
}

/// `r`, 10 % wider on each side (4 px at least), within the image.
fn grown(r: Rect, [width, height]: [usize; 2]) -> Rect {
    let (dx, dy) = (r.width().div_ceil(10).max(4), r.height().div_ceil(10).max(4));
    Rect {
        x0: r.x0.saturating_sub(dx),
        y0: r.y0.saturating_sub(dy),
        x1: (r.x1 + dx).min(width),
        y1: (r.y1 + dy).min(height),
    }
}

/// The crop where scene.json names none: the masks' bounding boxes and 10 % on each side.
fn crop_around(masks: &[Mask], size: [usize; 2]) -> Rect {
    let all = masks.iter().map(|m| m.bounds).reduce(Rect::union);
    grown(all.unwrap_or(Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] }), size)
}

/// The part `to` of the image, of which `image` shows `from`; black outside that.
fn cut(image: &Image, from: Rect, to: Rect) -> Image {
    let mut out = Image::new(to.width(), to.height(), image.channels);
    let n = image.channels;
    let (x0, x1) = (from.x0.max(to.x0), from.x1.min(to.x1));
    if x0 >= x1 {
        return out;
    }
    for y in from.y0.max(to.y0)..from.y1.min(to.y1) {
        let source = ((y - from.y0) * image.width + x0 - from.x0) * n;
        let target = ((y - to.y0) * to.width() + x0 - to.x0) * n;
        let length = (x1 - x0) * n;
        out.data[target..target + length].copy_from_slice(&image.data[source..source + length]);
    }
    out
}

fn check_memory(crop: Rect) -> Result<()> {
    let bytes = crop.width() * crop.height() * PIXEL_BYTES;
    if bytes <= MAX_FRAME_BYTES {
        return Ok(());
    }
    Err(Error::input(
        "scene.json",
        format!(
            "a frame of {}×{} pixels takes {:.1} GiB of memory; at most {} GiB are used",
            crop.width(),
            crop.height(),
            bytes as f64 / f64::from(1 << 30),
            MAX_FRAME_BYTES >> 30
        ),
        Hint::from("make the crop smaller, or scale images and camera down").with(Remedy::Downscale),
    ))
}

/// One warning for each kind of note, with its count and first frame.
fn notes_as_warnings<'a>(
    notes: impl Iterator<Item = (usize, &'a Vec<&'static str>, &'a Vec<&'static str>)>,
    warnings: &mut Vec<Warning>,
) {
    let mut seen: BTreeMap<(&str, &str), (usize, usize)> = BTreeMap::new();
    for (frame, of_mask, of_colour) in notes {
        let masks = of_mask.iter().map(|n| ("masks", *n));
        for key in masks.chain(of_colour.iter().map(|n| ("frames", *n))) {
            seen.entry(key).or_insert((frame, 0)).1 += 1;
        }
    }
    for ((topic, note), (first, count)) in seen {
        let found = format!("{note} (in {count} files, first in frame {first})");
        warnings.push(Warning::new(
            topic,
            found,
            Hint::from("look at the masks' outlines").with(Remedy::Check),
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growing_by_two_is_a_five_by_five_square() {
        for (x, y) in [(0, 0), (5, 4), (9, 8), (1, 7)] {
            let mut mask = Image::new(10, 9, 1);
            mask.pixel_mut(x, y)[0] = 0.1;
            let near = grown_by_two(&mask);
            for (i, n) in near.iter().enumerate() {
                let expected = (i % 10).abs_diff(x) <= 2 && (i / 10).abs_diff(y) <= 2;
                assert_eq!(*n, expected, "pixel {i} for fabric at ({x}, {y})");
            }
        }
    }

    #[test]
    fn cut_moves_pixels_to_their_place() {
        let from = Rect { x0: 3, y0: 2, x1: 6, y1: 5 };
        let mut image = Image::new(3, 3, 1);
        image.pixel_mut(1, 2)[0] = 1.0;
        let out = cut(&image, from, Rect { x0: 1, y0: 3, x1: 9, y1: 10 });
        assert_eq!(out.pixel(3, 1), [1.0]);
        assert_eq!(out.data.iter().sum::<f32>(), 1.0);
    }
}
