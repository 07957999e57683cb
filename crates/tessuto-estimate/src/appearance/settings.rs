//! Settings of the estimation.

use serde::{Deserialize, Serialize};

use tessuto_core::error::Result;
use tessuto_core::settings::{ordered, settings};

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

impl MapPrior {
    /// Their names.
    pub const NAMES: &[&str] = &["smooth", "decoder"];
}

settings! {
    /// How material and light are found.
    pub struct AppearanceSettings {
        /// Prior that keeps the maps from following noise: smoothness of neighbouring texels, or the output of an
        /// untrained convolutional decoder.
        prior: MapPrior = MapPrior::Smooth, choice(MapPrior::NAMES);
        /// Width and height of the maps, over the part of uv space that the template uses.
        map_size: usize = 512, number(2.0..=8192.0, "texel");
        /// Rows of the environment map that is written; it has twice as many columns.
        light_rows: usize = 256, number(2.0..=4096.0, "texel");
        /// Rows of the environment map as it is optimised, at first; doubled at equal parts of the steps. At most
        /// light_finest.
        light_coarsest: usize = 8, number(2.0..=4096.0, "texel");
        /// Rows of the environment map as it is optimised, in the end. At most light_rows.
        light_finest: usize = 64, number(2.0..=4096.0, "texel");
        /// Steps of the optimisation.
        steps: usize = 400, number(0.0..=1e6, "");
        /// Pixels of each step, drawn from all frames.
        batch: usize = 25_000, number(1.0..=1e8, "px");
        /// Samples in each of a pixel's two estimates, rounded up to a multiple of 8.
        samples_per_pixel: usize = 8, number(8.0..=8e4, "");
        /// Most pixels that are kept, drawn from all frames.
        most_pixels: usize = 3_000_000, number(1.0..=1e9, "px");
        /// Adam's learning rate of the maps.
        map_rate: f64 = 0.01, number(0.0..=1.0, "");
        /// Adam's learning rate of the logarithm of the light.
        light_rate: f64 = 0.03, number(0.0..=1.0, "");
        /// Both rates fall by this factor over the second half of the steps.
        final_rate: f64 = 0.1, number(1e-6..=1.0, "");
        /// Fraction of the steps with grey light. At most colour_from.
        grey_until: f64 = 0.4, number(0.0..=1.0, "");
        /// Fraction of the steps from which on the light has its full colour.
        colour_from: f64 = 0.6, number(0.0..=1.0, "");
        /// Initial radiance from every direction, before scale and tint are led to those of known fabrics.
        light_start: f64 = 1.5, number(1e-3..=1e3, "linear");
        /// Roughness that the maps start with.
        roughness_start: f64 = 0.7, number(0.3..=1.0, "");
        /// Metallic that the maps start with.
        metallic_start: f64 = 0.2, number(0.0..=1.0, "");
        /// Weight of the mean absolute differences between neighbouring texels of the light.
        light_smoothness: f64 = 5e-5, number(0.0..=1e3, "");
        /// Weight of the mean absolute differences between neighbouring texels of the diffuse map.
        diffuse_smoothness: f64 = 3e-4, number(0.0..=1e3, "");
        /// Weight of the mean of the metallic map: a region of similar colour becomes metal only where that lowers
        /// its mean squared error by more than this.
        metallic_pull: f64 = 2e-4, number(0.0..=1e3, "");
        /// Weight of metal's mean squared difference from the mean colour of metal of similar tint: nearly all
        /// that metal shows is the light.
        metal_colour_pull: f64 = 0.1, number(0.0..=1e3, "");
        /// Weight of the mean squared difference from roughness_start: without highlights roughness stays there.
        roughness_pull: f64 = 1e-3, number(0.0..=1e3, "");
        /// Fraction of the steps from which on patches with large errors count less; 1: all count alike to the end.
        reweight_from: f64 = 0.6, number(0.0..=1.0, "");
        /// Passes over all pixels that finish the diffuse map once light and surface are found; 0: it stays as the
        /// steps leave it.
        sharpening_passes: usize = 3, number(0.0..=1000.0, "");
        /// Fraction of the light samples that are drawn uniformly over the sphere.
        uniform_fraction: f64 = 0.25, number(0.0..=1.0, "");
        /// Samples for each pixel of the final images, rounded up to a multiple of 8.
        render_samples_per_pixel: usize = 16, number(8.0..=8e4, "");
    }
}

impl AppearanceSettings {
    /// Checks what several settings must be together; ranges are the table's.
    ///
    /// # Errors
    /// [`Error::Usage`](tessuto_core::Error::Usage) naming both settings.
    pub fn check_order(&self) -> Result<()> {
        ordered(
            "appearance.light_coarsest",
            self.light_coarsest as f64,
            "appearance.light_finest",
            self.light_finest as f64,
        )?;
        ordered(
            "appearance.light_finest",
            self.light_finest as f64,
            "appearance.light_rows",
            self.light_rows as f64,
        )?;
        ordered("appearance.grey_until", self.grey_until, "appearance.colour_from", self.colour_from)
    }
}
