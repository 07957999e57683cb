//! A rectangle of fabric of known size from its four corners in the image.
//!
//! Where the corners are those of a rigid rectangle, its pose is found from the homography and refined on the
//! reprojection error. Fabric that sags or bends has corners nearer to each other than the rectangle's, never
//! farther: where no rigid rectangle fits, each corner gets the depth that makes the six distances between them fit
//! best, long ones counting more than short ones, and the four corners lie nearly in a plane.

use glam::{DMat3, DVec2, DVec3};

use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};
use tessuto_core::math::minimise::{Model, Policy};
use tessuto_core::mesh::{Mesh, grid};

/// A rectangle whose corners are this near [fraction of its mean side] to those seen, root mean square, is rigid.
const RIGID: f64 = 0.004;
/// What a distance that is too short counts against one that is too long.
const SHORT: f64 = 0.25;
/// Weight of a corner's height above the plane of the others, against strain.
const LIFT: f64 = 0.05;
/// So much damping that no step helps says that the pose is found.
const POLICY: Policy = Policy {
    lambda: 1e-3,
    accepted: [0.2, 0.0],
    rejected: [8.0, 0.0],
    strictly: true,
    least_gain: [0.0, 1e-12],
    most: 1e9,
    ..Policy::PATIENT
};

/// Where the corners are in space.
#[derive(Debug, Clone, Copy)]
pub struct Corners {
    /// Upper left, upper right, lower right, lower left `[m]`, camera frame.
    pub positions: [DVec3; 4],
    /// Root mean square distance of the rigid rectangle's corners from those seen `[px]`.
    pub rigid_error: f64,
    /// Whether the rigid rectangle was taken.
    pub rigid: bool,
    /// Whether another pose of the rigid rectangle fits nearly as well.
    pub ambiguous: bool,
}

/// Finds the corners of a rectangle of `size` (width along the upper side, height) `[m]` seen at `p_pixel` `[px]`:
/// upper left, upper right, lower right, lower left.
///
/// # Errors
/// [`Error::Usage`] if the four points are no convex quadrilateral in this order.
pub fn locate(camera: &Camera, size: DVec2, p_pixel: [DVec2; 4]) -> Result<Corners> {
    check_order(p_pixel)?;
    let side = (0..4).map(|k| p_pixel[k].distance(p_pixel[(k + 1) % 4])).sum::<f64>() / 4.0;
    let poses = fit(camera, size, p_pixel);
    let (pose, rigid_error) = poses[0];
    let turned_away = (poses[1].0.rotation.z_axis - pose.rotation.z_axis).length() > 0.05;
    let rigid_positions = model(size).map(|c| pose.apply(c));
    let rigid = rigid_error < RIGID * side;
    let positions = if rigid {
        rigid_positions
    } else {
        by_distances(p_pixel.map(|p| camera.ray(p).truncate()), size, rigid_positions.map(|p| p.z))
    };
    Ok(Corners {
        positions,
        rigid_error,
        rigid,
        ambiguous: turned_away && poses[1].1 < 1.5 * rigid_error + 0.2,
    })
}

/// Refuses corners that are no convex quadrilateral, clockwise from the upper left.
pub(super) fn check_order(p_pixel: [DVec2; 4]) -> Result<()> {
    let turn =
        |k: usize| (p_pixel[(k + 1) % 4] - p_pixel[k]).perp_dot(p_pixel[(k + 2) % 4] - p_pixel[(k + 1) % 4]);
    // A tenth of a square pixel is a line, not a corner.
    if (0..4).all(|k| turn(k) > 0.1) {
        return Ok(());
    }
    Err(Error::usage(
        format!(
            "the corners {} are no quadrilateral clockwise from the upper left",
            p_pixel.map(|p| format!("{:.0},{:.0}", p.x, p.y)).join(" ")
        ),
        "give upper left, upper right, lower right, lower left, as seen in the image",
    ))
}

/// Corners of the rectangle in its own plane `[m]`.
fn model(size: DVec2) -> [DVec2; 4] {
    [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|c| DVec2::from_array(c) * size)
}

/// The two poses of a rigid rectangle that fit, tilted either way, and their root mean square errors `[px]`; the better
/// one first.
pub(super) fn fit(camera: &Camera, size: DVec2, p_pixel: [DVec2; 4]) -> [(Pose, f64); 2] {
    let (model, rays) = (model(size), p_pixel.map(|p| camera.ray(p).truncate()));
    let first = from_homography(model, rays);
    // A weak perspective hardly distinguishes a pose from the one tilted the other way.
    let view = first.translation.normalize();
    let half_turn = DMat3::from_axis_angle(view, std::f64::consts::PI);
    let other =
        Pose { rotation: half_turn * first.rotation * DMat3::from_rotation_z(std::f64::consts::PI), ..first };
    let mut poses = [first, other].map(|pose| refine(pose, camera, model, p_pixel));
    poses.sort_by(|a, b| a.1.total_cmp(&b.1));
    poses
}

/// The regular grid on the patch between four corners; uv and order as in [`grid`].
pub fn patch(corners: [DVec3; 4], [columns, rows]: [usize; 2]) -> Mesh {
    let mut mesh = grid(columns, rows, DVec2::ONE, 1.0);
    for (k, p) in mesh.positions.iter_mut().enumerate() {
        let (s, t) = ((k % columns) as f64 / (columns - 1) as f64, (k / columns) as f64 / (rows - 1) as f64);
        *p = corners[0].lerp(corners[1], s).lerp(corners[3].lerp(corners[2], s), t);
    }
    mesh
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    rotation: DMat3,
    translation: DVec3,
}

impl Pose {
    fn apply(&self, p: DVec2) -> DVec3 {
        self.rotation * p.extend(0.0) + self.translation
    }

    /// A point of its plane `[m]`, and the plane's normal.
    pub(super) fn plane(&self) -> (DVec3, DVec3) {
        (self.translation, self.rotation.z_axis)
    }

    fn moved(&self, step: &[f64]) -> Self {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2]));
        Self {
            rotation: DMat3::from_quat(turn) * self.rotation,
            translation: self.translation + DVec3::new(step[3], step[4], step[5]),
        }
    }
}

/// The pose whose homography takes `model` `[m]` to `rays` (plane z = 1): exact for a rigid rectangle.
fn from_homography(model: [DVec2; 4], rays: [DVec2; 4]) -> Pose {
    // h33 = 1: the middle of the rectangle is in front of the camera. Two equations a corner.
    let scale = model[2].length();
    let mut rows = Vec::new();
    for (m, r) in model.iter().map(|m| *m / scale).zip(rays) {
        rows.push([m.x, m.y, 1.0, 0.0, 0.0, 0.0, -r.x * m.x, -r.x * m.y, r.x]);
        rows.push([0.0, 0.0, 0.0, m.x, m.y, 1.0, -r.y * m.x, -r.y * m.y, r.y]);
    }
    let h = solve(rows);
    let (h1, h2, h3) =
        (DVec3::new(h[0], h[3], h[6]), DVec3::new(h[1], h[4], h[7]), DVec3::new(h[2], h[5], 1.0));
    let length = 0.5 * (h1.length() + h2.length());
    // The nearest orthonormal pair: equal parts of what is not perpendicular.
    let (a, b) = (h1.normalize(), h2.normalize());
    let (sum, difference) = ((a + b).normalize(), (a - b).normalize());
    let (x, y) = ((sum + difference).normalize(), (sum - difference).normalize());
    Pose { rotation: DMat3::from_cols(x, y, x.cross(y)), translation: h3 * (scale / length) }
}

/// Solves as many linear equations as unknowns, each row with its right side at the end, by elimination with pivots.
fn solve<const N: usize>(mut rows: Vec<[f64; N]>) -> Vec<f64> {
    let n = N - 1;
    for c in 0..n {
        let pivot =
            (c..n).max_by(|a, b| rows[*a][c].abs().total_cmp(&rows[*b][c].abs())).expect("rows remain");
        rows.swap(c, pivot);
        for r in 0..n {
            if r != c && rows[c][c] != 0.0 {
                let factor = rows[r][c] / rows[c][c];
                for k in c..N {
                    rows[r][k] -= factor * rows[c][k];
                }
            }
        }
    }
    (0..n).map(|k| if rows[k][k] == 0.0 { 0.0 } else { rows[k][n] / rows[k][k] }).collect()
}

/// The pose of least reprojection error near `pose`, and its root mean square error `[px]`.
fn refine(mut pose: Pose, camera: &Camera, corners: [DVec2; 4], p_pixel: [DVec2; 4]) -> (Pose, f64) {
    let square = POLICY.minimise(&mut Reprojection { camera, corners, p_pixel }, &mut pose, 100);
    (pose, (square / 4.0).sqrt())
}

/// The error of a pose: that of its `corners` where they are seen.
struct Reprojection<'a> {
    camera: &'a Camera,
    corners: [DVec2; 4],
    p_pixel: [DVec2; 4],
}

impl Reprojection<'_> {
    /// `None` of a pose that is not in front of the camera.
    fn residuals(&self, pose: &Pose) -> Option<[DVec2; 4]> {
        let points = self.corners.map(|c| pose.apply(c));
        let in_front = points.iter().all(|p| p.z > 1e-6);
        in_front.then(|| std::array::from_fn(|k| self.camera.project(points[k]) - self.p_pixel[k]))
    }

    fn square(&self, pose: &Pose) -> f64 {
        self.residuals(pose).map_or(f64::INFINITY, |r| r.iter().map(|r| r.length_squared()).sum::<f64>())
    }
}

impl Model for Reprojection<'_> {
    type Point = Pose;
    /// Derivatives of the residuals, and these.
    type System = ([[DVec2; 4]; 6], [DVec2; 4]);

    fn linearise(&mut self, pose: &Pose) -> (f64, Self::System) {
        let base = self.residuals(pose).unwrap_or_default();
        // Forward differences: the problem is tiny and smooth.
        let unit = pose.translation.length().max(1e-3);
        let mut jacobian = [[DVec2::ZERO; 4]; 6];
        for (j, column) in jacobian.iter_mut().enumerate() {
            let mut step = [0.0; 6];
            step[j] = if j < 3 { 1e-7 } else { 1e-7 * unit };
            let Some(there) = self.residuals(&pose.moved(&step)) else { continue };
            *column = std::array::from_fn(|k| (there[k] - base[k]) / step[j]);
        }
        (self.square(pose), (jacobian, base))
    }

    fn step(&mut self, pose: &Pose, (jacobian, base): &Self::System, lambda: f64) -> Option<(Pose, f64)> {
        let dot = |a: &[DVec2; 4], b: &[DVec2; 4]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let rows = (0..6).map(|i| {
            let mut row = [0.0; 7];
            for j in 0..6 {
                row[j] = dot(&jacobian[i], &jacobian[j]) * if i == j { 1.0 + lambda } else { 1.0 };
            }
            row[6] = -dot(&jacobian[i], base);
            row
        });
        let next = pose.moved(&solve(rows.collect()));
        Some((next, self.square(&next)))
    }
}

/// Points on the `rays` whose distances fit those of a rectangle of `size`, from the depths `z` on.
fn by_distances(rays: [DVec2; 4], size: DVec2, mut z: [f64; 4]) -> [DVec3; 4] {
    let pairs = [
        (0, 1, size.x),
        (1, 2, size.y),
        (2, 3, size.x),
        (3, 0, size.y),
        (0, 2, size.length()),
        (1, 3, size.length()),
    ];
    let at = |z: &[f64; 4]| -> [DVec3; 4] { std::array::from_fn(|k| rays[k].extend(1.0) * z[k]) };
    let misfit = |z: &[f64; 4]| -> [f64; 7] {
        let p = at(z);
        let lift = (p[1] - p[0]).cross(p[3] - p[0]).dot(p[2] - p[0]) / (size.x * size.y * size.min_element());
        std::array::from_fn(|k| match pairs.get(k) {
            Some((a, b, rest)) => p[*a].distance(p[*b]) / rest - 1.0,
            None => lift,
        })
    };
    // Sums of absolute strains, by reweighted squares: the distances that are taut count, those that sag do not.
    for _ in 0..400 {
        let r = misfit(&z);
        let weight = |k: usize| {
            if k == 6 {
                LIFT
            } else if r[k] < 0.0 {
                SHORT
            } else {
                1.0
            }
        };
        let weights: [f64; 7] = std::array::from_fn(|k| weight(k) / r[k].abs().max(1e-4));
        let mut rows = vec![[0.0; 5]; 4];
        let columns: [[f64; 7]; 4] = std::array::from_fn(|j| {
            let mut there = z;
            there[j] *= 1.0 + 1e-7;
            let s = misfit(&there);
            std::array::from_fn(|i| (s[i] - r[i]) / (z[j] * 1e-7))
        });
        for i in 0..4 {
            for j in 0..4 {
                rows[i][j] = (0..7).map(|k| weights[k] * columns[i][k] * columns[j][k]).sum();
            }
            // A trace of damping, for four depths that three taut sides leave free.
            rows[i][i] *= 1.0 + 1e-3;
            rows[i][4] = -(0..7).map(|k| weights[k] * columns[i][k] * r[k]).sum::<f64>();
        }
        let step = solve(rows);
        let limit = step.iter().zip(&z).map(|(s, z)| (s / z).abs()).fold(0.0, f64::max);
        // Small steps: reweighting overshoots.
        let factor = if limit > 0.02 { 0.02 / limit } else { 1.0 } * 0.5;
        z.iter_mut().zip(&step).for_each(|(z, s)| *z += factor * s);
        if limit < 1e-9 {
            break;
        }
    }
    at(&z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 900.0, fy: 880.0, cx: 630.0, cy: 365.0, width: 1280, height: 720 };

    fn tilted(size: DVec2) -> [DVec3; 4] {
        let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.5, 0.1);
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|c| rotation * (DVec2::from_array(c) * size).extend(0.0) + DVec3::new(0.1, -0.05, 1.4))
    }

    #[test]
    fn a_rigid_rectangle_is_found_where_it_is() {
        let size = DVec2::new(0.7, 0.5);
        let truth = tilted(size);
        let found = locate(&CAMERA, size, truth.map(|p| CAMERA.project(p))).unwrap();
        assert!(found.rigid && !found.ambiguous && found.rigid_error < 1e-6);
        for k in 0..4 {
            assert!(found.positions[k].distance(truth[k]) < 1e-8);
        }
        // Half a pixel of error in one corner moves it by millimetres, not more.
        let mut seen = truth.map(|p| CAMERA.project(p));
        seen[2] += DVec2::new(0.4, -0.3);
        let found = locate(&CAMERA, size, seen).unwrap();
        assert!((0..4).all(|k| found.positions[k].distance(truth[k]) < 5e-3));
    }

    #[test]
    fn fabric_with_a_sagging_side_keeps_its_depth() {
        // The upper corners are 2.5 % nearer to each other than the fabric is wide.
        let size = DVec2::new(0.55, 0.56);
        let truth = [[-0.268, -0.3], [0.268, -0.3], [0.275, 0.26], [-0.275, 0.26]]
            .map(|[x, y]| DVec3::new(x, y, 1.35));
        let found = locate(&CAMERA, size, truth.map(|p| CAMERA.project(p))).unwrap();
        assert!(!found.rigid);
        for k in 0..4 {
            assert!(found.positions[k].distance(truth[k]) < 3e-3, "{k}: {}", found.positions[k]);
        }
    }

    #[test]
    fn corners_out_of_order_are_refused() {
        let [a, b, c, d] = tilted(DVec2::ONE).map(|p| CAMERA.project(p));
        assert!(locate(&CAMERA, DVec2::ONE, [a, c, b, d]).is_err());
        assert!(locate(&CAMERA, DVec2::ONE, [d, c, b, a]).is_err());
        assert!(locate(&CAMERA, DVec2::ONE, [a, b, b, d]).is_err());
    }
}
