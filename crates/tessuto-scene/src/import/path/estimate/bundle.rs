//! The poses and points that explain best where windows were seen (bundle adjustment: B. Triggs and others, 2000), by
//! Gauss and Newton's method; points are eliminated, so that the system is one of poses.
//!
//!   E = Σ over windows and frames of (ν + 2)/2 ln(1 + ‖W (p_observed − p)‖² / (ν σ²)) + ½ Σ (ρ − ρ̄)²/s²,
//!
//! Student's t for both coordinates, whose tails leave aside what moves by itself; W is a window's own certainty, and
//! where it was first seen is one more observation of it. The prior of the inverse depths ρ also sets the length of a
//! unit: ρ̄ is 1. Poses that are given set it else, and add, of every frame but the first, which is fixed,
//!
//!   ½ ‖log(R R_givenᵀ)‖²/s_R² + ½ ‖c − c_given‖²/s_c² with the camera's place c = −Rᵀt.
//!
//! A path that is smooth adds [`Smooth`]'s.

use tessuto_core::parallel;

use super::observed::{Point, observed, place, stepped};
use super::smooth::Smooth;
use super::track::Track;
use glam::{DMat3, DQuat, DVec2, DVec3};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::math::minimise::{Model, Policy};
use tessuto_core::math::root::Root;

/// ν: tails of Student's t.
pub(super) const TAILS: f64 = 3.0;
/// s: spread of the inverse depths around their mean.
const DEPTHS: f64 = 1.0;
/// Parts of the windows that are summed one beside the other.
const PARTS: usize = 12;
const POLICY: Policy = Policy {
    lambda: 1e-3,
    accepted: [0.2, 1e-9],
    rejected: [8.0, 1e-4],
    attempts: 8,
    strictly: true,
    least_gain: [0.01, 1e-7],
    most: 1e8,
};

/// What is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freedom {
    /// No pose.
    Still,
    /// No pose, but depths.
    Depths,
    /// Rotations.
    Turns,
    /// Rotations, translations, depths.
    All,
}

impl Freedom {
    /// Unknowns of a pose and of a point.
    pub fn unknowns(self) -> [usize; 2] {
        match self {
            Self::Still => [0, 2],
            Self::Depths => [0, 3],
            Self::Turns => [3, 2],
            Self::All => [6, 3],
        }
    }

    fn has_depths(self) -> bool {
        self.unknowns()[1] == 3
    }
}

/// Poses, camera_from_world, and points, one of each track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    pub poses: Vec<Pose>,
    pub points: Vec<Point>,
}

/// Windows that were seen in frames which are counted as the poses are.
pub(super) struct Bundle<'a> {
    pub camera: &'a Camera,
    pub tracks: &'a [Track],
    pub freedom: Freedom,
    /// σ², in units of the windows' own variances.
    pub variance: f64,
    pub given: Option<Given>,
    pub smooth: Option<Smooth>,
    /// Mean of the inverse depths, about.
    pub usual: f64,
}

/// Poses that are known, but not exactly.
#[derive(Debug, Clone)]
pub(super) struct Given {
    pub poses: Vec<Pose>,
    /// s_R² `[rad²]` and s_c², of each coordinate.
    pub variances: [f64; 2],
}

impl Given {
    /// How far a pose is off, by rotation `[rad]` and place.
    pub fn off(&self, n: usize, pose: &Pose) -> [DVec3; 2] {
        let given = &self.poses[n];
        let turn = DQuat::from_mat3(&(pose.rotation * given.rotation.transpose())).to_scaled_axis();
        [turn, pose.in_world(DVec3::ZERO) - given.in_world(DVec3::ZERO)]
    }

    pub fn value(&self, poses: &[Pose]) -> f64 {
        let of = |(n, pose): (usize, &Pose)| {
            let off = self.off(n, pose);
            (0..2).map(|k| 0.5 * off[k].length_squared() / self.variances[k]).sum::<f64>()
        };
        poses.iter().enumerate().skip(1).map(of).sum()
    }

    /// Adds to the normal equations of all six unknowns of every pose but the first.
    pub fn add(&self, poses: &[Pose], matrix: &mut [f64], gradient: &mut [f64]) {
        let size = gradient.len();
        for (n, pose) in poses.iter().enumerate().skip(1) {
            let off = self.off(n, pose);
            // c = −Rᵀ exp(−ω) (t + τ). The rotation's gradient is the vector itself, which the Jacobian of log keeps.
            let back = pose.rotation.transpose();
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            let by_turn = axes.map(|axis| back * axis.cross(pose.translation));
            let by_step = axes.map(|axis| -(back * axis));
            let place: Vec<DVec3> = by_turn.into_iter().chain(by_step).collect();
            let start = 6 * (n - 1);
            for j in 0..6 {
                gradient[start + j] += place[j].dot(off[1]) / self.variances[1];
                for k in 0..6 {
                    matrix[(start + j) * size + start + k] += place[j].dot(place[k]) / self.variances[1];
                }
            }
            for j in 0..3 {
                gradient[start + j] += off[0][j] / self.variances[0];
                matrix[(start + j) * size + start + j] += 1.0 / self.variances[0];
            }
        }
    }
}

/// Of one track: the normal equations of its point, and what joins it to poses.
struct Eliminated {
    matrix: DMat3,
    gradient: DVec3,
    /// By pose: six rows of which the freedom's are used.
    joined: Vec<(usize, [DVec3; 6])>,
}

pub(super) struct System {
    size: usize,
    /// By parts.
    tracks: Vec<Vec<Eliminated>>,
    matrix: Vec<f64>,
    gradient: Vec<f64>,
}

impl<'a> Bundle<'a> {
    /// Of windows as certain as they say, without given poses.
    pub fn new(camera: &'a Camera, tracks: &'a [Track], freedom: Freedom) -> Self {
        Self { camera, tracks, freedom, variance: 1.0, given: None, smooth: None, usual: 1.0 }
    }
}

impl Bundle<'_> {
    /// Takes the steps from `state` on, at most this many; the value that they end with.
    pub fn minimise(&mut self, state: &mut State, iterations: usize) -> f64 {
        POLICY.minimise(self, state, iterations)
    }

    fn part(&self) -> usize {
        self.tracks.len().div_ceil(PARTS).max(1)
    }

    /// Squared residuals of a track in its own units, that in its first frame first; infinite behind a camera.
    pub fn squares<'a>(&'a self, state: &'a State, t: usize) -> impl Iterator<Item = f64> + 'a {
        let (track, point) = (&self.tracks[t], &state.points[t]);
        let first = (track.root * (point.at - track.at)).length_squared();
        let others = track.seen.iter().map(move |(frame, at)| {
            let there = place(self.camera, &state.poses[track.host], &state.poses[*frame], point);
            there.map_or(f64::INFINITY, |there| (track.root * (there - *at)).length_squared())
        });
        std::iter::once(first).chain(others)
    }

    fn value(&self, state: &State) -> f64 {
        let of_track = |t: usize| {
            let cost = |s: f64| 0.5 * (TAILS + 2.0) * (s / (TAILS * self.variance)).ln_1p();
            self.squares(state, t).map(cost).sum::<f64>() + self.prior(&state.points[t])
        };
        let values: Vec<f64> = parallel::map(self.tracks.len(), of_track);
        let of_given = self.given.as_ref().map_or(0.0, |given| given.value(&state.poses));
        let of_path = self.smooth.as_ref().map_or(0.0, |smooth| smooth.value(&state.poses));
        values.iter().sum::<f64>() + of_given + of_path
    }

    fn prior(&self, point: &Point) -> f64 {
        let off = (point.inverse_depth - self.usual) / DEPTHS;
        if self.freedom.has_depths() { 0.5 * off * off } else { 0.0 }
    }

    /// σ² for which the residuals at `state` are likeliest.
    pub fn likeliest(&self, state: &State) -> f64 {
        let squares: Vec<Vec<f64>> = parallel::map(self.tracks.len(), |t| self.squares(state, t).collect());
        let squares: Vec<f64> = squares.into_iter().flatten().filter(|s| s.is_finite()).collect();
        let mut variance = self.variance;
        for _ in 0..30 {
            let weighted = |s: &f64| (TAILS + 2.0) * s / (TAILS + s / variance);
            let next = squares.iter().map(weighted).sum::<f64>() / (2.0 * squares.len().max(1) as f64);
            let change = (next / variance - 1.0).abs();
            variance = next.max(1e-12);
            if change < 1e-4 {
                break;
            }
        }
        variance
    }

    /// Twice the negative logarithm of the likelihood at `state`, and what the unknowns cost by G. Schwarz's
    /// criterion (1978): each the logarithm of how many numbers tell it.
    pub fn evidence(&self, state: &State) -> f64 {
        let variance = self.likeliest(state);
        let cost = |s: f64| (TAILS + 2.0) * (s / (TAILS * variance)).ln_1p() + 2.0 * variance.ln();
        let of_tracks = |t: usize| self.squares(state, t).map(cost).sum::<f64>();
        let likelihood: f64 = (0..self.tracks.len()).map(of_tracks).sum();
        let [of_pose, of_point] = self.freedom.unknowns();
        let mut seen = vec![0usize; state.poses.len()];
        let mut unknowns = 0.0;
        for track in self.tracks {
            track.seen.iter().for_each(|(frame, _)| seen[*frame] += 1);
            unknowns += of_point as f64 * (2.0 * (track.seen.len() + 1) as f64).ln();
        }
        let poses = seen.iter().skip(1).map(|count| of_pose as f64 * (2.0 * (*count).max(1) as f64).ln());
        likelihood + unknowns + poses.sum::<f64>()
    }

    /// The normal equations of the poses alone, damped.
    fn reduced(&self, system: &System, lambda: f64) -> (Root, Vec<f64>) {
        let size = system.size;
        let of_pose = self.freedom.unknowns()[0];
        // What the points' elimination takes off matrix and gradient.
        let part = |tracks: &Vec<Eliminated>| {
            let (mut matrix, mut right) = (vec![0.0; size * size], vec![0.0; size]);
            for track in tracks {
                let inverse = track.damped(lambda).inverse();
                for (a, rows) in &track.joined {
                    let carried = rows.map(|row| inverse * row);
                    for k in 0..of_pose {
                        right[(a - 1) * of_pose + k] -= carried[k].dot(track.gradient);
                    }
                    for (b, others) in &track.joined {
                        add(&mut matrix, size, [*a, *b], of_pose, |j, k| -carried[j].dot(others[k]));
                    }
                }
            }
            (matrix, right)
        };
        let parts: Vec<_> = parallel::over(&system.tracks, part);
        let (matrices, rights): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let mut matrix = sum(matrices.into_iter().chain([system.matrix.clone()]));
        let right = sum(rights.into_iter().chain([system.gradient.clone()]));
        for k in 0..size {
            matrix[k * size + k] += lambda * system.matrix[k * size + k] + 1e-12;
        }
        (Root::of(&matrix, size), right)
    }

    /// The normal equations of the poses but the first, factored: their inverse is the covariance of the unknowns.
    pub fn certainty(&mut self, state: &State) -> Root {
        let (_, system) = self.linearise(state);
        self.reduced(&system, 0.0).0
    }

    /// Mean variances of every coordinate of the rotations and of the places of all poses but the first, as far as the
    /// windows and the given poses know them.
    pub fn uncertainty(&mut self, state: &State) -> [f64; 2] {
        let root = self.certainty(state);
        let size = 6 * (state.poses.len() - 1);
        let mut sums = [0.0; 2];
        for k in 0..size {
            // Rows of a pose by which its rotation and its place change: the latter by R c' = −τ + ω × t.
            let (n, k) = (k / 6, k % 6);
            let t = state.poses[n + 1].translation;
            let axis = DVec3::AXES[k % 3];
            let mut row = vec![0.0; size];
            if k < 3 {
                row[6 * n + k] = 1.0;
            } else {
                let by_turn = t.cross(axis);
                row[6 * n..6 * n + 3].copy_from_slice(&by_turn.to_array());
                row[6 * n + k] = -1.0;
            }
            sums[k / 3] += root.solve(&row).iter().zip(&row).map(|(a, b)| a * b).sum::<f64>();
        }
        sums.map(|sum| sum / (size / 2).max(1) as f64)
    }

    /// A track's normal equations; those of the poses are added to `matrix` and `gradient`.
    fn eliminated(&self, state: &State, t: usize, matrix: &mut [f64], gradient: &mut [f64]) -> Eliminated {
        let (track, point) = (&self.tracks[t], &state.points[t]);
        let [of_pose, of_point] = self.freedom.unknowns();
        let size = gradient.len();
        let mut out = Eliminated { matrix: DMat3::ZERO, gradient: DVec3::ZERO, joined: Vec::new() };
        let weight = |r: DVec2| (TAILS + 2.0) / (TAILS * self.variance + r.length_squared());
        let (w, r) = (track.root, track.root * (point.at - track.at));
        let first = weight(r);
        let back = w.transpose();
        let certain = first * (back * w);
        out.matrix.x_axis += certain.x_axis.extend(0.0);
        out.matrix.y_axis += certain.y_axis.extend(0.0);
        out.gradient += (first * (back * r)).extend(0.0);
        if self.freedom.has_depths() {
            out.matrix.z_axis.z += DEPTHS.powi(-2);
            out.gradient.z += (point.inverse_depth - self.usual) / (DEPTHS * DEPTHS);
        } else {
            out.matrix.z_axis.z = 1.0;
        }
        let whitened = |rows: [[f64; 6]; 2]| -> [[f64; 6]; 2] {
            std::array::from_fn(|i| {
                std::array::from_fn(|k| w.row(i).x * rows[0][k] + w.row(i).y * rows[1][k])
            })
        };
        let mut of_host = [DVec3::ZERO; 6];
        for (frame, at) in &track.seen {
            let (host, pose) = (&state.poses[track.host], &state.poses[*frame]);
            let Some(seen) = observed(self.camera, host, pose, point) else { continue };
            let r = w * (seen.at - *at);
            let omega = weight(r);
            let by = [(*frame, whitened(seen.by_frame)), (track.host, whitened(seen.by_host))];
            let [u, v] = seen.by_point.map(|row| {
                DVec3::from_array(std::array::from_fn(|k| if k < of_point { row[k] } else { 0.0 }))
            });
            let by_point = [w.row(0).x * u + w.row(0).y * v, w.row(1).x * u + w.row(1).y * v];
            let r = [r.x, r.y];
            let mut joined = [DVec3::ZERO; 6];
            for i in 0..2 {
                out.matrix += omega * tessuto_core::math::outer(by_point[i], by_point[i]);
                out.gradient += omega * r[i] * by_point[i];
                for k in 0..of_pose {
                    joined[k] += omega * by[0].1[i][k] * by_point[i];
                    of_host[k] += omega * by[1].1[i][k] * by_point[i];
                }
            }
            out.joined.push((*frame, joined));
            for (a, rows_a) in &by {
                for (b, rows_b) in &by {
                    add(matrix, size, [*a, *b], of_pose, |j, k| {
                        omega * (rows_a[0][j] * rows_b[0][k] + rows_a[1][j] * rows_b[1][k])
                    });
                }
                for k in (0..of_pose).filter(|_| *a > 0) {
                    gradient[(a - 1) * of_pose + k] += omega * (rows_a[0][k] * r[0] + rows_a[1][k] * r[1]);
                }
            }
        }
        out.joined.push((track.host, of_host));
        out.joined.retain(|(frame, _)| *frame > 0 && of_pose > 0);
        out
    }
}

/// Adds a block of two poses; that of the first one is fixed.
fn add(
    matrix: &mut [f64],
    size: usize,
    [a, b]: [usize; 2],
    of_pose: usize,
    value: impl Fn(usize, usize) -> f64,
) {
    if a == 0 || b == 0 {
        return;
    }
    for j in 0..of_pose {
        let row = ((a - 1) * of_pose + j) * size + (b - 1) * of_pose;
        (0..of_pose).for_each(|k| matrix[row + k] += value(j, k));
    }
}

fn sum(parts: impl IntoIterator<Item = Vec<f64>>) -> Vec<f64> {
    let added = |mut a: Vec<f64>, b: Vec<f64>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
        a
    };
    parts.into_iter().reduce(added).unwrap_or_default()
}

impl Eliminated {
    fn damped(&self, lambda: f64) -> DMat3 {
        let m = &self.matrix;
        let diagonal = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
        *m + DMat3::from_diagonal(lambda * diagonal)
    }
}

impl Model for Bundle<'_> {
    type Point = State;
    type System = System;

    fn refresh(&mut self, state: &State) {
        self.variance = self.likeliest(state);
    }

    fn linearise(&mut self, state: &State) -> (f64, System) {
        let size = (state.poses.len() - 1) * self.freedom.unknowns()[0];
        let all: Vec<usize> = (0..self.tracks.len()).collect();
        let part = |tracks: &[usize]| {
            let (mut matrix, mut gradient) = (vec![0.0; size * size], vec![0.0; size]);
            let of = |t: &usize| self.eliminated(state, *t, &mut matrix, &mut gradient);
            let tracks: Vec<Eliminated> = tracks.iter().map(of).collect();
            (tracks, matrix, gradient)
        };
        let parts: Vec<_> =
            parallel::over(&all.chunks(self.part()).collect::<Vec<_>>(), |tracks| part(tracks));
        let (mut tracks, mut matrices, mut gradients) = (Vec::new(), Vec::new(), Vec::new());
        for (of, matrix, gradient) in parts {
            tracks.push(of);
            matrices.push(matrix);
            gradients.push(gradient);
        }
        let (mut matrix, mut gradient) = (sum(matrices), sum(gradients));
        if let Some(given) = &self.given {
            given.add(&state.poses, &mut matrix, &mut gradient);
        }
        if let Some(smooth) = &self.smooth {
            smooth.add(&state.poses, &mut matrix, &mut gradient);
        }
        (self.value(state), System { size, tracks, matrix, gradient })
    }

    fn step(&mut self, at: &State, system: &System, lambda: f64) -> Option<(State, f64)> {
        let of_pose = self.freedom.unknowns()[0];
        let (root, right) = self.reduced(system, lambda);
        let step: Vec<f64> = root.solve(&right).iter().map(|v| -v).collect();
        let mut next = at.clone();
        let moved = |frame: usize| &step[(frame - 1) * of_pose..frame * of_pose];
        for (frame, pose) in next.poses.iter_mut().enumerate().skip(1).filter(|_| of_pose > 0) {
            let mut six = [0.0; 6];
            six[..of_pose].copy_from_slice(moved(frame));
            *pose = stepped(pose, &six);
        }
        for (track, point) in system.tracks.iter().flatten().zip(&mut next.points) {
            let of_poses = track.joined.iter().fold(DVec3::ZERO, |sum, (frame, rows)| {
                let by = rows.iter().zip(moved(*frame)).map(|(row, step)| *step * *row);
                sum + by.sum::<DVec3>()
            });
            let change = -(track.damped(lambda).inverse() * (track.gradient + of_poses));
            point.at += change.truncate();
            if self.freedom.has_depths() {
                point.inverse_depth += change.z;
            }
        }
        let value = self.value(&next);
        value.is_finite().then_some((next, value))
    }
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::*;
    use tessuto_core::math::gradient_check::check;

    #[test]
    fn the_gradient_is_that_of_differences() {
        let mut worst = 0.0f64;
        for (seed, freedom) in [
            (1, Freedom::Turns),
            (2, Freedom::All),
            (3, Freedom::Still),
            (4, Freedom::Depths),
            (5, Freedom::All),
            (6, Freedom::All),
        ] {
            let (camera, tracks, truth) = made::tracks(seed, 5, 12, 2, 0.3);
            let given = (seed == 5)
                .then(|| Given { poses: made::disturbed(&truth, 9).poses, variances: [4e-6, 1e-6] });
            let smooth =
                (seed == 6).then(|| Smooth { times: vec![0.0, 1.0, 2.0, 4.0, 5.0], variances: [4e-6, 1e-6] });
            let mut bundle =
                Bundle { given, smooth, variance: 1.3, ..Bundle::new(&camera, &tracks, freedom) };
            let mut state = made::disturbed(&truth, seed);
            if !freedom.has_depths() {
                state.poses.iter_mut().for_each(|pose| pose.translation = DVec3::ZERO);
            }
            let (_, system) = bundle.linearise(&state);
            let of_points = system.tracks.iter().flatten().flat_map(|track| track.gradient.to_array());
            let gradient: Vec<f64> = system.gradient.iter().copied().chain(of_points).collect();
            let [of_pose, _] = freedom.unknowns();
            let value = |x: &[f64]| {
                let mut moved = state.clone();
                for (n, pose) in moved.poses.iter_mut().enumerate().skip(1) {
                    let mut six = [0.0; 6];
                    six[..of_pose].copy_from_slice(&x[(n - 1) * of_pose..n * of_pose]);
                    *pose = stepped(pose, &six);
                }
                let rest = &x[system.gradient.len()..];
                for (point, x) in moved.points.iter_mut().zip(rest.chunks(3)) {
                    point.at += DVec2::new(x[0], x[1]);
                    point.inverse_depth += if freedom.has_depths() { x[2] } else { 0.0 };
                }
                bundle.value(&moved)
            };
            let found = check(&vec![0.0; gradient.len()], &gradient, 1e-5, 12, seed, value);
            worst = worst.max(found.relative_error);
        }
        println!("worst {worst:.1e}");
        assert!(worst < 1e-6);
    }

    #[test]
    fn it_gives_the_same_bytes_for_any_number_of_threads() {
        let (camera, tracks, truth) = made::tracks(5, 6, 40, 0, 0.2);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut bundle = Bundle::new(&camera, &tracks, Freedom::All);
                let mut state = made::disturbed(&truth, 5);
                bundle.minimise(&mut state, 4);
                state
            })
        };
        assert_eq!(run(1), run(3));
    }
}
