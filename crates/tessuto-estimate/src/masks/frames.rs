//! The frames as the masks are found on them: shrunk where the fabric is large, in colours whose noise is even.

use std::path::Path;

use tessuto_core::parallel;

use super::region::Region;
use crate::io::image;
use crate::io::scene::ColourFiles;
use tessuto_core::error::{Error, Result};

/// Frames are shrunk until the fabric is about this large `[px]`, the square root of its area: outlines are found to a
/// fraction of a pixel, and work grows with the square.
const FABRIC: f64 = 900.0;
/// Most memory for the frames of a clip `[bytes]`.
const MAX_BYTES: usize = 2 << 30;

/// All frames of a clip.
pub(super) struct Frames {
    /// Width and height `[px]`.
    pub size: [usize; 2],
    /// Pixels of the recording, in each direction, that became one.
    pub factor: usize,
    pub images: Vec<Colours>,
}

/// One frame, shape [height, width, 3]: 16 √v of sRGB bytes v. Dark colours, in which fabric and surroundings differ by
/// little, are spread, and the noise of sensors is nearly the same in all.
pub(super) struct Colours {
    pub width: usize,
    pub data: Vec<u8>,
}

impl Colours {
    pub fn at(&self, x: usize, y: usize) -> [f32; 3] {
        let i = 3 * (y * self.width + x);
        [f32::from(self.data[i]), f32::from(self.data[i + 1]), f32::from(self.data[i + 2])]
    }

    /// The colour between pixels, clamped to the image.
    pub fn sample(&self, x: f32, y: f32) -> [f32; 3] {
        let (w, h) = (self.width, self.data.len() / 3 / self.width);
        let (x, y) = (x.clamp(0.0, (w - 1) as f32), y.clamp(0.0, (h - 1) as f32));
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
        let (s, t) = (x - x0 as f32, y - y0 as f32);
        let corners = [self.at(x0, y0), self.at(x1, y0), self.at(x0, y1), self.at(x1, y1)];
        std::array::from_fn(|c| {
            let (a, b) = (
                corners[0][c] + s * (corners[1][c] - corners[0][c]),
                corners[2][c] + s * (corners[3][c] - corners[2][c]),
            );
            a + t * (b - a)
        })
    }
}

impl Frames {
    /// Reads the frames; the fabric covers about `area` pixels of each.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file.
    pub fn read(files: &ColourFiles, area: f64) -> Result<Self> {
        let size = [files.camera.width, files.camera.height];
        let count = files.paths.len();
        let bytes = |factor: usize| 3 * count * (size[0] / factor) * (size[1] / factor);
        let mut factor = (area.sqrt() / FABRIC).ceil().max(1.0) as usize;
        while bytes(factor) > MAX_BYTES {
            factor += 1;
        }
        let images = parallel::try_map(count, |k| read_one(&files.paths[k], size, factor))?;
        Ok(Self { size: size.map(|n| n / factor), factor, images })
    }

    /// A place of the recording (column, row) `[px]` on these frames.
    pub fn place(&self, at: [f64; 2]) -> [f32; 2] {
        at.map(|v| ((v + 0.5) / self.factor as f64 - 0.5) as f32)
    }
}

/// One image of the recording as frames are kept.
pub(super) fn read_one(path: &Path, size: [usize; 2], factor: usize) -> Result<Colours> {
    let read = image::read_bytes(path)?;
    if [read.width, read.height] != size {
        return Err(Error::input(
            path.display().to_string(),
            format!("is {}×{} pixels, but the frames {}×{}", read.width, read.height, size[0], size[1]),
            "give an image of the same camera and size",
        ));
    }
    Ok(companded(&read.data, size, factor))
}

/// RGB bytes as frames are kept.
pub(super) fn companded(rgb: &[u8], [width, height]: [usize; 2], factor: usize) -> Colours {
    let table: Vec<u8> =
        (0..256 * 16).map(|v| (16.0 * (v as f32 / 16.0).sqrt()).round().min(255.0) as u8).collect();
    let (w, h) = (width / factor, height / factor);
    let n = (factor * factor) as u32;
    let mut data = Vec::with_capacity(3 * w * h);
    for y in 0..h {
        for x in 0..w {
            for c in 0..3 {
                let mut sum = 0_u32;
                for row in y * factor..(y + 1) * factor {
                    for column in x * factor..(x + 1) * factor {
                        sum += u32::from(rgb[3 * (row * width + column) + c]);
                    }
                }
                data.push(table[(16 * sum / n).min(4095) as usize]);
            }
        }
    }
    Colours { width: w, data }
}

/// The coverage of a region found on shrunk frames, in the size of the recording: [height · width].
pub(super) fn enlarged(
    coverage: &super::region::Field,
    factor: usize,
    [width, height]: [usize; 2],
) -> Vec<f32> {
    let mut out = vec![0.0; width * height];
    let bounds = coverage.rect;
    let scale = factor as f32;
    for y in (bounds.y0 * factor)..((bounds.y1 * factor).min(height)) {
        for x in (bounds.x0 * factor)..((bounds.x1 * factor).min(width)) {
            let at = |k: usize| (k as f32 + 0.5) / scale - 0.5;
            out[y * width + x] = coverage.sample(at(x), at(y));
        }
    }
    out
}

/// Squared difference of two colours.
pub(super) fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum()
}

/// Median absolute difference between adjacent frames outside of a region, as a standard deviation of a channel: noise,
/// compression and what moves.
pub(super) fn noise(frames: &Frames, away_from: &Region) -> f32 {
    let [w, h] = frames.size;
    let mut counts = [0_u64; 256];
    for pair in frames.images.windows(2) {
        for y in (0..h).step_by(7) {
            for x in (0..w).step_by(5).filter(|x| !away_from.at(*x, y)) {
                let i = 3 * (y * w + x) + 1;
                counts[usize::from(pair[0].data[i].abs_diff(pair[1].data[i]))] += 1;
            }
        }
    }
    let half = counts.iter().sum::<u64>() / 2;
    let mut below = 0;
    let median = counts.iter().position(|n| {
        below += n;
        below > half
    });
    // Of whole numbers: half a step up. A difference of two has √2 of the deviation of one.
    (median.unwrap_or(0) as f32 + 0.5) * 1.483 / std::f32::consts::SQRT_2
}
