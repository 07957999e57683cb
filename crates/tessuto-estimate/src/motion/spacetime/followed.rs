//! What was followed: all motions that may lead to the right one, and what they show of the clip.

use super::best_path::Pool;
use super::gain::GAIN_FITS;
use super::track::{Follower, STARTS, Tracked};
use super::{Positions, Problem, acceleration};
use crate::motion::terms::shading::Light;

/// Followers agree if they are [alike](Problem::alike) by this part of the sheet's size.
const AGREED: f64 = 0.05;

/// Spread of accelerations over the root mean square of those that followers found: a few are much larger than
/// most, and those of a motion that went astray too small.
const OF_ACCELERATIONS: f64 = 3.0;
/// Least spread, of that of the settings.
const LEAST_ACCELERATION: f64 = 0.1;

impl Problem<'_> {
    /// What all followers that were not lost found; the best path alone if they agree. From now on the light and
    /// the spread of accelerations are those of the best path.
    pub(super) fn followed(&mut self, tracked: &Tracked) -> Pool {
        let found: Vec<Vec<Positions>> = tracked.followers.iter().filter_map(Follower::found).collect();
        let best = self.best_path(&found);
        self.light = self.light_of(&best);
        self.acceleration = self.acceleration_spread(&best);
        if self.agreed(&found, &best) {
            return Pool::of(best);
        }
        // Given light and spread another path may be the best.
        Pool { best: self.best_path(&found), motions: found, agreed: false, asked: None }
    }

    /// Whether all followers found the same, and its print everywhere: `best` needs no others.
    fn agreed(&self, followed: &[Vec<Positions>], best: &[Positions]) -> bool {
        let same = |frames: &Vec<Positions>| self.alike(frames, &followed[0], AGREED);
        followed.len() == STARTS && followed[1..].iter().all(same) && !self.prints_lost(best).contains(&true)
    }

    /// Spread of the accelerations that a motion like `frames` asks for `[m/s²]`.
    pub(super) fn acceleration_spread(&self, frames: &[Positions]) -> f64 {
        let components = 3 * self.cloth.vertex_count() * frames.len().saturating_sub(2);
        let squares = 2.0 * acceleration::value(frames, self.scene.fps.powi(4));
        let root_mean_square = (squares / components.max(1) as f64).sqrt();
        (OF_ACCELERATIONS * root_mean_square).max(LEAST_ACCELERATION * self.settings.acceleration)
    }

    /// The light that shows in `frames`.
    pub(super) fn light_of(&self, frames: &[Positions]) -> Light {
        let mut finest = self.at_level(0);
        (0..GAIN_FITS).for_each(|_| finest.update_references(frames));
        finest.light
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use tessuto_sim::Cloth;

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
