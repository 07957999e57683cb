//! The mesh as a camera sees it whose shutter is open for a while: what a blurred frame can be compared with.

use glam::DVec3;

use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::image::{Image, srgb};
use tessuto_core::mesh::Positions;

/// Shapes drawn between the middles of the intervals before and after a frame, and of these, counted from the
/// outer ones, the first that an exposure of 1, 1/2 and 1/4 of the time from frame to frame takes.
const SHAPES: usize = 9;
const FIRST: [usize; 3] = [0, 2, 3];

/// Colour (sRGB, [h, w, 3]) and coverage ([h, w, 1]) of frame `n` of `motion` as `view` sees it with the shutter
/// open for the whole, half and a quarter of the time from frame to frame, about the frame; means in linear light
/// of shapes that lie straight between the frames'. None where no vertex moves by more than a pixel in that time.
///
/// - `draw`: renders a shape; sRGB and coverage of each pixel
pub(super) fn exposures(
    motion: &[Positions],
    n: usize,
    view: &Viewpoint,
    mut draw: impl FnMut(&Positions) -> Vec<[f32; 4]>,
) -> Option<[[Image; 2]; 3]> {
    let time = |k: usize| k as f64 / (SHAPES - 1) as f64 - 0.5;
    let shapes: Vec<Positions> = (0..SHAPES).map(|k| between(motion, n as f64 + time(k))).collect();
    let way = |(p, q): (&DVec3, &DVec3)| view.project(*p).distance(view.project(*q));
    let longest = shapes[0].iter().zip(&shapes[SHAPES - 1]).map(way).fold(0.0, f64::max);
    if longest <= 1.0 {
        return None;
    }
    let light = |c: [f32; 4]| [srgb::decode(c[0]), srgb::decode(c[1]), srgb::decode(c[2]), c[3]];
    let drawn: Vec<Vec<[f32; 4]>> =
        shapes.iter().map(|shape| draw(shape).into_iter().map(light).collect()).collect();
    Some(FIRST.map(|first| mean(&drawn[first..SHAPES - first], &view.camera)))
}

/// Positions at `time`, counted in frames; beyond the first and the last frame those of these.
fn between(motion: &[Positions], time: f64) -> Positions {
    let time = time.clamp(0.0, (motion.len() - 1) as f64);
    let before = time.floor() as usize;
    let after = (before + 1).min(motion.len() - 1);
    motion[before].iter().zip(&motion[after]).map(|(p, q)| p.lerp(*q, time - before as f64)).collect()
}

/// Colour, encoded again, and coverage.
fn mean(drawn: &[Vec<[f32; 4]>], camera: &Camera) -> [Image; 2] {
    let (mut rgb, mut mask) =
        (Image::new(camera.width, camera.height, 3), Image::new(camera.width, camera.height, 1));
    let part = 1.0 / drawn.len() as f32;
    for pixels in drawn {
        for (i, pixel) in pixels.iter().enumerate() {
            (0..3).for_each(|c| rgb.data[3 * i + c] += part * pixel[c]);
            mask.data[i] += part * pixel[3];
        }
    }
    rgb.data.iter_mut().for_each(|v| *v = srgb::encode(*v));
    [rgb, mask]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point that moves by 4 px a frame to the right, drawn as one white pixel.
    fn exposed(n: usize, speed: f64) -> Option<[[Image; 2]; 3]> {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 8.0, cy: 0.0, width: 17, height: 1 };
        let motion: Vec<Positions> =
            (0..3).map(|k| vec![DVec3::new(0.01 * speed * (k as f64 - 1.0), 0.0, 1.0)]).collect();
        exposures(&motion, n, &camera.into(), |shape| {
            let column = camera.project(shape[0]).x.round() as usize;
            (0..17).map(|x| if x == column { [1.0; 4] } else { [0.0; 4] }).collect()
        })
    }

    #[test]
    fn light_is_spread_along_the_way_that_the_shutter_sees() {
        // In eighths of a frame the pixels are 6, 6 (6.5 is rounded up: 7), 7, 8, 8, 9, 9, 10, 10.
        let [whole, half, quarter] = exposed(1, 4.0).unwrap();
        for (exposure, [first, last]) in [(&whole, [6, 10]), (&half, [7, 9]), (&quarter, [8, 9])] {
            let [rgb, mask] = exposure;
            assert!((mask.data.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            let lit: Vec<usize> = (0..17).filter(|x| mask.data[*x] > 0.0).collect();
            assert!(lit[0].abs_diff(first) <= 1 && lit[lit.len() - 1].abs_diff(last) <= 1, "{lit:?}");
            // The mean of light, not of its code.
            for x in lit {
                assert!((srgb::decode(rgb.pixel(x, 0)[0]) - mask.data[x]).abs() < 1e-5);
            }
        }
        assert!(whole[1].data.iter().filter(|v| **v > 0.0).count() > 3);
    }

    #[test]
    fn a_clip_ends_at_its_ends_and_what_stands_still_is_sharp() {
        let [[_, mask], ..] = exposed(0, 4.0).unwrap();
        assert!(mask.data[4] > 0.5 && mask.data[..4].iter().all(|v| *v == 0.0), "{:?}", mask.data);
        assert!(exposed(1, 0.9).is_none());
    }
}
