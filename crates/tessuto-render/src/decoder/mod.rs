//! Material maps as the output of an untrained convolutional decoder, whose weights are optimised
//! instead of the texels (a deep image prior): smooth regions and repeated patterns are easy for it,
//! noise is hard. Runs on the CPU; built with the cargo feature `decoder`.
//!
//! Source: `[DIP]`, \[SAFT\] §2.5.1. The source's list of layers doubles seven times, to 512 px, while its
//! tiles have 128 px: the two bilinear doublings are left out, their convolutions kept.

mod blend;
mod network;

use serde::{Deserialize, Serialize};

use blend::Blend;
use network::{Graph, Network};
use tessuto_core::math::rng::Rng;

/// Channels of the maps: diffuse 3, roughness 1, metallic 1.
pub const CHANNELS: usize = 5;

/// Size of a decoder and how it is optimised.
#[derive(Debug, Clone, PartialEq)]
pub struct DecoderConfig {
    /// Tiles along each edge of the maps, ≥ 1.
    pub tiles: usize,
    /// Overlap of neighbouring tiles `[px]`, even; half of it is also cut off at the maps' border.
    pub overlap: usize,
    /// Edge of a tile's latent image `[px]`.
    pub latent_edge: usize,
    /// Channels of the latent image and after each transposed convolution; every one doubles the
    /// edge, and one more doubling leads to the maps.
    pub channels: Vec<usize>,
    /// Adam's step.
    pub learning_rate: f64,
    /// Adam's decay rates.
    pub betas: [f64; 2],
}

impl DecoderConfig {
    /// The published size: 4×4 tiles of 128² px, 2.8 M weights, maps of 472² px.
    pub fn published() -> Self {
        Self {
            tiles: 4,
            overlap: 10,
            latent_edge: 4,
            channels: vec![512, 256, 128, 64, 32],
            learning_rate: 2e-4,
            betas: [0.9, 0.9999],
        }
    }

    /// Edges of [`light`](Self::light) decoders are multiples of this.
    pub const LIGHT_STEP: usize = 16;

    /// One tile of `edge`² px, a multiple of [`LIGHT_STEP`](Self::LIGHT_STEP), and fewer channels: at 256 px a fifth of
    /// the time per step and far fewer steps (docs/experiments/log/appearance-decoder.md).
    pub fn light(edge: usize) -> Self {
        assert!(edge > 0 && edge.is_multiple_of(Self::LIGHT_STEP), "edge {edge}");
        Self {
            tiles: 1,
            overlap: 0,
            latent_edge: edge / Self::LIGHT_STEP,
            channels: vec![64, 64, 32, 32],
            learning_rate: 5e-3,
            betas: [0.9, 0.99],
        }
    }

    /// Edge of a tile `[px]`.
    pub fn tile_edge(&self) -> usize {
        self.latent_edge << self.channels.len()
    }

    /// Edge of the maps `[px]`: tiles · (tile edge − overlap).
    pub fn edge(&self) -> usize {
        self.tiles * (self.tile_edge() - self.overlap)
    }
}

/// The decoder: fixed random latent images, weights, and the optimiser's state.
pub struct Decoder {
    network: Network,
    blend: Blend,
    /// Weights of all layers, one after another.
    weights: Vec<f32>,
    adam: Adam,
    /// What [`maps`](Self::maps) computed for the present weights, until [`step`](Self::step) uses it up.
    graph: Option<Graph>,
}

impl Decoder {
    /// A decoder with random latents and weights, which depend on `seed` only.
    pub fn new(config: &DecoderConfig, seed: u64) -> Self {
        assert!(config.tiles >= 1 && !config.channels.is_empty() && config.latent_edge >= 1, "{config:?}");
        assert!(config.overlap.is_multiple_of(2) && 2 * config.overlap < config.tile_edge(), "{config:?}");
        let network = Network::new(config, &mut Rng::new(seed, 0));
        let weights = network.initial_weights(&mut Rng::new(seed, 1));
        let adam = Adam::new(weights.len(), config.learning_rate, config.betas);
        Self { network, blend: Blend::new(config), weights, adam, graph: None }
    }

    /// Width and height of the maps `[px]`.
    pub fn edge(&self) -> usize {
        self.blend.edge()
    }

    /// Number of weights.
    pub fn weight_count(&self) -> usize {
        self.weights.len()
    }

    /// The maps of the present weights, each value in (0, 1), planar, shape [5, edge, edge], row 0 on top:
    /// red, green, blue of the diffuse map, roughness, metallic.
    pub fn maps(&mut self) -> Vec<f32> {
        let graph = self.graph.get_or_insert_with(|| self.network.forward(&self.weights));
        self.blend.maps(&graph.tiles())
    }

    /// One step of the weights against `gradient`, ∂loss/∂maps, shape [5, edge, edge]. Returns whether it
    /// was taken: a gradient that is not finite is skipped.
    pub fn step(&mut self, gradient: &[f32]) -> bool {
        if gradient.iter().any(|g| !g.is_finite()) {
            return false;
        }
        let weights = self.gradient(gradient);
        self.adam.step(&mut self.weights, &weights)
    }

    /// Weights and optimiser.
    pub fn state(&self) -> DecoderState {
        DecoderState { weights: self.weights.clone(), adam: self.adam.clone() }
    }

    /// Takes back a [`state`](Self::state); returns whether it is of a decoder of this size.
    pub fn set_state(&mut self, state: &DecoderState) -> bool {
        let count = self.weights.len();
        let fits =
            [&state.weights, &state.adam.mean, &state.adam.mean_square].iter().all(|v| v.len() == count);
        if fits {
            (self.weights, self.adam) = (state.weights.clone(), state.adam.clone());
            self.graph = None;
        }
        fits
    }

    /// The next steps' length.
    pub fn set_learning_rate(&mut self, learning_rate: f64) {
        self.adam.learning_rate = learning_rate;
    }

    /// ∂loss/∂weights for ∂loss/∂maps.
    fn gradient(&mut self, gradient: &[f32]) -> Vec<f32> {
        let graph = self.graph.take().unwrap_or_else(|| self.network.forward(&self.weights));
        graph.backward(&self.blend.maps_vjp(gradient))
    }
}

/// What [`Decoder::set_state`] resumes from.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DecoderState {
    weights: Vec<f32>,
    adam: Adam,
}

/// Adam in single precision (Kingma and Ba 2015, alg. 1). Not [`optim::Adam`](tessuto_core::optim::Adam): the
/// weights are f32, a million of them, with decay rates of their own; its f64 would double what a checkpoint
/// holds.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Adam {
    learning_rate: f64,
    betas: [f64; 2],
    steps: i32,
    mean: Vec<f32>,
    mean_square: Vec<f32>,
}

impl Adam {
    fn new(count: usize, learning_rate: f64, betas: [f64; 2]) -> Self {
        Self { learning_rate, betas, steps: 0, mean: vec![0.0; count], mean_square: vec![0.0; count] }
    }

    fn step(&mut self, weights: &mut [f32], gradient: &[f32]) -> bool {
        if gradient.iter().any(|g| !g.is_finite()) {
            return false;
        }
        self.steps += 1;
        let [b1, b2] = self.betas;
        let length = (self.learning_rate / (1.0 - b1.powi(self.steps))) as f32;
        let correction = (1.0 / (1.0 - b2.powi(self.steps))) as f32;
        let [b1, b2] = [b1 as f32, b2 as f32];
        let state = self.mean.iter_mut().zip(&mut self.mean_square);
        for ((w, g), (m, v)) in weights.iter_mut().zip(gradient).zip(state) {
            *m = b1 * *m + (1.0 - b1) * g;
            *v = b2 * *v + (1.0 - b2) * g * g;
            *w -= length * *m / ((*v * correction).sqrt() + 1e-8);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(tiles: usize) -> DecoderConfig {
        DecoderConfig {
            tiles,
            overlap: if tiles > 1 { 4 } else { 0 },
            latent_edge: 2,
            channels: vec![6, 5, 4],
            learning_rate: 1e-2,
            betas: [0.9, 0.99],
        }
    }

    #[test]
    fn sizes_are_the_published_ones() {
        let config = DecoderConfig::published();
        assert_eq!((config.tile_edge(), config.edge()), (128, 472));
        assert_eq!(DecoderConfig::light(256).edge(), 256);
        let mut decoder = Decoder::new(&small(2), 3);
        let edge = decoder.edge();
        assert_eq!(edge, 2 * (16 - 4));
        let maps = decoder.maps();
        assert_eq!(maps.len(), CHANNELS * edge * edge);
        assert!(maps.iter().all(|v| (0.0..=1.0).contains(v)));
    }

    /// A loss that is not linear in the maps: Σ c (maps − ½)³ with fixed signs c.
    fn loss(maps: &[f32]) -> (f64, Vec<f32>) {
        let sign = |k: usize| if k.is_multiple_of(3) { -1.0 } else { 0.7 };
        let term = |(k, m): (usize, &f32)| sign(k) * (f64::from(*m) - 0.5).powi(3);
        let slope = |(k, m): (usize, &f32)| (3.0 * sign(k) * (f64::from(*m) - 0.5).powi(2)) as f32;
        (maps.iter().enumerate().map(term).sum(), maps.iter().enumerate().map(slope).collect())
    }

    #[test]
    fn gradient_agrees_with_finite_differences() {
        for tiles in [1, 2] {
            let mut decoder = Decoder::new(&small(tiles), 7);
            let (_, slope) = loss(&decoder.maps());
            let gradient = decoder.gradient(&slope);
            assert!(gradient.iter().filter(|g| g.abs() > 1e-4).count() > gradient.len() / 2);
            let start = decoder.weights.clone();
            let mut rng = Rng::new(1, 0);
            // Maps have single precision: take random directions over all weights, and a fairly long step.
            for _ in 0..6 {
                let direction: Vec<f32> = start.iter().map(|_| rng.signed() as f32).collect();
                let mut at = |step: f32| {
                    decoder.graph = None;
                    decoder.weights = start.iter().zip(&direction).map(|(w, d)| w + step * d).collect();
                    loss(&decoder.maps()).0
                };
                const STEP: f32 = 1e-4;
                let difference = (at(STEP) - at(-STEP)) / f64::from(2.0 * STEP);
                let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
                let analytic = dot(&gradient, &direction);
                let scale = dot(&gradient, &gradient).sqrt();
                // Kinks of the rectifiers (about 3 % at ten times the step) and rounding: 1 % of the gradient's length.
                assert!(
                    (analytic - difference).abs() < 1e-2 * scale,
                    "{analytic} for {difference} ({scale})"
                );
            }
        }
    }

    #[test]
    fn fits_a_picture() {
        let mut decoder = Decoder::new(&small(2), 0);
        let edge = decoder.edge();
        let target: Vec<f32> = (0..CHANNELS * edge * edge)
            .map(|k| if (k % edge / 6 + k / edge / 6).is_multiple_of(2) { 0.8 } else { 0.3 })
            .collect();
        let error = |maps: &[f32]| {
            maps.iter().zip(&target).map(|(m, t)| (m - t).powi(2)).sum::<f32>() / maps.len() as f32
        };
        let first = error(&decoder.maps());
        for _ in 0..150 {
            let slope: Vec<f32> = decoder.maps().iter().zip(&target).map(|(m, t)| m - t).collect();
            assert!(decoder.step(&slope));
        }
        let last = error(&decoder.maps());
        assert!(last < 0.2 * first, "{first} → {last}");
        let before = decoder.weights.clone();
        assert!(!decoder.step(&vec![f32::NAN; CHANNELS * edge * edge]));
        assert_eq!(decoder.weights, before);
    }

    #[test]
    fn same_bytes_for_any_number_of_threads() {
        // Large enough for the matrix products to be shared among threads.
        let config = DecoderConfig { latent_edge: 8, channels: vec![64, 64, 32], ..small(2) };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut decoder = Decoder::new(&config, 5);
                for _ in 0..3 {
                    let slope = loss(&decoder.maps()).1;
                    decoder.step(&slope);
                }
                decoder.maps()
            })
        };
        let one = run(1);
        assert!(one == run(2) && one == run(3));
        assert_ne!(one, Decoder::new(&config, 6).maps());
    }
}
