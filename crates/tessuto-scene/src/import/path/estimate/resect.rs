//! The pose of one more frame, from points that are known.

use super::bundle::{Freedom, Given, TAILS};
use super::observed::{Point, observed, place, stepped};
use super::track::Track;
use glam::{DMat2, DVec2};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::math::minimise::{Model, Policy};
use tessuto_core::math::root::Root;

const POLICY: Policy = Policy {
    lambda: 1e-3,
    accepted: [0.2, 1e-9],
    rejected: [8.0, 1e-4],
    attempts: 6,
    strictly: true,
    least_gain: [1e-7, 1e-7],
    most: 1e8,
};
const ITERATIONS: usize = 30;

/// A window that the frame shows.
pub(super) struct Sight<'a> {
    /// The pose of the frame that showed it first.
    pub host: &'a Pose,
    pub point: &'a Point,
    /// Its own certainty [1/px].
    pub root: DMat2,
    /// Where it is `[px]`.
    pub at: DVec2,
}

impl<'a> Sight<'a> {
    /// What frame `n` shows of a track whose `host` and `point` are these; `None` if it does not show it.
    pub fn of(track: &Track, n: usize, host: &'a Pose, point: &'a Point) -> Option<Self> {
        let place = track.seen.binary_search_by_key(&n, |(frame, _)| *frame).ok()?;
        Some(Self { host, point, root: track.root, at: track.seen[place].1 })
    }
}

pub(super) struct Resection<'a> {
    pub camera: &'a Camera,
    pub sights: Vec<Sight<'a>>,
    pub freedom: Freedom,
    /// σ², as of the other frames.
    pub variance: f64,
    /// Where the path has the pose, and the variances of its rotation and of its place.
    pub near: Option<(Pose, [f64; 2])>,
}

impl Resection<'_> {
    /// The pose, from `start` on.
    pub fn solve(&mut self, start: Pose) -> Pose {
        let mut pose = self.near.map_or(start, |(near, _)| near);
        POLICY.minimise(self, &mut pose, ITERATIONS);
        pose
    }

    /// The same as poses that are given, of which the first is none.
    fn given(&self) -> Option<Given> {
        self.near.map(|(near, variances)| Given { poses: vec![Pose::IDENTITY, near], variances })
    }

    fn value(&self, pose: &Pose) -> f64 {
        let cost = |s: &Sight| {
            let there = place(self.camera, s.host, pose, s.point)?;
            let square = (s.root * (there - s.at)).length_squared();
            Some(0.5 * (TAILS + 2.0) * (square / (TAILS * self.variance)).ln_1p())
        };
        let of_path = self.given().map_or(0.0, |given| given.value(&[Pose::IDENTITY, *pose]));
        self.sights.iter().map(|s| cost(s).unwrap_or(f64::INFINITY)).sum::<f64>() + of_path
    }
}

impl Model for Resection<'_> {
    type Point = Pose;
    type System = ([f64; 36], [f64; 6]);

    fn linearise(&mut self, pose: &Pose) -> (f64, Self::System) {
        let (mut matrix, mut gradient) = ([0.0; 36], [0.0; 6]);
        let free = self.freedom.unknowns()[0];
        for s in &self.sights {
            let Some(seen) = observed(self.camera, s.host, pose, s.point) else { continue };
            let r = s.root * (seen.at - s.at);
            let omega = (TAILS + 2.0) / (TAILS * self.variance + r.length_squared());
            let [u, v] = seen.by_frame;
            for (row, r) in [(s.root.row(0), r.x), (s.root.row(1), r.y)] {
                let by: [f64; 6] =
                    std::array::from_fn(|k| if k < free { row.x * u[k] + row.y * v[k] } else { 0.0 });
                (0..36).for_each(|k| matrix[k] += omega * by[k / 6] * by[k % 6]);
                (0..6).for_each(|k| gradient[k] += omega * by[k] * r);
            }
        }
        if let Some(given) = self.given() {
            given.add(&[Pose::IDENTITY, *pose], &mut matrix, &mut gradient);
        }
        (self.value(pose), (matrix, gradient))
    }

    fn step(&mut self, at: &Pose, (matrix, gradient): &Self::System, lambda: f64) -> Option<(Pose, f64)> {
        let mut damped = *matrix;
        (0..6).for_each(|k| damped[7 * k] *= 1.0 + lambda);
        let step: Vec<f64> = Root::of(&damped, 6).solve(gradient).iter().map(|v| -v).collect();
        let next = stepped(at, &step);
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
    fn a_pose_is_found_among_known_points_and_its_gradient_is_that_of_differences() {
        let (camera, tracks, truth) = made::tracks(8, 4, 60, 6, 0.0);
        let seen = tracks.iter().zip(&truth.points).filter(|(track, _)| track.host == 0);
        let sights: Vec<Sight> = seen
            .map(|(track, point)| Sight {
                host: &truth.poses[0],
                point,
                root: track.root,
                at: track.seen[0].1,
            })
            .collect();
        let start = Pose::IDENTITY;
        let mut worst = 0.0f64;
        let mut of = Resection { camera: &camera, sights, freedom: Freedom::All, variance: 0.5, near: None };
        for near in [Some((stepped(&start, &[0.02, -0.01, 0.03, 0.1, 0.0, -0.1]), [1e-5, 1e-4])), None] {
            of.near = near;
            let (_, (_, gradient)) = of.linearise(&start);
            let value = |x: &[f64]| of.value(&stepped(&start, x));
            worst = worst.max(check(&[0.0; 6], &gradient, 1e-5, 12, 2, value).relative_error);
        }
        let [turned, moved] = of.solve(start).apart(&truth.poses[1]);
        println!("worst {worst:.1e}, {:.1e}°, {moved:.1e} off", turned.to_degrees());
        assert!(worst < 1e-6 && turned.to_degrees() < 1e-3 && moved < 1e-4);
    }
}
