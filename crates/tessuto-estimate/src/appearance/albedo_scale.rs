//! Scale and tint of the albedo, which images of a diffuse surface constrain only together with the light's.
//!
//! What is known beforehand: most fabrics have parts that are hardly dyed and reflect about 0.7 of the light
//! (bleached cotton 0.8, raw cotton 0.65), others are dyed all over, darker and of any hue; light is more or less
//! tinted, and cameras are exposed so that it lies within a certain range. So with the logarithms of brightness
//! and tint of the brightest part as it is seen, o, of its albedo, a, and of its light, l, all normal: o = a + l,
//! a of one of two kinds of cloth, and mean and variance of a given o follow in closed form. In effect a white
//! patch (Land and McCann 1971, "Lightness and retinex theory") that doubts itself.

use serde::{Deserialize, Serialize};

/// Fraction of the texels that count as the brightest part.
const PART: f64 = 0.05;
/// Highest albedo of a fabric.
pub(super) const HIGHEST: f64 = 0.9;

/// Kinds of cloth, by their brightest part.
const KINDS: [Kind; 2] = [
    Kind { probability: 0.7, albedo: 0.7, spread: 0.15, tint: 0.05 },
    Kind { probability: 0.3, albedo: 0.25, spread: 0.7, tint: 0.6 },
];
/// Irradiance over π of cloth in images whose brightest value is 1, and the standard deviation of its logarithm.
const LIGHT: f64 = 0.6;
const LIGHT_SPREAD: f64 = 0.5;
/// Standard deviation, per channel, of the logarithm of the light's tint.
const LIGHT_TINT: f64 = 0.3;

struct Kind {
    probability: f64,
    /// Mean albedo of the channels.
    albedo: f64,
    /// Standard deviation of its logarithm.
    spread: f64,
    /// That of the logarithm of the tint, per channel.
    tint: f64,
}

/// What is known of the albedo of the brightest part, the twentieth of what was seen that is not metal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AlbedoScale {
    /// Its mean, by channel; the maps have this scale.
    pub brightest: [f64; 3],
    /// Standard deviation of the logarithm of all maps' common factor: the factor lies within e^±this of 1 with
    /// a probability of two thirds.
    pub log_deviation: f64,
    /// The same of the factor of each channel beyond the common one.
    pub tint_log_deviation: f64,
    /// Probability that it is not dyed.
    pub undyed: f64,
}

/// Mean colour of the brightest of the texels of `diffuse`, planes [3, n], that count with `weights` `[n]`. `None`
/// if it is black, and without any.
pub(super) fn brightest(diffuse: &[f64], weights: &[f64]) -> Option<[f64; 3]> {
    let n = weights.len();
    let sum = |i: usize| diffuse[i] + diffuse[n + i] + diffuse[2 * n + i];
    let mut order: Vec<(f64, usize)> = (0..n).filter(|i| weights[*i] > 0.0).map(|i| (sum(i), i)).collect();
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let wanted = PART * order.iter().map(|(_, i)| weights[*i]).sum::<f64>();
    let (mut colour, mut total) = ([0.0; 3], 0.0);
    for (_, i) in order {
        (0..3).for_each(|c| colour[c] += weights[i] * diffuse[c * n + i]);
        total += weights[i];
        if total >= wanted {
            break;
        }
    }
    (total > 0.0 && colour.iter().all(|c| *c > 0.0)).then(|| colour.map(|c| c / total))
}

/// What to expect of the albedo of a part that is seen to have the linear colour `seen` > 0, albedo times
/// irradiance over π.
pub(super) fn expected(seen: [f64; 3]) -> AlbedoScale {
    let logs = seen.map(f64::ln);
    let mean = logs.iter().sum::<f64>() / 3.0;
    let tint = logs.map(|l| l - mean);
    let tint_square: f64 = tint.iter().map(|t| t * t).sum();
    let brightness = (seen.iter().sum::<f64>() / 3.0).ln() - LIGHT.ln();
    // Of each kind: log albedo and its variance, fraction of the tint and its variance, evidence.
    let given = KINDS.map(|kind| {
        let (light, cloth) = (LIGHT_SPREAD.powi(2), kind.spread.powi(2));
        let off = brightness - kind.albedo.ln();
        let log = kind.albedo.ln() + cloth / (cloth + light) * off;
        let (tint_light, tint_cloth) = (LIGHT_TINT.powi(2), kind.tint.powi(2));
        let share = tint_cloth / (tint_cloth + tint_light);
        // The tints of three channels sum to 0: two degrees of freedom.
        let exponent = off * off / (cloth + light) + tint_square / (tint_cloth + tint_light);
        let evidence =
            kind.probability * (-0.5 * exponent).exp() / ((cloth + light).sqrt() * (tint_cloth + tint_light));
        [log, cloth * light / (cloth + light), share, share * tint_light, evidence]
    });
    let total = given[0][4] + given[1][4];
    // Far from all that is known both vanish; dyed is the wider kind.
    let undyed = if total > 0.0 { given[0][4] / total } else { 0.0 };
    let mixed = |k: usize| undyed * given[0][k] + (1.0 - undyed) * given[1][k];
    let between = |k: usize| undyed * (1.0 - undyed) * (given[0][k] - given[1][k]).powi(2);
    let colour = tint.map(|t| (mixed(2) * t).exp());
    let scale = 3.0 * mixed(0).exp() / colour.iter().sum::<f64>();
    AlbedoScale {
        brightest: colour.map(|c| (scale * c).min(HIGHEST)),
        log_deviation: (mixed(1) + between(0)).sqrt(),
        tint_log_deviation: (mixed(3) + between(2) * tint_square / 2.0).sqrt(),
        undyed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tinted_light_is_taken_off_white_and_a_dyed_cloth_keeps_its_colour() {
        let warm = expected([0.55, 0.42, 0.33]);
        assert!(warm.brightest.iter().all(|a| (a / 0.7 - 1.0).abs() < 0.12), "{warm:?}");
        let red = expected([0.4, 0.04, 0.04]);
        assert!(red.brightest[0] > 3.0 * red.brightest[1] && red.brightest[0] <= HIGHEST, "{red:?}");
        assert!(
            red.tint_log_deviation > 2.0 * warm.tint_log_deviation && red.undyed < 0.1,
            "{red:?} {warm:?}"
        );
    }

    #[test]
    fn a_black_cloth_is_not_made_white_and_is_known_less_well() {
        let white = expected([0.42; 3]);
        let black = expected([0.02; 3]);
        let mean = |s: &AlbedoScale| s.brightest.iter().sum::<f64>() / 3.0;
        assert!((0.6..0.8).contains(&mean(&white)) && mean(&black) < 0.12, "{white:?} {black:?}");
        assert!(black.log_deviation > 1.5 * white.log_deviation, "{white:?} {black:?}");
        let nothing = expected([1e-30; 3]);
        assert!(nothing.brightest.iter().all(|a| a.is_finite() && *a > 0.0), "{nothing:?}");
    }

    #[test]
    fn the_brightest_part_leaves_out_what_has_no_weight() {
        let n = 100;
        let diffuse: Vec<f64> = (0..3 * n).map(|k| (k % n) as f64 / 100.0).collect();
        let all = brightest(&diffuse, &vec![1.0; n]).unwrap();
        assert!((all[0] - 0.97).abs() < 1e-9, "{all:?}");
        let weights: Vec<f64> = (0..n).map(|i| f64::from(i < 50)).collect();
        let half = brightest(&diffuse, &weights).unwrap();
        assert!(half.iter().all(|c| (0.46..0.50).contains(c)), "{half:?}");
        assert_eq!(brightest(&diffuse, &vec![0.0; n]), None);
    }
}
