//! Depth difference at the measured points' pixels, with a z-buffer of its own: it does not share
//! code with the rasteriser, so that each can be checked against the other.

use glam::{DVec2, DVec3};

use tessuto_core::camera::{Camera, Viewpoint};

/// Depth difference δ `[m]`: mean |z_mesh − z| over the measured points whose pixel the mesh covers;
/// None if it covers none.
///
/// - `points`: measured `[m]`, in front of the camera, shape `[P]`; a point's pixel is its rounded projection
/// - `positions`: vertices `[m]`, shape `[V]`
/// - `view`: how the frame is seen
pub(crate) fn mean_difference(
    points: &[DVec3],
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    view: &Viewpoint,
) -> Option<f64> {
    let pixel_of = |p: &DVec3| {
        let p_pixel = view.project(*p);
        (p_pixel.y.round_ties_even() as i64, p_pixel.x.round_ties_even() as i64)
    };
    let mut pixels: Vec<(i64, i64)> = points.iter().map(pixel_of).collect();
    pixels.sort_unstable();
    pixels.dedup();
    let nearest = depths(&pixels, positions, triangles, view);
    let (mut sum, mut count) = (0.0, 0usize);
    for p in points {
        let z = nearest[pixels.partition_point(|q| *q < pixel_of(p))];
        if z.is_finite() {
            sum += (z - view.depth(*p)).abs();
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}

/// Smallest depth `[m]` of the mesh at each pixel (row, column), infinite where it is not hit.
///
/// - `pixels`: ascending, each once. Triangles with a vertex behind the camera are left out.
pub fn depths(
    pixels: &[(i64, i64)],
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    view: &Viewpoint,
) -> Vec<f64> {
    let mut nearest = vec![f64::INFINITY; pixels.len()];
    for triangle in triangles {
        let corners = triangle.map(|i| view.in_camera(positions[i as usize]));
        if corners.iter().all(|p| p.z > 0.0) {
            draw(corners, pixels, &view.camera, &mut nearest);
        }
    }
    nearest
}

/// Draws a triangle whose corners are in the camera's frame.
fn draw(corners: [DVec3; 3], pixels: &[(i64, i64)], camera: &Camera, nearest: &mut [f64]) {
    let [a, b, c] = corners.map(|p| camera.project(p));
    let (low, high) = (a.min(b).min(c).ceil(), a.max(b).max(c).floor());
    let (x0, y0, x1, y1) = (low.x as i64, low.y as i64, high.x as i64, high.y as i64);
    let area = (b - a).perp_dot(c - a);
    if area.abs() < 1e-12 {
        return;
    }
    // Step through the pixels of the bounding box, jumping over those beside it.
    let mut k = pixels.partition_point(|p| *p < (y0, x0));
    while k < pixels.len() && pixels[k].0 <= y1 {
        let (y, x) = pixels[k];
        if x < x0 {
            k += pixels[k..].partition_point(|p| *p < (y, x0));
        } else if x > x1 {
            k += pixels[k..].partition_point(|p| *p < (y + 1, x0));
        } else {
            let p = DVec2::new(x as f64, y as f64) - a;
            let l1 = p.perp_dot(c - a) / area;
            let l2 = (b - a).perp_dot(p) / area;
            let l0 = 1.0 - l1 - l2;
            if l0 >= 0.0 && l1 >= 0.0 && l2 >= 0.0 {
                // 1/z is affine in the image.
                let z = 1.0 / (l0 / corners[0].z + l1 / corners[1].z + l2 / corners[2].z);
                nearest[k] = nearest[k].min(z);
            }
            k += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::Pose;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn a_world_moved_with_its_camera_has_the_same_depths() {
        let camera = Camera { fx: 100.0, fy: 90.0, cx: 31.2, cy: 30.7, width: 64, height: 64 };
        let mesh = grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
        let mut rng = Rng::new(3, 0);
        let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p + rng.vector() * 0.02).collect();
        let points: Vec<DVec3> =
            (0..200).map(|_| DVec3::new(0.15 * rng.signed(), 0.1 * rng.signed(), 1.1)).collect();
        let pose = Pose::random(&mut rng);
        let view = Viewpoint { camera, camera_from_world: Some(pose) };
        let moved = |x: &[DVec3]| -> Vec<DVec3> { x.iter().map(|p| pose.in_world(*p)).collect() };
        let here = mean_difference(&points, &x, &mesh.triangles(), &camera.into()).unwrap();
        let there = mean_difference(&moved(&points), &moved(&x), &mesh.triangles(), &view).unwrap();
        assert!(here > 0.05 && (here - there).abs() < 1e-12, "{here} {there}");
    }
}
