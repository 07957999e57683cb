//! Settings of the estimation.

use serde::{Deserialize, Serialize};

/// What keeps the maps from following noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapPrior {
    /// Every texel is a parameter; neighbours are drawn to each other.
    Smooth,
    /// The maps are what an untrained convolutional decoder puts out; its weights are the parameters. Needs the cargo
    /// feature `decoder`.
    Decoder,
}

/// How material and light are found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AppearanceSettings {
    /// How the maps are made: smooth or decoder.
    pub prior: MapPrior,
    /// Width and height of the maps `[texel]`, over the part of uv space that the template uses.
    pub map_size: usize,
    /// Rows of the light `[texel]`; it has twice as many columns.
    pub light_rows: usize,
    /// Rows of the light as it is optimised, at first; doubled at equal intervals.
    pub light_coarsest: usize,
    /// Rows of the light as it is optimised, in the end.
    pub light_finest: usize,
    /// Steps of the optimisation.
    pub steps: usize,
    /// Pixels, drawn from all frames, of each step.
    pub batch: usize,
    /// Samples in each of a pixel's two estimates, rounded up to a multiple of 8.
    pub samples_per_pixel: usize,
    /// Pixels kept, drawn from all frames, at most.
    pub most_pixels: usize,
    /// Adam's learning rate of the maps.
    pub map_rate: f64,
    /// Adam's learning rate of the light's logarithm.
    pub light_rate: f64,
    /// Both rates fall by this factor over the second half of the steps.
    pub final_rate: f64,
    /// Fraction of the steps with grey light.
    pub grey_until: f64,
    /// Fraction of the steps after which the light has its full colour.
    pub colour_from: f64,
    /// Radiance that the light starts with, from everywhere.
    pub light_start: f64,
    /// Roughness that the maps start with.
    pub roughness_start: f64,
    /// Metallic that the maps start with.
    pub metallic_start: f64,
    /// Weight of the mean absolute differences between neighbouring texels of the light.
    pub light_smoothness: f64,
    /// Weight of the mean absolute differences between neighbouring texels of the diffuse map.
    pub diffuse_smoothness: f64,
    /// Weight of the mean absolute differences between neighbouring texels of roughness and metallic.
    pub surface_smoothness: f64,
    /// Weight of the mean of the metallic map: what no highlight shows to be metal is paint.
    pub metallic_pull: f64,
    /// Fraction of the steps after which patches with large errors count less; 1: all count alike to the end.
    pub reweight_from: f64,
    /// Fraction of the light samples that are drawn uniformly over the sphere.
    pub uniform_fraction: f64,
    /// Samples for each pixel of the final images, rounded up to a multiple of 8.
    pub render_samples_per_pixel: usize,
}

impl Default for AppearanceSettings {
    fn default() -> Self {
        Self {
            prior: MapPrior::Smooth,
            map_size: 512,
            light_rows: 256,
            light_coarsest: 8,
            light_finest: 64,
            steps: 400,
            batch: 25_000,
            samples_per_pixel: 8,
            most_pixels: 3_000_000,
            map_rate: 0.01,
            light_rate: 0.03,
            final_rate: 0.1,
            grey_until: 0.4,
            colour_from: 0.6,
            light_start: 1.5,
            roughness_start: 0.5,
            metallic_start: 0.4,
            light_smoothness: 5e-5,
            diffuse_smoothness: 3e-4,
            surface_smoothness: 1e-3,
            metallic_pull: 0.0,
            reweight_from: 0.6,
            uniform_fraction: 0.25,
            render_samples_per_pixel: 24,
        }
    }
}

impl AppearanceSettings {
    /// Settings with their values and the ranges that these must lie in.
    pub fn ranges(&self) -> Vec<(&'static str, f64, f64, f64)> {
        vec![
            ("appearance.map_size", self.map_size as f64, 2.0, 8192.0),
            ("appearance.light_rows", self.light_rows as f64, 2.0, 4096.0),
            ("appearance.light_coarsest", self.light_coarsest as f64, 2.0, self.light_finest as f64),
            ("appearance.light_finest", self.light_finest as f64, 2.0, self.light_rows as f64),
            ("appearance.steps", self.steps as f64, 0.0, 1e6),
            ("appearance.batch", self.batch as f64, 1.0, 1e8),
            ("appearance.samples_per_pixel", self.samples_per_pixel as f64, 8.0, 8e4),
            ("appearance.most_pixels", self.most_pixels as f64, 1.0, 1e9),
            ("appearance.map_rate", self.map_rate, 0.0, 1.0),
            ("appearance.light_rate", self.light_rate, 0.0, 1.0),
            ("appearance.final_rate", self.final_rate, 1e-6, 1.0),
            ("appearance.grey_until", self.grey_until, 0.0, self.colour_from),
            ("appearance.colour_from", self.colour_from, 0.0, 1.0),
            ("appearance.light_start", self.light_start, 1e-3, 1e3),
            ("appearance.roughness_start", self.roughness_start, 0.2, 1.0),
            ("appearance.metallic_start", self.metallic_start, 0.0, 1.0),
            ("appearance.light_smoothness", self.light_smoothness, 0.0, 1e3),
            ("appearance.diffuse_smoothness", self.diffuse_smoothness, 0.0, 1e3),
            ("appearance.surface_smoothness", self.surface_smoothness, 0.0, 1e3),
            ("appearance.metallic_pull", self.metallic_pull, 0.0, 1e3),
            ("appearance.reweight_from", self.reweight_from, 0.0, 1.0),
            ("appearance.uniform_fraction", self.uniform_fraction, 0.0, 1.0),
            ("appearance.render_samples_per_pixel", self.render_samples_per_pixel as f64, 8.0, 8e4),
        ]
    }
}
