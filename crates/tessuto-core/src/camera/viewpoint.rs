//! One view at one frame: the only way from a point of the world to a pixel, and back.

use std::borrow::Cow;

use glam::{DMat3, DVec2, DVec3};

use super::Camera;

/// Where a camera is: a point p of the world is at R p + t in the camera's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// R, a rotation; axes as in OpenCV.
    pub rotation: DMat3,
    /// t `[m]`.
    pub translation: DVec3,
}

impl Pose {
    /// Some pose, up to a metre off, for tests.
    #[doc(hidden)]
    pub fn random(rng: &mut crate::math::rng::Rng) -> Self {
        let turn = glam::DQuat::from_axis_angle(rng.vector().normalize(), 3.0 * rng.signed());
        Self { rotation: DMat3::from_quat(turn), translation: rng.vector() }
    }

    /// At the world's origin, along its axes.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Of a 4×4 matrix by rows, whose last row is 0 0 0 1. Whether it is a rotation is not looked at.
    pub fn from_rows(m: &[f64; 16]) -> Self {
        let row = |k: usize| DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
        let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        Self { rotation, translation: DVec3::new(m[3], m[7], m[11]) }
    }

    /// The 4×4 matrix by rows.
    pub fn rows(&self) -> [f64; 16] {
        let (rows, t) = (self.rotation.transpose(), self.translation);
        let [a, b, c] = [rows.x_axis, rows.y_axis, rows.z_axis];
        [a.x, a.y, a.z, t.x, b.x, b.y, b.z, t.y, c.x, c.y, c.z, t.z, 0.0, 0.0, 0.0, 1.0]
    }

    /// From the camera's frame to the world's.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// First `before`, then this: a point p is at self(before(p)).
    #[must_use]
    pub fn after(&self, before: &Self) -> Self {
        let translation = self.rotation * before.translation + self.translation;
        Self { rotation: self.rotation * before.rotation, translation }
    }

    /// How far the camera is turned `[rad]` and moved `[m]` from where `other` is.
    pub fn apart(&self, other: &Self) -> [f64; 2] {
        let way = self.after(&other.inverse());
        let cos = 0.5 * (way.rotation.x_axis.x + way.rotation.y_axis.y + way.rotation.z_axis.z - 1.0);
        let centre = |pose: &Self| pose.in_world(DVec3::ZERO);
        [cos.clamp(-1.0, 1.0).acos(), centre(self).distance(centre(other))]
    }

    /// The point of the world that lies at `p_camera` in the camera's frame.
    pub fn in_world(&self, p_camera: DVec3) -> DVec3 {
        self.rotation.transpose() * (p_camera - self.translation)
    }
}

/// A camera somewhere in the world. Points and directions are the world's, unless a name says otherwise.
///
/// A camera at the origin has no pose rather than the identity: it costs nothing, and no number changes in its
/// last bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// Intrinsics.
    pub camera: Camera,
    /// From the world's frame to the camera's; `None` where they are the same.
    pub camera_from_world: Option<Pose>,
}

impl From<Camera> for Viewpoint {
    /// A camera at the world's origin.
    fn from(camera: Camera) -> Self {
        Self { camera, camera_from_world: None }
    }
}

impl From<&Camera> for Viewpoint {
    fn from(camera: &Camera) -> Self {
        Self::from(*camera)
    }
}

impl From<&Self> for Viewpoint {
    fn from(view: &Self) -> Self {
        *view
    }
}

impl Viewpoint {
    /// From the same place, in another image of it.
    #[must_use]
    #[inline]
    pub fn with_camera(&self, camera: Camera) -> Self {
        Self { camera, ..*self }
    }

    /// A point in the camera's frame `[m]`.
    #[inline]
    pub fn in_camera(&self, p: DVec3) -> DVec3 {
        match &self.camera_from_world {
            None => p,
            Some(pose) => pose.rotation * p + pose.translation,
        }
    }

    /// Points in the camera's frame `[m]`.
    pub fn all_in_camera<'a>(&self, points: &'a [DVec3]) -> Cow<'a, [DVec3]> {
        match self.camera_from_world {
            None => Cow::Borrowed(points),
            Some(_) => points.iter().map(|p| self.in_camera(*p)).collect(),
        }
    }

    /// A direction, or a gradient by a point, of the camera's frame in the world's.
    #[inline]
    pub fn turned_to_world(&self, d_camera: DVec3) -> DVec3 {
        match &self.camera_from_world {
            None => d_camera,
            Some(pose) => pose.rotation.transpose() * d_camera,
        }
    }

    /// A matrix of second derivatives by a point, the same: M becomes Rᵀ M R.
    #[inline]
    pub fn matrix_turned_to_world(&self, m_camera: DMat3) -> DMat3 {
        match &self.camera_from_world {
            None => m_camera,
            Some(pose) => pose.rotation.transpose() * m_camera * pose.rotation,
        }
    }

    /// Distance of a point from the camera's plane `[m]`, negative behind it.
    #[inline]
    pub fn depth(&self, p: DVec3) -> f64 {
        self.in_camera(p).z
    }

    /// Pixel position of a point; means nothing of one that is not in front of the camera.
    #[inline]
    pub fn project(&self, p: DVec3) -> DVec2 {
        self.camera.project(self.in_camera(p))
    }

    /// The same of a point in front of the camera; `None` of others.
    #[inline]
    pub fn project_in_front(&self, p: DVec3) -> Option<DVec2> {
        let p_camera = self.in_camera(p);
        (p_camera.z > 0.0).then(|| self.camera.project(p_camera))
    }

    /// Derivatives of u and v of [`project`](Self::project) by the point [px/m].
    #[inline]
    pub fn projection_rows(&self, p: DVec3) -> [DVec3; 2] {
        self.camera.projection_rows(self.in_camera(p)).map(|row| self.turned_to_world(row))
    }

    /// Direction of the ray through pixel position `p_pixel`, of depth 1.
    #[inline]
    pub fn ray(&self, p_pixel: DVec2) -> DVec3 {
        self.turned_to_world(self.camera.ray(p_pixel))
    }

    /// Where the camera is `[m]`.
    #[inline]
    pub fn eye(&self) -> DVec3 {
        match &self.camera_from_world {
            None => DVec3::ZERO,
            Some(pose) => -(pose.rotation.transpose() * pose.translation),
        }
    }

    /// From the camera to a point `[m]`.
    #[inline]
    pub fn offset(&self, p: DVec3) -> DVec3 {
        match self.camera_from_world {
            None => p,
            Some(_) => p - self.eye(),
        }
    }

    /// Unit vector from the camera to a point; zero where it is.
    #[inline]
    pub fn direction(&self, p: DVec3) -> DVec3 {
        self.offset(p).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn poses_are_inverted_chained_and_written_by_rows() {
        let mut rng = Rng::new(5, 0);
        let [a, b] = [Pose::random(&mut rng), Pose::random(&mut rng)];
        let at = |pose: &Pose, p: DVec3| pose.rotation * p + pose.translation;
        let p = rng.vector();
        assert!((at(&a.after(&b), p) - at(&a, at(&b, p))).length() < 1e-12);
        assert!((at(&a.inverse(), at(&a, p)) - p).length() < 1e-12);
        assert_eq!(Pose::from_rows(&a.rows()), a);
        assert_eq!(Pose::IDENTITY.rows()[..6], [1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let turn = Pose { rotation: DMat3::from_rotation_y(0.3), translation: DVec3::ZERO };
        let moved = Pose { translation: DVec3::X * 0.2, ..Pose::IDENTITY };
        let [angle, way] = turn.after(&moved).apart(&Pose::IDENTITY);
        assert!((angle - 0.3).abs() < 1e-9 && (way - 0.2).abs() < 1e-12, "{angle} {way}");
    }

    const CAMERA: Camera = Camera { fx: 800.0, fy: 700.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

    /// Some viewpoint, a point in front of it, and the same in the camera's frame.
    fn posed(rng: &mut Rng) -> (Viewpoint, DVec3, DVec3) {
        let pose = Pose::random(rng);
        let view = Viewpoint { camera: CAMERA, camera_from_world: Some(pose) };
        let p_camera = DVec3::new(0.3 * rng.signed(), 0.2 * rng.signed(), 1.2 + 0.5 * rng.signed());
        (view, pose.in_world(p_camera), p_camera)
    }

    #[test]
    fn a_moved_camera_sees_what_one_at_the_origin_sees_of_moved_points() {
        let mut rng = Rng::new(1, 0);
        let mut worst = 0.0f64;
        for _ in 0..50 {
            let (view, p, p_camera) = posed(&mut rng);
            worst = worst.max(view.project(p).distance(CAMERA.project(p_camera)));
            assert!((view.depth(p) - p_camera.z).abs() < 1e-12);
            assert!((view.offset(p).length() - p_camera.length()).abs() < 1e-12);
            assert!(view.all_in_camera(&[p])[0].distance(p_camera) < 1e-12);
            assert!(view.in_camera(view.eye()).length() < 1e-12);
            let behind = p - 2.0 * p_camera.z * view.ray(DVec2::new(319.5, 239.5));
            assert!(view.project_in_front(p) == Some(view.project(p)));
            assert!(view.project_in_front(behind).is_none());
        }
        println!("pixels apart: at most {worst:.1e}");
        assert!(worst < 1e-9);
    }

    #[test]
    fn the_ray_through_a_projected_point_hits_it() {
        let mut rng = Rng::new(2, 0);
        for _ in 0..50 {
            let (view, p, _) = posed(&mut rng);
            let ray = view.ray(view.project(p));
            assert!(p.distance(view.eye() + ray * view.depth(p)) < 1e-12);
            assert!(view.direction(p).distance(ray.normalize()) < 1e-12);
        }
    }

    #[test]
    fn slopes_are_central_differences() {
        let mut rng = Rng::new(3, 0);
        let mut worst = 0.0f64;
        for _ in 0..50 {
            let (view, p, _) = posed(&mut rng);
            let d = rng.vector();
            let rows = view.projection_rows(p);
            let found = DVec2::new(rows[0].dot(d), rows[1].dot(d));
            let h = 1e-5;
            let expected = (view.project(p + d * h) - view.project(p - d * h)) / (2.0 * h);
            assert!(expected.length() > 1.0, "{expected}");
            worst = worst.max(found.distance(expected) / expected.length());
        }
        println!("slopes: worst relative error {worst:.1e}");
        assert!(worst < 1e-7);
    }

    #[test]
    fn a_camera_at_the_origin_changes_no_bit() {
        let view = Viewpoint::from(CAMERA);
        let p = DVec3::new(-0.0, 0.1, 1.3);
        let bits = |p: DVec3| p.to_array().map(f64::to_bits);
        assert_eq!(bits(view.in_camera(p)), bits(p));
        assert_eq!(bits(view.offset(p)), bits(p));
        assert_eq!(bits(view.ray(DVec2::new(3.0, 4.0))), bits(CAMERA.ray(DVec2::new(3.0, 4.0))));
        assert_eq!(view.projection_rows(p).map(bits), CAMERA.projection_rows(p).map(bits));
        assert!(matches!(view.all_in_camera(&[p]), Cow::Borrowed(_)));
    }
}
