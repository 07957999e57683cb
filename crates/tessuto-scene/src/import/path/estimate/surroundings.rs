//! What is around the fabric in a frame: its brightness in several sizes, and where nothing of the fabric is.

use std::path::{Path, PathBuf};

use crate::io::image;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;

/// Pixels around the fabric that are left out, too, as a part of the image's width.
const MARGIN: f64 = 0.01;
/// The shorter side of the smallest size is at least this long `[px]`.
const COARSEST: usize = 40;
const SIZES: usize = 6;
/// Noise of images is at least that of their rounding, and of what codecs leave out `[grey levels]`.
const LEAST_NOISE: f64 = 0.5;

/// Values of one channel.
#[derive(Clone)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub data: Vec<f32>,
}

/// One size of a frame.
pub(super) struct Level {
    /// Grey levels, 0 to 255, smoothed over about a pixel.
    pub grey: Plane,
    /// Pixels that show what is not the fabric.
    pub free: Vec<bool>,
}

/// A frame; every level has half the pixels, in both directions, of the one before.
pub(super) struct Surroundings {
    pub levels: Vec<Level>,
    /// Standard deviation of the noise of a pixel `[grey levels]`.
    pub noise: f64,
    /// Pixels around which a whole window is free.
    clear: Vec<bool>,
}

impl Plane {
    fn row(&self, x: usize, y: f64) -> f32 {
        let (y0, [a, b, c, d]) = spline(y);
        let at = |k: isize| {
            let y = (y0 + k).clamp(0, self.height as isize - 1) as usize;
            self.data[y * self.width + x]
        };
        a * at(-1) + b * at(0) + c * at(1) + d * at(2)
    }

    /// The value at a place `[px]`, between pixels cubic (E. Catmull, R. Rom, 1974), beyond the border that of it.
    pub fn sample(&self, x: f64, y: f64) -> f32 {
        let (x0, weights) = spline(x);
        let at = |k: usize| (x0 + k as isize - 1).clamp(0, self.width as isize - 1) as usize;
        (0..4).map(|k| weights[k] * self.row(at(k), y)).sum()
    }

    /// Whether the place is within the image, by `margin` `[px]` at least.
    pub fn holds(&self, x: f64, y: f64, margin: f64) -> bool {
        let within = |v: f64, n: usize| v >= margin && v <= n as f64 - 1.0 - margin;
        within(x, self.width) && within(y, self.height)
    }

    /// Slopes at a pixel that is not at the border.
    pub fn slope(&self, x: usize, y: usize) -> [f32; 2] {
        let i = y * self.width + x;
        let d = &self.data;
        [0.5 * (d[i + 1] - d[i - 1]), 0.5 * (d[i + self.width] - d[i - self.width])]
    }

    /// Smoothed by 1 4 6 4 1 in both directions.
    fn smoothed(&self) -> Self {
        let (w, h) = (self.width, self.height);
        let along = |data: &[f32], at: &dyn Fn(usize, isize) -> usize| -> Vec<f32> {
            let value = |i: usize| {
                let [a, b, c, d, e] = [-2, -1, 0, 1, 2].map(|k| data[at(i, k)]);
                (a + e + 4.0 * (b + d) + 6.0 * c) / 16.0
            };
            (0..w * h).map(value).collect()
        };
        let clamped = |v: usize, k: isize, n: usize| (v as isize + k).clamp(0, n as isize - 1) as usize;
        let rows = along(&self.data, &|i, k| i / w * w + clamped(i % w, k, w));
        Self { data: along(&rows, &|i, k| clamped(i / w, k, h) * w + i % w), ..*self }
    }
}

/// The pixel before a place, and the weights of the one before that and of the three after.
fn spline(v: f64) -> (isize, [f32; 4]) {
    let before = v.floor();
    let t = (v - before) as f32;
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ];
    (before as isize, weights)
}

impl Surroundings {
    /// Of frame `n` of the scene in `folder`. `radius` is that of a window `[px]`.
    ///
    /// # Errors
    /// Those of reading the frame and its mask.
    pub fn read(folder: &Path, n: usize, radius: usize) -> Result<Self> {
        let frame = image::read(&find(folder, &format!("rgbs/rgb_{n:03}"))?)?;
        let mask = image::read_grey(&find(folder, &format!("masks/mask_{n:03}"))?)?;
        Ok(Self::of(&frame, &mask, radius))
    }

    /// Of a frame, shape [height, width, 3], and its mask.
    pub fn of(frame: &Image, mask: &Image, radius: usize) -> Self {
        let (width, height) = (frame.width, frame.height);
        let value = |c: &[f32]| 255.0 * (c[0] + c[1] + c[2]) / 3.0;
        let raw = Plane { width, height, data: frame.data.chunks_exact(3).map(value).collect() };
        // Straightened frames are black where the lens shows nothing.
        let taken: Vec<bool> = raw.data.iter().zip(&mask.data).map(|(v, m)| *m > 0.0 || *v == 0.0).collect();
        let taken = widened(&taken, width, margin(width));
        let free: Vec<bool> = taken.iter().map(|t| !t).collect();
        let noise = noise(&raw, &free);
        let mut clear: Vec<bool> = widened(&taken, width, radius + 1).iter().map(|t| !t).collect();
        let border = radius + 3;
        for (i, c) in clear.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            *c &= x >= border && y >= border && x + border < width && y + border < height;
        }
        let mut levels = vec![Level { grey: raw.smoothed(), free }];
        while levels.len() < SIZES {
            let next = levels[levels.len() - 1].half();
            if next.grey.width.min(next.grey.height) < COARSEST {
                break;
            }
            levels.push(next);
        }
        Self { levels, noise, clear }
    }

    /// Whether a window around the place is whole and free.
    pub fn clear(&self, x: f64, y: f64) -> bool {
        let Plane { width, height, .. } = self.levels[0].grey;
        let inside = x >= 0.0 && y >= 0.0 && x < width as f64 - 0.5 && y < height as f64 - 0.5;
        inside && self.clear[(y + 0.5) as usize * width + (x + 0.5) as usize]
    }
}

impl Level {
    fn half(&self) -> Self {
        let full = &self.grey;
        let (width, height) = (full.width / 2, full.height / 2);
        let four = |k: usize| {
            let i = (k / width) * 2 * full.width + (k % width) * 2;
            [i, i + 1, i + full.width, i + full.width + 1]
        };
        let mean = |k: usize| 0.25 * four(k).iter().map(|i| full.data[*i]).sum::<f32>();
        let data = (0..width * height).map(mean).collect();
        let free = (0..width * height).map(|k| four(k).iter().all(|i| self.free[*i])).collect();
        Self { grey: Plane { width, height, data }.smoothed(), free }
    }
}

/// Pixels around the fabric that are left out, too, of an image of this width.
pub(super) fn margin(width: usize) -> usize {
    ((MARGIN * width as f64).ceil() as usize).max(2)
}

/// Pixels with one that is set within `reach` of them, along rows and columns.
pub(super) fn widened(set: &[bool], width: usize, reach: usize) -> Vec<bool> {
    let height = set.len() / width.max(1);
    let along = |set: &[bool], lines: usize, count: usize, at: &dyn Fn(usize, usize) -> usize| -> Vec<bool> {
        let mut out = vec![false; set.len()];
        let mut before = vec![0; count + 1];
        for line in 0..lines {
            (0..count).for_each(|k| before[k + 1] = before[k] + usize::from(set[at(line, k)]));
            for k in 0..count {
                out[at(line, k)] = before[(k + reach + 1).min(count)] > before[k.saturating_sub(reach)];
            }
        }
        out
    };
    let rows = along(set, height, width, &|line, k| line * width + k);
    along(&rows, width, height, &|line, k| k * width + line)
}

/// Standard deviation of a pixel's noise (J. Immerkær, "Fast noise variance estimation", 1996).
fn noise(grey: &Plane, free: &[bool]) -> f64 {
    let (w, d) = (grey.width, &grey.data);
    let (mut sum, mut count) = (0.0, 0);
    for y in 1..grey.height.saturating_sub(1) {
        for i in y * w + 1..y * w + w - 1 {
            if free[i] {
                let sides = d[i - 1] + d[i + 1] + d[i - w] + d[i + w];
                let corners = d[i - w - 1] + d[i - w + 1] + d[i + w - 1] + d[i + w + 1];
                sum += f64::from((corners - 2.0 * sides + 4.0 * d[i]).abs());
                count += 1;
            }
        }
    }
    let mean = if count > 0 { sum / f64::from(count) } else { 0.0 };
    (mean / 6.0 * std::f64::consts::FRAC_PI_2.sqrt()).max(LEAST_NOISE)
}

/// The image file of this name, whatever its ending.
pub(super) fn find(folder: &Path, name: &str) -> Result<PathBuf> {
    let found = ["png", "jpg", "jpeg"].map(|ending| folder.join(format!("{name}.{ending}")));
    let missing = || Error::input(folder.join(name).display().to_string(), "is missing", "import it again");
    found.into_iter().find(|path| path.is_file()).ok_or_else(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_reaches_along_both_sides() {
        let mut set = vec![false; 40 * 30];
        set[15 * 40 + 20] = true;
        let wide = widened(&set, 40, 2);
        let found: Vec<usize> = (0..set.len()).filter(|k| wide[*k]).collect();
        assert_eq!(found.len(), 25);
        assert!(found.iter().all(|k| (k % 40).abs_diff(20) <= 2 && (k / 40).abs_diff(15) <= 2));
    }

    #[test]
    fn values_between_pixels_follow_a_parabola_and_pixels_are_kept() {
        let f = |x: f64, y: f64| 0.3 * x * x - 0.1 * x * y + 2.0 * y;
        let data = (0..20 * 20).map(|k| f((k % 20) as f64, (k / 20) as f64) as f32).collect();
        let plane = Plane { width: 20, height: 20, data };
        for (x, y) in [(5.0, 7.0), (5.25, 9.5), (11.9, 3.1)] {
            assert!((f64::from(plane.sample(x, y)) - f(x, y)).abs() < 1e-4);
        }
    }
}
