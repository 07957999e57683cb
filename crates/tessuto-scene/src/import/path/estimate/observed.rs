//! Where a point that a frame shows is in another frame, and how that changes with both poses and the point.

use glam::{DVec2, DVec3};

use tessuto_core::camera::{Camera, Pose};

/// A point of the world, by its pixel position in the frame that showed it first and one over its depth there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub at: DVec2,
    pub inverse_depth: f64,
}

/// A pixel position and its derivatives: of u and v, each by what is named.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observed {
    pub at: DVec2,
    /// By a rotation of the frame's pose and by its translation, R → exp(ω) R, t → t + τ.
    pub by_frame: [[f64; 6]; 2],
    /// The same of the frame that showed it first.
    pub by_host: [[f64; 6]; 2],
    /// By position there, and by the inverse depth.
    pub by_point: [[f64; 3]; 2],
}

/// Pixel position alone; `None` behind the camera.
pub(super) fn place(camera: &Camera, host: &Pose, frame: &Pose, point: &Point) -> Option<DVec2> {
    let q = in_frame(camera, host, frame, point);
    (q.z > 0.0).then(|| camera.project(q))
}

/// R_n R_hᵀ (b − ρ t_h) + ρ t_n with the ray b and the inverse depth ρ: the point in the frame of the camera, times ρ.
fn in_frame(camera: &Camera, host: &Pose, frame: &Pose, point: &Point) -> DVec3 {
    let rho = point.inverse_depth;
    let from_host = camera.ray(point.at) - rho * host.translation;
    frame.rotation * (host.rotation.transpose() * from_host) + rho * frame.translation
}

/// Pixel position with its derivatives; `None` behind the camera.
pub(super) fn observed(camera: &Camera, host: &Pose, frame: &Pose, point: &Point) -> Option<Observed> {
    let rho = point.inverse_depth;
    let from_host = camera.ray(point.at) - rho * host.translation;
    let turn = frame.rotation * host.rotation.transpose();
    let turned = turn * from_host;
    let q = turned + rho * frame.translation;
    if q.z <= 0.0 {
        return None;
    }
    let rows = camera.projection_rows(q);
    let six = |a: DVec3, b: DVec3| [a.x, a.y, a.z, b.x, b.y, b.z];
    let back = turn.transpose();
    let by_frame = rows.map(|row| six(turned.cross(row), rho * row));
    // R_hᵀ → R_hᵀ exp(−ω): the turn of what comes from the host is the other way round.
    let by_host = rows.map(|row| six(-from_host.cross(back * row), -rho * (back * row)));
    let by_depth = frame.translation - turn * host.translation;
    let by_point = rows.map(|row| {
        let ray = back * row;
        [ray.x / camera.fx, ray.y / camera.fy, row.dot(by_depth)]
    });
    Some(Observed { at: camera.project(q), by_frame, by_host, by_point })
}

/// A pose after a step.
pub(super) fn stepped(pose: &Pose, step: &[f64]) -> Pose {
    let turn = glam::DQuat::from_scaled_axis(DVec3::from_slice(step));
    Pose {
        rotation: glam::DMat3::from_quat(turn) * pose.rotation,
        translation: pose.translation + DVec3::from_slice(&step[3..]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn derivatives_are_those_of_differences() {
        let camera = Camera { fx: 600.0, fy: 550.0, cx: 239.5, cy: 200.5, width: 480, height: 400 };
        let (mut rng, mut worst) = (Rng::new(4, 0), 0.0f64);
        let pose = |rng: &mut Rng| {
            let step: Vec<f64> = (0..6).map(|_| 0.2 * rng.signed()).collect();
            stepped(&Pose::IDENTITY, &step)
        };
        for seed in 0..20 {
            let (host, frame) = (pose(&mut rng), pose(&mut rng));
            let point =
                Point { at: DVec2::new(240.0 + 200.0 * rng.signed(), 200.0), inverse_depth: rng.uniform() };
            let at = observed(&camera, &host, &frame, &point).unwrap();
            for c in 0..2 {
                let gradient = [&at.by_frame[c][..], &at.by_host[c], &at.by_point[c]].concat();
                // Pixels and radians differ by the focal length.
                let scale = |k: usize| if k == 12 || k == 13 { 600.0 } else { 1.0 };
                let scaled: Vec<f64> = gradient.iter().enumerate().map(|(k, g)| g * scale(k)).collect();
                let value = |x: &[f64]| {
                    let x: Vec<f64> = x.iter().enumerate().map(|(k, x)| x * scale(k)).collect();
                    let moved = Point {
                        at: point.at + DVec2::new(x[12], x[13]),
                        inverse_depth: point.inverse_depth + x[14],
                    };
                    place(&camera, &stepped(&host, &x[6..12]), &stepped(&frame, &x[..6]), &moved).unwrap()[c]
                };
                worst = worst.max(check(&[0.0; 15], &scaled, 1e-4, 6, seed, value).relative_error);
            }
        }
        println!("worst {worst:.1e}");
        assert!(worst < 1e-7);
    }
}
