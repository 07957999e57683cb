//! Environment map: radiance from every direction.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use tessuto_core::camera::Viewpoint;

/// Radiance that arrives from each direction, constant within a texel. Texel (column i, row j) has its centre
/// at lon = ((i + ½)/W − ½)·2π, lat = (½ − (j + ½)/H)·π, and the direction to the light is
/// (cos lat · sin lon, −sin lat, cos lat · cos lon) in the camera frame: the middle of the image is where the
/// camera looks (+z), the top is up (−y), left and right border are behind the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvironmentMap {
    /// Columns W.
    pub width: usize,
    /// Rows H.
    pub height: usize,
    /// Linear radiance, ≥ 0, shape [H, W].
    pub texels: Vec<[f32; 3]>,
}

impl EnvironmentMap {
    /// The same radiance from everywhere.
    pub fn uniform(width: usize, height: usize, radiance: [f32; 3]) -> Self {
        assert!(width > 0 && height > 0, "an environment needs texels, not {width}×{height}");
        Self { width, height, texels: vec![radiance; width * height] }
    }

    /// Direction to the light at the centre of texel (`column`, `row`).
    pub fn direction(&self, column: usize, row: usize) -> DVec3 {
        let lon = ((column as f64 + 0.5) / self.width as f64 - 0.5) * 2.0 * PI;
        let lat = (0.5 - (row as f64 + 0.5) / self.height as f64) * PI;
        DVec3::new(lat.cos() * lon.sin(), -lat.sin(), lat.cos() * lon.cos())
    }

    /// Index of the texel that the unit vector `direction` points to.
    pub fn texel_of(&self, direction: DVec3) -> usize {
        let lat = (-direction.y).clamp(-1.0, 1.0).asin();
        let lon = direction.x.atan2(direction.z);
        let row = ((0.5 - lat / PI) * self.height as f64) as usize;
        let column = ((lon / (2.0 * PI) + 0.5) * self.width as f64) as usize;
        row.min(self.height - 1) * self.width + column.min(self.width - 1)
    }

    /// Solid angle `[sr]` of one texel of `row`.
    pub fn solid_angle(&self, row: usize) -> f64 {
        let edge = |j: usize| (PI * j as f64 / self.height as f64).cos();
        2.0 * PI / self.width as f64 * (edge(row) - edge(row + 1))
    }

    /// The map in the frame of the camera of `view`, each texel the mean of four directions of the old one.
    pub fn seen_from(&self, view: &Viewpoint) -> Self {
        let turned = view.camera_from_world.map(|pose| pose.rotation).filter(|r| *r != DMat3::IDENTITY);
        let Some(rotation) = turned else { return self.clone() };
        let fine = Self::uniform(2 * self.width, 2 * self.height, [0.0; 3]);
        let back = rotation.transpose();
        let mut turned = Self::uniform(self.width, self.height, [0.0; 3]);
        for row in 0..fine.height {
            for column in 0..fine.width {
                let from = self.texels[self.texel_of(back * fine.direction(column, row))];
                let texel = &mut turned.texels[row / 2 * self.width + column / 2];
                texel.iter_mut().zip(from).for_each(|(t, f)| *t += 0.25 * f);
            }
        }
        turned
    }
}

#[cfg(test)]
mod tests {
    use tessuto_core::camera::Camera;

    use super::*;

    #[test]
    fn directions_and_texels_are_inverse_and_the_middle_is_ahead() {
        let e = EnvironmentMap::uniform(16, 8, [1.0; 3]);
        for row in 0..8 {
            for column in 0..16 {
                assert_eq!(e.texel_of(e.direction(column, row)), row * 16 + column);
            }
        }
        assert_eq!(e.texel_of(DVec3::new(1e-3, -1e-3, 1.0).normalize()), 3 * 16 + 8);
        assert!(e.direction(0, 0).y < -0.9, "the top row is up");
        assert!(e.direction(12, 4).x > 0.9, "the quarter to the right is +x");
        let total: f64 = (0..8).map(|row| 16.0 * e.solid_angle(row)).sum();
        assert!((total - 4.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn the_light_turns_with_the_camera() {
        let mut map = EnvironmentMap::uniform(64, 32, [0.0; 3]);
        let up = map.texel_of(-DVec3::Y + 1e-3 * DVec3::Z);
        let right = map.texel_of(DVec3::X);
        map.texels[up] = [7.0; 3];
        map.texels[right] = [5.0; 3];
        let camera = Camera { fx: 500.0, fy: 480.0, cx: 330.0, cy: 230.0, width: 640, height: 480 };
        let motion = [vec![DVec3::new(-0.3, -0.2, 1.0), DVec3::new(0.3, 0.2, 1.0)]];
        let view = Viewpoint::about(&motion, camera, 90f64.to_radians(), 0.0).unwrap();
        let turned = map.seen_from(&view);
        // From the left border, looking to the right: what was at the right is ahead.
        let ahead = turned.texels[turned.texel_of(DVec3::new(0.05, 0.05, 1.0).normalize())];
        let power = |e: &EnvironmentMap| -> f64 {
            let rows = e.texels.chunks_exact(e.width).enumerate();
            rows.map(|(r, t)| t.iter().map(|t| f64::from(t[0])).sum::<f64>() * e.solid_angle(r)).sum()
        };
        assert!(ahead[0] > 0.5, "{ahead:?}");
        assert!((power(&turned) / power(&map) - 1.0).abs() < 0.3);
    }
}
