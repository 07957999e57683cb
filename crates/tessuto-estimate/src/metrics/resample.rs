//! Images at another size.

use tessuto_core::image::Image;

/// `image` at `width`×`height` `[px]` by cubic convolution (Keys 1981, a = −½); where it shrinks, the
/// kernel is stretched by the same factor, so that nothing is skipped. Values stay in [0, 1].
///
/// The same as Pillow's `BICUBIC`, without its rounding to 8 bits.
pub(super) fn bicubic(image: &Image, width: usize, height: usize) -> Image {
    if (image.width, image.height) == (width, height) {
        return image.clone();
    }
    let n = image.channels;
    let mut wide = Image::new(width, image.height, n);
    for (x, (start, weights)) in kernel(image.width, width).iter().enumerate() {
        for y in 0..image.height {
            for c in 0..n {
                let tap = |(k, w): (usize, &f64)| w * f64::from(image.pixel(start + k, y)[c]);
                wide.pixel_mut(x, y)[c] = clamped(weights.iter().enumerate().map(tap).sum());
            }
        }
    }
    let mut out = Image::new(width, height, n);
    for (y, (start, weights)) in kernel(image.height, height).iter().enumerate() {
        for x in 0..width {
            for c in 0..n {
                let tap = |(k, w): (usize, &f64)| w * f64::from(wide.pixel(x, start + k)[c]);
                out.pixel_mut(x, y)[c] = clamped(weights.iter().enumerate().map(tap).sum());
            }
        }
    }
    out
}

fn clamped(value: f64) -> f32 {
    value.clamp(0.0, 1.0) as f32
}

/// For each of `target` samples: the first of `source` it takes, and the weights, whose sum is 1.
fn kernel(source: usize, target: usize) -> Vec<(usize, Vec<f64>)> {
    let scale = source as f64 / target as f64;
    let stretch = scale.max(1.0);
    let at = |k: usize| {
        let centre = (k as f64 + 0.5) * scale;
        let low = (centre - 2.0 * stretch + 0.5).max(0.0) as usize;
        let high = ((centre + 2.0 * stretch + 0.5) as usize).min(source);
        let weights: Vec<f64> = (low..high).map(|i| cubic((i as f64 + 0.5 - centre) / stretch)).collect();
        let sum: f64 = weights.iter().sum();
        (low, weights.iter().map(|w| w / sum).collect())
    };
    (0..target).map(at).collect()
}

/// Keys' kernel with a = −½.
fn cubic(x: f64) -> f64 {
    const A: f64 = -0.5;
    let x = x.abs();
    if x < 1.0 {
        ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0
    } else if x < 2.0 {
        (((x - 5.0) * x + 8.0) * x - 4.0) * A
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp() {
        let mut ramp = Image::new(12, 3, 1);
        for (k, v) in ramp.data.iter_mut().enumerate() {
            *v = 0.1 + 0.05 * (k % 12) as f32;
        }
        for width in [12, 24, 36] {
            let found = bicubic(&ramp, width, 5);
            let scale = 12.0 / width as f32;
            // Away from the border, where there is nothing beyond to lean on.
            for x in width / 4..3 * width / 4 {
                let expected = 0.1 + 0.05 * ((x as f32 + 0.5) * scale - 0.5);
                assert!((found.pixel(x, 2)[0] - expected).abs() < 1e-6, "{width}, {x}");
            }
        }
        assert!((bicubic(&ramp, 3, 1).pixel(1, 0)[0] - 0.375).abs() < 1e-6);
    }
}
