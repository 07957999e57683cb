//! Finite-difference checks of derivatives, for tests and for trying out new terms.

use super::rng::Rng;

/// Outcome of [`check`]: the worst direction and how far apart the two derivatives are there.
#[derive(Debug, Clone, Copy)]
pub struct Worst {
    /// Derivative along the direction from the gradient.
    pub analytic: f64,
    /// Difference along the direction, at the step that agrees best.
    pub numeric: f64,
    /// |analytic − numeric| / max(|analytic|, |numeric|, floor · gradient norm).
    pub relative_error: f64,
}

/// Floor of the relative error of [`check`].
const FLOOR: f64 = 1e-3;

/// Compares `gradient` (∂f/∂x, as long as `x`) with central differences of `f` along `directions`
/// random directions, each at the best of the steps `step`·{10, 3, 1, 0.3, 0.1} and of the extrapolations from two
/// successive ones, and returns the worst direction.
///
/// # Panics
/// If the gradient is zero, so that zero never matches zero, or if any value is not finite.
pub fn check(
    x: &[f64],
    gradient: &[f64],
    step: f64,
    directions: usize,
    seed: u64,
    f: impl FnMut(&[f64]) -> f64,
) -> Worst {
    check_above(FLOOR, x, gradient, step, directions, seed, f)
}

/// [`check`] of a function of coarse numbers, such as sums over images of 32 bits: in a direction in which the gradient
/// nearly cancels they show rounding only, so errors are relative to the root mean square of the derivatives in
/// all directions, gradient norm/√n, at least.
///
/// # Panics
/// As [`check`].
pub fn check_coarse(
    x: &[f64],
    gradient: &[f64],
    step: f64,
    directions: usize,
    seed: u64,
    f: impl FnMut(&[f64]) -> f64,
) -> Worst {
    check_above((x.len() as f64).sqrt().recip(), x, gradient, step, directions, seed, f)
}

fn check_above(
    floor: f64,
    x: &[f64],
    gradient: &[f64],
    step: f64,
    directions: usize,
    seed: u64,
    mut f: impl FnMut(&[f64]) -> f64,
) -> Worst {
    assert_eq!(x.len(), gradient.len());
    let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
    assert!(norm.is_finite() && norm > 0.0, "the gradient's norm is {norm}: nothing to compare");
    let mut rng = Rng::new(seed, 77);
    let mut worst = Worst { analytic: 0.0, numeric: 0.0, relative_error: -1.0 };
    for _ in 0..directions {
        let direction: Vec<f64> = x.iter().map(|_| rng.signed()).collect();
        let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
        let analytic = direction.iter().zip(gradient).map(|(d, g)| d / length * g).sum::<f64>();
        let mut best = Worst { analytic, numeric: f64::NAN, relative_error: f64::INFINITY };
        let mut coarser: Option<(f64, f64)> = None;
        for scale in [10.0, 3.0, 1.0, 0.3, 0.1] {
            let h = step * scale;
            let mut moved = |s: f64| {
                f(&x.iter().zip(&direction).map(|(x, d)| x + s * h * d / length).collect::<Vec<_>>())
            };
            let central = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            assert!(central.is_finite(), "the function is not finite near x");
            // Two steps together cancel the error of second order (Richardson).
            let extrapolated = coarser.map(|(h1, d1)| {
                let q = (h / h1).powi(2);
                (central - q * d1) / (1.0 - q)
            });
            coarser = Some((h, central));
            for numeric in [Some(central), extrapolated].into_iter().flatten() {
                let scale = analytic.abs().max(numeric.abs()).max(floor * norm);
                let relative_error = (analytic - numeric).abs() / scale;
                if relative_error < best.relative_error {
                    best = Worst { analytic, numeric, relative_error };
                }
            }
        }
        if best.relative_error > worst.relative_error {
            worst = best;
        }
    }
    worst
}
