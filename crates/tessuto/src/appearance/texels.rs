//! Material maps, one parameter per texel and channel.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

#[cfg(feature = "decoder")]
use crate::decoder::DecoderState;
use crate::error::{Error, Hint, Remedy, Result};
use crate::optim::Adam;
use crate::pbr::CHANNELS;

/// Limits of the channels: diffuse, roughness, metallic.
pub(super) const LIMITS: [[f64; 2]; CHANNELS] = [[0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [0.2, 1.0], [0.0, 1.0]];

/// Where the total variation turns from linear to quadratic.
const SOFT: f32 = 0.01;

/// Something that makes material maps and learns from their gradient.
pub(super) trait Maps {
    /// The maps, one plane per channel, shape [[`CHANNELS`], size, size], within their limits.
    fn maps(&mut self) -> Vec<f32>;

    /// What [`restore`](Self::restore) resumes from.
    fn save(&self) -> MapState;

    /// Takes back what [`save`](Self::save) gave.
    ///
    /// # Errors
    /// [`Error::Input`] if it was of other maps.
    fn restore(&mut self, state: &MapState) -> Result<()>;

    /// Moves the parameters against a gradient of a loss with respect to the maps.
    fn step(&mut self, gradient: &[f32], rate: f64);
}

/// Parameters and optimiser of maps.
#[derive(Serialize, Deserialize)]
pub(super) enum MapState {
    Texels(Vec<f64>, Adam),
    #[cfg(feature = "decoder")]
    Decoder(DecoderState),
}

/// The maps themselves are the parameters.
pub(super) struct Texels {
    size: usize,
    values: Vec<f64>,
    adam: Adam,
    /// Weights of the prior, by channel.
    smoothness: [f64; CHANNELS],
    /// Weight of the mean of each channel.
    pull: [f64; CHANNELS],
}

impl Texels {
    /// Starts from `planes`.
    pub fn new(size: usize, planes: &[f32], smoothness: [f64; CHANNELS], pull: [f64; CHANNELS]) -> Self {
        let values: Vec<f64> = planes.iter().copied().map(f64::from).collect();
        Self { size, adam: Adam::new(values.len(), 1.0), values, smoothness, pull }
    }
}

impl Maps for Texels {
    fn maps(&mut self) -> Vec<f32> {
        self.values.iter().map(|v| *v as f32).collect()
    }

    fn save(&self) -> MapState {
        MapState::Texels(self.values.clone(), self.adam.clone())
    }

    fn restore(&mut self, state: &MapState) -> Result<()> {
        match state {
            MapState::Texels(values, adam)
                if values.len() == self.values.len() && adam.matches(values.len()) =>
            {
                self.values.clone_from(values);
                self.adam = adam.clone();
                Ok(())
            }
            _ => Err(other_maps()),
        }
    }

    fn step(&mut self, gradient: &[f32], rate: f64) {
        let n = self.size * self.size;
        let mut total: Vec<f64> = gradient.iter().copied().map(f64::from).collect();
        let planes = self.values.par_chunks_exact(n).zip(total.par_chunks_exact_mut(n));
        planes.zip(self.smoothness.par_iter().zip(&self.pull[..])).for_each(
            |((plane, total), (smoothness, pull))| {
                total.iter_mut().for_each(|g| *g += pull / n as f64);
                add_variation_gradient(self.size, plane, smoothness / n as f64, total);
            },
        );
        self.adam.set_learning_rate(rate);
        self.adam.step(&mut self.values, &total, 1.0);
        for (plane, [low, high]) in self.values.chunks_exact_mut(n).zip(LIMITS) {
            plane.iter_mut().for_each(|v| *v = v.clamp(low, high));
        }
    }
}

/// The checkpoint is of other maps.
pub(super) fn other_maps() -> Error {
    Error::input(
        "checkpoint, appearance",
        "it has maps of another kind or size",
        Hint::from("start afresh").with(Remedy::NoResume),
    )
}

/// Adds `weight` times the gradient of Σ √(d² + `SOFT`²) over the differences d of neighbours in `plane`.
fn add_variation_gradient(size: usize, plane: &[f64], weight: f64, gradient: &mut [f64]) {
    let soft = f64::from(SOFT);
    for y in 0..size {
        for x in 0..size {
            let i = y * size + x;
            for (j, inside) in [(i + 1, x + 1 < size), (i + size, y + 1 < size)] {
                if inside {
                    let d = plane[j] - plane[i];
                    let g = weight * d / (d * d + soft * soft).sqrt();
                    gradient[j] += g;
                    gradient[i] -= g;
                }
            }
        }
    }
}

/// Diffuse planes [3, size, size] from the mean of `values` at the points `uvs`; texels that no point is near take
/// the mean of their neighbours.
pub(super) fn splat(size: usize, uvs: impl Iterator<Item = [f32; 2]>, values: &[[f32; 3]]) -> Vec<f32> {
    let mut sums = vec![[0.0f32; 4]; size * size];
    for ([u, v], value) in uvs.zip(values) {
        let at = |s: f32| (s * size as f32 - 0.5).clamp(0.0, (size - 1) as f32);
        let (x, y) = (at(u), at(1.0 - v));
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (column, row) = ((x as usize + dx).min(size - 1), (y as usize + dy).min(size - 1));
            let weight = (1.0 - (x - column as f32).abs()).max(0.0) * (1.0 - (y - row as f32).abs()).max(0.0);
            let sum = &mut sums[row * size + column];
            (0..3).for_each(|c| sum[c] += weight * value[c]);
            sum[3] += weight;
        }
    }
    fill(size, &mut sums);
    (0..3).flat_map(|c| sums.iter().map(move |s| if s[3] > 0.0 { s[c] / s[3] } else { 0.0 })).collect()
}

/// Gives empty texels the sums of the 2×2 block that they lie in, blocks again of blocks (pull and push).
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
    for y in 0..size {
        for x in 0..size {
            let own = &mut sums[y * size + x];
            if own[3] <= 0.0 {
                *own = coarse[y / 2 * half + x / 2];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::gradient_check::check;
    use crate::math::rng::Rng;

    #[test]
    fn gradient_of_the_variation_matches_differences() {
        let mut rng = Rng::new(4, 0);
        let plane: Vec<f64> = (0..36).map(|_| 0.1 * rng.uniform()).collect();
        let mut gradient = vec![0.0; 36];
        add_variation_gradient(6, &plane, 0.7, &mut gradient);
        let value = |p: &[f64]| {
            let soft = f64::from(SOFT);
            let term = |d: f64| 0.7 * (d * d + soft * soft).sqrt();
            let across: f64 = (0..36).filter(|i| i % 6 < 5).map(|i| term(p[i + 1] - p[i])).sum();
            across + (0..30).map(|i| term(p[i + 6] - p[i])).sum::<f64>()
        };
        let worst = check(&plane, &gradient, 1e-4, 8, 5, value);
        eprintln!("worst relative error {:.1e}", worst.relative_error);
        assert!(worst.relative_error < 1e-6);
    }

    #[test]
    fn splatting_fills_what_no_point_is_near() {
        let planes = splat(4, [[0.125, 0.875]].into_iter(), &[[0.5, 0.25, 1.0]]);
        assert_eq!(planes.len(), 48);
        assert!(planes[..16].iter().all(|v| *v == 0.5) && planes[32..].iter().all(|v| *v == 1.0));
    }
}
