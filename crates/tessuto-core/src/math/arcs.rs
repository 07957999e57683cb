//! Inverse cosine and tangent of four numbers at a time, without branches, to two units in the last place. The plain
//! twin is the standard library's.
//!
//! Sources: the rational functions of Sun's fdlibm (arcsine) and of Moshier's Cephes (arctangent).

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::lanes::Lanes;

/// (asin √z − √z)/√z for z up to ¼ is z P(z)/Q(z).
const SINE_P: [f64; 6] = [
    3.479_331_075_960_212e-5,
    7.915_349_942_898_145e-4,
    -4.005_553_450_067_941e-2,
    2.012_125_321_348_629_3e-1,
    -3.255_658_186_224_009e-1,
    1.666_666_666_666_666_6e-1,
];
const SINE_Q: [f64; 5] = [
    7.703_815_055_590_194e-2,
    -6.882_839_716_054_533e-1,
    2.020_945_760_233_505_7,
    -2.403_394_911_734_414,
    1.0,
];
/// (atan √z − √z)/√z for √z up to [`TANGENT_LIMIT`], likewise.
const TANGENT_P: [f64; 5] = [
    -8.750_608_600_031_904e-1,
    -1.615_753_718_733_365e1,
    -7.500_855_792_314_705e1,
    -1.228_866_684_490_136_2e2,
    -6.485_021_904_942_025e1,
];
const TANGENT_Q: [f64; 6] = [
    1.0,
    2.485_846_490_142_306_3e1,
    1.650_270_098_316_988_5e2,
    4.328_810_604_912_903e2,
    4.853_903_996_359_137e2,
    1.945_506_571_482_614e2,
];
/// Larger tangents are turned by an eighth of a circle.
const TANGENT_LIMIT: f64 = 0.66;

/// acos x, for x from −1 to 1.
#[inline(always)]
pub(super) fn acos(x: Lanes) -> Lanes {
    let size = x.abs();
    let is_small = size.simd_le(Lanes::HALF);
    let z = is_small.select(x * x, (Lanes::ONE - size) * Lanes::HALF);
    let s = is_small.select(size, z.sqrt());
    let arcsine = s + s * (z * polynomial(z, SINE_P) / polynomial(z, SINE_Q));
    let is_negative = x.simd_lt(Lanes::ZERO);
    // π/2 ∓ asin |x|, or 2 asin √((1 − |x|)/2) and what is missing to π.
    let double = arcsine + arcsine;
    let signed = is_negative.select(-arcsine, arcsine);
    let far = is_negative.select(Lanes::splat(PI) - double, double);
    is_small.select(Lanes::splat(FRAC_PI_2) - signed, far)
}

/// Angle of the point (x, y) from the first axis.
#[inline(always)]
pub(super) fn atan2(y: Lanes, x: Lanes) -> Lanes {
    let (rise, run) = (y.abs(), x.abs());
    let is_steep = rise.simd_gt(run);
    let (low, high) = (is_steep.select(run, rise), is_steep.select(rise, run));
    let is_turned = low.simd_gt(high * Lanes::splat(TANGENT_LIMIT));
    let below = is_turned.select(high + low, high);
    // The origin has the angle 0.
    let below = below.simd_gt(Lanes::ZERO).select(below, Lanes::ONE);
    let t = is_turned.select(low - high, low) / below;
    let z = t * t;
    let near = t + t * (z * polynomial(z, TANGENT_P) / polynomial(z, TANGENT_Q));
    let angle = is_turned.select(near + Lanes::splat(FRAC_PI_4), near);
    let angle = is_steep.select(Lanes::splat(FRAC_PI_2) - angle, angle);
    let angle = x.simd_lt(Lanes::ZERO).select(Lanes::splat(PI) - angle, angle);
    y.simd_lt(Lanes::ZERO).select(-angle, angle)
}

#[inline(always)]
fn polynomial<const N: usize>(z: Lanes, coefficients: [f64; N]) -> Lanes {
    let [first, rest @ ..] = &coefficients[..] else { return Lanes::ZERO };
    rest.iter().fold(Lanes::splat(*first), |sum, c| sum * z + Lanes::splat(*c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    /// In units of the last place of `exact`.
    fn off(found: f64, exact: f64) -> f64 {
        (found - exact).abs() / (f64::EPSILON * exact.abs()).max(f64::MIN_POSITIVE)
    }

    #[test]
    fn they_are_the_standard_library_s() {
        let mut rng = Rng::new(3, 0);
        let mut worst = [0.0f64; 2];
        let edges = [0.0, 0.5, -0.5, 1.0, -1.0, 0.66, 1e-9, -1e-9];
        for k in 0..40_000 {
            let mut number = || match k < 64 {
                true => [edges[k % 8], edges[k / 8]],
                // Of any size, and near a ray.
                false => [rng.signed(), rng.signed() * if k % 2 == 0 { 1.0 } else { 1e-4 }],
            };
            let pairs: [[f64; 2]; 4] = std::array::from_fn(|_| number());
            let [x, y] = [0, 1].map(|c| Lanes::new(pairs.map(|pair| pair[c])));
            let (cosines, angles) = (acos(x).to_array(), atan2(y, x).to_array());
            for (lane, [x, y]) in pairs.into_iter().enumerate() {
                worst[0] = worst[0].max(off(cosines[lane], x.acos()));
                worst[1] = worst[1].max(off(angles[lane], y.atan2(x)));
            }
        }
        println!("acos within {:.2}, atan2 within {:.2} units in the last place", worst[0], worst[1]);
        assert!(worst.iter().all(|off| *off < 2.5), "{worst:?}");
    }
}
