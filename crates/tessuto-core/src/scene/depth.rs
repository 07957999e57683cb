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
}

/// Least noise, as a fraction of the depth: what no sensor measures better than, calibrated as it is.
const LEAST: f64 = 1e-3;
/// From the second differences of noise alone to its standard deviation, of medians: 1.4826 / √6.
const OF_DIFFERENCES: f64 = 0.605;

impl Depths {
    /// Depth maps of the camera's whole image; their noise is that of the pixels `within`, shape [height · width], in
    /// the first one: half of their second differences along rows and columns are smaller than noise alone makes them.
    pub fn new(camera: Camera, maps: Vec<Vec<f32>>, within: &[bool]) -> Self {
        let width = camera.width;
        let mut differences: Vec<f64> = Vec::new();
        if let Some(map) = maps.first() {
            for k in (0..map.len()).filter(|k| within.get(*k) == Some(&true)) {
                for step in [1, width] {
                    let around = [k.checked_sub(step), Some(k), Some(k + step)];
                    let inside = |k: &Option<usize>| k.is_some_and(|k| within.get(k) == Some(&true));
                    if around.iter().all(inside) {
                        let [a, b, c] = around.map(|k| k.map_or(f64::NAN, |k| f64::from(map[k])));
                        differences.push(((a - 2.0 * b + c) / b).abs());
                    }
                }
            }
        }
        differences.retain(|d| d.is_finite());
        let median = crate::math::median::median(differences).unwrap_or(LEAST);
        Self { camera, maps, noise: (OF_DIFFERENCES * median).max(LEAST) }
    }

    /// The maps of a `range` of frames; the noise stays that of all.
    ///
    /// Panics if there are no such frames.
    pub fn span(&self, range: Range<usize>) -> Self {
        Self { camera: self.camera, maps: self.maps[range].to_vec(), noise: self.noise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn the_noise_of_a_tilted_plane_is_found() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 31.5, width: 64, height: 64 };
        let mut rng = Rng::new(1, 0);
        let z = |k: usize| (1.0 + 2e-3 * (k % 64) as f64) * (1.0 + 0.01 * rng.normal());
        let mut map: Vec<f32> = (0..64 * 64).map(z).map(|z| z as f32).collect();
        map[700] = f32::NAN;
        let found = Depths::new(camera, vec![map], &[true; 64 * 64]).noise;
        println!("{found}");
        assert!((found / 0.01 - 1.0).abs() < 0.1);
        assert_eq!(Depths::new(camera, Vec::new(), &[]).noise, LEAST);
    }
}
