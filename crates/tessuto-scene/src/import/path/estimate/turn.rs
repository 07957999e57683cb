//! How a camera turned between two frames: the rotation that carries the brightness around the fabric from one to the
//! other best, coarse to fine. It says where windows are to be looked for.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::surroundings::Surroundings;
use tessuto_core::camera::Camera;
use tessuto_core::math::median::median;
use tessuto_core::math::root::Root;

/// Pixels of a level that are compared, at most about.
const PIXELS: usize = 20_000;
/// The finest level has at most this many pixels across.
const FINEST: usize = 700;
const STEPS: usize = 15;
/// A step of less than this many pixels is the last.
const LITTLE: f64 = 0.01;
/// Differences of brightness that are surely noise `[grey levels]`.
const NOISE: f64 = 2.0;
/// Fewest pixels that tell a rotation.
const FEWEST: usize = 50;

/// The rotation of rays from the camera's frame in `from` to that in `to`, nearest to `start`.
pub(super) fn turn(camera: &Camera, from: &Surroundings, to: &Surroundings, start: DMat3) -> DMat3 {
    let coarse_to_fine = (0..from.levels.len()).rev();
    let levels = coarse_to_fine.filter(|k| *k + 1 == from.levels.len() || camera.width >> k <= FINEST);
    levels.fold(start, |turn, k| refined(camera, from, to, k, turn))
}

fn refined(camera: &Camera, from: &Surroundings, to: &Surroundings, level: usize, start: DMat3) -> DMat3 {
    let camera = camera.downsampled(1 << level);
    let (from, to) = (&from.levels[level], &to.levels[level]);
    let (width, height) = (from.grey.width, from.grey.height);
    let stride = ((width * height) as f64 / PIXELS as f64).sqrt().ceil().max(1.0) as usize;
    let rows = (1..height - 1).step_by(stride);
    let pixels: Vec<(usize, usize)> = rows
        .flat_map(|y| (1..width - 1).step_by(stride).map(move |x| (x, y)))
        .filter(|(x, y)| from.free[y * width + x])
        .collect();
    let mut turn = start;
    for _ in 0..STEPS {
        // Brightness here and there, and its slope by the rotation.
        let seen: Vec<(f64, f64, DVec3)> = pixels
            .iter()
            .filter_map(|&(x, y)| {
                let q = turn * camera.ray(DVec2::new(x as f64, y as f64));
                let p = camera.project(q);
                if q.z <= 0.0 || !to.grey.holds(p.x, p.y, 1.0) {
                    return None;
                }
                let (u, v) = ((p.x + 0.5) as usize, (p.y + 0.5) as usize);
                if !to.free[v * width + u] {
                    return None;
                }
                let [gx, gy] = to.grey.slope(u, v).map(f64::from);
                let [row_x, row_y] = camera.projection_rows(q);
                let by_turn = q.cross(gx * row_x + gy * row_y);
                let here = f64::from(from.grey.data[y * width + x]);
                Some((here, f64::from(to.grey.sample(p.x, p.y)), by_turn))
            })
            .collect();
        if seen.len() < FEWEST {
            return start;
        }
        let brighter = seen.iter().map(|s| s.0).sum::<f64>() / seen.iter().map(|s| s.1).sum::<f64>().max(1.0);
        let off = |s: &(f64, f64, DVec3)| s.0 - brighter * s.1;
        let spread = 1.5 * median(seen.iter().map(|s| off(s).abs()).collect()).unwrap_or(0.0) + NOISE;
        let (mut matrix, mut right) = ([0.0; 9], DVec3::ZERO);
        for s in &seen {
            let r = off(s);
            // Geman and McClure: people who walk through the image are not listened to.
            let weight = (1.0 + (r / spread / 2.0).powi(2)).powi(-2);
            right += weight * r * s.2;
            for (k, entry) in matrix.iter_mut().enumerate() {
                *entry += weight * s.2[k / 3] * s.2[k % 3];
            }
        }
        [0, 4, 8].iter().for_each(|k| matrix[*k] += 1e-9 * (matrix[0] + matrix[4] + matrix[8]));
        let step = DVec3::from_slice(&Root::of(&matrix, 3).solve(&right.to_array()));
        if !step.is_finite() || step.length() > 0.3 {
            return start;
        }
        turn = DMat3::from_quat(DQuat::from_scaled_axis(step)) * turn;
        if step.length() * camera.fx < LITTLE {
            break;
        }
    }
    turn
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::*;

    #[test]
    fn the_rotation_of_a_textured_world_is_found() {
        let camera = Camera { fx: 220.0, fy: 220.0, cx: 119.5, cy: 89.5, width: 240, height: 180 };
        for axis in [DVec3::new(0.02, -0.05, 0.03), DVec3::new(-0.004, 0.001, 0.0)] {
            let truth = DMat3::from_quat(DQuat::from_scaled_axis(axis));
            let [a, b] = [DMat3::IDENTITY, truth].map(|turn| made::sky(&camera, turn));
            let found = turn(&camera, &a, &b, DMat3::IDENTITY);
            let off = DQuat::from_mat3(&(found * truth.transpose())).to_scaled_axis().length();
            println!("{:.4}° off", off.to_degrees());
            assert!(off * camera.fx < 0.1, "{off}");
        }
    }
}
