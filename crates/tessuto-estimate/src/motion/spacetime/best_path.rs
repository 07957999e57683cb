//! Several motions that the search may start from, and of all of them the best in each frame.

use tessuto_core::parallel;

use super::noise::Asked;
use super::{LevelSearch, Positions, Problem, acceleration};

/// What tracking found, and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Pool {
    /// Motions that may lead to the right one, each of shape [N, V]. Once they are refined, what those became
    /// of which the best path takes a frame, and the best path before the sheet was followed again.
    pub motions: Vec<Vec<Positions>>,
    /// The best path through them; once they are refined, what the frames of the best path started from. Shape [N, V].
    pub best: Vec<Positions>,
    /// Whether all followers found the same: no others are looked for.
    pub agreed: bool,
    /// What the clip asked for when they were refined.
    pub(super) asked: Option<Asked>,
}

impl Pool {
    /// Of one motion, beside which no others are looked for.
    pub fn of(motion: Vec<Positions>) -> Self {
        Self { motions: vec![motion.clone()], best: motion, agreed: true, asked: None }
    }
}

impl Problem<'_> {
    /// The path through the motions `sides`, each of shape [N, V], with the least E of frames and accelerations.
    pub(super) fn best_path(&self, sides: &[Vec<Positions>]) -> Vec<Positions> {
        let mut finest = self.at_level(0);
        finest.compares = true;
        let mut values: Vec<Vec<f64>> = Vec::with_capacity(sides.len());
        for (side, frames) in sides.iter().enumerate() {
            // Sides share many frames.
            let known = (0..frames.len()).map(|n| {
                let same = (0..side).find(|&other| sides[other][n] == frames[n])?;
                Some(values[same][n])
            });
            let known: Vec<Option<f64>> = known.collect();
            values.push(finest.frame_values(frames, &known));
        }
        let chosen = best_sides(sides, &values, self.acceleration_weight());
        chosen.iter().enumerate().map(|(n, side)| sides[*side][n].clone()).collect()
    }

    /// The path through two motions of the same search, each of shape [N, V], that explains the images best,
    /// accelerations included: what priors made of either does not count.
    pub fn by_pictures(&self, before: Vec<Positions>, after: Vec<Positions>) -> Vec<Positions> {
        let mut finest = self.at_level(0);
        finest.compares = true;
        let sides = [before, after];
        let value = |search: &LevelSearch, n: usize, x: &Positions| search.terms(n).of_pictures(x);
        let values = sides.each_ref().map(|frames| finest.values(frames, &vec![None; frames.len()], value));
        let chosen = best_sides(&sides, &values, self.acceleration_weight());
        chosen.iter().enumerate().map(|(n, side)| sides[*side][n].clone()).collect()
    }
}

impl LevelSearch<'_, '_> {
    /// E of every frame by itself, without comparison to adjacent ones, where it is not `known`; 0 of the first.
    fn frame_values(&mut self, frames: &[Positions], known: &[Option<f64>]) -> Vec<f64> {
        self.values(frames, known, |search, n, x| search.terms(n).value(x))
    }

    /// `of` every frame by itself, where it is not `known`; 0 of the first.
    fn values(
        &mut self,
        frames: &[Positions],
        known: &[Option<f64>],
        of: impl Fn(&Self, usize, &Positions) -> f64 + Sync,
    ) -> Vec<f64> {
        let unknown = frames.iter().enumerate().skip(1).filter(|(n, _)| known[*n].is_none());
        self.looks.iter_mut().for_each(|look| look.set_ways(frames));
        self.fit_anew(&unknown.collect::<Vec<_>>());
        let search = &*self;
        let value = |(n, x): (usize, &Positions)| match known[n] {
            Some(value) => value,
            None if n == 0 => 0.0,
            None => of(search, n, x),
        };
        parallel::numbered(frames, value)
    }
}

/// The side to take in every frame, given the E of each side's frames, shape [S, N], and the weight κ of the
/// accelerations `[1/m²]`: dynamic programming over the sides of two frames in sequence. Of equals the first side.
fn best_sides(sides: &[Vec<Positions>], values: &[Vec<f64>], kappa: f64) -> Vec<usize> {
    let (size, count) = (sides.len(), values[0].len());
    // Lowest cost of a path that ends with the sides [a][b] in two frames, and the side before a, by frame.
    let mut cost = vec![vec![f64::INFINITY; size]; size];
    // The first frame is known.
    cost[0] = values.iter().map(|v| v.get(1).copied().unwrap_or(0.0)).collect();
    let mut came_from: Vec<Vec<Vec<usize>>> = Vec::new();
    let all_triples = || (0..size.pow(3)).map(|k| (k / (size * size), k / size % size, k % size));
    for n in 2..count {
        let mut next = vec![vec![f64::INFINITY; size]; size];
        let mut from = vec![vec![0; size]; size];
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
    let pairs = (0..size * size).map(|k| (k / size, k % size));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::spacetime::proof::scene;
    use glam::DVec3;
    use tessuto_core::math::rng::Rng;
    use tessuto_sim::Cloth;

    #[test]
    fn the_path_is_the_best_of_all() {
        let mut rng = Rng::new(8, 0);
        let mut mixed = 0;
        for _ in 0..20 {
            let mut random = || -> Vec<Positions> { (0..6).map(|_| vec![rng.vector(); 1]).collect() };
            let mut sides = vec![random(), random(), random()];
            let first = sides[0][0].clone();
            sides.iter_mut().for_each(|side| side[0].clone_from(&first));
            let values: Vec<Vec<f64>> =
                (0..3).map(|_| (0..6).map(|_| 3.0 * rng.normal()).collect()).collect();
            let cost = |path: &[usize]| {
                let x: Vec<Positions> = path.iter().enumerate().map(|(n, s)| sides[*s][n].clone()).collect();
                let own: f64 = path.iter().enumerate().skip(1).map(|(n, s)| values[*s][n]).sum();
                own + acceleration::value(&x, 0.7)
            };
            let found = best_sides(&sides, &values, 0.7);
            let path = |k: usize| (0..6).map(|n| k / 3usize.pow(n) % 3).collect::<Vec<usize>>();
            let least = (0..3usize.pow(6)).map(|k| cost(&path(k))).fold(f64::INFINITY, f64::min);
            assert!((cost(&found) - least).abs() < 1e-12 * least.abs().max(1.0), "{} {least}", cost(&found));
            mixed += usize::from((0..3).all(|side| found[1..].contains(&side)));
        }
        assert!(mixed > 5, "{mixed} paths with all sides");
        let one = vec![Positions::new()];
        assert_eq!(best_sides(&[one.clone(), one], &[vec![0.0], vec![0.0]], 1.0), [0]);
    }

    #[test]
    fn leaving_the_picture_does_not_pay() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, Default::default()).unwrap();
        let count = scene.frames.len();
        let near = vec![scene.template.positions.clone(); count];
        let mut gone = near.clone();
        gone[1..].iter_mut().flatten().for_each(|x| *x += DVec3::X * 10.0);
        let colour = |frames: &[Positions]| {
            let terms = problem.objective(frames);
            terms.iter().find(|(name, _)| *name == "colour").unwrap().1
        };
        println!("colour {} near, {} gone", colour(&near), colour(&gone));
        assert!(colour(&gone) > colour(&near));
        assert_eq!(problem.best_path(&[gone, near.clone()])[1..], near[1..]);
    }

    #[test]
    fn what_was_found_before_stays_where_it_explains_the_pictures_better() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, Default::default()).unwrap();
        let right = vec![scene.template.positions.clone(); scene.frames.len()];
        let mut off = right.clone();
        off[2].iter_mut().for_each(|x| *x += DVec3::X * 0.02);
        assert_eq!(problem.by_pictures(right.clone(), off.clone()), right);
        assert_eq!(problem.by_pictures(off, right.clone()), right, "whichever comes first");
    }
}
