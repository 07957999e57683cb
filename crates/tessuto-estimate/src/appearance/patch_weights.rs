//! Robust weights per triangle and frame.
//!
//! Where the motion is off, pixels show another part of the cloth than the estimate thinks, and no material explains
//! them. The mean squared error s_c of a patch c (a triangle in a frame), known without the noise of rendering from
//! two independent estimates, shows where: patches count with 1/(s_c + s), s the median, as observations of unequal
//! noise do. Weights of single pixels would follow the noise, see docs/experiments/log/appearance.md.

use serde::{Deserialize, Serialize};

/// Errors that a patch is given at first, all equal to its frame's mean.
const PRIOR: f32 = 10.0;

/// Errors of the patches so far.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct PatchWeights {
    triangles: usize,
    /// Sum and number of squared errors, shape [frames · triangles].
    errors: Vec<(f32, f32)>,
    /// Weight of each patch, 1 in the mean over the errors; empty: all are 1.
    weights: Vec<f32>,
}

impl PatchWeights {
    /// All patches count alike.
    pub fn new(frames: usize, triangles: usize) -> Self {
        Self { triangles, errors: vec![(0.0, 0.0); frames * triangles], weights: Vec::new() }
    }

    /// Whether it has as many patches as `other`.
    pub fn matches(&self, other: &Self) -> bool {
        let count = other.errors.len();
        self.triangles == other.triangles
            && self.errors.len() == count
            && (self.weights.is_empty() || self.weights.len() == count)
    }

    /// Notes the squared error of a pixel that shows `patch`, not weighted; one estimate of it may be negative.
    pub fn note(&mut self, patch: u32, error: f32) {
        let (sum, count) = &mut self.errors[patch as usize];
        *sum += error;
        *count += 1.0;
    }

    /// Weight of `patch`.
    pub fn weight(&self, patch: u32) -> f32 {
        self.weights.get(patch as usize).copied().unwrap_or(1.0)
    }

    /// Finds the weights from the errors noted so far.
    pub fn update(&mut self) {
        let total = |errors: &[(f32, f32)]| errors.iter().fold((0.0f64, 0.0f64), add);
        let mut means = Vec::with_capacity(self.errors.len());
        for frame in self.errors.chunks_exact(self.triangles) {
            let (sum, count) = total(frame);
            let mean = (sum / count.max(1.0)).max(0.0) as f32;
            means.extend(frame.iter().map(|(s, n)| ((s + PRIOR * mean) / (n + PRIOR)).max(0.0)));
        }
        let seen = || self.errors.iter().zip(&means).filter(|((_, n), _)| *n > 0.0);
        let mut sorted: Vec<f32> = seen().map(|(_, mean)| *mean).collect();
        if sorted.is_empty() {
            return;
        }
        sorted.sort_unstable_by(f32::total_cmp);
        let median = sorted[sorted.len() / 2].max(1e-8);
        let weight = |mean: f32| 1.0 / (mean + median);
        let weighted = seen().map(|((_, n), mean)| (weight(*mean) * n, *n));
        let (sum, count) = weighted.fold((0.0f64, 0.0f64), |s, v| add(s, &v));
        let scale = (count / sum) as f32;
        self.weights = means.iter().map(|mean| scale * weight(*mean)).collect();
    }
}

fn add(sum: (f64, f64), value: &(f32, f32)) -> (f64, f64) {
    (sum.0 + f64::from(value.0), sum.1 + f64::from(value.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_patches_count_less_and_the_mean_weight_is_one() {
        let mut weights_by_patch = PatchWeights::new(2, 3);
        assert_eq!(weights_by_patch.weight(5), 1.0);
        for k in 0..600u32 {
            let patch = k % 6;
            weights_by_patch.note(patch, if patch == 4 { 0.09 } else { 0.01 });
        }
        weights_by_patch.update();
        let weights: Vec<f32> = (0..6).map(|p| weights_by_patch.weight(p)).collect();
        assert!((weights.iter().sum::<f32>() - 6.0).abs() < 1e-4, "{weights:?}");
        assert!(
            weights[4] < 0.3 * weights[0] && weights[3] < weights[0] && weights[3] > weights[4],
            "{weights:?}"
        );
    }
}
