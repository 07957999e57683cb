//! Poses that are given, refined: the bundle adjustment of the windows that stand still begins with them.
//!
//! Two models contend for where the windows were seen: the poses as they are given, with the windows' depths alone
//! free, and all free. What is better by its evidence is kept.
//!
//! Windows tell rotations best, and of a camera that hardly moves little else; given poses may know its way better. So
//! these stay as one more observation, whose spreads are the likeliest ones (A. Dempster and others, *Maximum
//! likelihood from incomplete data via the EM algorithm*, 1977): how far off they are, and how far the refined ones may
//! be. They also hold the unit of length, and the world, in which gravity is below and other cameras are.

use glam::{DMat3, DQuat, DVec3, DVec4};

use super::bundle::{Bundle, Freedom, Given, State};
use super::observed::Point;
use super::solve::{among, chosen, others, residuals};
use super::track::{Followed, Track};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::math::median::median;

/// Iterations of both models, and of the free one after each estimate of the given poses' spreads.
const ITERATIONS: [usize; 2] = [80, 4];
/// Estimates of these, and the change of a variance that ends them.
const ROUNDS: usize = 10;
const SETTLED: f64 = 0.02;
/// Least variances `[rad²]`, and of a unit that is the usual depth.
const LEAST: f64 = 1e-14;
/// One over a depth is at least this part of the median.
pub(super) const FARTHEST: f64 = 1e-3;

/// What was found.
pub(super) struct Refined {
    /// camera_from_world of every frame, in the world and unit of the given ones.
    pub poses: Vec<Pose>,
    /// Whether these explain the windows better than the given ones.
    pub better: bool,
    /// Windows that stand still by these, and all.
    pub windows: [usize; 2],
    /// What is left of the place of a window by the given poses and by these, standard deviation `[px]`.
    pub left: [f64; 2],
}

/// The `given` poses, one of every frame, refined by what `camera` saw and was followed.
pub(super) fn refine(camera: &Camera, followed: &Followed, given: &[Pose]) -> Refined {
    let chosen = chosen(followed, given.len());
    let (of, tracks) = among(&followed.tracks, &chosen);
    let back = given[0].inverse();
    let relative: Vec<Pose> = given.iter().map(|pose| pose.after(&back)).collect();
    let of_chosen: Vec<Pose> = chosen.iter().map(|n| relative[*n]).collect();
    let depths: Vec<f64> = tracks.iter().map(|track| inverse_depth(camera, &of_chosen, track)).collect();
    // One over the median depth is the unit, as the depths' prior has it.
    let usual = median(depths.iter().copied().filter(|d| *d > 0.0).collect()).unwrap_or(1.0);
    let in_unit = |pose: &Pose| Pose { translation: pose.translation * usual, ..*pose };
    let point = |(track, depth): (&Track, &f64)| Point {
        at: track.at,
        inverse_depth: (depth / usual).clamp(FARTHEST, 1.0 / FARTHEST),
    };
    let points = tracks.iter().zip(&depths).map(point).collect();
    let mut as_given = State { poses: of_chosen.iter().map(in_unit).collect(), points };

    let bundle = |freedom: Freedom| Bundle::new(camera, &tracks, freedom);
    let [mut fixed, mut free] = [Freedom::Depths, Freedom::All].map(bundle);
    fixed.minimise(&mut as_given, ITERATIONS[0]);
    let mut refined = as_given.clone();
    free.minimise(&mut refined, ITERATIONS[0]);
    weigh(&mut free, &mut refined, &as_given.poses);

    let better = free.evidence(&refined) < fixed.evidence(&as_given);
    let (_, before) = residuals(&fixed, &as_given);
    let (still, after) = residuals(&free, &refined);
    let way = |from: usize, to: usize| in_unit(&relative[to]).after(&in_unit(&relative[from]).inverse());
    let found = others(&free, &refined, followed, &chosen, &of, &way);
    let found: Vec<Pose> =
        found.iter().map(|pose| Pose { translation: pose.translation / usual, ..*pose }).collect();
    Refined { poses: laid(&found, given), better, windows: [still, tracks.len()], left: [before, after] }
}

/// Refines `state` further with the `given` poses as observations, whose spreads are found.
fn weigh(bundle: &mut Bundle, state: &mut State, given: &[Pose]) {
    let mut variances = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        // As they lie best around the present ones.
        let poses = laid(given, &state.poses);
        let mut target = Given { poses, variances };
        let known = bundle.uncertainty(state);
        let mut sums = [0.0; 2];
        for (n, pose) in state.poses.iter().enumerate().skip(1) {
            let off = target.off(n, pose);
            (0..2).for_each(|k| sums[k] += off[k].length_squared());
        }
        let count = (3 * (state.poses.len() - 1)).max(1) as f64;
        let next = [0, 1].map(|k| (sums[k] / count + known[k]).max(LEAST));
        let settled = (0..2).all(|k| (next[k] / variances[k] - 1.0).abs() < SETTLED);
        variances = next;
        target.variances = next;
        bundle.given = Some(target);
        let depths = state.points.iter().map(|point| point.inverse_depth);
        bundle.usual = depths.sum::<f64>() / state.points.len().max(1) as f64;
        bundle.minimise(state, ITERATIONS[1]);
        if settled {
            break;
        }
    }
}

/// One over the depth of a window in its first frame, by least squares of the rays that meet its own; `poses` of the
/// frames as the track counts them.
pub(super) fn inverse_depth(camera: &Camera, poses: &[Pose], track: &Track) -> f64 {
    let (host, ray) = (&poses[track.host], camera.ray(track.at));
    let sums = track.seen.iter().fold([0.0; 2], |[up, down], (n, at)| {
        // a + ρ b, seen at o.
        let turn = poses[*n].rotation * host.rotation.transpose();
        let (a, b) = (turn * ray, poses[*n].translation - turn * host.translation);
        let o = camera.ray(*at);
        let [p, q] = [a, b].map(|v| v.truncate() - o.truncate() * v.z);
        [up - p.dot(q), down + q.length_squared()]
    });
    if sums[1] > 0.0 { sums[0] / sums[1] } else { 0.0 }
}

/// `found` in the world of `given`: turned and moved as a whole, so that rotations and places lie best on those.
fn laid(found: &[Pose], given: &[Pose]) -> Vec<Pose> {
    let turn = |(f, g): (&Pose, &Pose)| DQuat::from_mat3(&(g.rotation.transpose() * f.rotation));
    let pairs = || found.iter().zip(given);
    let first = pairs().next().map_or(DQuat::IDENTITY, turn);
    let sum = pairs()
        .map(turn)
        .fold(DVec4::ZERO, |sum, q| sum + DVec4::from(if q.dot(first) < 0.0 { -q } else { q }));
    let rotation = DMat3::from_quat(DQuat::from_vec4(sum.normalize()));
    let centre = |poses: &[Pose]| {
        let sum: DVec3 = poses.iter().map(|pose| pose.in_world(DVec3::ZERO)).sum();
        sum / poses.len().max(1) as f64
    };
    let world = Pose { rotation, translation: centre(given) - rotation * centre(found) };
    let back = world.inverse();
    found.iter().map(|pose| pose.after(&back)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::super::observed::stepped;
    use super::*;
    use tessuto_core::math::rng::Rng;

    fn followed(tracks: Vec<Track>, poses: &[Pose]) -> Followed {
        Followed { tracks, turns: poses.iter().map(|pose| pose.rotation).collect() }
    }

    /// The truth in another world, of another unit, with poses that are off.
    fn given(truth: &[Pose], off: [f64; 2]) -> Vec<Pose> {
        let mut rng = Rng::new(6, 0);
        let world = Pose { translation: DVec3::new(3.0, -2.0, 1.0), ..Pose::random(&mut rng) };
        let pose = |pose: &Pose| {
            let step: Vec<f64> = (0..6).map(|k| off[k / 3] * rng.normal()).collect();
            let off = stepped(pose, &step);
            Pose { translation: 1.7 * off.translation, ..off }.after(&world)
        };
        truth.iter().map(pose).collect()
    }

    #[test]
    fn poses_that_are_off_are_refined_and_exact_ones_are_kept() {
        for (frames, windows) in [(12, 200), (70, 60)] {
            let (camera, tracks, truth) = made::tracks(1, frames, windows, windows / 10, 0.1);
            let [exact, off] = [[0.0; 2], [2e-3, 1e-3]].map(|off| given(&truth.poses, off));
            let worst = |poses: &[Pose]| {
                poses.iter().zip(&exact).fold([0.0f64; 2], |worst, (a, b)| {
                    let [turned, moved] = a.apart(b);
                    [worst[0].max(turned.to_degrees()), worst[1].max(moved / 1.7)]
                })
            };
            let followed = followed(tracks, &truth.poses);
            let found = refine(&camera, &followed, &off);
            println!("{:?} to {:?}; {:?} px", worst(&off), worst(&found.poses), found.left);
            assert!(found.better && found.left[1] < 0.5 * found.left[0]);
            let [turned, moved] = worst(&found.poses);
            assert!(turned < 0.12 && moved < 2e-3, "{turned}° {moved}");
            assert!(!refine(&camera, &followed, &exact).better);
        }
    }
}
