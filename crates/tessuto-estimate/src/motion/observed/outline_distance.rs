//! Distance to the outline of the observed mask.

use glam::DVec2;

use tessuto_core::image::Image;
use tessuto_core::video::COVERED;

/// Signed distance `[px]` to the outline of a mask: positive on the fabric. Constant where there is no outline.
#[derive(Debug, Clone)]
pub struct OutlineDistance {
    /// Pixels of the mask along one pixel of `distance`.
    scale: usize,
    width: usize,
    height: usize,
    /// In pixels of the mask, shape [height, width].
    distance: Vec<f32>,
}

/// The outline within this distance of the image border, in pixels of the distances, may be cut by it and does not
/// count.
const BORDER: f64 = 3.0;

impl OutlineDistance {
    /// Signed distance of `mask` (threshold ½), kept for one of `scale`×`scale` pixels. The image border is not an
    /// outline.
    pub fn new(mask: &Image, scale: usize) -> Self {
        let small = (scale > 1).then(|| mask.downsampled(scale));
        let mask = small.as_ref().unwrap_or(mask);
        let inside: Vec<bool> = mask.data.iter().map(|&m| m >= COVERED).collect();
        Self::of(&inside, [mask.width, mask.height], scale)
    }

    /// The same of what is `inside` of an outline, given by squares of `scale`×`scale` pixels, shape [h, w].
    pub fn of(inside: &[bool], [w, h]: [usize; 2], scale: usize) -> Self {
        // Nothing is farther.
        let reach = (w + h) as f32;
        let [to_background, to_fabric] = [false, true].map(|target| distance(inside, target, [w, h], reach));
        // Pixel centres on both sides of the outline are half a pixel from it.
        let from_outline = |distance: f32| (distance - 0.5) * scale as f32;
        let signed = |i: usize| match inside[i] {
            true => from_outline(to_background[i]),
            false => -from_outline(to_fabric[i]),
        };
        Self { scale, width: w, height: h, distance: (0..w * h).map(signed).collect() }
    }

    /// Distance and its gradient at pixel position `p` of the mask; `None` near the image border.
    pub fn sample(&self, p: DVec2) -> Option<(f64, DVec2)> {
        let scale = self.scale as f64;
        let p = (p - 0.5 * (scale - 1.0)) / scale;
        let (w, h) = (self.width, self.height);
        let inside =
            p.x >= BORDER && p.y >= BORDER && p.x < (w - 1) as f64 - BORDER && p.y < (h - 1) as f64 - BORDER;
        if !inside {
            return None;
        }
        let (x, y) = (p.x as usize, p.y as usize);
        let (s, t) = (p.x - x as f64, p.y - y as f64);
        let at = |x: usize, y: usize| f64::from(self.distance[y * w + x]);
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        let value = (a + s * (b - a)) * (1.0 - t) + (c + s * (d - c)) * t;
        let gradient =
            DVec2::new((b - a) * (1.0 - t) + (d - c) * t, (c - a) * (1.0 - s) + (d - b) * s) / scale;
        Some((value, gradient))
    }
}

/// Exact Euclidean distance of every pixel to the nearest pixel with `inside == target`
/// (Felzenszwalb and Huttenlocher 2012, "Distance Transforms of Sampled Functions"), cut at `reach`.
pub fn distance(inside: &[bool], target: bool, [width, height]: [usize; 2], reach: f32) -> Vec<f32> {
    let far = reach * reach;
    let mut sq: Vec<f32> = inside.iter().map(|&i| if i == target { 0.0 } else { far }).collect();
    let mut line = vec![0.0; width.max(height)];
    let mut hull = Hull::default();
    for x in 0..width {
        for y in 0..height {
            line[y] = sq[y * width + x];
        }
        hull.transform(&line[..height], |y, d| sq[y * width + x] = d);
    }
    for row in sq.chunks_exact_mut(width) {
        line[..width].copy_from_slice(row);
        hull.transform(&line[..width], |x, d| row[x] = d);
    }
    sq.into_iter().map(f32::sqrt).collect()
}

/// Lower envelope of the parabolas (q − p)² + f(p).
#[derive(Default)]
struct Hull {
    vertex: Vec<usize>,
    start: Vec<f32>,
}

impl Hull {
    fn transform(&mut self, f: &[f32], mut set: impl FnMut(usize, f32)) {
        self.vertex.clear();
        self.start.clear();
        let height = |p: usize| f[p] + (p * p) as f32;
        for q in 0..f.len() {
            let mut from = f32::NEG_INFINITY;
            while let (Some(&p), Some(&start)) = (self.vertex.last(), self.start.last()) {
                from = (height(q) - height(p)) / (2.0 * (q - p) as f32);
                if from > start {
                    break;
                }
                self.vertex.pop();
                self.start.pop();
                from = f32::NEG_INFINITY;
            }
            self.vertex.push(q);
            self.start.push(from);
        }
        let mut k = 0;
        for q in 0..f.len() {
            while k + 1 < self.start.len() && self.start[k + 1] <= q as f32 {
                k += 1;
            }
            let d = q.abs_diff(self.vertex[k]) as f32;
            set(q, d * d + f[self.vertex[k]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn distance_agrees_with_brute_force() {
        let (w, h) = (23, 17);
        let mut rng = Rng::new(4, 0);
        let inside: Vec<bool> = (0..w * h).map(|_| rng.uniform() < 0.1).collect();
        let fast = distance(&inside, true, [w, h], (w + h) as f32);
        for i in 0..w * h {
            let sq = |j: usize| (i % w).abs_diff(j % w).pow(2) + (i / w).abs_diff(j / w).pow(2);
            let nearest = (0..w * h).filter(|&j| inside[j]).map(sq).min().unwrap();
            assert!((fast[i] - (nearest as f32).sqrt()).abs() < 1e-4, "pixel {i}");
        }
    }

    #[test]
    fn an_outline_far_away_still_tells_the_way() {
        let mut mask = Image::new(400, 40, 1);
        for y in 0..40 {
            mask.pixel_mut(390, y)[0] = 1.0;
        }
        let (value, gradient) = OutlineDistance::new(&mask, 1).sample(DVec2::new(50.25, 20.0)).unwrap();
        assert!((value + 339.25).abs() < 1e-3 && (gradient - DVec2::X).length() < 1e-3, "{value} {gradient}");
    }

    #[test]
    fn a_straight_edge_has_unit_slope_and_its_zero_between_the_pixels() {
        let mut mask = Image::new(40, 40, 1);
        for y in 0..40 {
            for x in 20..40 {
                mask.pixel_mut(x, y)[0] = 1.0;
            }
        }
        let (value, gradient) = OutlineDistance::new(&mask, 1).sample(DVec2::new(22.25, 20.0)).unwrap();
        assert!((value - 2.75).abs() < 1e-6 && (gradient - DVec2::X).length() < 1e-6, "{value} {gradient}");
        let (value, _) = OutlineDistance::new(&mask, 1).sample(DVec2::new(19.5, 20.0)).unwrap();
        assert!(value.abs() < 1e-6, "{value}");
        // A coarser one speaks of the same pixels.
        let (value, gradient) = OutlineDistance::new(&mask, 4).sample(DVec2::new(22.25, 20.0)).unwrap();
        assert!((value - 2.75).abs() < 1e-6 && (gradient - DVec2::X).length() < 1e-6, "{value} {gradient}");
    }
}
