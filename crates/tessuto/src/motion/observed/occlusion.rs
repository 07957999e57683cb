//! The sheet in front of itself: points that it hides, and parts of its boundary that are not its outline.

use glam::{DVec2, DVec3};

use super::samples::{EdgePoint, SurfaceSamples};
use crate::camera::Camera;
use crate::raster::{Rasterizer, Rendering, Texture};

/// What is nearer to the camera by more than this part of a point's depth hides it.
const NEARER: f64 = 0.01;
/// Beyond a boundary point by so many pixels nothing of the sheet is seen where the boundary is the outline.
const BEYOND: f64 = 1.5;

/// What of a frame's mesh does not count, at one resolution; held fixed while a step is taken.
#[derive(Debug, Clone, Default)]
pub struct Occlusion {
    /// Whether a surface point is hidden; empty if none is.
    pub hidden: Vec<bool>,
    /// Whether a boundary point lies in front of or behind more of the sheet; empty if none does.
    pub inner: Vec<bool>,
}

impl Occlusion {
    /// Of the mesh at `x` as `camera` sees it.
    pub fn new(
        rasterizer: &Rasterizer,
        samples: &SurfaceSamples,
        boundary: &[EdgePoint],
        camera: &Camera,
        x: &[DVec3],
    ) -> Self {
        if !turned_over(rasterizer.triangles(), camera, x) {
            return Self::default();
        }
        let mut rendering = Rendering::new();
        rasterizer.render(camera, x, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
        let depth_at = |p: DVec2| {
            let at = p.round();
            let within =
                at.x >= 0.0 && at.y >= 0.0 && at.x < camera.width as f64 && at.y < camera.height as f64;
            within.then(|| rendering.depth(at.x as usize, at.y as usize)).flatten()
        };
        let hidden = samples.points.iter().map(|point| {
            let p = samples.position(point, x);
            p.z > 0.0 && depth_at(camera.project(p)).is_some_and(|z| z < (1.0 - NEARER) * p.z)
        });
        let inner = boundary.iter().map(|point| {
            let [a, b] = point.vertices.map(|v| camera.project(x[v as usize]));
            let opposite = camera.project(x[point.opposite as usize]);
            let out = (b - a).perp().normalize_or_zero();
            let out = if out.dot(opposite - a) > 0.0 { -out } else { out };
            depth_at(a * point.weights[0] + b * point.weights[1] + out * BEYOND).is_some()
        });
        Self { hidden: hidden.collect(), inner: inner.collect() }
    }
}

/// Whether some triangles show the camera their other side: where none do, the sheet can hardly be in front of itself.
fn turned_over(triangles: &[[u32; 3]], camera: &Camera, x: &[DVec3]) -> bool {
    let mut sides = [false; 2];
    for t in triangles {
        let [a, b, c] = t.map(|v| x[v as usize]);
        if a.z <= 0.0 || b.z <= 0.0 || c.z <= 0.0 {
            continue;
        }
        let [a, b, c] = [a, b, c].map(|p| camera.project(p));
        sides[usize::from((b - a).perp_dot(c - a) > 0.0)] = true;
    }
    sides == [true; 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid;
    use crate::motion::observed::samples::boundary_points;

    #[test]
    fn a_flap_hides_what_is_behind_it_and_its_edge_is_no_outline() {
        // A sheet whose right half is turned over to lie in front of the left one, 30 mm nearer.
        let mesh = grid(21, 11, DVec2::new(0.4, 0.2), 1.0);
        let camera = Camera { fx: 300.0, fy: 300.0, cx: 79.5, cy: 79.5, width: 160, height: 160 };
        let samples = SurfaceSamples::new(&mesh, &mesh.positions, &camera, 1.0);
        let boundary = boundary_points(&mesh, &mesh.positions, &camera, 2.0);
        let rasterizer = Rasterizer::new(&mesh);
        let of = |x: &[DVec3]| Occlusion::new(&rasterizer, &samples, &boundary, &camera, x);
        let flat = of(&mesh.positions);
        assert!(flat.hidden.is_empty() && flat.inner.is_empty());
        let fold = |p: &DVec3| if p.x > 0.08 { DVec3::new(0.16 - p.x, p.y, p.z - 0.03) } else { *p };
        let x: Vec<DVec3> = mesh.positions.iter().map(fold).collect();
        let folded = of(&x);
        for (point, hidden) in samples.points.iter().zip(&folded.hidden) {
            let p = samples.position(point, &mesh.positions);
            // A margin of a cell about the edge of the flap and the fold.
            if (p.x + 0.04).abs() > 0.03 && (p.x - 0.08).abs() > 0.03 && p.y.abs() < 0.08 {
                assert_eq!(*hidden, p.x > -0.04 && p.x < 0.08, "{p}");
            }
        }
        for (point, inner) in boundary.iter().zip(&folded.inner) {
            let [a, b] = point.vertices.map(|v| mesh.positions[v as usize]);
            if a.x == b.x && a.y.abs() < 0.08 && b.y.abs() < 0.08 {
                assert_eq!(*inner, a.x > 0.0, "{a} {b}");
            }
        }
        assert!(folded.inner.contains(&true) && folded.inner.contains(&false));
    }
}
