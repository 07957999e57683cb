//! Colour maps of the images.

/// sRGB-encoded colour in [0, 1].
pub type Colour = [f32; 3];

/// Of pixels without a value.
pub const NOTHING: Colour = [0.88, 0.88, 0.88];
/// Of fabric for which there is nothing to compare with.
pub const UNKNOWN: Colour = [0.72, 0.72, 0.72];

/// Viridis (van der Walt, Smith; public domain): nine of its colours.
const VIRIDIS: [Colour; 9] = encoded([
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
]);

/// Inferno (van der Walt, Smith; public domain): nine of its colours, black at 0.
const INFERNO: [Colour; 9] = encoded([
    [0, 0, 4],
    [33, 12, 74],
    [87, 16, 110],
    [138, 34, 106],
    [188, 55, 84],
    [228, 90, 49],
    [249, 142, 9],
    [249, 203, 53],
    [252, 255, 164],
]);

/// Blue, white, red: even steps of lightness to both sides of the middle.
const SIGNED: [Colour; 5] =
    encoded([[24, 74, 160], [112, 162, 219], [247, 247, 247], [236, 132, 100], [168, 24, 38]]);

/// Colour of `fraction` in [0, 1] for amounts: dark blue, green, yellow.
pub fn sequential(fraction: f32) -> Colour {
    interpolate(&VIRIDIS, fraction)
}

/// Colour of `fraction` in [0, 1] for errors: black, red, yellow.
pub fn heat(fraction: f32) -> Colour {
    interpolate(&INFERNO, fraction)
}

/// Colour of `value` in [−1, 1]: blue below zero, white at zero, red above.
pub fn diverging(value: f32) -> Colour {
    interpolate(&SIGNED, 0.5 + 0.5 * value)
}

/// The straight line from `a` at `fraction` = 0 to `b` at 1.
pub fn mix(a: Colour, b: Colour, fraction: f32) -> Colour {
    [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * fraction)
}

fn interpolate(stops: &[Colour], fraction: f32) -> Colour {
    let at = fraction.clamp(0.0, 1.0) * (stops.len() - 1) as f32;
    let k = (at as usize).min(stops.len() - 2);
    mix(stops[k], stops[k + 1], at - k as f32)
}

/// Of bytes.
const fn encoded<const N: usize>(bytes: [[u8; 3]; N]) -> [Colour; N] {
    let mut out = [[0.0; 3]; N];
    let mut k = 0;
    while k < 3 * N {
        out[k / 3][k % 3] = bytes[k / 3][k % 3] as f32 / 255.0;
        k += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_grow_lighter_and_signs_are_mirrored() {
        let lightness = |c: Colour| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        for map in [sequential, heat] {
            let steps: Vec<f32> = (0..=64).map(|k| lightness(map(k as f32 / 64.0))).collect();
            assert!(steps.is_sorted(), "{steps:?}");
        }
        assert!(diverging(1.0)[0] > diverging(1.0)[2] && diverging(-1.0)[2] > diverging(-1.0)[0]);
        assert_eq!(diverging(0.0)[0], diverging(0.0)[2]);
        assert_eq!(diverging(7.0), diverging(1.0));
    }
}
