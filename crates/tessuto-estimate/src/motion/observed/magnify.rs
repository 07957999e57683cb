//! Small images made larger, so that bilinear colours and the blur of the pyramid lose less of them.

use tessuto_core::image::Image;
use tessuto_core::video::Frame;

/// Least coverage that colours are divided by.
const LEAST_COVERAGE: f32 = 1e-3;
/// Values are this part of themselves on the way: cubics overshoot, and what is above 1 is cut.
const HEADROOM: f32 = 0.5;

/// `frame` with `factor` times the pixels along each side, by Catmull and Rom's cubics; colours of the fabric and
/// of what is behind it do not mix.
pub fn magnified(frame: &Frame, factor: usize) -> Frame {
    let (w, h) = (frame.rgb.width, frame.rgb.height);
    // Colour by coverage, and coverage; rows of pixels.
    let weighted: Vec<[f32; 4]> = (frame.rgb.data.chunks_exact(3).zip(&frame.mask.data))
        .map(|(c, m)| [c[0] * m, c[1] * m, c[2] * m, *m].map(|v| v * HEADROOM))
        .collect();
    // Down the columns, then along the rows.
    let down: Vec<[f32; 4]> = (spread(h, factor).iter())
        .flat_map(|(first, weights)| {
            let rows = &weighted[first * w..];
            (0..w).map(move |x| sum(weights, |k| rows[k * w + x]))
        })
        .collect();
    let columns = spread(w, factor);
    let (mut rgb, mut mask) = (Image::new(w * factor, h * factor, 3), Image::new(w * factor, h * factor, 1));
    let pixels = down.chunks_exact(w.max(1)).flat_map(|row| columns.iter().map(move |column| (row, column)));
    let texels = rgb.data.chunks_exact_mut(3).zip(mask.data.iter_mut());
    for ((row, (first, weights)), (colour, mask)) in pixels.zip(texels) {
        let texel = sum(weights, |k| row[first + k]).map(|v| v.clamp(0.0, 1.0));
        let [r, g, b, m] = texel.map(|v| v / HEADROOM);
        let scale = 1.0 / m.max(LEAST_COVERAGE);
        colour.copy_from_slice(&[r, g, b].map(|c| (c * scale).clamp(0.0, 1.0)));
        *mask = m.clamp(0.0, 1.0);
    }
    Frame { rgb, mask }
}

fn sum(weights: &[f32], pixel: impl Fn(usize) -> [f32; 4]) -> [f32; 4] {
    let mut sum = [0.0; 4];
    for (k, weight) in weights.iter().enumerate() {
        let pixel = pixel(k);
        (0..4).for_each(|c| sum[c] += pixel[c] * weight);
    }
    sum
}

/// For each of `factor` times `count` pixels the first of those that it is made of, and their weights.
fn spread(count: usize, factor: usize) -> Vec<(usize, Vec<f32>)> {
    let ratio = count as f32 / (count * factor) as f32;
    let of = |k: usize| {
        let at = (k as f32 + 0.5) * ratio;
        let first = ((at - 2.0).floor().max(0.0) as usize).min(count - 1);
        let end = ((at + 2.0).ceil() as usize).clamp(first + 1, count);
        let mut weights: Vec<f32> = (first..end).map(|i| cubic(i as f32 - (at - 0.5))).collect();
        let sum = weights.iter().fold(0.0, |sum, w| sum + w);
        weights.iter_mut().for_each(|w| *w /= sum);
        (first, weights)
    };
    (0..count * factor).map(of).collect()
}

/// The cubic spline through its points that Catmull and Rom have named, at a distance from one of them.
///
/// Source: Mitchell and Netravali, *Reconstruction filters in computer graphics*, 1988, with B = 0 and C = 1/2.
fn cubic(x: f32) -> f32 {
    let a = x.abs();
    let k = if a < 1.0 {
        9.0 * a.powi(3) - 15.0 * a.powi(2) + 6.0
    } else if a < 2.0 {
        -3.0 * a.powi(3) + 15.0 * a.powi(2) - 24.0 * a + 12.0
    } else {
        0.0
    };
    k / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::camera::Camera;

    #[test]
    fn smooth_colours_stay_where_they_are() {
        let (w, h) = (40, 32);
        let colour = |p: DVec2| {
            let wave = |k: f64| 0.5 + 0.3 * (0.25 * k * p.x + 0.4 * p.y).sin();
            [1.0, 1.5, 2.0].map(|k| wave(k) as f32)
        };
        let (mut rgb, mut mask) = (Image::new(w, h, 3), Image::new(w, h, 1));
        for y in 0..h {
            for x in 0..w {
                // Fabric in the middle, what is behind it black.
                let inside = (6..34).contains(&x) && (6..26).contains(&y);
                let value = if inside { colour(DVec2::new(x as f64, y as f64)) } else { [0.0; 3] };
                rgb.pixel_mut(x, y).copy_from_slice(&value);
                mask.pixel_mut(x, y)[0] = f32::from(inside);
            }
        }
        let camera = Camera { fx: 50.0, fy: 50.0, cx: 20.0, cy: 16.0, width: w, height: h };
        let (small, large) = (&camera, camera.magnified(4));
        let frame = magnified(&Frame { rgb, mask }, 4);
        assert_eq!([frame.rgb.width, frame.rgb.height], [large.width, large.height]);
        let mut worst = 0.0f32;
        for y in 0..large.height {
            for x in 0..large.width {
                let ray = large.ray(DVec2::new(x as f64, y as f64));
                let p = small.project(ray);
                let coverage = frame.mask.pixel(x, y)[0];
                let inside = (8.0..31.0).contains(&p.x) && (8.0..23.0).contains(&p.y);
                let outside = !(3.0..36.0).contains(&p.x) || !(3.0..28.0).contains(&p.y);
                assert!(!inside || coverage > 0.999, "{p}: {coverage}");
                assert!(!outside || coverage < 0.001, "{p}: {coverage}");
                if inside {
                    let pairs = frame.rgb.pixel(x, y).iter().zip(colour(p));
                    worst = pairs.fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
                }
                // What is half fabric has the fabric's colour.
                if coverage > 0.5 {
                    let pairs = frame.rgb.pixel(x, y).iter().zip(colour(p));
                    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 0.12), "{p}");
                }
            }
        }
        println!("colours differ by at most {worst}");
        assert!(worst < 0.02 && worst > 0.0);
    }
}
