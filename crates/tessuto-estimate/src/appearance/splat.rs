//! Colours of points, gathered on a map.

use tessuto_render::pbr::Footprint;

/// Weighted colours, spread over the four texels around each point.
pub(super) struct Splat {
    size: usize,
    /// Weighted sum of the colours and of the weights, shape [size, size], row 0 at v = 1.
    sums: Vec<[f32; 4]>,
}

impl Splat {
    /// Nothing yet, on a map of `size`.
    pub fn new(size: usize) -> Self {
        Self { size, sums: vec![[0.0; 4]; size * size] }
    }

    /// Adds a point at `uv`, 0 to 1.
    pub fn add(&mut self, uv: [f32; 2], colour: [f32; 3], weight: f32) {
        for (texel, share) in Footprint::new([self.size; 2], uv).shares() {
            let (sum, w) = (&mut self.sums[texel], share * weight);
            (0..3).for_each(|c| sum[c] += w * colour[c]);
            sum[3] += w;
        }
    }

    /// Mean colour at `uv`, `None` where no point is near.
    pub fn at(&self, uv: [f32; 2]) -> Option<[f32; 3]> {
        let mut mean = [0.0; 4];
        for (texel, share) in Footprint::new([self.size; 2], uv).shares() {
            let sum = &self.sums[texel];
            if sum[3] > 0.0 {
                (0..3).for_each(|c| mean[c] += share * sum[c] / sum[3]);
                mean[3] += share;
            }
        }
        (mean[3] > 0.0).then(|| [0, 1, 2].map(|c| mean[c] / mean[3]))
    }

    /// Sum of the weights of each texel, shape [size, size].
    pub fn weights(&self) -> impl Iterator<Item = f32> {
        self.sums.iter().map(|sum| sum[3])
    }

    /// Mean colours, planes [3, size, size]; texels that no point is near go on smoothly from those around, 0
    /// without any.
    pub fn planes(mut self) -> Vec<f32> {
        fill(self.size, &mut self.sums);
        let plane = |c: usize| self.sums.iter().map(move |s| if s[3] > 0.0 { s[c] / s[3] } else { 0.0 });
        (0..3).flat_map(plane).collect()
    }
}

/// Gives empty texels the colour that the map of 2×2 blocks, filled in the same way, has there, bilinear (Gortler
/// et al. 1996, "The Lumigraph", pull and push).
fn fill(size: usize, sums: &mut [[f32; 4]]) {
    if size < 2 || sums.iter().all(|s| s[3] > 0.0) {
        return;
    }
    let half = size.div_ceil(2);
    let mut coarse = vec![[0.0f32; 4]; half * half];
    for y in 0..size {
        for x in 0..size {
            let sum = &mut coarse[y / 2 * half + x / 2];
            (0..4).for_each(|c| sum[c] += sums[y * size + x][c]);
        }
    }
    fill(half, &mut coarse);
    let coarse = Splat { size: half, sums: coarse };
    let scale = 1.0 / (2 * half) as f32;
    for y in 0..size {
        for x in 0..size {
            let own = &mut sums[y * size + x];
            if own[3] <= 0.0 {
                let uv = [(x as f32 + 0.5) * scale, 1.0 - (y as f32 + 0.5) * scale];
                if let Some([r, g, b]) = coarse.at(uv) {
                    *own = [r, g, b, 1.0];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splatting_fills_what_no_point_is_near() {
        let mut splat = Splat::new(4);
        splat.add([0.125, 0.875], [0.5, 0.25, 1.0], 2.0);
        assert_eq!(splat.weights().filter(|w| *w > 0.0).count(), 1);
        assert_eq!((splat.at([0.125, 0.875]), splat.at([0.9, 0.1])), (Some([0.5, 0.25, 1.0]), None));
        let planes = splat.planes();
        assert_eq!(planes.len(), 48);
        assert!(planes[..16].iter().all(|v| *v == 0.5) && planes[32..].iter().all(|v| *v == 1.0));
        assert!(Splat::new(3).planes().iter().all(|v| *v == 0.0));
    }

    #[test]
    fn a_hole_between_two_colours_goes_smoothly_from_one_to_the_other() {
        let size = 32;
        let mut splat = Splat::new(size);
        for row in 0..size {
            for (column, value) in [(0, 0.0), (1, 0.0), (30, 1.0), (31, 1.0)] {
                let uv = [column, row].map(|k| (k as f32 + 0.5) / size as f32);
                splat.add(uv, [value; 3], 1.0);
            }
        }
        let row = &splat.planes()[16 * size..17 * size];
        assert!(row.windows(2).all(|w| w[1] >= w[0] - 0.02 && w[1] - w[0] < 0.3), "{row:?}");
        assert!(row[4] < 0.4 && row[27] > 0.6, "{row:?}");
    }
}
