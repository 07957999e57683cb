//! The sheet followed once more, with what its clip asks for.
//!
//! The first followers know no more of the cloth than its template and what holds for most clips; where it bends
//! unlike those, they find other waves than it has, or miss them. Motions that are refined show how it bends, how
//! firmly it keeps its lengths, how much is to be made of colours and outlines, and the light. Followers that use
//! all that find frames that no motion so far has, and from those others start. They go forward from the first
//! frame and backward from the last.

use tessuto_core::parallel;

use super::noise::Asked;
use super::track::{Follower, Start};
use super::{LevelSearch, Positions, Problem};
use crate::session::foreign_state;
use tessuto_core::error::Result;

/// Directions of time and kinds of start: each finds waves that the others miss.
const COURSES: [(bool, Start); 4] =
    [(false, Start::Strict), (false, Start::Loose), (true, Start::Strict), (true, Start::Loose)];

/// Followers under way; none before they start.
pub(super) type Followers = Vec<Follower>;

impl Problem<'_> {
    /// Follows the fabric on all courses, with what `asked` says and the light that shows in `best`, from where
    /// that begins and ends; goes on with `followers`, which are handed to `report` after every frame, with the
    /// objective of the first of them. Where one is lost it keeps the frames of `best`.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] for followers that are not of this clip; what `report` returns.
    pub(super) fn follow_again(
        &self,
        best: &[Positions],
        asked: &Asked,
        followers: &mut Followers,
        mut report: impl FnMut(&mut Followers, f64) -> Result<()>,
    ) -> Result<()> {
        let last = best.len() - 1;
        let light = self.light_of(best);
        let informed = |(_, start): (bool, Start)| {
            let inform = |level: &mut LevelSearch| {
                level.asked.clone_from(asked);
                level.light = light;
            };
            self.levels(inform, |left| start.loosened(&self.settings, left))
        };
        let mut searches = COURSES.map(informed);
        if followers.is_empty() {
            let begin = |((backward, _), levels): (&(bool, Start), &mut Vec<LevelSearch>)| {
                Follower::at(frame_at(*backward, last, 0), best, levels)
            };
            followers.extend(COURSES.iter().zip(&mut searches).map(begin));
        }
        let done = followers[0].frames.len();
        let matches = |(follower, (backward, _)): (&Follower, &(bool, Start))| {
            // The first frame is known: who goes backward ends before it.
            let of = if *backward { done.min(last.max(1)) } else { done };
            follower.frames.len() == of
                && follower.gains.len() == searches[0].len()
                && self.matches(&follower.frames, &follower.gains)
        };
        if followers.len() != COURSES.len()
            || done > best.len()
            || !followers.iter().zip(&COURSES).all(matches)
        {
            return Err(foreign_state("refine"));
        }
        for k in done..=last {
            let step = |((levels, follower), (backward, _)): (
                (&mut Vec<LevelSearch>, &mut Follower),
                &(bool, Start),
            )| {
                if *backward && k == last {
                    return 0.0;
                }
                let value = follower.follow(k, |k| frame_at(*backward, last, k), levels);
                if follower.lost.is_some() {
                    follower.frames[k].clone_from(&best[frame_at(*backward, last, k)]);
                }
                value
            };
            let sides = searches.iter_mut().zip(followers.iter_mut()).zip(&COURSES).collect();
            let values: Vec<f64> = parallel::consume(sides, |_, side| step(side));
            report(followers, values[0])?;
        }
        Ok(())
    }

    /// Number of frames that are followed again.
    pub(super) fn again_steps(&self) -> usize {
        self.scene.frames.len() - 1
    }

    /// The motions that `followers` found in the end, each of shape [N, V].
    pub(super) fn followed_again(&self, followers: &Followers) -> Vec<Vec<Positions>> {
        let motion = |(follower, (backward, _)): (&Follower, &(bool, Start))| match backward {
            false => follower.frames.clone(),
            true => {
                let first = std::iter::once(&self.start.known[0]);
                first.chain(follower.frames.iter().rev()).take(self.scene.frames.len()).cloned().collect()
            }
        };
        followers.iter().zip(&COURSES).map(motion).collect()
    }
}

/// Number of motions that are followed again.
pub(super) const AGAIN: usize = COURSES.len();

/// The frame at place `k` of a course that ends, or begins, at frame `last`.
fn frame_at(backward: bool, last: usize, k: usize) -> usize {
    if backward { last - k } else { k }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use tessuto_sim::Cloth;

    /// How far the farthest vertex is from `right` in any frame `[m]`.
    fn off(frames: &[Positions], right: &Positions) -> f64 {
        let pairs = frames.iter().flat_map(|x| x.iter().zip(right));
        pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    #[test]
    fn lost_frames_are_filled_from_the_later_ones() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let right = &scene.template.positions;
        let mut forward = vec![right.clone(); 4];
        // Most of a stripe aside, and a third of it nearer.
        for (n, by) in [(1, 12e-3), (2, 15e-3)] {
            forward[n].iter_mut().for_each(|x| *x += DVec3::new(by, 0.0, -0.3 * by));
        }
        let filled_of = |frames: &[Positions]| {
            let mut followers = Followers::new();
            problem.follow_again(frames, &Asked::default(), &mut followers, |_, _| Ok(())).unwrap();
            let mut motions = problem.followed_again(&followers);
            assert!(motions.len() == AGAIN && motions.iter().all(|m| m.len() == 4 && m[0] == *right));
            motions.insert(0, frames.to_vec());
            problem.best_path(&motions)
        };
        let filled = filled_of(&forward);
        println!("{} m before, {} m after", off(&forward, right), off(&filled, right));
        assert!(off(&filled, right) < 0.1 * off(&forward, right));
        // Nothing is lost where it was right.
        assert!(off(&filled_of(&vec![right.clone(); 4]), right) <= off(&filled, right));
    }

    #[test]
    fn one_that_is_lost_keeps_the_frames_that_were_there() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let mut best = vec![scene.template.positions.clone(); 4];
        best[3].iter_mut().for_each(|x| *x += DVec3::Z * 1e-3);
        let mut followers = Followers::new();
        let mut frames = 0;
        let lose = |followers: &mut Followers, _| {
            frames += 1;
            followers[0].lost.get_or_insert((2, f64::NAN));
            Ok(())
        };
        problem.follow_again(&best, &Asked::default(), &mut followers, lose).unwrap();
        let found = problem.followed_again(&followers);
        assert_eq!((frames, &found[0][2..]), (3, &best[2..]));
        assert_ne!(found[1][2], best[2], "the others go on");
        followers[1].frames.pop();
        assert!(problem.follow_again(&best, &Asked::default(), &mut followers, |_, _| Ok(())).is_err());
    }
}
