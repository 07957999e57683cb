//! Small images made larger, so that bilinear colours and the blur of the pyramid lose less of them.

use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Rgba};

use tessuto_core::image::Image;
use tessuto_core::video::Frame;

/// Least coverage that colours are divided by.
const LEAST_COVERAGE: f32 = 1e-3;
/// Values are this part of themselves on the way: cubics overshoot, and `resize` cuts at 1.
const HEADROOM: f32 = 0.5;

/// `frame` with `factor` times the pixels along each side, by Catmull and Rom's cubics; colours of the fabric and of what
/// is behind it do not mix.
pub fn magnified(frame: &Frame, factor: usize) -> Frame {
    let (w, h) = (frame.rgb.width, frame.rgb.height);
    let weighted = ImageBuffer::from_fn(w as u32, h as u32, |x, y| {
        let (x, y) = (x as usize, y as usize);
        let (c, m) = (frame.rgb.pixel(x, y), frame.mask.pixel(x, y)[0]);
        Rgba([c[0] * m, c[1] * m, c[2] * m, m].map(|v| v * HEADROOM))
    });
    let (w, h) = (w * factor, h * factor);
    let larger = resize(&weighted, w as u32, h as u32, FilterType::CatmullRom);
    let (mut rgb, mut mask) = (Image::new(w, h, 3), Image::new(w, h, 1));
    for ((texel, colour), mask) in larger.pixels().zip(rgb.data.chunks_exact_mut(3)).zip(mask.data.iter_mut())
    {
        let [r, g, b, m] = texel.0.map(|v| v / HEADROOM);
        let scale = 1.0 / m.max(LEAST_COVERAGE);
        colour.copy_from_slice(&[r, g, b].map(|c| (c * scale).clamp(0.0, 1.0)));
        *mask = m.clamp(0.0, 1.0);
    }
    Frame { rgb, mask }
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
