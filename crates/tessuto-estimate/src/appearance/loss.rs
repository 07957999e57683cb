//! Squared difference of sRGB colours from two noisy estimates of the linear colour.

use tessuto_core::image::srgb;

/// Observed values from here on are as bright as the camera can measure.
pub(super) const SATURATED: f32 = 0.998;

/// Value and derivatives with respect to both linear `estimates`, summed over the channels, of r_a r_b with
/// r = sRGB(estimate) − observed: with independent estimates its mean is the square of the mean residual, so that
/// noise does not count as error. Where the observation is saturated, brighter estimates are right.
pub(super) fn loss(observed: [f32; 3], estimates: &[[f32; 3]; 2]) -> (f32, [[f32; 3]; 2]) {
    let mut value = 0.0;
    let mut adjoints = [[0.0; 3]; 2];
    for c in 0..3 {
        let [a, b] = [0, 1].map(|k| {
            let l = estimates[k][c];
            let residual = srgb::encode(l) - observed[c];
            let right = observed[c] >= SATURATED && residual > 0.0;
            if right { [0.0; 2] } else { [residual, srgb::encode_slope(l)] }
        });
        value += a[0] * b[0];
        adjoints[0][c] = b[0] * a[1];
        adjoints[1][c] = a[0] * b[1];
    }
    (value, adjoints)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_central_differences_and_saturation_is_one_sided() {
        let observed = [0.3, 0.7, 1.0];
        let at = [[0.2, 0.3, 0.8], [0.15, 0.5, 0.9]];
        let (_, adjoints) = loss(observed, &at);
        let mut worst: f32 = 0.0;
        for k in 0..2 {
            for c in 0..3 {
                let moved = |h: f32| {
                    let mut x = at;
                    x[k][c] += h;
                    loss(observed, &x).0
                };
                let numeric = (moved(1e-3) - moved(-1e-3)) / 2e-3;
                worst = worst.max((numeric - adjoints[k][c]).abs() / numeric.abs().max(1e-2));
            }
        }
        eprintln!("worst relative error {worst:.1e}");
        assert!(worst < 1e-2);
        assert_eq!(loss([1.0; 3], &[[1.5; 3], [3.0; 3]]), (0.0, [[0.0; 3]; 2]));
    }
}
