//! Pinhole camera in the OpenCV frame: x right, y down, z forward, metres; the camera is the origin. Where it
//! stands in the world says a [`Viewpoint`].

mod around;
mod viewpoint;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

pub use viewpoint::{Pose, Viewpoint};

/// Pinhole intrinsics `[px]`. The centre of pixel (column i, row j) is at (i, j).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Focal length along x `[px]`.
    pub fx: f64,
    /// Focal length along y `[px]`.
    pub fy: f64,
    /// Principal point, column `[px]`.
    pub cx: f64,
    /// Principal point, row `[px]`.
    pub cy: f64,
    /// Image width `[px]`.
    pub width: usize,
    /// Image height `[px]`.
    pub height: usize,
}

/// Pixel rectangle, `x0 <= column < x1`, `y0 <= row < y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rect {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// One past the last column.
    pub x1: usize,
    /// One past the last row.
    pub y1: usize,
}

impl Rect {
    /// The smallest rectangle that contains both.
    pub fn union(self, other: Self) -> Self {
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }

    /// Wider by `margin` on each side, within an image of this width and height.
    pub fn padded(self, margin: usize, [width, height]: [usize; 2]) -> Self {
        Self {
            x0: self.x0.saturating_sub(margin),
            y0: self.y0.saturating_sub(margin),
            x1: (self.x1 + margin).min(width),
            y1: (self.y1 + margin).min(height),
        }
    }

    /// The smallest rectangle that contains the pixels (column, row); `None` if there are none.
    pub fn around(pixels: impl IntoIterator<Item = (usize, usize)>) -> Option<Self> {
        pixels.into_iter().map(|(x, y)| Self { x0: x, y0: y, x1: x + 1, y1: y + 1 }).reduce(Self::union)
    }

    /// Width `[px]`.
    #[inline]
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// Height `[px]`.
    #[inline]
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }
}

impl Camera {
    /// Pixel position of a point `p` `[m]` in front of the camera: u = fx·x/z + cx, v = fy·y/z + cy.
    #[inline]
    pub fn project(&self, p: DVec3) -> DVec2 {
        DVec2::new(self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy)
    }

    /// Derivatives of u and v of [`project`](Self::project) by the point `p` [px/m].
    #[inline]
    pub fn projection_rows(&self, p: DVec3) -> [DVec3; 2] {
        let (a, b) = (self.fx / p.z, self.fy / p.z);
        [DVec3::new(a, 0.0, -a * p.x / p.z), DVec3::new(0.0, b, -b * p.y / p.z)]
    }

    /// Direction, with z = 1, of the ray through pixel position `p_pixel`.
    #[inline]
    pub fn ray(&self, p_pixel: DVec2) -> DVec3 {
        DVec3::new((p_pixel.x - self.cx) / self.fx, (p_pixel.y - self.cy) / self.fy, 1.0)
    }

    /// The camera of the sub-image `crop`.
    pub fn cropped(&self, crop: Rect) -> Self {
        Self {
            cx: self.cx - crop.x0 as f64,
            cy: self.cy - crop.y0 as f64,
            width: crop.width(),
            height: crop.height(),
            ..*self
        }
    }

    /// The camera of the same image at another size `[px]`.
    pub fn resized(&self, [width, height]: [u32; 2]) -> Self {
        let (sx, sy) = (f64::from(width) / self.width as f64, f64::from(height) / self.height as f64);
        // Pixel centres are at whole numbers, so it is the pixels' corners that scale.
        Self {
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: (self.cx + 0.5) * sx - 0.5,
            cy: (self.cy + 0.5) * sy - 0.5,
            width: width as usize,
            height: height as usize,
        }
    }

    /// The camera of the image whose pixels are the means of `factor`×`factor` blocks
    /// (incomplete blocks at the right and lower border are dropped).
    pub fn downsampled(&self, factor: usize) -> Self {
        let s = factor as f64;
        // Block k covers the pixel centres s·k … s·k + s − 1, so its centre is at s·k + (s − 1)/2.
        Self {
            fx: self.fx / s,
            fy: self.fy / s,
            cx: (self.cx - (s - 1.0) / 2.0) / s,
            cy: (self.cy - (s - 1.0) / 2.0) / s,
            width: self.width / factor,
            height: self.height / factor,
        }
    }

    /// The camera of the image that has `factor`×`factor` pixels in place of each.
    pub fn magnified(&self, factor: usize) -> Self {
        let s = factor as f64;
        Self {
            fx: self.fx * s,
            fy: self.fy * s,
            cx: self.cx * s + (s - 1.0) / 2.0,
            cy: self.cy * s + (s - 1.0) / 2.0,
            width: self.width * factor,
            height: self.height * factor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 800.0, fy: 700.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

    #[test]
    fn a_rectangle_around_pixels_holds_them_and_no_more() {
        let found = Rect::around([(3, 7), (5, 2), (4, 4)]);
        assert_eq!(found, Some(Rect { x0: 3, y0: 2, x1: 6, y1: 8 }));
        assert_eq!(Rect::around([]), None);
    }

    #[test]
    fn ray_is_the_inverse_of_project() {
        let p = DVec3::new(0.2, -0.1, 1.5);
        let r = CAMERA.ray(CAMERA.project(p)) * p.z;
        assert!((r - p).length() < 1e-14);
    }

    #[test]
    fn downsampled_pixel_centres_are_block_centres() {
        let p = DVec3::new(0.2, -0.1, 1.5);
        let (full, half) = (CAMERA.project(p), CAMERA.downsampled(4).project(p));
        assert!((full - (half * 4.0 + DVec2::splat(1.5))).length() < 1e-12);
        let back = CAMERA.magnified(4).downsampled(4);
        assert!((back.project(p) - full).length() < 1e-12 && back.width == CAMERA.width);
    }
}
