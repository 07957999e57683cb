//! Roughness and metallic, one of each per region of similar colour.

use serde::{Deserialize, Serialize};

use super::regions::MOST;
use tessuto_core::optim::Adam;

/// Limits of roughness and metallic.
pub(super) const LIMITS: [[f64; 2]; 2] = [[0.3, 1.0], [0.0, 1.0]];

/// Prior of surfaces that show no highlight.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePrior {
    /// Weight of the mean metallic.
    pub metallic: f64,
    /// Weight of the mean squared difference from `roughness`.
    pub roughness_weight: f64,
    /// Roughness.
    pub roughness: f64,
}

impl SurfacePrior {
    /// Adds the gradient of the prior with respect to the `values` of regions that cover these `areas` of the map.
    fn add_gradient(&self, values: &[f64], areas: &[f64; MOST], gradient: &mut [f64]) {
        for (k, area) in areas.iter().enumerate() {
            gradient[k] += 2.0 * self.roughness_weight * area * (values[k] - self.roughness);
            gradient[MOST + k] += self.metallic * area;
        }
    }
}

/// Roughness and metallic of the regions.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Surfaces {
    /// Region of every texel.
    labels: Vec<u8>,
    /// Shape [2, [`MOST`]].
    values: Vec<f64>,
    adam: Adam,
}

impl Surfaces {
    /// All regions have this `roughness` and `metallic`.
    pub fn new(labels: Vec<u8>, roughness: f64, metallic: f64) -> Self {
        let values = [roughness, metallic].iter().flat_map(|v| [*v; MOST]).collect();
        Self { labels, values, adam: Adam::new(2 * MOST, 1.0) }
    }

    /// Whether it is the state of a map of `texels`.
    pub fn matches(&self, texels: usize) -> bool {
        self.labels.len() == texels
            && self.labels.iter().all(|l| usize::from(*l) < MOST)
            && self.values.len() == 2 * MOST
            && self.adam.matches(2 * MOST)
    }

    /// Roughness (0) or metallic (1) of every texel.
    pub fn plane(&self, channel: usize) -> impl Iterator<Item = f32> {
        let values = &self.values[channel * MOST..][..MOST];
        self.labels.iter().map(|label| values[usize::from(*label)] as f32)
    }

    /// Goes on with other regions, which start from the means of what they were.
    pub fn regroup(&mut self, labels: Vec<u8>) {
        let mut sums = vec![[0.0; 3]; MOST];
        for (old, new) in self.labels.iter().zip(&labels) {
            let (sum, old) = (&mut sums[usize::from(*new)], usize::from(*old));
            sum[0] += self.values[old];
            sum[1] += self.values[MOST + old];
            sum[2] += 1.0;
        }
        for (k, sum) in sums.iter().enumerate().filter(|(_, sum)| sum[2] > 0.0) {
            self.values[k] = sum[0] / sum[2];
            self.values[MOST + k] = sum[1] / sum[2];
        }
        self.adam = Adam::new(2 * MOST, 1.0);
        self.labels = labels;
    }

    /// Moves against the `gradient` of a loss with respect to the planes [2, n], and against the prior's.
    pub fn step(&mut self, gradient: &[f32], prior: &SurfacePrior, rate: f64) {
        let n = self.labels.len();
        let mut total = vec![0.0; 2 * MOST];
        let mut areas = [0.0; MOST];
        for (i, label) in self.labels.iter().enumerate() {
            let k = usize::from(*label);
            total[k] += f64::from(gradient[i]);
            total[MOST + k] += f64::from(gradient[n + i]);
            areas[k] += 1.0 / n as f64;
        }
        prior.add_gradient(&self.values, &areas, &mut total);
        self.adam.set_learning_rate(rate);
        self.adam.step(&mut self.values, &total, 1.0);
        for (values, [low, high]) in self.values.chunks_exact_mut(MOST).zip(LIMITS) {
            values.iter_mut().for_each(|v| *v = v.clamp(low, high));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn gradient_of_the_surfaces_prior_matches_differences() {
        let mut rng = Rng::new(9, 0);
        let prior = SurfacePrior { metallic: 0.3, roughness_weight: 0.8, roughness: 0.7 };
        let values: Vec<f64> = (0..2 * MOST).map(|_| rng.uniform()).collect();
        let areas: [f64; MOST] = std::array::from_fn(|_| rng.uniform());
        let mut gradient = vec![0.0; 2 * MOST];
        prior.add_gradient(&values, &areas, &mut gradient);
        let value = |v: &[f64]| {
            let of = |k: usize| 0.8 * (v[k] - 0.7).powi(2) + 0.3 * v[MOST + k];
            (0..MOST).map(|k| areas[k] * of(k)).sum()
        };
        let worst = check(&values, &gradient, 1e-4, 8, 5, value);
        assert!(worst.relative_error < 1e-6, "{:.1e}", worst.relative_error);
    }
}
