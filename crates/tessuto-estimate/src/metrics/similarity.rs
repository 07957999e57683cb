//! Image similarity: PSNR, SSIM and correlation.

use tessuto_core::image::{Image, srgb};

/// Peak signal-to-noise ratio `[dB]` of values in [0, 1]: −10 log10 mean (a − b)², at most 120.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squared = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    -10.0 * (squared.sum::<f64>() / a.len() as f64).max(1e-12).log10()
}

/// The factor per channel of linear colour that brings `estimate` nearest to `truth`, argmin_k ‖k e − t‖² = Σ e t
/// / Σ e²; both are sRGB-encoded, shape [pixels, 3].
pub fn best_scale(estimate: &[f32], truth: &[f32]) -> [f64; 3] {
    assert_eq!(estimate.len(), truth.len());
    let (mut et, mut ee) = ([0.0; 3], [0.0; 3]);
    for (e, t) in estimate.chunks_exact(3).zip(truth.chunks_exact(3)) {
        for c in 0..3 {
            let (e, t) = (srgb::decode_f64(e[c].into()), srgb::decode_f64(t[c].into()));
            et[c] += e * t;
            ee[c] += e * e;
        }
    }
    std::array::from_fn(|c| et[c] / f64::max(ee[c], 1e-12))
}

/// sRGB-encoded colours, shape [pixels, 3], with their linear values multiplied by `scale` and cut off at 1.
pub fn scaled(colours: &[f32], scale: [f64; 3]) -> Vec<f32> {
    let value = |(k, v): (usize, &f32)| {
        srgb::encode_f64((srgb::decode_f64((*v).into()) * scale[k % 3]).clamp(0.0, 1.0)) as f32
    };
    colours.iter().enumerate().map(value).collect()
}

/// [`psnr`] of all channels of the pixels that are `covered`, shape [height · width]; None where none is.
pub fn masked_psnr(a: &Image, b: &Image, covered: &[bool]) -> Option<f64> {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    let (a, b) = (taken(a, covered), taken(b, covered));
    (!a.is_empty()).then(|| psnr(&a, &b))
}

/// The covered pixels' values, shape [covered, channels].
pub(super) fn taken(image: &Image, covered: &[bool]) -> Vec<f32> {
    let pixels = image.data.chunks_exact(image.channels).zip(covered);
    pixels.filter(|(_, c)| **c).flat_map(|(p, _)| p.iter().copied()).collect()
}

/// Pearson's correlation; None where either is (nearly) constant.
pub fn correlation(a: &[f32], b: &[f32]) -> Option<f64> {
    assert_eq!(a.len(), b.len());
    let count = a.len() as f64;
    let mean = |v: &[f32]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
    let (ma, mb) = (mean(a), mean(b));
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (da, db) = (f64::from(*a) - ma, f64::from(*b) - mb);
        aa += da * da;
        bb += db * db;
        ab += da * db;
    }
    // A quarter of a grey level of 8 bits: less is not variation of an image.
    let constant = |sum: f64| (sum / count).sqrt() < 1e-3;
    (!a.is_empty() && !constant(aa) && !constant(bb)).then(|| ab / (aa * bb).sqrt())
}

/// Boxes across the covered part.
const ACROSS: f64 = 64.0;
/// Tiles along each side of the covered part.
const TILES: usize = 8;
/// Images that vary by less than this, as standard deviation within tiles, have nothing to compare.
const PLAIN: f64 = 0.02;

/// Sums over the pixels of a tile: products of two of 1, x, y, a, b; x and y `[px]`, a and b grey values.
#[derive(Clone, Copy, Default)]
struct Tile {
    sums: [f64; 15],
}

impl Tile {
    fn add(&mut self, x: f64, y: f64, a: f64, b: f64) {
        let products =
            [1.0, x, y, a, b, x * x, x * y, y * y, x * a, x * b, y * a, y * b, a * a, a * b, b * b];
        self.sums.iter_mut().zip(products).for_each(|(sum, v)| *sum += v);
    }

    /// Σa², Σab, Σb² of the residuals of a and b without the plane c₀ + c₁ x + c₂ y that is nearest to each.
    fn without_planes(&self) -> [f64; 3] {
        let [n, x, y, a, b, xx, xy, yy, xa, xb, ya, yb, aa, ab, bb] = self.sums;
        let centred = |uv: f64, u: f64, v: f64| uv - u * v / n;
        // First what goes with x, then what goes with the part of y that x does not explain.
        let over = |v: f64, w: f64| if w > 1e-9 { v / w } else { 0.0 };
        let xx = centred(xx, x, x);
        let slope = over(centred(xy, x, y), xx);
        let [xa, xb] = [centred(xa, x, a), centred(xb, x, b)];
        let [va, vb] = [centred(ya, y, a) - slope * xa, centred(yb, y, b) - slope * xb];
        let vv = centred(yy, y, y) - slope * centred(xy, x, y);
        let left = |uv: f64, u: f64, v: f64, [xu, xv]: [f64; 2], [vu, vw]: [f64; 2]| {
            centred(uv, u, v) - over(xu * xv, xx) - over(vu * vw, vv)
        };
        [
            left(aa, a, a, [xa, xa], [va, va]).max(0.0),
            left(ab, a, b, [xa, xb], [va, vb]),
            left(bb, b, b, [xb, xb], [vb, vb]).max(0.0),
        ]
    }
}

/// Grey values of two images, means of the channels and of the covered pixels of boxes.
struct Boxes {
    /// Boxes across and down the covered part.
    size: [usize; 2],
    /// Column, row and the two values of each box that is covered by half or more.
    values: Vec<([usize; 2], [f64; 2])>,
}

impl Boxes {
    /// Boxes of whole pixels, such that the covered part is about [`ACROSS`] of them across. None where nothing is
    /// covered.
    fn new(a: &Image, b: &Image, covered: &[bool]) -> Option<Self> {
        let places = || (0..covered.len()).filter(|i| covered[*i]).map(|i| (i % a.width, i / a.width));
        let count = places().count();
        let (x0, y0) = places().fold((a.width, a.height), |(x, y), p| (x.min(p.0), y.min(p.1)));
        let (x1, y1) = places().fold((0, 0), |(x, y), p| (x.max(p.0 + 1), y.max(p.1 + 1)));
        if count == 0 {
            return None;
        }
        let side = (((count as f64).sqrt() / ACROSS).round() as usize).max(1);
        let size @ [columns, rows] = [(x1 - x0).div_ceil(side), (y1 - y0).div_ceil(side)];
        let mut sums = vec![[0.0; 3]; columns * rows];
        for (x, y) in places() {
            let grey =
                |image: &Image| f64::from(image.pixel(x, y).iter().sum::<f32>()) / image.channels as f64;
            let sum = &mut sums[(y - y0) / side * columns + (x - x0) / side];
            sum.iter_mut().zip([1.0, grey(a), grey(b)]).for_each(|(sum, v)| *sum += v);
        }
        let whole = (side * side) as f64;
        let kept = sums.iter().enumerate().filter(|(_, [n, ..])| 2.0 * n >= whole);
        let values = kept.map(|(k, [n, a, b])| ([k % columns, k / columns], [a / n, b / n])).collect();
        Some(Self { size, values })
    }
}

/// Normalised cross-correlation within tiles, how well the patterns of two images lie on each other: Σ_t cov_t(a,
/// b) / Σ_t σ_t(a) σ_t(b) over 8×8 tiles t of the covered part's bounding box, of the channels' mean without its
/// plane in the tile. 1 is the same pattern, 0 another one. Light that brightens or darkens a tile as a whole, and
/// what it adds across a tile evenly, make no difference. Large images are first averaged over boxes, some 64
/// across the covered part: then a displacement counts by its part of the whole, and neither grain nor threads do.
/// None where an image is plain.
pub fn local_correlation(a: &Image, b: &Image, covered: &[bool]) -> Option<f64> {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    let boxes = Boxes::new(a, b, covered)?;
    let [columns, rows] = boxes.size;
    let mut tiles = [Tile::default(); TILES * TILES];
    for ([x, y], [a, b]) in &boxes.values {
        let (across, down) = (x * TILES, y * TILES);
        // Columns and rows of a tile counted from its own first: small numbers keep the differences of sums exact.
        let within = |along: usize, count: usize| (along % count) as f64 / TILES as f64;
        let tile = &mut tiles[down / rows * TILES + across / columns];
        tile.add(within(across, columns), within(down, rows), *a, *b);
    }
    let (mut count, mut aa, mut bb, mut ab, mut most) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for tile in tiles.iter().filter(|t| t.sums[0] > 0.0) {
        let [va, cov, vb] = tile.without_planes();
        count += tile.sums[0];
        aa += va;
        bb += vb;
        ab += cov;
        most += (va * vb).sqrt();
    }
    let plain = |sum: f64| (sum / count).sqrt() < PLAIN;
    (count > 0.0 && most > 0.0 && !plain(aa) && !plain(bb)).then(|| ab / most)
}

/// Half the width of the window `[px]`.
const RADIUS: usize = 5;

/// Structural similarity in [−1, 1] of images in [0, 1]: mean over channels and over all 11×11
/// windows that lie wholly in the covered part, weighted by a Gaussian of σ = 1.5 px; None without one.
///
/// - `covered`: shape [height · width]
///
/// Source: Wang et al. 2004, "Image quality assessment: from error visibility to structural
/// similarity", eq. 13, K1 = 0.01, K2 = 0.03.
pub fn ssim(a: &Image, b: &Image, covered: &[bool]) -> Option<f64> {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let whole = windows(covered, a.width, a.height);
    let count = whole.iter().filter(|w| **w).count();
    if count == 0 {
        return None;
    }
    let mut total = 0.0;
    for c in 0..a.channels {
        let plane = |of: &dyn Fn(f64, f64) -> f64| {
            let values = a.data.iter().zip(&b.data).skip(c).step_by(a.channels);
            blurred(values.map(|(a, b)| of(f64::from(*a), f64::from(*b))).collect(), a.width)
        };
        let (ma, mb) = (plane(&|a, _| a), plane(&|_, b| b));
        let (aa, bb, ab) = (plane(&|a, _| a * a), plane(&|_, b| b * b), plane(&|a, b| a * b));
        for k in (0..whole.len()).filter(|k| whole[*k]) {
            let (m2, mab) = (ma[k] * ma[k] + mb[k] * mb[k], ma[k] * mb[k]);
            let (variances, covariance) = (aa[k] + bb[k] - m2, ab[k] - mab);
            total += (2.0 * mab + C1) * (2.0 * covariance + C2) / ((m2 + C1) * (variances + C2));
        }
    }
    Some(total / (count * a.channels) as f64)
}

/// Which pixels are centres of windows that lie wholly in the image and are wholly covered.
fn windows(covered: &[bool], width: usize, height: usize) -> Vec<bool> {
    // How many pixels in a row, up to this one, are covered; then the same down the columns.
    let mut whole = vec![false; covered.len()];
    let mut down = vec![0usize; width];
    for y in 0..height {
        let mut along = 0;
        for x in 0..width {
            along = if covered[y * width + x] { along + 1 } else { 0 };
            down[x] = if along > 2 * RADIUS { down[x] + 1 } else { 0 };
            if down[x] > 2 * RADIUS {
                whole[(y - RADIUS) * width + x - RADIUS] = true;
            }
        }
    }
    whole
}

/// `plane` under a Gaussian of σ = 1.5 px; right where [`windows`] is true.
fn blurred(plane: Vec<f64>, width: usize) -> Vec<f64> {
    let mut weights: [f64; 2 * RADIUS + 1] = std::array::from_fn(|k| {
        let x = k as f64 - RADIUS as f64;
        (-0.5 * (x / 1.5) * (x / 1.5)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    let along = |plane: &[f64], stride: usize| {
        let mut out = vec![0.0; plane.len()];
        let reach = RADIUS * stride;
        for at in reach..plane.len().saturating_sub(reach) {
            let taps = weights.iter().enumerate();
            out[at] = taps.map(|(k, w)| w * plane[at + k * stride - reach]).sum();
        }
        out
    };
    along(&along(&plane, 1), width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similarity_of_constant_pictures_is_the_luminance_term() {
        let grey = |v: f32| Image { width: 13, height: 12, channels: 3, data: vec![v; 13 * 12 * 3] };
        let covered = vec![true; 13 * 12];
        let expected = (2.0 * 0.25 * 0.5 + 1e-4) / (0.0625 + 0.25 + 1e-4);
        let found = ssim(&grey(0.25), &grey(0.5), &covered).unwrap();
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
        assert!((ssim(&grey(0.5), &grey(0.5), &covered).unwrap() - 1.0).abs() < 1e-9);
        let mut holed = covered.clone();
        holed[5 * 13 + 6] = false;
        assert_eq!(ssim(&grey(0.5), &grey(0.5), &holed), None);
    }

    #[test]
    fn prints_are_recognised_in_other_light_and_told_from_others() {
        // Stripes, `shift` px to the right, on the left three quarters of the image.
        let stripes = |shift: usize, light: &dyn Fn(usize) -> f32| {
            let mut image = Image::new(64, 48, 3);
            for y in 0..48 {
                for x in 0..64 {
                    let phase = (x + 64 - shift) as f32 * std::f32::consts::TAU / 8.0;
                    image.pixel_mut(x, y).fill(light(x) * (0.5 + 0.3 * phase.sin()));
                }
            }
            image
        };
        let covered: Vec<bool> = (0..64 * 48).map(|i| i % 64 < 48).collect();
        let even = |_: usize| 1.0;
        let pattern = stripes(0, &even);
        let found = |b: &Image| local_correlation(&pattern, b, &covered);
        assert!((found(&pattern).unwrap() - 1.0).abs() < 1e-9);
        // Each tile is 6 px wide; the light falls to a quarter from the left to the right.
        let dimmed = found(&stripes(0, &|x| 1.0 - 0.75 * (x / 6) as f32 / 8.0)).unwrap();
        assert!((dimmed - 1.0).abs() < 1e-5, "{dimmed}");
        assert!(found(&stripes(4, &even)).unwrap() < -0.8);
        assert!(found(&stripes(2, &even)).unwrap().abs() < 0.3);
        assert_eq!(found(&stripes(0, &|_| 0.05)), None);
        // Light that is added and grows from left to right and downwards, steeply.
        let mut lit = pattern.clone();
        for y in 0..48 {
            for x in 0..64 {
                lit.pixel_mut(x, y).iter_mut().for_each(|v| *v += 0.05 * x as f32 - 0.03 * y as f32);
            }
        }
        assert!((found(&lit).unwrap() - 1.0).abs() < 1e-5, "{:?}", found(&lit));
        assert_eq!(local_correlation(&pattern, &pattern, &vec![false; 64 * 48]), None);
    }

    #[test]
    fn grain_finer_than_the_boxes_is_no_other_print_and_displacement_is_the_same_in_any_resolution() {
        let stripes = |side: usize, shift: f32, grain: f32| {
            let mut image = Image::new(side, side, 3);
            for y in 0..side {
                for x in 0..side {
                    let phase = (13.0 * (x as f32 + 0.5) / side as f32 - shift) * std::f32::consts::TAU;
                    let grain = if (x + y) % 2 == 0 { grain } else { -grain };
                    image.pixel_mut(x, y).fill(0.5 + 0.2 * phase.sin() + grain);
                }
            }
            image
        };
        let found = |side: usize, shift: f32, grain: f32| {
            let (a, b) = (stripes(side, 0.0, 0.0), stripes(side, shift, grain));
            local_correlation(&a, &b, &vec![true; side * side]).unwrap()
        };
        assert!(found(512, 0.0, 0.3) > 0.999, "{}", found(512, 0.0, 0.3));
        assert!(found(64, 0.0, 0.3) < 0.6, "{}", found(64, 0.0, 0.3));
        let [coarse, fine] = [64, 512].map(|side| found(side, 0.125, 0.0));
        assert!((coarse - fine).abs() < 0.02 && coarse < 0.9, "{coarse} {fine}");
    }

    #[test]
    fn closed_forms_of_psnr_and_correlation() {
        assert!((psnr(&[0.5, 0.6], &[0.4, 0.7]) - 20.0).abs() < 1e-5);
        assert_eq!(psnr(&[0.5], &[0.5]), 120.0);
        let ramp = [0.1, 0.2, 0.3, 0.4];
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-6;
        assert!(near(correlation(&ramp, &ramp.map(|v| 0.9 - 2.0 * v)), -1.0));
        assert!(near(correlation(&ramp, &[0.0, 1.0, 1.0, 0.0]), 0.0));
        assert_eq!(correlation(&ramp, &[0.5; 4]), None);
    }
}
