//! A camera moves smoothly: how fast it goes and turns changes little from frame to frame.
//!
//!   S = ½ Σ over frames of ‖(v_after − v_before)/√h‖²/q_c + ‖(w_after − w_before)/√h‖²/q_R,
//!
//! with the velocities v of the camera's place and w of its rotation, log(R_next Rᵀ), over the time between two frames,
//! and h the time between their middles: accelerations are white noise. Their variances q are the likeliest ones, found
//! by expectation and maximisation (A. Dempster and others, 1977): of a path that jumps they are so large that S
//! tells nothing.

use glam::{DMat3, DQuat, DVec3};
use tessuto_core::camera::Pose;
use tessuto_core::parallel;

use super::bundle::{Bundle, State};

/// Most rounds, and the change of every variance that ends them.
const ROUNDS: usize = 40;
const SETTLED: f64 = 0.02;
/// Iterations of a round.
const ITERATIONS: usize = 3;
/// Least variances `[rad², unit²]`, by frame³.
const LEAST: f64 = 1e-14;

/// What is known of accelerations.
#[derive(Debug, Clone)]
pub(super) struct Smooth {
    /// When the poses are, in frames; rising.
    pub times: Vec<f64>,
    /// q_R and q_c, of each coordinate.
    pub variances: [f64; 2],
}

/// How a velocity changes around a pose: of the rotation and of the place, each with its rows by the unknowns of the
/// pose before, of that pose and of the one after.
struct Change {
    off: [DVec3; 2],
    /// By kind and coordinate.
    rows: [[[f64; 18]; 3]; 2],
}

impl Smooth {
    /// Around pose `n`, which is neither the first nor the last.
    fn change(&self, poses: &[Pose], n: usize) -> Change {
        let [before, here, after] = [n - 1, n, n + 1].map(|k| &poses[k]);
        let [h0, h1] = [n - 1, n].map(|k| self.times[k + 1] - self.times[k]);
        let root = (0.5 * (h0 + h1)).sqrt().recip();
        let [w0, w1] = [turn(before, here), turn(here, after)];
        let place = |pose: &Pose| pose.in_world(DVec3::ZERO);
        let [c0, c1, c2] = [before, here, after].map(place);
        let off = [(w1 / h1 - w0 / h0) * root, ((c2 - c1) / h1 - (c1 - c0) / h0) * root];

        // log(exp(a) exp(w) exp(−b)) ≈ w + J(w) a − J(−w) b.
        let of_turns = [by_turn(-w0) / h0, -(by_turn(-w1) / h1) - by_turn(w0) / h0, by_turn(w1) / h1];
        let of_places = [1.0 / h0, -1.0 / h1 - 1.0 / h0, 1.0 / h1];
        let mut rows = [[[0.0; 18]; 3]; 2];
        for (k, pose) in [before, here, after].into_iter().enumerate() {
            // c = −Rᵀ exp(−ω) (t + τ).
            let back = pose.rotation.transpose();
            for (j, axis) in DVec3::AXES.into_iter().enumerate() {
                let by = [
                    of_turns[k] * axis * root,
                    back * axis.cross(pose.translation) * (of_places[k] * root),
                    -(back * axis) * (of_places[k] * root),
                ];
                for c in 0..3 {
                    rows[0][c][6 * k + j] = by[0][c];
                    rows[1][c][6 * k + j] = by[1][c];
                    rows[1][c][6 * k + 3 + j] = by[2][c];
                }
            }
        }
        Change { off, rows }
    }

    /// Where the camera most likely is at a time between two of the `poses`, and the variances of its rotation and of
    /// its place, of each coordinate, as far as the path tells.
    pub fn between(&self, poses: &[Pose], time: f64) -> (Pose, [f64; 2]) {
        let last = poses.len() - 1;
        let b = self.times.partition_point(|t| *t < time).clamp(1, last);
        let near = [(b - 1).saturating_sub(1), b - 1, b, (b + 1).min(last)];
        let rotation = poses[b - 1].rotation;
        let turns = near.map(|k| turn(&Pose { rotation, ..poses[k] }, &poses[k]));
        let places = near.map(|k| poses[k].in_world(DVec3::ZERO));
        let times = near.map(|k| self.times[k]);
        let (h, t) = (times[2] - times[1], time - times[1]);
        // By its places and velocities at both ends (C. Hermite).
        let at = |v: [DVec3; 4]| {
            let slope = |from: usize, to: usize| (v[to] - v[from]) * (h / (times[to] - times[from]));
            let (m0, m1, s) = (slope(0, 2), slope(1, 3), t / h);
            let (a, c) = (v[1], 3.0 * (v[2] - v[1]) - 2.0 * m0 - m1);
            a + s * (m0 + s * (c + s * (m0 + m1 - 2.0 * (v[2] - v[1]))))
        };
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(at(turns))) * rotation;
        let pose = Pose { rotation, translation: -(rotation * at(places)) };
        // Of a motion with white accelerations between ends whose velocities are known.
        let spread = (t * (h - t) / h).powi(3) / 3.0;
        (pose, self.variances.map(|q| (q * spread).max(LEAST)))
    }

    fn inner(poses: &[Pose]) -> std::ops::Range<usize> {
        1..poses.len().saturating_sub(1)
    }

    /// S.
    pub fn value(&self, poses: &[Pose]) -> f64 {
        let of = |n: usize| {
            let off = self.change(poses, n).off;
            (0..2).map(|kind| 0.5 * off[kind].length_squared() / self.variances[kind]).sum::<f64>()
        };
        Self::inner(poses).map(of).sum()
    }

    /// Adds to the normal equations of all six unknowns of every pose but the first.
    pub fn add(&self, poses: &[Pose], matrix: &mut [f64], gradient: &mut [f64]) {
        let size = gradient.len();
        for n in Self::inner(poses) {
            let Change { off, rows } = self.change(poses, n);
            for kind in 0..2 {
                let weight = self.variances[kind].recip();
                for (c, row) in rows[kind].iter().enumerate() {
                    // Unknowns of the first pose, which is fixed, are left out.
                    let free: Vec<(usize, f64)> =
                        (0..18).filter_map(|k| Some(((6 * (n - 1) + k).checked_sub(6)?, row[k]))).collect();
                    for (j, a) in &free {
                        gradient[*j] += weight * a * off[kind][c];
                        free.iter().for_each(|(k, b)| matrix[j * size + k] += weight * a * b);
                    }
                }
            }
        }
    }

    /// Sums over all frames of the squares of the changes of velocity, by kind, and of their variances as the `bundle`
    /// with this prior knows them.
    fn spreads(&self, bundle: &mut Bundle, state: &State) -> ([f64; 2], [f64; 2]) {
        let certain = bundle.certainty(state);
        let size = 6 * (state.poses.len() - 1);
        let of = |n: usize| {
            let Change { off, rows } = self.change(&state.poses, n + 1);
            let variance = |row: &[f64; 18]| {
                let mut whole = vec![0.0; size];
                (0..18).filter(|k| 6 * n + k >= 6).for_each(|k| whole[6 * n + k - 6] = row[k]);
                certain.solve(&whole).iter().zip(&whole).map(|(a, b)| a * b).sum::<f64>()
            };
            let variances = [0, 1].map(|kind| rows[kind].iter().map(variance).sum::<f64>());
            ([0, 1].map(|kind| off[kind].length_squared()), variances)
        };
        let count = Self::inner(&state.poses).len();
        let all = parallel::map(count, of);
        all.iter().fold(([0.0; 2], [0.0; 2]), |(squares, variances), (more, uncertain)| {
            ([0, 1].map(|k| squares[k] + more[k]), [0, 1].map(|k| variances[k] + uncertain[k]))
        })
    }
}

fn turn(from: &Pose, to: &Pose) -> DVec3 {
    DQuat::from_mat3(&(to.rotation * from.rotation.transpose())).to_scaled_axis()
}

/// J: how log(exp(a) exp(w)) changes with a small a.
fn by_turn(w: DVec3) -> DMat3 {
    let angle = w.length();
    let cross = DMat3::from_cols(w.cross(DVec3::X), w.cross(DVec3::Y), w.cross(DVec3::Z));
    let second = if angle < 1e-4 {
        1.0 / 12.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    DMat3::IDENTITY - 0.5 * cross + second * (cross * cross)
}

/// Refines `state`, at which the `bundle` without a prior is least, by a path that is as smooth as is likeliest;
/// `times` are those of the poses, in frames.
pub(super) fn smoothen(bundle: &mut Bundle, state: &mut State, times: Vec<f64>) {
    let count = 3.0 * times.len().saturating_sub(2) as f64;
    if count == 0.0 {
        return;
    }
    let mut smooth = Smooth { times, variances: [f64::INFINITY; 2] };
    for _ in 0..ROUNDS {
        let (squares, uncertain) = smooth.spreads(bundle, state);
        let next = [0, 1].map(|k| ((squares[k] + uncertain[k]) / count).max(LEAST));
        let settled = (0..2).all(|k| (next[k] / smooth.variances[k] - 1.0).abs() < SETTLED);
        smooth.variances = next;
        bundle.smooth = Some(smooth.clone());
        bundle.minimise(state, ITERATIONS);
        if settled {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::super::observed::stepped;
    use super::*;
    use tessuto_core::math::rng::Rng;

    /// A camera that goes and turns evenly.
    fn even(t: f64) -> Pose {
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(t * DVec3::new(0.02, -0.05, 0.01)));
        Pose { rotation, translation: -(rotation * (t * DVec3::new(0.03, 0.01, -0.02))) }
    }

    #[test]
    fn an_even_motion_costs_nothing_and_is_known_between_its_poses() {
        let times = vec![0.0, 1.0, 3.0, 4.0, 8.0];
        let poses: Vec<Pose> = times.iter().map(|t| even(*t)).collect();
        let smooth = Smooth { times, variances: [1e-4, 1e-6] };
        assert!(smooth.value(&poses) < 1e-18);
        for time in [0.4, 2.0, 3.3, 6.0, 7.9] {
            let (pose, variances) = smooth.between(&poses, time);
            let [turned, moved] = pose.apart(&even(time));
            assert!(turned < 1e-9 && moved < 1e-9, "{turned} {moved}");
            assert!(variances[0] > variances[1] && variances[0] < 1e-3);
        }
        let mut jumps = poses;
        jumps[2].translation.x += 0.1;
        assert!(smooth.value(&jumps) > 1.0);
    }

    #[test]
    fn the_rotation_after_a_small_one_changes_as_is_said() {
        let mut rng = Rng::new(2, 0);
        for size in [1e-6, 0.1, 1.0, 2.5] {
            let w = size * rng.vector().normalize();
            let a = 1e-6 * rng.vector();
            let after = |k: f64| {
                let turned = DQuat::from_scaled_axis(k * a) * DQuat::from_scaled_axis(w);
                turned.to_scaled_axis()
            };
            let off = (0.5 * (after(1.0) - after(-1.0)) - by_turn(w) * a).length() / a.length();
            assert!(off < 1e-6, "{size}: {off}");
        }
    }

    #[test]
    fn a_smooth_path_is_found_where_windows_alone_tell_less_and_a_wild_one_is_kept() {
        const FRAMES: usize = 30;
        for seed in [1, 2] {
            let (camera, tracks, truth) = made::tracks(seed, FRAMES, 60, 0, 0.3);
            for wild in [false, true] {
                let path = |n: usize| {
                    let t = n as f64;
                    let mut rng = Rng::new(n as u64, 7);
                    let step: Vec<f64> =
                        (0..6).map(|k| if k < 3 { 0.01 } else { 0.02 } * rng.normal()).collect();
                    let sway = [0.1, 0.07, 0.08].map(|f| 0.02 * (f * t).sin());
                    let smooth =
                        stepped(&Pose::IDENTITY, &[sway[0], sway[1], 0.0, 2.0 * sway[2], sway[1], sway[0]]);
                    if wild && n > 0 { stepped(&smooth, &step) } else { smooth }
                };
                let truth = State { poses: (0..FRAMES).map(path).collect(), points: truth.points.clone() };
                let tracks = made::seen(&camera, &tracks, &truth, 0.3, seed);
                let mut bundle = Bundle::new(&camera, &tracks, super::super::bundle::Freedom::All);
                let mut state = made::disturbed(&truth, seed);
                bundle.minimise(&mut state, 100);
                // Root mean square of rotations [°], and of places after the best scale.
                let apart = |state: &State| {
                    let scale = made::scale(&state.poses, &truth.poses);
                    let pairs = state.poses.iter().zip(&truth.poses);
                    let sum = pairs.fold([0.0; 2], |[a, b], (found, truth)| {
                        let place = |pose: &Pose| pose.in_world(DVec3::ZERO);
                        let moved = scale * place(found) - place(truth);
                        [a + found.apart(truth)[0].to_degrees().powi(2), b + moved.length_squared()]
                    });
                    sum.map(|sum| (sum / FRAMES as f64).sqrt())
                };
                let before = apart(&state);
                smoothen(&mut bundle, &mut state, (0..FRAMES).map(|n| n as f64).collect());
                let after = apart(&state);
                println!("wild {wild}: {before:?} to {after:?}");
                let most = if wild { [1.1, 1.1] } else { [1.0, 0.75] };
                assert!((0..2).all(|k| after[k] < most[k] * before[k]));
            }
        }
    }
}
