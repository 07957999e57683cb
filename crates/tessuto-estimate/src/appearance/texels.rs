//! Material maps as they are optimised: the diffuse colour by texel, roughness and metallic by region.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::albedo_scale::HIGHEST;
use super::metal_colour;
use super::regions::regions;
use super::surfaces::{self, SurfacePrior, Surfaces};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::optim::Adam;
#[cfg(feature = "decoder")]
use tessuto_render::decoder::DecoderState;
use tessuto_render::pbr::CHANNELS;

/// Limits of the channels: diffuse, roughness, metallic.
pub(super) const LIMITS: [[f64; 2]; CHANNELS] =
    [[0.0, HIGHEST], [0.0, HIGHEST], [0.0, HIGHEST], surfaces::LIMITS[0], surfaces::LIMITS[1]];

/// Where the total variation turns from linear to quadratic.
const SOFT: f32 = 0.01;

/// Factors by channel of the diffuse planes [3, n], from these and the metallic plane `[n]`.
pub(super) type Factors<'a> = &'a mut dyn FnMut(&[f64], &[f32]) -> Option<[f64; 3]>;

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

    /// Multiplies the diffuse map by what `factors` makes of it and of the metallic map, by channel, and returns that.
    /// `None`: it stays as it is.
    fn rescale(&mut self, factors: Factors<'_>) -> Option<[f64; 3]>;

    /// Finds regions that share a surface anew.
    fn regroup(&mut self);

    /// Finds anew which texels are of one metal.
    fn find_metals(&mut self) {}
}

/// Parameters and optimiser of maps.
#[derive(Serialize, Deserialize)]
pub(super) enum MapState {
    Texels(Vec<f64>, Adam, Surfaces),
    #[cfg(feature = "decoder")]
    Decoder(DecoderState),
}

/// Diffuse colour by texel; roughness and metallic by region of similar colour.
pub(super) struct Texels {
    size: usize,
    diffuse: Vec<f64>,
    adam: Adam,
    surfaces: Surfaces,
    /// Metal of every texel; empty until it is looked for.
    metals: Vec<u8>,
    prior: TexelPrior,
}

/// What is expected of the maps.
#[derive(Debug, Clone, Copy)]
pub(super) struct TexelPrior {
    /// Weight of the mean absolute differences between neighbours of the diffuse map.
    pub smoothness: f64,
    /// Weight of the mean squared difference of metal from its mean colour.
    pub metal_colour: f64,
    /// Of roughness and metallic.
    pub surface: SurfacePrior,
}

impl Texels {
    /// Starts from `diffuse` planes [3, size, size], roughness and metallic that are the same everywhere.
    pub fn new(size: usize, diffuse: &[f32], [roughness, metallic]: [f64; 2], prior: TexelPrior) -> Self {
        let surfaces = Surfaces::new(regions(diffuse), roughness, metallic);
        let diffuse: Vec<f64> = diffuse.iter().copied().map(f64::from).collect();
        Self { size, adam: Adam::new(diffuse.len(), 1.0), diffuse, surfaces, metals: Vec::new(), prior }
    }
}

impl Maps for Texels {
    fn maps(&mut self) -> Vec<f32> {
        let mut maps: Vec<f32> = self.diffuse.iter().map(|v| *v as f32).collect();
        (0..2).for_each(|channel| maps.extend(self.surfaces.plane(channel)));
        maps
    }

    fn save(&self) -> MapState {
        MapState::Texels(self.diffuse.clone(), self.adam.clone(), self.surfaces.clone())
    }

    fn restore(&mut self, state: &MapState) -> Result<()> {
        match state {
            MapState::Texels(diffuse, adam, surfaces)
                if diffuse.len() == self.diffuse.len()
                    && adam.matches(diffuse.len())
                    && surfaces.matches(self.size * self.size) =>
            {
                self.diffuse.clone_from(diffuse);
                self.adam = adam.clone();
                self.surfaces = surfaces.clone();
                Ok(())
            }
            _ => Err(other_maps()),
        }
    }

    fn step(&mut self, gradient: &[f32], rate: f64) {
        let n = self.size * self.size;
        let (diffuse, surfaces) = gradient.split_at(3 * n);
        let mut total = vec![0.0; 3 * n];
        let planes = self.diffuse.par_chunks_exact(n).zip(diffuse.par_chunks_exact(n));
        planes.zip(total.par_chunks_exact_mut(n)).for_each(|((plane, gradient), total)| {
            total.iter_mut().zip(gradient).for_each(|(t, g)| *t = f64::from(*g));
            add_variation_gradient(self.size, plane, self.prior.smoothness / n as f64, total);
        });
        if !self.metals.is_empty() {
            let metallic: Vec<f32> = self.surfaces.plane(1).collect();
            let weight = self.prior.metal_colour;
            metal_colour::add_gradient(&self.diffuse, &metallic, &self.metals, weight, &mut total);
        }
        self.adam.set_learning_rate(rate);
        self.adam.step(&mut self.diffuse, &total, 1.0);
        self.diffuse.par_chunks_exact_mut(n).zip(LIMITS).for_each(|(plane, [low, high])| {
            plane.iter_mut().for_each(|v| *v = v.clamp(low, high));
        });
        self.surfaces.step(surfaces, &self.prior.surface, rate);
    }

    fn rescale(&mut self, factors: Factors<'_>) -> Option<[f64; 3]> {
        let metallic: Vec<f32> = self.surfaces.plane(1).collect();
        let factors = factors(&self.diffuse, &metallic)?;
        let n = self.size * self.size;
        for ((plane, factor), [low, high]) in self.diffuse.chunks_exact_mut(n).zip(factors).zip(LIMITS) {
            plane.iter_mut().for_each(|v| *v = (*v * factor).clamp(low, high));
        }
        Some(factors)
    }

    fn regroup(&mut self) {
        let diffuse: Vec<f32> = self.diffuse.iter().map(|v| *v as f32).collect();
        self.surfaces.regroup(regions(&diffuse));
    }

    fn find_metals(&mut self) {
        let metallic: Vec<f32> = self.surfaces.plane(1).collect();
        self.metals = metal_colour::metals(&self.diffuse, &metallic);
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

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

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
    fn texels_of_one_colour_share_a_surface_and_no_other() {
        // Left half red, right half blue; the loss wants metal on the left, and one texel of it says nothing.
        let (size, n) = (8, 64);
        let ink = |c: usize, i: usize| if (i % size < 4) == (c == 0) { 0.6 } else { 0.1 };
        let diffuse: Vec<f32> = (0..3 * n).map(|k| ink(k / n, k % n)).collect();
        let surface = SurfacePrior { metallic: 1e-3, roughness_weight: 0.0, roughness: 0.7 };
        let prior = TexelPrior { smoothness: 0.0, metal_colour: 0.0, surface };
        let mut texels = Texels::new(size, &diffuse, [0.7, 0.2], prior);
        let mut gradient = vec![0.0; 5 * n];
        (0..n).filter(|i| i % size < 4 && *i != 9).for_each(|i| gradient[4 * n + i] = -1.0);
        (0..20).for_each(|_| texels.step(&gradient, 0.01));
        let metallic = texels.maps()[4 * n..].to_vec();
        assert_eq!(metallic[9], metallic[0]);
        assert!(metallic[0] > 0.3 && metallic[7] < 0.1, "{metallic:?}");
        // Regions found anew start from what was.
        texels.regroup();
        assert_eq!(texels.maps()[4 * n..], metallic);
        let factors = texels.rescale(&mut |diffuse, metal| {
            assert_eq!((diffuse.len(), metal.len()), (3 * n, n));
            Some([0.5, 1.0, 2.0])
        });
        assert_eq!(factors, Some([0.5, 1.0, 2.0]));
        let scaled = texels.maps();
        assert!((scaled[0] - 0.3).abs() < 1e-6 && scaled[2 * n + 7] == HIGHEST as f32, "{scaled:?}");
    }
}
