//! Lens distortion after Brown and Conrady, or of fisheye lenses after Kannala and Brandt, and its removal from images.

use glam::DVec2;
use rayon::prelude::*;

use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

/// Distortion of Brown and Conrady, as OpenCV has it: a point (x, y) of the plane z = 1 is seen at
///
/// x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²),
/// y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y, with r² = x² + y².
///
/// A fisheye lens shows it in the same direction from the middle, at the radius
///
/// θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), with θ = arctan r, the angle from the optical axis.
///
/// Sources: OpenCV, *Camera Calibration and 3D Reconstruction* and *Fisheye camera model*; J. Kannala and S.
/// Brandt, *A generic camera model and calibration method for conventional, wide-angle, and fish-eye
/// lenses*, 2006.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Distortion {
    /// Radial, r².
    pub k1: f64,
    /// Radial, r⁴.
    pub k2: f64,
    /// Radial, r⁶.
    pub k3: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// k1 to k4 of a fisheye lens, of which nothing else counts.
    pub fisheye: Option<[f64; 4]>,
}

impl Distortion {
    /// From the order of OpenCV, k1 k2 p1 p2 k3, of which the last may be missing.
    pub fn from_opencv(k: &[f64]) -> Self {
        let at = |i: usize| k.get(i).copied().unwrap_or(0.0);
        Self { k1: at(0), k2: at(1), p1: at(2), p2: at(3), k3: at(4), fisheye: None }
    }

    /// Of a fisheye lens: k1 k2 k3 k4.
    pub fn of_fisheye(k: [f64; 4]) -> Self {
        Self { fisheye: Some(k), ..Self::default() }
    }

    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Where the lens shows the point `p` of the plane z = 1.
    pub fn apply(&self, p: DVec2) -> DVec2 {
        let r2 = p.length_squared();
        if let Some([k1, k2, k3, k4]) = self.fisheye {
            let r = r2.sqrt();
            let t = r.atan();
            let t2 = t * t;
            let seen = t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
            // In the middle θ / r is 1.
            return if r > 0.0 { p * (seen / r) } else { p };
        }
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let xy = 2.0 * p.x * p.y;
        p * radial
            + DVec2::new(
                self.p1 * xy + self.p2 * (r2 + 2.0 * p.x * p.x),
                self.p1 * (r2 + 2.0 * p.y * p.y) + self.p2 * xy,
            )
    }

    /// Square of the radius up to which the lens shows points farther out farther out; beyond it the formula
    /// folds back and means nothing.
    fn valid_r2(&self) -> f64 {
        if let Some([k1, k2, k3, k4]) = self.fisheye {
            let slope = |t2: f64| 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
            // Up to a right angle, beyond which no pinhole camera sees.
            let angles = (0..1570).map(|k| f64::from(k) * 0.001);
            let angle = angles.into_iter().find(|t| slope(t * t) <= 0.0);
            return angle.map_or(f64::INFINITY, |t| t.tan().powi(2));
        }
        // Derivative of r (1 + k1 r² + k2 r⁴ + k3 r⁶); 8 is a field of view of 166°.
        let slope = |r2: f64| 1.0 + r2 * (3.0 * self.k1 + r2 * (5.0 * self.k2 + r2 * 7.0 * self.k3));
        let radius = (0..=4000).map(|k| f64::from(k) * 0.002).find(|r| slope(r * r) <= 0.0);
        radius.map_or(f64::INFINITY, |r| r * r)
    }
}

/// How to make the images of a pinhole camera from those of a lens with the same focal length and centre.
pub(super) struct Undistortion {
    size: [usize; 2],
    /// Column and row in the lens's image of every pixel; NaN where it shows nothing. Shape [height · width].
    sources: Vec<[f32; 2]>,
    /// Fraction of the pinhole camera's pixels that the lens shows, in [0, 1].
    pub seen: f64,
}

impl Undistortion {
    /// The table of `camera` with `distortion`.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if most of the image would be lost, which no real lens does.
    pub fn new(camera: &Camera, distortion: &Distortion, place: &str) -> Result<Self> {
        let (w, h) = (camera.width, camera.height);
        let limit = distortion.valid_r2();
        let mut sources = vec![[f32::NAN; 2]; w * h];
        sources.par_chunks_mut(w).enumerate().for_each(|(row, out)| {
            for (column, out) in out.iter_mut().enumerate() {
                let p = camera.ray(DVec2::new(column as f64, row as f64)).truncate();
                if p.length_squared() < limit {
                    let q = distortion.apply(p);
                    let at = [camera.fx * q.x + camera.cx, camera.fy * q.y + camera.cy];
                    let inside = |v: f64, n: usize| v > -0.5 && v < n as f64 - 0.5;
                    if inside(at[0], w) && inside(at[1], h) {
                        *out = at.map(|v| v as f32);
                    }
                }
            }
        });
        let seen = sources.iter().filter(|s| !s[0].is_nan()).count() as f64 / (w * h) as f64;
        if seen < 0.5 {
            return Err(Error::input(
                place,
                format!("its lens distortion ({distortion:?}) leaves {:.0} % of the image", 100.0 * seen),
                "check the coefficients and their order: k1 k2 p1 p2 k3, of a fisheye lens k1 k2 k3 k4",
            ));
        }
        Ok(Self { size: [w, h], sources, seen })
    }

    /// The pinhole camera's image: bilinear, black where the lens shows nothing. Shapes [height, width, channels].
    pub fn apply(&self, pixels: &[u8], channels: usize) -> Vec<u8> {
        let [w, h] = self.size;
        let mut out = vec![0u8; pixels.len()];
        for (out, source) in out.chunks_exact_mut(channels).zip(&self.sources) {
            if source[0].is_nan() {
                continue;
            }
            // Half a pixel beyond the outermost centres repeats them.
            let (x, y) = (source[0].clamp(0.0, (w - 1) as f32), source[1].clamp(0.0, (h - 1) as f32));
            let (x0, y0) = ((x as usize).min(w.saturating_sub(2)), (y as usize).min(h.saturating_sub(2)));
            let (s, t) = (x - x0 as f32, y - y0 as f32);
            let (a, b) = ((y0 * w + x0) * channels, ((y0 + 1).min(h - 1) * w + x0) * channels);
            for (c, out) in out.iter_mut().enumerate() {
                let at = |k: usize| f32::from(pixels[k + c]);
                let upper = at(a) + s * (at(a + channels) - at(a));
                let lower = at(b) + s * (at(b + channels) - at(b));
                *out = (upper + t * (lower - upper) + 0.5) as u8;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 60.0, fy: 62.0, cx: 39.0, cy: 31.0, width: 80, height: 60 };

    #[test]
    fn a_distorted_picture_is_straightened() {
        let lens = Distortion { k1: -0.2, k2: 0.05, k3: -0.01, p1: 0.01, p2: -0.005, fisheye: None };
        // What is seen through the lens: invert the formula by fixed points.
        straightens(&lens, |seen| {
            let mut p = seen;
            for _ in 0..100 {
                p += seen - lens.apply(p);
            }
            assert!((lens.apply(p) - seen).length() < 1e-9);
            p
        });
    }

    #[test]
    fn a_fisheye_picture_is_straightened() {
        let k = [0.02, -0.01, 0.004, -0.001];
        // The formula as it is written, inverted by halving: the angle that is seen at this radius.
        straightens(&Distortion::of_fisheye(k), |seen| {
            let radius =
                |t: f64| t + k[0] * t.powi(3) + k[1] * t.powi(5) + k[2] * t.powi(7) + k[3] * t.powi(9);
            let (mut low, mut high) = (0.0, 1.5);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if radius(middle) < seen.length() { low = middle } else { high = middle }
            }
            if seen.length() > 0.0 { seen / seen.length() * low.tan() } else { seen }
        });
    }

    /// Films a smooth pattern on the plane z = 1 through `lens` and straightens it; `source` is the point of the
    /// plane that is seen at one of the image.
    fn straightens(lens: &Distortion, source: impl Fn(DVec2) -> DVec2) {
        let pattern =
            |p: DVec2| (128.0 + 60.0 * (4.0 * p.x).sin() + 50.0 * (5.0 * p.y + p.x).cos()).round() as u8;
        let mut filmed = vec![0u8; 80 * 60];
        let mut pinhole = vec![0u8; 80 * 60];
        for row in 0..60 {
            for column in 0..80 {
                let seen = CAMERA.ray(DVec2::new(column as f64, row as f64)).truncate();
                filmed[row * 80 + column] = pattern(source(seen));
                pinhole[row * 80 + column] = pattern(seen);
            }
        }
        let table = Undistortion::new(&CAMERA, lens, "test").unwrap();
        let straight = table.apply(&filmed, 1);
        let difference = |a: &[u8]| {
            let all = a.iter().zip(&pinhole).zip(&table.sources).filter(|(_, s)| !s[0].is_nan());
            all.map(|((a, b), _)| a.abs_diff(*b)).max().unwrap()
        };
        assert!(difference(&filmed) > 20, "the pattern must show the distortion");
        assert!(difference(&straight) <= 3, "{}", difference(&straight));
        assert!(table.seen > 0.8 && table.seen <= 1.0);
    }

    #[test]
    fn beyond_the_fold_nothing_is_seen() {
        // r (1 − r²/3) grows up to r = 1 only.
        let lens = Distortion { k1: -1.0 / 3.0, ..Default::default() };
        assert!((lens.valid_r2() - 1.0).abs() < 0.01);
        // θ (1 − θ²/3) grows up to θ = 1 only.
        let lens = Distortion::of_fisheye([-1.0 / 3.0, 0.0, 0.0, 0.0]);
        assert!((lens.valid_r2().sqrt().atan() - 1.0).abs() < 0.01);
        let wild = Distortion { k1: -30.0, ..Default::default() };
        assert!(Undistortion::new(&CAMERA, &wild, "lens.yml").is_err());
    }
}
