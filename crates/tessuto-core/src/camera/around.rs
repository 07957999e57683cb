//! Cameras around the fabric.

use glam::{DMat3, DVec3};

use super::{Camera, Pose, Viewpoint};
use crate::error::{Error, Result};
use crate::mesh::Positions;

/// Margin around the fabric, as a fraction of the image.
const MARGIN: f64 = 0.05;
/// Nearest that a vertex may come to the camera `[m]`.
const NEAREST: f64 = 0.05;

impl Viewpoint {
    /// Turned about the middle of the fabric by `left` and `up` `[rad]` as seen from the recording camera, looking at
    /// that middle, and as near as the whole `motion`, shape [N, V], fits into the image.
    ///
    /// # Errors
    /// [`Error::Usage`] unless |`up`| < 90°.
    pub fn about(motion: &[Positions], camera: Camera, left: f64, up: f64) -> Result<Self> {
        if !left.is_finite() || !up.is_finite() || up.abs() >= std::f64::consts::FRAC_PI_2 {
            let angles = format!("camera {}° to the left, {}° up", left.to_degrees(), up.to_degrees());
            return Err(Error::usage(angles, "up must lie between -90 and 90"));
        }
        let vertices = || motion.iter().flatten().copied();
        let middle = middle(motion);
        let right = DVec3::new(left.cos(), 0.0, -left.sin());
        let level = DVec3::new(left.sin(), 0.0, left.cos());
        let forward = level * up.cos() + DVec3::Y * up.sin();
        let down = forward.cross(right);
        let rotation = DMat3::from_cols(right, down, forward).transpose();
        let (width, height) = (camera.width as f64, camera.height as f64);
        let camera = Camera { cx: (width - 1.0) / 2.0, cy: (height - 1.0) / 2.0, ..camera };
        let room = [width, height].map(|n| n * (0.5 - MARGIN));
        let distance = vertices()
            .map(|x| {
                let q = rotation * (x - middle);
                let [across, along] = [camera.fx * q.x.abs() / room[0], camera.fy * q.y.abs() / room[1]];
                across.max(along).max(NEAREST) - q.z
            })
            .fold(NEAREST, f64::max);
        let pose = Pose { rotation, translation: DVec3::Z * distance - rotation * middle };
        Ok(Self { camera, camera_from_world: Some(pose) })
    }

    /// Views about the middle of one `motion`, all as far from it as the farthest.
    #[must_use]
    pub fn at_one_distance(views: Vec<Self>, motion: &[Positions]) -> Vec<Self> {
        let middle = middle(motion);
        let distance = |view: &Self| view.depth(middle);
        let farthest = views.iter().map(distance).fold(0.0, f64::max);
        let moved = |view: Self| {
            let farther = DVec3::Z * (farthest - distance(&view));
            let back = |pose: Pose| Pose { translation: pose.translation + farther, ..pose };
            Self { camera_from_world: view.camera_from_world.map(back), ..view }
        };
        views.into_iter().map(moved).collect()
    }

    /// The same view in an image of `size` pixels: as large as it fits.
    #[must_use]
    pub fn sized(self, [width, height]: [usize; 2]) -> Self {
        let c = self.camera;
        let scale = f64::min(width as f64 / c.width as f64, height as f64 / c.height as f64);
        // Pixel centres are at whole numbers, so the image's middle is at (n − 1)/2.
        let moved = |at: f64, old: usize, new: usize| {
            (at - (old as f64 - 1.0) / 2.0) * scale + (new as f64 - 1.0) / 2.0
        };
        let camera = Camera {
            fx: c.fx * scale,
            fy: c.fy * scale,
            cx: moved(c.cx, c.width, width),
            cy: moved(c.cy, c.height, height),
            width,
            height,
        };
        self.with_camera(camera)
    }
}

/// The middle of the box around a motion.
fn middle(motion: &[Positions]) -> DVec3 {
    let vertices = || motion.iter().flatten().copied();
    let low = vertices().reduce(DVec3::min).unwrap_or(DVec3::ZERO);
    let high = vertices().reduce(DVec3::max).unwrap_or(DVec3::ZERO);
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 500.0, fy: 480.0, cx: 330.0, cy: 230.0, width: 640, height: 480 };

    fn motion() -> Vec<Positions> {
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        vec![
            vec![corner(-0.3, -0.2, 1.0), corner(0.3, 0.2, 1.0)],
            vec![corner(-0.3, -0.2, 1.2), corner(0.3, 0.2, 1.1)],
        ]
    }

    #[test]
    fn the_whole_motion_is_seen_and_fills_the_picture() {
        for (left, up) in [(45f64, 0f64), (-80.0, 30.0), (180.0, -60.0)] {
            let view = Viewpoint::about(&motion(), CAMERA, left.to_radians(), up.to_radians()).unwrap();
            let pixels: Vec<_> = motion()
                .iter()
                .flat_map(|s| view.all_in_camera(s).into_owned())
                .map(|x| (x.z, view.camera.project(x)))
                .collect();
            assert!(
                pixels
                    .iter()
                    .all(|(z, p)| *z > 0.0 && (0.0..639.0).contains(&p.x) && (0.0..479.0).contains(&p.y))
            );
            let reach = |f: fn(&glam::DVec2) -> f64, n: f64| {
                pixels.iter().map(|(_, p)| (f(p) / n - 0.5).abs()).fold(0.0, f64::max)
            };
            let widest = reach(|p| p.x, 639.0).max(reach(|p| p.y, 479.0));
            assert!((0.4..0.46).contains(&widest), "{left} {up}: {widest}");
        }
    }

    #[test]
    fn to_the_left_means_that_the_left_border_comes_nearer() {
        let view = Viewpoint::about(&motion(), CAMERA, 45f64.to_radians(), 0.0).unwrap();
        let x = view.all_in_camera(&motion()[0]).into_owned();
        assert!(x[0].z < x[1].z && x[0].x < x[1].x, "{x:?}");
        assert!((view.camera_from_world.unwrap().rotation.determinant() - 1.0).abs() < 1e-12);
        assert!(Viewpoint::about(&motion(), CAMERA, 0.0, 2.0).is_err());
    }

    #[test]
    fn another_size_shows_the_same() {
        let view = Viewpoint::from(CAMERA).sized([1280, 960]);
        let p = DVec3::new(0.1, -0.05, 1.0);
        let (small, large) = (CAMERA.project(p), view.camera.project(p));
        assert!((large - (small * 2.0 + glam::DVec2::splat(0.5))).length() < 1e-9);
    }
}
