//! Front and back of a sheet.

use glam::DVec3;

use super::Mesh;
use crate::camera::Viewpoint;

/// One side of a mesh, whose polygons are wound alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Whether its corners go around clockwise in the image.
    clockwise: bool,
}

impl Side {
    /// The side that `view` sees of a triangle with these corners of the world; `None` if it sees neither.
    #[inline]
    pub fn seen(view: &Viewpoint, corners: [DVec3; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|p| view.offset(p));
        let volume = a.dot((b - a).cross(c - a));
        (volume != 0.0 && volume.is_finite()).then_some(Self { clockwise: volume > 0.0 })
    }

    /// The side of `mesh` that `view` sees more of, in pixels: its front, where this is how the first frame sees the
    /// template.
    pub fn front(mesh: &Mesh, view: &Viewpoint) -> Self {
        let mut sum = 0.0;
        for t in mesh.triangles() {
            let corners = t.map(|v| mesh.positions[v as usize]);
            if corners.iter().all(|p| view.depth(*p) > 0.0) {
                let [a, b, c] = corners.map(|p| view.project(p));
                let area = (b - a).perp_dot(c - a).abs();
                sum += match Self::seen(view, corners) {
                    Some(Self { clockwise: true }) => area,
                    Some(_) => -area,
                    None => 0.0,
                };
            }
        }
        Self { clockwise: sum > 0.0 }
    }

    /// Sign of x0 · ((x1 − x0) × (x2 − x0)) of a triangle that shows this side, its corners in the camera's frame.
    #[inline]
    pub fn sign(self) -> i8 {
        if self.clockwise { 1 } else { -1 }
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        Self { clockwise: !self.clockwise }
    }

    /// Whether a triangle with these corners, seen by `view`, shows the other side.
    #[inline]
    pub fn turned(self, view: &Viewpoint, corners: [DVec3; 3]) -> bool {
        Self::seen(view, corners) == Some(self.other())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::camera::{Camera, Pose};
    use crate::math::rng::Rng;
    use crate::mesh::grid;

    #[test]
    fn what_is_turned_over_shows_its_back_from_wherever_it_is_seen() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 49.5, cy: 49.5, width: 100, height: 100 };
        let mut rng = Rng::new(3, 0);
        for pose in [None, Some(Pose::random(&mut rng))] {
            let view = Viewpoint { camera, camera_from_world: pose };
            let mut mesh = grid(5, 5, DVec2::splat(0.4), 1.0);
            let place = |p: DVec3| pose.map_or(p, |pose| pose.in_world(p));
            let flat = mesh.positions.clone();
            mesh.positions = flat.iter().map(|p| place(*p)).collect();
            let front = Side::front(&mesh, &view);
            // The right quarter is laid over the rest.
            let fold = |p: &DVec3| if p.x > 0.05 { DVec3::new(0.15 - p.x, p.y, p.z - 0.02) } else { *p };
            let folded: Vec<DVec3> = flat.iter().map(|p| place(fold(p))).collect();
            let mut turned = 0;
            for t in mesh.triangles() {
                let right = t.iter().all(|v| flat[*v as usize].x > 0.05);
                assert!(!front.turned(&view, t.map(|v| mesh.positions[v as usize])));
                assert_eq!(front.turned(&view, t.map(|v| folded[v as usize])), right, "{t:?}");
                turned += usize::from(right);
            }
            assert!(turned == 8, "{turned}");
            assert_eq!(Side::front(&Mesh { positions: folded, ..mesh.clone() }, &view), front);
            mesh.faces.iter_mut().for_each(|face| face.vertices.reverse());
            assert_eq!(Side::front(&mesh, &view), front.other());
        }
    }
}
