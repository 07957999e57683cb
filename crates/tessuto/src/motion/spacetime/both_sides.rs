//! The start of the search from both sides: frames followed backward in time as well, and the better of the two in each.
//!
//! Where the fabric moves fast, it may be lost for some frames and found again: the next ones are right, those between are
//! not, and no gradient leads them back. Followed from the right ones backward they are reached from the other side.

use rayon::prelude::*;

use super::acceleration;
use super::track::{Follower, Tracked};
use super::{LevelSearch, Positions, Problem};
use crate::error::Result;
use crate::session::{Epoch, Session, foreign_state, named};

/// Forward and backward.
const SIDES: usize = 2;
/// A frame is found when a step lowers its E by less than this part: only the basin counts, `refine` goes on from there.
const LEAST_GAIN: f64 = 1e-2;

impl Problem<'_> {
    /// `forward`, shape [N, V], with the frames that are better explained when followed backward from the last one:
    /// the path through both with the least E of frames and accelerations.
    ///
    /// # Errors
    /// As of [`Problem::track`].
    pub(super) fn both_sides(
        &self,
        forward: &[Positions],
        tracked: &mut Tracked,
        session: &mut Session,
    ) -> Result<Vec<Positions>> {
        let count = forward.len();
        let mut levels: Vec<LevelSearch> =
            self.observed.coarse_to_fine().map(|level| self.at_level(level)).collect();
        for level in &mut levels {
            level.loosen(1.0, self.settings.start_tail);
            level.least_gain = LEAST_GAIN;
        }
        let last = count - 1;
        let start = |levels: &mut [LevelSearch]| {
            let gains = levels.iter_mut().map(|level| {
                level.update_gain(last, &forward[last]);
                level.gains[last].clone()
            });
            Follower { gains: gains.collect(), frames: vec![forward[last].clone()], lost: None }
        };
        let mut backward = tracked.backward.take().unwrap_or_else(|| start(&mut levels));
        let matches = backward.gains.len() == levels.len() && self.matches(&backward.frames, &backward.gains);
        if !matches || !(1..=count).contains(&backward.frames.len()) {
            return Err(foreign_state("track"));
        }
        let forward_steps = self.forward_steps(tracked.smooth);
        for k in backward.frames.len()..last {
            let value = backward.follow(k, |k| last - k, &mut levels);
            let epoch = Epoch {
                stage: "track".into(),
                step: forward_steps + k,
                of: forward_steps + self.backward_steps(),
                active_frames: count,
                losses: named([("total", value)]),
                parameters: named([("shear_smooth", tracked.smooth)]),
            };
            tracked.backward = Some(backward);
            session.step(&epoch, &[], Some(&*tracked))?;
            backward = tracked.backward.take().expect("put there above");
        }
        drop(levels);
        let found = backward.lost.map_or(backward.frames.len(), |(k, _)| k);
        let mut behind = forward.to_vec();
        for (k, x) in backward.frames[..found].iter().enumerate() {
            behind[last - k].clone_from(x);
        }
        tracked.backward = Some(backward);
        let sides = [forward, &behind];
        let mut finest = self.at_level(self.observed.range[0]);
        finest.loosen(1.0, self.settings.start_tail);
        let chosen = best_path(sides, &sides.map(|x| finest.frame_values(x)), self.acceleration_weight());
        Ok(chosen.iter().enumerate().map(|(n, side)| sides[*side][n].clone()).collect())
    }

    /// Number of frames that are followed backward.
    pub(super) fn backward_steps(&self) -> usize {
        self.scene.frames.len().saturating_sub(2)
    }
}

impl LevelSearch<'_, '_> {
    /// E of every frame by itself, without comparison to adjacent ones.
    fn frame_values(&mut self, frames: &[Positions]) -> Vec<f64> {
        for (n, x) in frames.iter().enumerate().skip(1) {
            self.update_gain(n, x);
        }
        let search = &*self;
        let value = |(n, x): (usize, &Positions)| if n == 0 { 0.0 } else { search.terms(n).value(x) };
        frames.par_iter().enumerate().map(value).collect()
    }
}

/// The side to take in every frame, given the E of each side's frames `[SIDES][N]` and the weight κ of the accelerations `[1/m²]`:
/// dynamic programming over the sides of two frames in sequence. Of equals the first side.
fn best_path(sides: [&[Positions]; SIDES], values: &[Vec<f64>; SIDES], kappa: f64) -> Vec<usize> {
    let count = values[0].len();
    // Lowest cost of a path that ends with the sides [a][b] in two frames, and the side before a, by frame.
    let mut cost = [[f64::INFINITY; SIDES]; SIDES];
    // The first frame is known.
    cost[0] = std::array::from_fn(|b| values[b].get(1).copied().unwrap_or(0.0));
    let mut came_from: Vec<[[usize; SIDES]; SIDES]> = Vec::new();
    for n in 2..count {
        let mut next = [[f64::INFINITY; SIDES]; SIDES];
        let mut from = [[0; SIDES]; SIDES];
        for (a, b, c) in all_triples() {
            let three = [&sides[a][n - 2], &sides[b][n - 1], &sides[c][n]];
            let total = cost[a][b] + values[c][n] + acceleration::of_three(three, kappa);
            if total < next[b][c] {
                (next[b][c], from[b][c]) = (total, a);
            }
        }
        cost = next;
        came_from.push(from);
    }
    let pairs = all_triples().filter(|(a, ..)| *a == 0).map(|(_, b, c)| (b, c));
    let (mut b, mut c) =
        pairs.fold((0, 0), |best, (b, c)| if cost[b][c] < cost[best.0][best.1] { (b, c) } else { best });
    let mut chosen = vec![0; count];
    for n in (1..count).rev() {
        chosen[n] = c;
        if n >= 2 {
            (b, c) = (came_from[n - 2][b][c], b);
        }
    }
    chosen
}

/// The sides of three frames.
fn all_triples() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..SIDES * SIDES * SIDES).map(|k| (k / (SIDES * SIDES), k / SIDES % SIDES, k % SIDES))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::deviation::tests::{at_video_resolution, still};
    use super::*;
    use crate::math::rng::Rng;
    use crate::sim::Cloth;

    #[test]
    fn the_path_is_the_best_of_all() {
        let mut rng = Rng::new(8, 0);
        let mut mixed = 0;
        for _ in 0..20 {
            let mut random = || -> Vec<Positions> { (0..7).map(|_| vec![rng.vector(); 1]).collect() };
            let (a, mut b) = (random(), random());
            b[0].clone_from(&a[0]);
            let values = [(); 2].map(|()| (0..7).map(|_| 3.0 * rng.normal()).collect::<Vec<f64>>());
            let sides = [a.as_slice(), b.as_slice()];
            let cost = |path: &[usize]| {
                let x: Vec<Positions> = path.iter().enumerate().map(|(n, s)| sides[*s][n].clone()).collect();
                let own: f64 = path.iter().enumerate().skip(1).map(|(n, s)| values[*s][n]).sum();
                own + acceleration::value(&x, 0.7)
            };
            let found = best_path(sides, &values, 0.7);
            let all = (0..128).map(|bits| cost(&(0..7).map(|n| bits >> n & 1).collect::<Vec<usize>>()));
            let least = all.fold(f64::INFINITY, f64::min);
            assert!((cost(&found) - least).abs() < 1e-12 * least.abs().max(1.0), "{} {least}", cost(&found));
            mixed += usize::from(found[1..].contains(&0) && found[1..].contains(&1));
        }
        assert!(mixed > 5, "{mixed} paths with both sides");
        let one = [Positions::new()];
        assert_eq!(best_path([&one, &one], &[vec![0.0], vec![0.0]], 1.0), [0]);
    }

    #[test]
    fn lost_frames_are_filled_from_the_later_ones() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_video_resolution()).unwrap();
        let right = &scene.template.positions;
        let mut forward = vec![right.clone(); 4];
        // Most of a stripe aside, and a third of it nearer.
        for (n, by) in [(1, 12e-3), (2, 15e-3)] {
            forward[n].iter_mut().for_each(|x| *x += DVec3::new(by, 0.0, -0.3 * by));
        }
        let mut tracked = problem.start(problem.settings.shear_smooth);
        let filled = problem.both_sides(&forward, &mut tracked, &mut Session::silent()).unwrap();
        let off = |x: &[Positions]| {
            let pairs = x.iter().flat_map(|x| x.iter().zip(right));
            pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
        };
        println!("{} m before, {} m after", off(&forward), off(&filled));
        assert!(off(&filled) < 0.1 * off(&forward));
        // Nothing is lost where it was right.
        let kept = problem.both_sides(&filled, &mut tracked, &mut Session::silent()).unwrap();
        assert!(off(&kept) <= off(&filled));
    }
}
