//! The start of the search from both sides: frames followed backward in time as well, and all that was found.
//!
//! Where the fabric moves fast, it may be lost for some frames and found again: the next ones are right, those between are
//! not, and no gradient leads them back. Followed from the right ones backward they are reached from the other side. It is half of all
//! tracking, and left out where the followers forward agree and have lost nothing.

use super::best_path::Pool;
use super::gain::GAIN_FITS;
use super::track::{Follower, STARTS, Tracked};
use super::{LevelSearch, Positions, Problem, acceleration};
use crate::error::Result;
use crate::motion::terms::shading::Light;
use crate::session::{Epoch, Session, foreign_state, named};

/// Followers agree if they are [alike](Problem::alike) by this part of the sheet's size.
const AGREED: f64 = 0.05;

/// Spread of accelerations over the root mean square of those that followers found: a few are much larger than most, and those of a motion
/// that went astray too small.
const OF_ACCELERATIONS: f64 = 3.0;
/// Least spread, of that of the settings.
const LEAST_ACCELERATION: f64 = 0.1;

impl Problem<'_> {
    /// What all followers that were not lost found: those of `tracked` and, unless these agree, the late ones, and what patches find of frames
    /// that all have lost. The best path alone if they agree.
    ///
    /// # Errors
    /// As of [`Problem::track`].
    pub(super) fn both_sides(&mut self, tracked: &mut Tracked, session: &mut Session) -> Result<Pool> {
        let mut sides: Vec<Vec<Positions>> = tracked.followers.iter().filter_map(Follower::found).collect();
        let forward = self.best_path(&sides);
        self.light = self.light_of(&forward);
        self.acceleration = self.acceleration_spread(&forward);
        if self.agreed(&sides, &forward) {
            return Ok(Pool::of(forward));
        }
        sides.extend(self.followed_late(forward, tracked, session)?);
        let best = self.best_path(&sides);
        sides.extend(self.rematched(&best));
        Ok(Pool { best: self.best_path(&sides), motions: sides })
    }

    /// Whether all followers found the same, and its print everywhere: `best` needs no others.
    fn agreed(&self, followed: &[Vec<Positions>], best: &[Positions]) -> bool {
        let same = |frames: &Vec<Positions>| self.alike(frames, &followed[0], AGREED);
        followed.len() == STARTS && followed[1..].iter().all(same) && !self.prints_lost(best).contains(&true)
    }

    /// What two more followers find: one that goes backward from where `forward` ends, with the frames that it does not reach as they are, and, on the other
    /// core, one with spreads as they are and the tails of a start, if it is not lost.
    fn followed_late(
        &self,
        forward: Vec<Positions>,
        tracked: &mut Tracked,
        session: &mut Session,
    ) -> Result<Vec<Vec<Positions>>> {
        let last = forward.len() - 1;
        let mut levels = [(); 2].map(|()| self.levels(|_| ([1.0; 2], self.settings.start_tail)));
        let start = |levels: &mut [LevelSearch], n: usize| {
            let gains = levels.iter_mut().map(|level| {
                level.update_gain(n, &forward[n]);
                level.gains[n].clone()
            });
            Follower { gains: gains.collect(), frames: vec![forward[n].clone()], lost: None }
        };
        let [mut backward, mut strict] = match tracked.late.take() {
            Some(late) => late,
            None => [start(&mut levels[0], last), start(&mut levels[1], 0)],
        };
        let matches = |f: &Follower| f.gains.len() == levels[0].len() && self.matches(&f.frames, &f.gains);
        let done = strict.frames.len();
        if ![&backward, &strict].into_iter().all(matches)
            || !(1..=forward.len()).contains(&done)
            || backward.frames.len() != done.min(last.max(1))
        {
            return Err(foreign_state("track"));
        }
        let forward_steps = self.forward_steps(tracked.smooth);
        for k in done..=last {
            let [for_backward, for_strict] = &mut levels;
            let (_, value) = rayon::join(
                // The first frame is known.
                || (k < last).then(|| backward.follow(k, |k| last - k, for_backward)),
                || strict.follow(k, |k| k, for_strict),
            );
            let epoch = Epoch {
                stage: "track".into(),
                step: forward_steps + k,
                of: forward_steps + self.late_steps(),
                active_frames: forward.len(),
                losses: named([("total", value)]),
                parameters: named([("shear_smooth", tracked.smooth)]),
            };
            tracked.late = Some([backward, strict]);
            session.step(&epoch, &[], Some(&*tracked))?;
            [backward, strict] = tracked.late.take().expect("put there above");
        }
        let late = strict.found();
        let reached = backward.lost.map_or(backward.frames.len(), |(k, _)| k);
        let mut behind = forward;
        for (k, x) in backward.frames[..reached].iter().enumerate() {
            behind[last - k].clone_from(x);
        }
        tracked.late = Some([backward, strict]);
        Ok(late.into_iter().chain([behind]).collect())
    }

    /// Spread of the accelerations that a motion like `frames` asks for `[m/s²]`.
    fn acceleration_spread(&self, frames: &[Positions]) -> f64 {
        let components = 3 * self.cloth.vertex_count() * frames.len().saturating_sub(2);
        let squares = 2.0 * acceleration::value(frames, self.scene.fps.powi(4));
        let root_mean_square = (squares / components.max(1) as f64).sqrt();
        (OF_ACCELERATIONS * root_mean_square).max(LEAST_ACCELERATION * self.settings.acceleration)
    }

    /// The light that shows in `frames`.
    fn light_of(&self, frames: &[Positions]) -> Light {
        let mut finest = self.at_level(self.observed.range[0]);
        (0..GAIN_FITS).for_each(|_| finest.update_references(frames));
        finest.light
    }

    /// Number of frames that are followed late, if any are.
    pub(super) fn late_steps(&self) -> usize {
        self.scene.frames.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use crate::sim::Cloth;

    #[test]
    fn lost_frames_are_filled_from_the_later_ones() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let mut problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let right = &scene.template.positions;
        let mut forward = vec![right.clone(); 4];
        // Most of a stripe aside, and a third of it nearer.
        for (n, by) in [(1, 12e-3), (2, 15e-3)] {
            forward[n].iter_mut().for_each(|x| *x += DVec3::new(by, 0.0, -0.3 * by));
        }
        let mut filled_of = |frames: &[Positions]| {
            let mut tracked = problem.start(problem.settings.shear_smooth);
            tracked.followers.iter_mut().for_each(|f| f.frames = frames.to_vec());
            problem.both_sides(&mut tracked, &mut Session::silent()).unwrap().best
        };
        let filled = filled_of(&forward);
        let off = |x: &[Positions]| {
            let pairs = x.iter().flat_map(|x| x.iter().zip(right));
            pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
        };
        println!("{} m before, {} m after", off(&forward), off(&filled));
        assert!(off(&filled) < 0.1 * off(&forward));
        // Nothing is lost where it was right.
        let all_right = vec![right.clone(); 4];
        assert!(off(&filled_of(&all_right)) <= off(&filled));
    }

    #[test]
    fn followers_agree_where_they_found_the_same_and_its_print() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let (right, size) = (vec![scene.template.positions.clone(); 4], scene.template.area().sqrt());
        let aside = |frame: usize, by: DVec3| {
            let mut frames = right.clone();
            frames[frame].iter_mut().for_each(|x| *x += by * size);
            frames
        };
        let agreed = |a: &[Positions], b: &[Positions]| problem.agreed(&[a.to_vec(), b.to_vec()], a);
        let [near, far] = [0.8, 1.2].map(|by| aside(3, DVec3::Z * (by * AGREED)));
        assert!(agreed(&right, &near));
        assert!(!agreed(&right, &far), "one frame differs");
        let lost = aside(2, DVec3::X * 0.05);
        assert!(!agreed(&lost, &lost), "both have lost it in the same way");
        assert!(!problem.agreed(std::slice::from_ref(&right), &right), "one alone, if the other is lost");
    }

    #[test]
    fn the_spread_of_accelerations_is_the_clips_own() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let right = &scene.template.positions;
        // 20 m/s² along the view in every frame: the root mean square of three components is 20/√3.
        let thrown = |n: usize| -> Positions {
            let t = n as f64 / scene.fps;
            right.iter().map(|x| *x + DVec3::Z * (10.0 * t * t)).collect()
        };
        let thrown: Vec<Positions> = (0..4).map(thrown).collect();
        let expected = OF_ACCELERATIONS * 20.0 / 3f64.sqrt();
        assert!((problem.acceleration_spread(&thrown) / expected - 1.0).abs() < 1e-6);
        let least = LEAST_ACCELERATION * problem.settings.acceleration;
        assert_eq!(problem.acceleration_spread(&vec![right.clone(); 4]), least);
        assert_eq!(problem.acceleration_spread(std::slice::from_ref(right)), least, "of one frame");
    }
}
