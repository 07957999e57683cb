//! What a depth sensor beside the camera measured.

use std::ops::Range;

use crate::camera::Camera;

/// Depth maps of a clip, as the camera sees them.
#[derive(Debug, Clone, PartialEq)]
pub struct Depths {
    /// The camera, in pixels of the maps, which show its whole image.
    pub camera: Camera,
    /// Depth along the camera's axis `[m]` of every frame, shape [N][height · width]; NaN where nothing was measured.
    pub maps: Vec<Vec<f32>>,
    /// Noise of one pixel, as a fraction of its depth.
    pub noise: f64,
    /// Number of pixels that err together, so that their mean is no better than one: 1 where each errs by itself.
    pub alike: f64,
}

/// Least noise, as a fraction of the depth: what no sensor measures better than, calibrated as it is.
const LEAST: f64 = 1e-3;
/// From the second differences of noise alone to its standard deviation, of medians: 1.4826 / √6.
const OF_DIFFERENCES: f64 = 0.605;
/// Pixels apart, and along the sides of squares, over which errors are compared: 1, 2, 4 … of this many doublings.
const DOUBLINGS: usize = 4;
/// Fewer differences tell no spread.
const FEWEST: usize = 256;

impl Depths {
    /// Depth maps of the camera's whole image. How they err is what the first one shows: there the fabric is at the
    /// depth `surface` `[m]` of each pixel, shape [height · width]; NaN beside it.
    ///
    /// Second differences leave out what the surface given is off by as a whole. The noise of a pixel is that of pixels
    /// as far apart as it takes; the means of squares of b² pixels spread by noise/b if each of them errs by itself,
    /// and by more where they err together.
    pub fn new(camera: Camera, maps: Vec<Vec<f32>>, surface: &[f64]) -> Self {
        let errors = maps.first().into_iter().flatten().zip(surface).map(|(z, at)| f64::from(*z) / at - 1.0);
        let mut grid = Grid { width: camera.width, values: errors.collect() };
        let steps = (0..DOUBLINGS).map(|k| 1 << k);
        let noise = steps.filter_map(|step| grid.spread(step)).fold(LEAST, f64::max);
        let mut alike: f64 = 1.0;
        for k in 1..DOUBLINGS {
            grid = grid.halved();
            if let Some(spread) = grid.spread(1) {
                alike = alike.max((f64::from(1u32 << k) * spread / noise).powi(2));
            }
        }
        Self { camera, maps, noise, alike }
    }

    /// The maps of a `range` of frames; the noise stays that of all.
    ///
    /// Panics if there are no such frames.
    pub fn span(&self, range: Range<usize>) -> Self {
        Self { camera: self.camera, maps: self.maps[range].to_vec(), noise: self.noise, alike: self.alike }
    }
}

/// Errors of the pixels of a map, or of squares of them; NaN where none is known.
struct Grid {
    width: usize,
    values: Vec<f64>,
}

impl Grid {
    fn height(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    /// Standard deviation by the second differences of what is `step` apart, along rows and columns; `None` of few.
    fn spread(&self, step: usize) -> Option<f64> {
        let (width, height) = (self.width, self.height());
        let second = |k: usize, step: usize| {
            let [a, b, c] = [k - step, k, k + step].map(|k| self.values[k]);
            (a - 2.0 * b + c).abs()
        };
        let within = |n: usize, size: usize| n >= step && n + step < size;
        let mut differences = Vec::new();
        for k in 0..width * height {
            differences.extend(within(k % width, width).then(|| second(k, step)));
            differences.extend(within(k / width, height).then(|| second(k, step * width)));
        }
        differences.retain(|d| d.is_finite());
        let enough = differences.len() >= FEWEST;
        enough.then(|| crate::math::median::median(differences)).flatten().map(|m| OF_DIFFERENCES * m)
    }

    /// Means of squares of four, of those of which half are known.
    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height() / 2);
        let mean = |k: usize| {
            let first = 2 * (k / width) * self.width + 2 * (k % width);
            let four = [0, 1, self.width, self.width + 1].map(|k| self.values[first + k]);
            let known = || four.iter().filter(|value| value.is_finite());
            if known().count() < 2 { f64::NAN } else { known().sum::<f64>() / known().count() as f64 }
        };
        Self { width, values: (0..width * height).map(mean).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    const SIZE: usize = 128;

    /// Maps of a tilted plane of which every pixel errs by its own of `errors`.
    fn measured(errors: &[f64]) -> Depths {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 63.5, cy: 63.5, width: SIZE, height: SIZE };
        let surface: Vec<f64> = (0..SIZE * SIZE).map(|k| 1.0 + 2e-3 * (k % SIZE) as f64).collect();
        let z = |(at, error): (&f64, &f64)| (at * (1.0 + error)) as f32;
        let mut map: Vec<f32> = surface.iter().zip(errors).map(z).collect();
        map[700] = f32::NAN;
        Depths::new(camera, vec![map], &surface)
    }

    #[test]
    fn the_noise_is_found_and_how_many_pixels_err_together() {
        let mut rng = Rng::new(1, 0);
        let white: Vec<f64> = (0..SIZE * SIZE).map(|_| 0.01 * rng.normal()).collect();
        let found = measured(&white);
        println!("{} {}", found.noise, found.alike);
        assert!((found.noise / 0.01 - 1.0).abs() < 0.1 && found.alike < 1.3);
        // Squares of 16 that err alike, and the whole map that is off besides.
        let alike = |k: usize| 0.003 + white[k / SIZE / 4 * SIZE + k % SIZE / 4];
        let found = measured(&(0..SIZE * SIZE).map(alike).collect::<Vec<f64>>());
        println!("{} {}", found.noise, found.alike);
        assert!((found.noise / 0.01 - 1.0).abs() < 0.15 && (12.0..22.0).contains(&found.alike));
    }

    #[test]
    fn maps_without_errors_or_without_fabric_have_the_least_noise() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 31.5, width: 64, height: 64 };
        for found in [measured(&[0.0; SIZE * SIZE]), Depths::new(camera, Vec::new(), &[])] {
            assert_eq!((found.noise, found.alike), (LEAST, 1.0));
        }
    }
}
