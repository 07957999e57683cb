//! What a rendering returns, and what its adjoint needs to know.

use super::bins::Bins;
use super::blend::Blend;
use super::projected::{Projected, Rays};
use tessuto_core::camera::Rect;
use tessuto_core::image::Image;

/// Image of a mesh over black, [`render`](super::Rasterizer::render)'s result. Its memory is used
/// again by the next rendering into it.
#[derive(Debug, Clone, Default)]
pub struct Rendering {
    /// Width `[px]`.
    pub width: usize,
    /// Height `[px]`.
    pub height: usize,
    /// Triangle seen at each pixel centre, [`Rendering::NO_TRIANGLE`] where there is none, shape
    /// [height, width].
    pub triangle: Vec<u32>,
    /// 1/z [1/m] at each pixel centre, 0 where there is no triangle, shape [height, width].
    pub inverse_depth: Vec<f64>,
    /// Red, green, blue and coverage after antialiasing, over black with coverage 0, shape [height,
    /// width].
    pub rgba: Vec<[f32; 4]>,
    pub(super) rays: Rays,
    pub(super) projected: Vec<Projected>,
    /// Triangle across each edge where the surface goes on, without folding over as the camera sees
    /// it; else `NO_TRIANGLE`. Shape [T, 3].
    pub(super) joined: Vec<[u32; 3]>,
    pub(super) bins: Bins,
    /// Silhouette blends found in each band of rows.
    pub(super) blends: Vec<Vec<Blend>>,
    /// Size of the texture that the planes in `projected` belong to `[texel]`.
    pub(super) texture_size: [usize; 2],
    /// Everything outside is background, [x0, x1) × [y0, y1) `[px]`.
    pub(super) drawn: Option<Rect>,
}

impl Rendering {
    /// Where no triangle is seen.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// An empty rendering; the first use gives it its size.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether pixel number `pixel` shows the other side of a [two-sided](super::Rasterizer::two_sided) fabric.
    pub fn shows_back(&self, pixel: usize) -> bool {
        let t = self.triangle[pixel];
        t != Self::NO_TRIANGLE && self.projected[t as usize].plain
    }

    /// Depth z `[m]` at the centre of pixel (column `x`, row `y`), `None` where no triangle is seen.
    pub fn depth(&self, x: usize, y: usize) -> Option<f64> {
        let inverse = self.inverse_depth[y * self.width + x];
        (inverse > 0.0).then(|| 1.0 / inverse)
    }

    /// Depth z `[m]` of every pixel, 0 where no triangle is seen, shape [height, width, 1].
    pub fn depth_image(&self) -> Image {
        let depth = |&inverse: &f64| if inverse > 0.0 { (1.0 / inverse) as f32 } else { 0.0 };
        let data = self.inverse_depth.iter().map(depth).collect();
        Image { width: self.width, height: self.height, channels: 1, data }
    }

    /// The pixel itself if a triangle covers its centre, or else a neighbour whose centre is covered: the edge
    /// pixels that antialiasing gave coverage have no triangle of their own.
    pub fn covered_near(&self, x: usize, y: usize) -> Option<(usize, usize)> {
        let candidates = [(x, y), (x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        candidates.into_iter().find(|&(x, y)| {
            let inside = x < self.width && y < self.height;
            inside && self.triangle[y * self.width + x] != Self::NO_TRIANGLE
        })
    }

    /// Number of pixels that the antialiasing changed, counted once for each neighbour blended in.
    pub fn blend_count(&self) -> usize {
        self.blends.iter().map(Vec::len).sum()
    }

    /// Gives the buffers the size of the image; a new size starts from background everywhere.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.triangle.clear();
        self.triangle.resize(width * height, Self::NO_TRIANGLE);
        self.inverse_depth.clear();
        self.inverse_depth.resize(width * height, 0.0);
        self.rgba.clear();
        self.rgba.resize(width * height, [0.0; 4]);
        self.drawn = None;
    }
}
