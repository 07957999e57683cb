//! Overlapping tiles blended into one image.

use rayon::prelude::*;

use super::{CHANNELS, DecoderConfig};

/// Where tiles lie, and how much each of their pixels counts.
pub(super) struct Blend {
    tiles: usize,
    tile_edge: usize,
    /// Distance of neighbouring tiles `[px]`.
    stride: usize,
    /// Pixels cut off at each border.
    margin: usize,
    /// Weight of a tile's column (or row), shape `[tile_edge]`, for the first, an inner and the last tile.
    ramps: [Vec<f32>; 4],
}

impl Blend {
    pub(super) fn new(config: &DecoderConfig) -> Self {
        let (edge, overlap) = (config.tile_edge(), config.overlap);
        // Sigmoid over the overlap, centred in it, from 1 % to 99 %: the weights of two neighbours sum to 1.
        let rising = |k: usize| {
            let at = (k as f64 + 0.5) / overlap as f64 - 0.5;
            1.0 / (1.0 + (-10.0 * at).exp())
        };
        let ramp = |first: bool, last: bool| -> Vec<f32> {
            let weight = |k: usize| {
                let up = if k < overlap && !first { rising(k) } else { 1.0 };
                let down = if edge - 1 - k < overlap && !last { rising(edge - 1 - k) } else { 1.0 };
                (up * down) as f32
            };
            (0..edge).map(weight).collect()
        };
        let ramps = [ramp(false, false), ramp(true, false), ramp(false, true), ramp(true, true)];
        Self { tiles: config.tiles, tile_edge: edge, stride: edge - overlap, margin: overlap / 2, ramps }
    }

    pub(super) fn edge(&self) -> usize {
        self.tiles * self.stride
    }

    fn ramp(&self, tile: usize) -> &[f32] {
        &self.ramps[usize::from(tile == 0) + 2 * usize::from(tile + 1 == self.tiles)]
    }

    /// Calls `f(map index, tile index, weight)` for every pixel of channel `c` of every tile that is not cut off.
    fn for_each(&self, c: usize, mut f: impl FnMut(usize, usize, f32)) {
        let (n, edge) = (self.tile_edge, self.edge());
        for tile in 0..self.tiles * self.tiles {
            let (ty, tx) = (tile / self.tiles, tile % self.tiles);
            let (down, across) = (self.ramp(ty), self.ramp(tx));
            let visible = |t: usize| {
                let first = self.margin.saturating_sub(t * self.stride);
                first..n.min(edge + self.margin - t * self.stride)
            };
            for i in visible(ty) {
                let row = (ty * self.stride + i - self.margin) * edge;
                let tile_row = ((tile * CHANNELS + c) * n + i) * n;
                for j in visible(tx) {
                    f(row + tx * self.stride + j - self.margin, tile_row + j, down[i] * across[j]);
                }
            }
        }
    }

    /// Maps, shape [5, edge, edge], of `tiles`, shape [tiles², 5, tile_edge, tile_edge].
    pub(super) fn maps(&self, tiles: &[f32]) -> Vec<f32> {
        let mut maps = vec![0.0; CHANNELS * self.edge() * self.edge()];
        maps.par_chunks_exact_mut(self.edge() * self.edge())
            .enumerate()
            .for_each(|(c, map)| self.for_each(c, |at, tile, weight| map[at] += weight * tiles[tile]));
        maps
    }

    /// Gradient of [`maps`](Self::maps), which is linear, in the tiles.
    pub(super) fn maps_vjp(&self, gradient: &[f32]) -> Vec<f32> {
        let area = self.edge() * self.edge();
        assert_eq!(gradient.len(), CHANNELS * area, "a gradient of another size than the maps");
        let mut tiles = vec![0.0; self.tiles * self.tiles * CHANNELS * self.tile_edge * self.tile_edge];
        for (c, map) in gradient.chunks_exact(area).enumerate() {
            self.for_each(c, |at, tile, weight| tiles[tile] = weight * map[at]);
        }
        tiles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_everywhere() {
        for (tiles, overlap) in [(1, 0), (2, 0), (2, 4), (3, 6)] {
            let config = DecoderConfig {
                tiles,
                overlap,
                latent_edge: 2,
                channels: vec![1, 1, 1],
                ..DecoderConfig::light(256)
            };
            let blend = Blend::new(&config);
            let ones = vec![1.0; tiles * tiles * CHANNELS * 16 * 16];
            let maps = blend.maps(&ones);
            assert_eq!(maps.len(), CHANNELS * (tiles * (16 - overlap)).pow(2));
            assert!(maps.iter().all(|v| (v - 1.0).abs() < 1e-6), "{tiles} tiles, overlap {overlap}");
        }
    }
}
