//! Which pixels the template covers, as far as checking needs it: pixel centres in triangles, no depth.

use std::path::Path;

use glam::{DVec2, DVec3};

use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::error::Repair;
use tessuto_core::image::Image;
use tessuto_core::mesh::Mesh;

/// A variant of the axes whose overlap is this much larger than the template's own is named.
pub const VARIANT_GAIN: f64 = 0.2;

/// Calls `visit(column, row)` for every integer point of 0..width × 0..height in the triangle `p` `[px]`.
/// Points on an edge belong to the triangle if `closed`.
pub fn fill_triangle(
    p: [DVec2; 3],
    [width, height]: [usize; 2],
    closed: bool,
    mut visit: impl FnMut(usize, usize),
) {
    let area = (p[1] - p[0]).perp_dot(p[2] - p[0]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
    let bounds = |low: f64, high: f64, n: usize| {
        (low.ceil().max(0.0) as usize, (high.floor() + 1.0).clamp(0.0, n as f64) as usize)
    };
    let (x0, x1) = bounds(low.x, high.x, width);
    let (y0, y1) = bounds(low.y, high.y, height);
    for y in y0..y1 {
        for x in x0..x1 {
            let q = DVec2::new(x as f64, y as f64);
            let inside = (0..3).all(|k| {
                let w = (p[(k + 1) % 3] - p[k]).perp_dot(q - p[k]) * area.signum();
                w > 0.0 || (closed && w == 0.0)
            });
            if inside {
                visit(x, y);
            }
        }
    }
}

/// Which pixels of `view` the `mesh` at `positions` `[m]` covers, shape [height · width]; triangles that reach behind
/// the camera are left out.
pub fn template_coverage(mesh: &Mesh, positions: &[DVec3], view: impl Into<Viewpoint>) -> Vec<bool> {
    let view = view.into();
    let size = [view.camera.width, view.camera.height];
    let mut covered = vec![false; size[0] * size[1]];
    for triangle in mesh.triangles() {
        let corners = triangle.map(|v| positions[v as usize]);
        if corners.iter().all(|p| view.depth(*p) > 0.0) {
            fill_triangle(corners.map(|p| view.project(p)), size, true, |x, y| {
                covered[y * size[0] + x] = true;
            });
        }
    }
    covered
}

/// Intersection over union of covered pixels and those where `mask` ≥ ½.
pub fn overlap(covered: &[bool], mask: &Image) -> f64 {
    let (mut both, mut either) = (0usize, 0usize);
    for (covered, value) in covered.iter().zip(&mask.data) {
        both += usize::from(*covered && *value >= 0.5);
        either += usize::from(*covered || *value >= 0.5);
    }
    if either == 0 { 0.0 } else { both as f64 / either as f64 }
}

/// The template with other signs or order of x and y, and how well it fits the mask.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// What is done to the file's coordinates.
    pub name: &'static str,
    /// Whether x and y are swapped, and then which axes are negated.
    pub swap_xy: bool,
    /// x, y, z.
    pub flip: [bool; 3],
    /// Overlap with the mask, in [0, 1].
    pub iou: f64,
}

/// Overlap with `mask` of the eight templates with x and y flipped or swapped; the first is the file's own.
/// Depth is taken as its absolute value, so that coordinates of the OpenGL camera (y up, z backwards)
/// show as a flip of y.
pub fn axis_variants(mesh: &Mesh, camera: &Camera, mask: &Image) -> [Variant; 8] {
    let backwards = mesh.positions.iter().all(|p| p.z < 0.0);
    let names = if backwards {
        [
            "z negated",
            "y and z negated, from the OpenGL camera frame",
            "x and z negated",
            "x, y and z negated",
            "x and y swapped, z negated",
            "x and y swapped, then y and z negated",
            "x and y swapped, then x and z negated",
            "x and y swapped, then all negated",
        ]
    } else {
        [
            "as it is",
            "y negated, from a frame with y up",
            "x negated",
            "x and y negated, from the PyTorch3D camera frame",
            "x and y swapped",
            "x and y swapped, then y negated",
            "x and y swapped, then x negated",
            "x and y swapped, then both negated",
        ]
    };
    std::array::from_fn(|k| {
        let change = |p: &DVec3| {
            let (x, y) = if k & 4 == 0 { (p.x, p.y) } else { (p.y, p.x) };
            let sign = |bit: usize| if k & bit == 0 { 1.0 } else { -1.0 };
            DVec3::new(x * sign(2), y * sign(1), p.z.abs())
        };
        let positions: Vec<DVec3> = mesh.positions.iter().map(change).collect();
        let iou = overlap(&template_coverage(mesh, &positions, camera), mask);
        Variant { name: names[k], swap_xy: k & 4 != 0, flip: [k & 2 != 0, k & 1 != 0, backwards], iou }
    })
}

impl Variant {
    /// What makes the template of the scene in `folder` this one.
    pub fn repair(&self, folder: &Path) -> Repair {
        Repair { swap_xy: self.swap_xy, flip: self.flip, ..Repair::of(folder) }
    }
}

/// The variant that fits best; the file's own unless another is better.
pub fn best_variant(variants: [Variant; 8]) -> Variant {
    let better = |best: Variant, v: Variant| if v.iou > best.iou { v } else { best };
    variants.into_iter().reduce(better).expect("eight variants")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_covers_the_expected_pixels() {
        // 0.4 m × 0.2 m at 1 m with 100 px focal length: columns 10..=50, rows 20..=40, edges included.
        let mesh = tessuto_core::mesh::grid(5, 3, DVec2::new(0.4, 0.2), 1.0);
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 30.0, cy: 30.0, width: 64, height: 64 };
        let covered = template_coverage(&mesh, &mesh.positions, camera);
        assert_eq!(covered.iter().filter(|c| **c).count(), 41 * 21);
        assert!(covered[20 * 64 + 10] && covered[40 * 64 + 50] && !covered[19 * 64 + 10]);
    }

    #[test]
    fn flipped_template_is_named() {
        let mut mesh = tessuto_core::mesh::grid(5, 3, DVec2::new(0.2, 0.2), 1.0);
        mesh.positions.iter_mut().for_each(|p| *p += DVec3::new(0.05, 0.2, 0.0));
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let covered = template_coverage(&mesh, &mesh.positions, camera);
        let data = covered.iter().map(|c| f32::from(u8::from(*c))).collect();
        let mask = Image { width: 64, height: 64, channels: 1, data };
        let flipped =
            Mesh { positions: mesh.positions.iter().map(|p| DVec3::new(-p.x, -p.y, p.z)).collect(), ..mesh };
        let variants = axis_variants(&flipped, &camera, &mask);
        assert!(variants[0].iou < 0.3);
        let best = best_variant(variants);
        assert_eq!((best.iou, best.name.contains("PyTorch3D"), best.flip), (1.0, true, [true, true, false]));
    }
}
