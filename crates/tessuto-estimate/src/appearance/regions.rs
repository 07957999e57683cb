//! Regions of similar colour: what is printed with one ink, or woven of one yarn, shines alike.
//!
//! Lloyd's algorithm (Lloyd 1982, "Least squares quantization in PCM") from centres that are farthest from each other
//! (Gonzalez 1985, "Clustering to minimize the maximum intercluster distance"). Nothing is drawn at random.

use rayon::prelude::*;

/// Most regions.
pub(super) const MOST: usize = 16;
/// Rounds of Lloyd's algorithm.
const ROUNDS: usize = 8;
/// Colours nearer than this, in sRGB, are one region from the start.
const APART: f32 = 0.06;
/// Brightness counts less than hue: where a map is not yet right, it holds shading.
const BRIGHTNESS: f32 = 0.5;

/// Region of every texel, below [`MOST`], from `diffuse` linear colours as planes [3, n].
pub(super) fn regions(diffuse: &[f32]) -> Vec<u8> {
    let n = diffuse.len() / 3;
    let colours: Vec<[f32; 3]> =
        (0..n).into_par_iter().map(|i| opponent([diffuse[i], diffuse[n + i], diffuse[2 * n + i]])).collect();
    clusters(&colours, APART)
}

/// Cluster of every colour, below [`MOST`]; colours nearer than `apart` to each other are one from the start.
pub(super) fn clusters(colours: &[[f32; 3]], apart: f32) -> Vec<u8> {
    let mut centres = farthest(colours, apart);
    let mut labels = vec![0u8; colours.len()];
    for _ in 0..ROUNDS {
        labels.par_iter_mut().zip(colours).for_each(|(label, colour)| *label = nearest(&centres, colour));
        let mut sums = vec![[0.0f64; 4]; centres.len()];
        for (label, colour) in labels.iter().zip(colours) {
            let sum = &mut sums[usize::from(*label)];
            (0..3).for_each(|c| sum[c] += f64::from(colour[c]));
            sum[3] += 1.0;
        }
        for (centre, sum) in centres.iter_mut().zip(&sums) {
            if sum[3] > 0.0 {
                *centre = [0, 1, 2].map(|c| (sum[c] / sum[3]) as f32);
            }
        }
    }
    labels
}

/// Brightness, red against green, both against blue, of the sRGB colour.
fn opponent(linear: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = linear.map(|l| tessuto_core::image::srgb::encode(l.clamp(0.0, 1.0)));
    [BRIGHTNESS * (r + g + b) / 3.0, r - g, (r + g) / 2.0 - b]
}

fn square_distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

fn nearest(centres: &[[f32; 3]], colour: &[f32; 3]) -> u8 {
    let mut best = (f32::INFINITY, 0);
    for (k, centre) in centres.iter().enumerate() {
        let distance = square_distance(centre, colour);
        if distance < best.0 {
            best = (distance, k as u8);
        }
    }
    best.1
}

/// The mean, and at most [`MOST`] − 1 of the colours, none within `apart` of another.
fn farthest(colours: &[[f32; 3]], apart: f32) -> Vec<[f32; 3]> {
    let mut mean = [0.0f64; 3];
    colours.iter().for_each(|colour| (0..3).for_each(|c| mean[c] += f64::from(colour[c])));
    let mut centres = vec![mean.map(|m| (m / colours.len().max(1) as f64) as f32)];
    let mut distances = vec![f32::INFINITY; colours.len()];
    while centres.len() < MOST {
        let last = centres[centres.len() - 1];
        let update = |(d, colour): (&mut f32, &[f32; 3])| *d = d.min(square_distance(&last, colour));
        distances.par_iter_mut().zip(colours).for_each(update);
        // The first of the farthest.
        let far = distances.iter().enumerate().fold(
            (0, -1.0),
            |best: (usize, f32), (i, d)| {
                if *d > best.1 { (i, *d) } else { best }
            },
        );
        if far.1 < apart * apart {
            break;
        }
        centres.push(colours[far.0]);
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_are_told_apart_and_shading_is_not() {
        // Red and blue stripes, darker to the right by a third.
        let n = 64;
        let mut planes = vec![0.0; 3 * n];
        for i in 0..n {
            let shade = 1.0 - 0.33 * (i as f32 / n as f32);
            let ink = if i % 4 < 2 { [0.6, 0.1, 0.1] } else { [0.1, 0.15, 0.5] };
            (0..3).for_each(|c| planes[c * n + i] = shade * ink[c]);
        }
        let labels = regions(&planes);
        let of =
            |ink: usize| labels.iter().enumerate().filter(move |(i, _)| i % 4 / 2 == ink).map(|(_, l)| *l);
        assert!(of(0).all(|a| of(1).all(|b| a != b)), "{labels:?}");
        assert!(regions(&vec![0.4; 3 * n]).iter().all(|l| *l == 0));
    }
}
