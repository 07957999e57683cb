//! Limits on the length of gradients.

use std::collections::VecDeque;

/// Clips to a fixed norm, then to a quantile of the norms before this one
/// (Seetharaman et al. 2020, "AutoClip: Adaptive Gradient Clipping for Source Separation Networks").
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct GradientClip {
    limit: f64,
    quantile: f64,
    history: VecDeque<f64>,
    length: usize,
}

impl GradientClip {
    /// Fixed limit, quantile in [0, 1] and how many norms it is taken of.
    pub fn new(limit: f64, quantile: f64, length: usize) -> Self {
        Self { limit, quantile, history: VecDeque::new(), length }
    }

    /// Scales `gradient` down where needed; leaves one that is not finite alone.
    pub fn clip(&mut self, gradient: &mut [f64]) {
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        if !norm.is_finite() {
            return;
        }
        let limited = norm.min(self.limit);
        let target = self.quantile().map_or(limited, |quantile| limited.min(quantile));
        if self.history.len() == self.length {
            self.history.pop_front();
        }
        self.history.push_back(limited);
        if target < norm {
            gradient.iter_mut().for_each(|g| *g *= target / norm);
        }
    }

    /// Linear interpolation between the order statistics; `None` before the first norm.
    fn quantile(&self) -> Option<f64> {
        let mut sorted: Vec<f64> = self.history.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = self.quantile.clamp(0.0, 1.0) * last as f64;
        let low = at as usize;
        let high = (low + 1).min(last);
        Some(sorted[low] + (at - low as f64) * (sorted[high] - sorted[low]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_cut_to_the_quantile_of_the_last_norms() {
        let mut clip = GradientClip::new(1000.0, 0.75, 4);
        for norm in [9.0, 1.0, 2.0, 3.0] {
            clip.clip(&mut [norm]);
        }
        // Before it came 9, 1, 2, 3: their 0.75 quantile lies a quarter of the way from 3 to 9.
        let mut gradient = [100.0];
        clip.clip(&mut gradient);
        assert!((gradient[0] - 4.5).abs() < 1e-12, "{gradient:?}");
        // 9 is forgotten, and 100 is remembered as it was: of 1, 2, 3, 100 it lies a quarter of the way from 3 to 100.
        let mut gradient = [50.0];
        clip.clip(&mut gradient);
        assert!((gradient[0] - 27.25).abs() < 1e-12, "{gradient:?}");
    }

    #[test]
    fn the_first_gradient_has_nothing_to_be_compared_with() {
        let mut gradient = [100.0];
        GradientClip::new(1000.0, 0.75, 4).clip(&mut gradient);
        assert_eq!(gradient, [100.0]);
    }

    #[test]
    fn the_fixed_limit_comes_first() {
        let mut gradient = [3e4, 4e4];
        GradientClip::new(1000.0, 0.75, 11).clip(&mut gradient);
        assert!((gradient[0] - 600.0).abs() < 1e-9 && (gradient[1] - 800.0).abs() < 1e-9, "{gradient:?}");
    }
}
