//! A point of the cloth as a pixel sees it.

use glam::{DVec3, Vec3};

/// A point of the cloth as a pixel sees it.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// Position `[m]`.
    pub position: Vec3,
    /// Shading normal: the vertices' normals interpolated, on the side that the camera sees, unit.
    pub normal: Vec3,
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Frame · number of triangles + triangle.
    pub patch: u32,
    /// Whether it is on the other side of a [two-sided](crate::raster::Rasterizer::two_sided) fabric.
    pub turned: bool,
}

/// Weights of a triangle's corners where the ray from the camera along `ray` meets its plane.
#[inline]
pub fn barycentrics([a, b, c]: [DVec3; 3], ray: DVec3) -> [f64; 3] {
    let weights = [ray.dot(b.cross(c)), ray.dot(c.cross(a)), ray.dot(a.cross(b))];
    weights.map(|w| w / weights.iter().sum::<f64>())
}
