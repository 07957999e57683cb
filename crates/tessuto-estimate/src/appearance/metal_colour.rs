//! Metal has few colours: foils and threads of one metal differ in how they shine, not in what they are made of.
//!
//! A metal shows nothing but the light that it mirrors, and of most directions of the light little is known: what
//! is wrong there comes out as streaks of colour. So metal of similar tint, however bright, is drawn to its mean
//! colour.

use super::regions::{MOST, clusters};

/// Metallic from which on a texel has a say in what its metal's colour is.
const METAL: f32 = 0.25;
/// Tints that are nearer than this to the mean of all, or to each other, are one metal at first, in fractions of
/// the sum of the sRGB channels: gold is 0.1 to 0.16 from silver, and what is wrong by the light 0.05 from what is
/// right.
const APART: f32 = 0.1;
/// A texel that is no metal.
const NONE: u8 = u8::MAX;

/// Metal of every texel of `diffuse`, planes [3, n], from the metallic plane `[n]`.
pub(super) fn metals(diffuse: &[f64], metallic: &[f32]) -> Vec<u8> {
    let n = metallic.len();
    let texels: Vec<usize> = (0..n).filter(|i| metallic[*i] >= METAL).collect();
    let tints: Vec<[f32; 3]> =
        texels.iter().map(|i| tint([0, 1, 2].map(|c| diffuse[c * n + i] as f32))).collect();
    let mut labels = vec![NONE; n];
    if !texels.is_empty() {
        texels.iter().zip(clusters(&tints, APART)).for_each(|(i, label)| labels[*i] = label);
    }
    labels
}

/// Red against green, both against blue, whatever the brightness.
fn tint(linear: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = linear.map(|l| tessuto_core::image::srgb::encode(l.clamp(0.0, 1.0)));
    let sum = (r + g + b).max(1e-3);
    [(r - g) / sum, ((r + g) / 2.0 - b) / sum, 0.0]
}

/// Adds the gradient of `weight` times the mean over all n texels of metallic · |colour − mean colour of the
/// metal|², by channel, to `gradient`, planes [3, n] as `diffuse`.
pub(super) fn add_gradient(
    diffuse: &[f64],
    metallic: &[f32],
    metals: &[u8],
    weight: f64,
    gradient: &mut [f64],
) {
    let n = metallic.len();
    let of = |i: usize| (metals[i] != NONE).then(|| (usize::from(metals[i]), f64::from(metallic[i])));
    let planes = diffuse.chunks_exact(n).zip(gradient.chunks_exact_mut(n));
    for (plane, gradient) in planes {
        let mut sums = [[0.0; 2]; MOST];
        for (i, value) in plane.iter().enumerate() {
            let Some((metal, m)) = of(i) else { continue };
            sums[metal][0] += m * value;
            sums[metal][1] += m;
        }
        for (i, value) in plane.iter().enumerate() {
            let Some((metal, m)) = of(i) else { continue };
            // The mean moves along, but the sum of the differences from it is 0.
            gradient[i] += 2.0 * weight / n as f64 * m * (value - sums[metal][0] / sums[metal][1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn gold_bright_or_dull_is_one_metal_and_silver_another() {
        let inks = [[0.9, 0.7, 0.25], [0.3, 0.233, 0.083], [0.6, 0.6, 0.6], [0.1, 0.3, 0.5]];
        let n = 40;
        let diffuse: Vec<f64> = (0..3 * n).map(|k| inks[k % n % 4][k / n]).collect();
        let metallic: Vec<f32> = (0..n).map(|i| if i % 4 == 3 { 0.0 } else { 0.6 }).collect();
        let metals = metals(&diffuse, &metallic);
        assert_eq!(metals[0], metals[1], "{metals:?}");
        assert!(metals[2] != metals[0] && metals[3] == NONE && metals[2] != NONE, "{metals:?}");
        let paint = super::metals(&diffuse, &vec![0.0; n]);
        assert!(paint.iter().all(|metal| *metal == NONE));
    }

    #[test]
    fn gradient_of_the_metals_colour_matches_differences() {
        let mut rng = Rng::new(6, 0);
        let n = 30;
        let diffuse: Vec<f64> = (0..3 * n).map(|_| rng.uniform()).collect();
        let metallic: Vec<f32> = (0..n).map(|_| rng.uniform() as f32).collect();
        let metals: Vec<u8> = (0..n).map(|i| if i % 5 == 4 { NONE } else { (i % 2) as u8 }).collect();
        let weight = 0.4;
        let mut gradient = vec![0.0; 3 * n];
        add_gradient(&diffuse, &metallic, &metals, weight, &mut gradient);
        let value = |d: &[f64]| {
            let mut sum = 0.0;
            for (plane, metal) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
                let of: Vec<usize> = (0..n).filter(|i| metals[*i] == metal).collect();
                let m = |i: usize| f64::from(metallic[i]);
                let at = |i: usize| d[plane * n + i];
                let mean =
                    of.iter().map(|i| m(*i) * at(*i)).sum::<f64>() / of.iter().map(|i| m(*i)).sum::<f64>();
                sum += of.iter().map(|i| m(*i) * (at(*i) - mean).powi(2)).sum::<f64>();
            }
            weight / n as f64 * sum
        };
        let worst = check(&diffuse, &gradient, 1e-4, 8, 5, value);
        assert!(worst.relative_error < 1e-6, "{:.1e}", worst.relative_error);
    }
}
