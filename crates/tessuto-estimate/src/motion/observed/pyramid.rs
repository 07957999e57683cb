//! Image pyramid of a frame, cleaned of what lies behind the fabric.

use glam::DVec2;

use tessuto_core::camera::{Rect, Viewpoint};
use tessuto_core::video::{COVERED, Frame};

/// One level: colours averaged over the fabric only, so that the background never bleeds in.
#[derive(Debug, Clone)]
pub struct Level {
    /// How the frame is seen, in pixels of this level.
    pub view: Viewpoint,
    /// The rectangle around the fabric.
    rect: Rect,
    /// sRGB colour and fraction of fabric within that, shape [height, width, 4].
    texels: Vec<[f32; 4]>,
}

/// Colour at a point of a level with its slope.
#[derive(Debug, Clone, Copy)]
pub struct Colour {
    /// sRGB.
    pub value: [f32; 3],
    /// Per pixel of this level, to the right.
    pub du: [f32; 3],
    /// Per pixel of this level, downwards.
    pub dv: [f32; 3],
}

impl Level {
    /// The rectangle around the fabric.
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// Colour of a pixel; `None` off the fabric.
    pub fn texel(&self, x: usize, y: usize) -> Option<[f32; 3]> {
        let Rect { x0, y0, x1, y1 } = self.rect;
        let inside = x >= x0 && y >= y0 && x < x1 && y < y1;
        let [r, g, b, coverage] = self.texels[inside.then(|| (y - y0) * (x1 - x0) + x - x0)?];
        (coverage >= COVERED).then_some([r, g, b])
    }

    /// Bilinear colour at pixel position `p` with its slope; `None` off the image or off the fabric.
    pub fn sample(&self, p: DVec2) -> Option<Colour> {
        let (cell, [s, t]) = self.cell(p)?;
        let [top, bottom] = [cell.horizontal(0), cell.horizontal(1)];
        let dv = cell.vertical(s);
        let du = std::array::from_fn(|c| top[c] + t * (bottom[c] - top[c]));
        Some(Colour { value: cell.value(s, t, &dv), du, dv: first_three(dv) })
    }

    /// The same without the slope.
    pub fn colour(&self, p: DVec2) -> Option<[f32; 3]> {
        let (cell, [s, t]) = self.cell(p)?;
        Some(cell.value(s, t, &cell.vertical(s)))
    }

    /// The four texels around `p` and where between them it lies; `None` off the image or where one of them is off
    /// the fabric.
    #[inline]
    fn cell(&self, p: DVec2) -> Option<(Cell<'_>, [f32; 2])> {
        let Rect { x0, y0, x1, y1 } = self.rect;
        // Around it there is no fabric.
        let inside = p.x >= x0 as f64 && p.y >= y0 as f64 && p.x < x1 as f64 - 1.0 && p.y < y1 as f64 - 1.0;
        if !inside {
            return None;
        }
        let (x, y) = (p.x as usize, p.y as usize);
        let (s, t) = ((p.x - x as f64) as f32, (p.y - y as f64) as f32);
        let rows = [y, y + 1].map(|y| self.texels[(y - y0) * (x1 - x0) + x - x0..].first_chunk::<2>());
        let [Some(upper), Some(lower)] = rows else { return None };
        let covered = upper[0][3].min(upper[1][3]).min(lower[0][3]).min(lower[1][3]) >= COVERED;
        covered.then_some((Cell([upper, lower]), [s, t]))
    }
}

/// Four texels, by row. All four of their numbers are computed with, side by side in a register, though the last
/// is no colour.
struct Cell<'a>([&'a [[f32; 4]; 2]; 2]);

impl Cell<'_> {
    /// What a row gains from left to right.
    #[inline]
    fn horizontal(&self, row: usize) -> [f32; 4] {
        let [left, right] = self.0[row];
        std::array::from_fn(|c| right[c] - left[c])
    }

    /// Slope downwards at `s` between left and right.
    #[inline]
    fn vertical(&self, s: f32) -> [f32; 4] {
        let [upper, lower] = self.0;
        std::array::from_fn(|c| {
            let left = lower[0][c] - upper[0][c];
            left + s * (lower[1][c] - upper[1][c] - left)
        })
    }

    /// The colour at `s`, `t`, with the slope downwards at `s`.
    #[inline]
    fn value(&self, s: f32, t: f32, dv: &[f32; 4]) -> [f32; 3] {
        let (first, top) = (self.0[0][0], self.horizontal(0));
        first_three(std::array::from_fn(|c| first[c] + s * top[c] + t * dv[c]))
    }
}

fn first_three([a, b, c, _]: [f32; 4]) -> [f32; 3] {
    [a, b, c]
}

/// Levels 0 to `coarsest` of `frame` as `view` sees it, each half the size of the one before; level 0 has the
/// frame's size. Those finer than `finest` have no colours, which would take most of the memory.
pub fn pyramid(frame: &Frame, view: &Viewpoint, [finest, coarsest]: [usize; 2]) -> Vec<Level> {
    let mut camera = view.camera;
    let mut weighted: Vec<[f32; 4]> = frame
        .rgb
        .data
        .chunks_exact(3)
        .zip(&frame.mask.data)
        .map(|(c, &m)| [c[0] * m, c[1] * m, c[2] * m, m])
        .collect();
    let mut levels = Vec::with_capacity(coarsest + 1);
    for level in 0..=coarsest {
        if level > 0 {
            weighted = halved(&weighted, camera.width, camera.height);
            camera = camera.downsampled(2);
        }
        weighted = blurred(&weighted, camera.width, camera.height);
        let normalised = |t: &[f32; 4]| {
            let s = 1.0 / t[3].max(1e-6);
            [t[0] * s, t[1] * s, t[2] * s, t[3]]
        };
        let rect = if level < finest { Rect::default() } else { covered(&weighted, camera.width) };
        let row = |y: usize| &weighted[y * camera.width + rect.x0..y * camera.width + rect.x1];
        let texels = (rect.y0..rect.y1).flat_map(row).map(normalised).collect();
        levels.push(Level { view: view.with_camera(camera), rect, texels });
    }
    levels
}

/// The smallest rectangle with all fabric.
fn covered(texels: &[[f32; 4]], width: usize) -> Rect {
    let mut rect: Option<Rect> = None;
    for (y, row) in texels.chunks_exact(width).enumerate() {
        let is_fabric = |t: &[f32; 4]| t[3] >= COVERED;
        if let (Some(first), Some(last)) = (row.iter().position(is_fabric), row.iter().rposition(is_fabric)) {
            let of_row = Rect { x0: first, y0: y, x1: last + 1, y1: y + 1 };
            rect = Some(rect.map_or(of_row, |rect| rect.union(of_row)));
        }
    }
    rect.unwrap_or_default()
}

fn halved(texels: &[[f32; 4]], width: usize, height: usize) -> Vec<[f32; 4]> {
    let (w, h) = (width / 2, height / 2);
    let mut out = Vec::with_capacity(w * h);
    for y in 0..h {
        for x in 0..w {
            let i = 2 * y * width + 2 * x;
            let four = [i, i + 1, i + width, i + width + 1];
            out.push([0, 1, 2, 3].map(|c| four.iter().map(|&i| texels[i][c]).sum::<f32>() * 0.25));
        }
    }
    out
}

/// Binomial blur (1 2 1)/4 along both axes, the border repeated.
fn blurred(texels: &[[f32; 4]], width: usize, height: usize) -> Vec<[f32; 4]> {
    let blend =
        |a: [f32; 4], b: [f32; 4], c: [f32; 4]| [0, 1, 2, 3].map(|k| 0.25 * a[k] + 0.5 * b[k] + 0.25 * c[k]);
    let mut rows = vec![[0.0; 4]; texels.len()];
    for (source, row) in texels.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for x in 0..width {
            row[x] = blend(source[x.saturating_sub(1)], source[x], source[(x + 1).min(width - 1)]);
        }
    }
    let mut out = vec![[0.0; 4]; texels.len()];
    for y in 0..height {
        let (up, down) = (y.saturating_sub(1) * width, (y + 1).min(height - 1) * width);
        for x in 0..width {
            out[y * width + x] = blend(rows[up + x], rows[y * width + x], rows[down + x]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::Camera;
    use tessuto_core::image::Image;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn slopes_are_those_of_the_bilinear_colours() {
        let (w, h) = (24, 20);
        let mut rng = Rng::new(3, 0);
        let (mut rgb, mut mask) = (Image::new(w, h, 3), Image::new(w, h, 1));
        rgb.data.iter_mut().for_each(|c| *c = 0.5 + 0.5 * rng.signed() as f32);
        // Fabric but for some columns and rows.
        mask.data.iter_mut().enumerate().for_each(|(i, m)| *m = f32::from(u8::from(i % w < 21 && i / w > 1)));
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: w, height: h };
        let levels = pyramid(&Frame { rgb, mask }, &camera.into(), [0, 1]);
        for level in &levels {
            let mut largest = 0.0f32;
            for k in 0..50 {
                // Inside one cell, where the colour is bilinear: there central differences are exact.
                let cell = DVec2::new((k % 7) as f64, 2.0 + (k / 7 % 6) as f64);
                let p = cell + DVec2::new(0.2 + 0.6 * rng.uniform(), 0.2 + 0.6 * rng.uniform());
                let at = level.sample(p).unwrap();
                assert_eq!(level.colour(p), Some(at.value));
                for (axis, slope) in [(DVec2::X, at.du), (DVec2::Y, at.dv)] {
                    let h = 0.1;
                    let [more, less] = [p + axis * h, p - axis * h].map(|p| level.sample(p).unwrap().value);
                    for c in 0..3 {
                        let difference = (more[c] - less[c]) / (2.0 * h as f32);
                        assert!((difference - slope[c]).abs() < 1e-5, "{difference} {}", slope[c]);
                        largest = largest.max(slope[c].abs());
                    }
                }
            }
            assert!(largest > 0.05, "no slope to compare");
            assert!(level.colour(DVec2::new(1.5, 0.2)).is_none() && level.texel(1, 0).is_none());
        }
        // Of the finer one, blurred by a pixel.
        let (known, none) = ([[20, 2], [0, 19]], [[22, 2], [23, 19], [0, 0]]);
        assert!(known.iter().all(|[x, y]| levels[0].texel(*x, *y).is_some()));
        assert!(none.iter().all(|[x, y]| levels[0].texel(*x, *y).is_none()));
        assert!(levels[0].colour(DVec2::new(19.5, 18.5)).is_some());
        assert!(levels[0].colour(DVec2::new(20.5, 18.5)).is_none());
        assert_eq!(levels[0].texels.len(), 21 * 18, "nothing is kept around the fabric");
    }
}
