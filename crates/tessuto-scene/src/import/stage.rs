//! From a decoded image to a file of the scene: undistorted, downscaled, compressed.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::empty::empty_place;
use super::lens::Undistortion;
use super::names::name;
use super::video::Raw;
use super::{Calibration, Masks, Settings};
use crate::io::{atomic_write, image};
use tessuto_core::camera::Camera;
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::image::region::Region;

/// What all images go through.
pub(super) struct Stage<'a> {
    pub settings: &'a Settings,
    folder: &'a Path,
    progress: &'a (dyn Fn(&str) + Sync),
    /// What was unusual about files of frames, and in which: frame and name.
    unusual: Mutex<BTreeMap<&'static str, BTreeMap<usize, String>>>,
}

/// What the colour frames have in common.
pub(super) struct Colours {
    /// Numbers of the written frames.
    pub frames: Range<usize>,
    /// Frames of the input, as far as it was read.
    pub read: usize,
    /// Pinhole camera of the frames before they are made smaller.
    pub camera: Camera,
    undistortion: Option<Undistortion>,
}

impl Colours {
    /// The camera and the straightening of frames of `size` `[px]`, whose pixels have `pixel_aspect`, width over
    /// height.
    pub fn new(
        settings: &Settings,
        size: [usize; 2],
        pixel_aspect: f64,
        count: usize,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let factor = settings.downscale;
        if size.iter().any(|n| n / factor < 2) {
            return Err(Error::usage(
                format!("downscale {factor} of frames of {}×{} pixels", size[0], size[1]),
                "leave 2 pixels or more in each direction",
            ));
        }
        if size.iter().any(|n| n % factor != 0) {
            notes.push(format!(
                "{}×{} pixels are no multiple of {factor}: the last columns or rows are left out",
                size[0], size[1]
            ));
        }
        let calibration = Calibration { pixel_aspect, ..settings.calibration.clone() };
        let camera = calibration.scaled_to(size, notes)?;
        let lens = &settings.calibration.distortion;
        let undistortion = if lens.is_none() {
            None
        } else {
            Some(Undistortion::new(&camera, lens, &settings.calibration.place)?)
        };
        if let Some(undistortion) = &undistortion {
            let lost = 100.0 * (1.0 - undistortion.seen);
            notes.push(format!(
                "lens distortion removed; {lost:.1} % of the straightened images lie outside \
                 the recorded ones and are black"
            ));
            if lens.fisheye.is_some() {
                let across = 2.0 * (camera.width as f64 / (2.0 * camera.fx)).atan().to_degrees();
                notes.push(format!(
                    "of the fisheye lens the middle {across:.0}° across are kept, at the same focal length"
                ));
            }
        }
        Ok(Self { frames: 0..count, read: count, camera, undistortion })
    }

    /// Width and height of the frames before they are made smaller `[px]`.
    pub fn size(&self) -> [usize; 2] {
        [self.camera.width, self.camera.height]
    }
}

impl<'a> Stage<'a> {
    /// Writes into `folder`.
    pub fn new(settings: &'a Settings, folder: &'a Path, progress: &'a (dyn Fn(&str) + Sync)) -> Self {
        Self { settings, folder, progress, unusual: Mutex::default() }
    }

    /// One note for each kind of what was unusual about files of frames.
    pub fn notes(&self) -> Vec<String> {
        let unusual = self.unusual.lock().expect("nobody panics with it");
        let note = |(note, files): (&&str, &BTreeMap<usize, String>)| {
            let first = files.values().next().map_or("", String::as_str);
            format!("frames: {note} (in {} files, first {first})", files.len())
        };
        unusual.iter().map(note).collect()
    }

    /// Writes frame `k` from an image file; copies the file where its pixels need no change.
    pub fn colour_file(&self, colours: &Colours, k: usize, path: &Path) -> Result<()> {
        let file = image::open(path)?;
        let full = file.full();
        expect_size([full.x1, full.y1], colours.size(), path)?;
        // Where transparency is the mask, it is not ignored.
        let heeded = |note: &&&str| self.settings.masks == Masks::Alpha && **note == image::ALPHA_IGNORED;
        for note in file.notes.iter().filter(|note| !heeded(note)) {
            let mut unusual = self.unusual.lock().expect("nobody panics with it");
            unusual.entry(note).or_default().insert(k, name(path));
        }
        if file.plain && colours.undistortion.is_none() && self.settings.downscale == 1 {
            let bytes = std::fs::read(path).map_err(|e| {
                Error::input(path.display().to_string(), format!("cannot be read: {e}"), "check the file")
            })?;
            // The content decides, as when it is read.
            let ending = if bytes.starts_with(&[0xFF, 0xD8]) { "jpg" } else { "png" };
            return self.put(&format!("rgbs/rgb_{k:03}.{ending}"), &bytes);
        }
        self.colour_pixels(colours, k, file.into_rgb8())
    }

    /// Writes frame `k` of a video.
    pub fn colour(&self, colours: &Colours, k: usize, frame: Raw) -> Result<()> {
        expect_size(frame.size, colours.size(), &self.settings.input)?;
        self.colour_pixels(colours, k, frame.rgb)
    }

    fn colour_pixels(&self, colours: &Colours, k: usize, rgb: Vec<u8>) -> Result<()> {
        let png = self.finish(colours, rgb, 3);
        self.put(&format!("rgbs/rgb_{k:03}.png"), &png)
    }

    /// Writes the image of the empty place, an image or a video at `path`.
    pub fn plate(&self, colours: &Colours, path: &Path) -> Result<()> {
        let place = empty_place(path, &self.settings.ffmpeg)?;
        expect_size([place.width, place.height], colours.size(), path)?;
        let bytes = place.data.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        let png = self.finish(colours, bytes, 3);
        self.put("plate.png", &png)
    }

    /// Writes mask `k` [0, 1] of frames of this size.
    pub fn mask(&self, colours: &Colours, k: usize, mask: &Image) -> Result<()> {
        let invert = self.settings.invert_masks;
        let mut mask = mask.clone();
        if invert {
            mask.data.iter_mut().for_each(|v| *v = 1.0 - *v);
        }
        if self.settings.largest_piece {
            keep_largest_piece(&mut mask);
        }
        let byte = |v: &f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let png = self.finish(colours, mask.data.iter().map(byte).collect(), 1);
        self.put(&format!("masks/mask_{k:03}.png"), &png)
    }

    fn finish(&self, colours: &Colours, mut pixels: Vec<u8>, channels: usize) -> Vec<u8> {
        if let Some(undistortion) = &colours.undistortion {
            pixels = undistortion.apply(&pixels, channels);
        }
        let (mut size, factor) = (colours.size(), self.settings.downscale);
        if factor > 1 {
            pixels = block_means(&pixels, size, channels, factor);
            size = size.map(|n| n / factor);
        }
        image::encode_png_bytes(&pixels, size, channels)
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path: PathBuf = self.folder.join(name);
        atomic_write(&path, bytes)?;
        (self.progress)(name);
        Ok(())
    }
}

fn expect_size(found: [usize; 2], expected: [usize; 2], path: &Path) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::input(
        path.display().to_string(),
        format!("is {}×{} pixels, but the first frame {}×{}", found[0], found[1], expected[0], expected[1]),
        "all frames must have one size: remove images that do not belong, or turn them alike",
    ))
}

/// Means of `factor`×`factor` blocks; incomplete blocks are dropped.
fn block_means(pixels: &[u8], [width, height]: [usize; 2], channels: usize, factor: usize) -> Vec<u8> {
    let (w, h, n) = (width / factor, height / factor, (factor * factor) as u32);
    let mut out = Vec::with_capacity(w * h * channels);
    let mut sums = vec![0u32; w * channels];
    for row in 0..h {
        sums.fill(0);
        for source in pixels.chunks_exact(width * channels).skip(row * factor).take(factor) {
            for (column, block) in source.chunks_exact(factor * channels).enumerate() {
                for (k, value) in block.iter().enumerate() {
                    sums[column * channels + k % channels] += u32::from(*value);
                }
            }
        }
        out.extend(sums.iter().map(|s| ((s + n / 2) / n) as u8));
    }
    out
}

/// Blackens all of a mask but its largest piece: pixels above 5 % that hang together along sides.
fn keep_largest_piece(mask: &mut Image) {
    let rect = Rect { x0: 0, y0: 0, x1: mask.width, y1: mask.height };
    let region = Region { rect, inside: mask.data.iter().map(|v| *v > 0.05).collect() };
    let mut pieces = region.pieces(true);
    pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    pieces.iter().skip(1).flatten().for_each(|i| mask.data[*i] = 0.0);
}
