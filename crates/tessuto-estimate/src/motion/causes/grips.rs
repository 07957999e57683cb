//! Where hands hold the cloth.
//!
//! Held vertices are stretches of the border, the grips, three vertices each. From the upper corners they are
//! moved along the border, each by itself and all that gained together, by ever smaller ways, as long as the
//! objective falls. At every place the causes are fitted anew: with those of a wrong hold the right one is no
//! better.

use std::collections::BTreeSet;

use tessuto_core::parallel;

use super::held::border_loop;
use super::search::Attempt;
use tessuto_core::mesh::Mesh;

/// Vertices that a hand holds beside its middle.
const BESIDE: isize = 1;
/// Ways of the grips as fractions of the border, one after the other.
const STRIDES: [f64; 3] = [1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0];
/// Where the best of the coarsest ways leaves a root of the misfit above this, hands are not what is missing.
const HOPELESS: f64 = 3.2;
/// Most places that are tried: hands are found in fewer, and what no hands explain is not searched for ever.
const MOST: usize = 32;
/// Kinds of changes that are tried one after the other.
pub(super) const PASSES: usize = STRIDES.len() + 2;

/// A stretch of the border: number of its first vertex along the loop, and of vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Grip {
    first: isize,
    count: isize,
}

impl Grip {
    /// About the middle of this one.
    fn about(self) -> Self {
        Self { first: self.first + self.count / 2 - BESIDE, count: 2 * BESIDE + 1 }
    }
}

/// What was found at a hold.
#[derive(Debug, Clone)]
pub struct Hold {
    /// Vertices in ascending order.
    pub held: Vec<usize>,
    /// What explains the motion with them, roughly.
    pub attempt: Attempt,
    /// The objective, and the price of what is held.
    pub value: f64,
}

/// A change of a grip: what is added to its first vertex and to its count.
#[derive(Debug, Clone, Copy)]
struct Change {
    grip: usize,
    first: isize,
    count: isize,
}

/// Where hands hold the cloth of `template` whose upper corners are `guess`, and the other places that were tried.
/// A held vertex costs `price`. `fit` fits causes to a hold, from those of another one if there is one; `None`
/// where the cloth cannot be simulated so. `advance` hears how many of [`PASSES`] are done.
pub fn find(
    template: &Mesh,
    guess: &[usize],
    price: f64,
    fit: impl Fn(&[usize], Option<&Attempt>) -> Option<Attempt> + Sync,
    advance: &mut dyn FnMut(usize),
) -> Option<(Hold, Vec<Hold>)> {
    let border = border_loop(template);
    let grips: Vec<Grip> = grips_of(&border, guess).into_iter().map(Grip::about).collect();
    // Nothing of the guess is on the border: a closed mesh, or a hole in one.
    let held = if grips.is_empty() { guess.to_vec() } else { held_by(&border, &grips) };
    let attempt = fit(&held, None)?;
    let value = attempt.value + price * held.len() as f64;
    let seen = BTreeSet::from([held.clone()]);
    let best = Hold { held, attempt, value };
    let mut descent = Descent { border, grips, price, fit, best, others: Vec::new(), seen };
    let along = STRIDES.map(|stride| {
        let stride = ((descent.border.len() as f64 * stride).round() as isize).max(1);
        [[-stride, 0], [stride, 0]]
    });
    // Shorter, then longer at either end.
    let lengths = [[[1, -1], [0, -1]], [[-1, 1], [0, 1]]];
    for (pass, ways) in along.iter().chain(&lengths).enumerate() {
        advance(pass);
        if pass > 0 && descent.best.attempt.misfit > HOPELESS * HOPELESS {
            break;
        }
        descent.run(ways);
    }
    Some((descent.best, descent.others))
}

/// A search under way.
struct Descent<F> {
    border: Vec<usize>,
    grips: Vec<Grip>,
    price: f64,
    fit: F,
    best: Hold,
    others: Vec<Hold>,
    /// Held vertices that were tried.
    seen: BTreeSet<Vec<usize>>,
}

impl<F: Fn(&[usize], Option<&Attempt>) -> Option<Attempt> + Sync> Descent<F> {
    /// Changes grips by `ways`, what is added to first vertex and count, as long as the objective falls.
    fn run(&mut self, ways: &[[isize; 2]]) {
        let of = |grip| ways.iter().map(move |[first, count]| Change { grip, first: *first, count: *count });
        let changes: Vec<Change> = (0..self.grips.len()).flat_map(of).collect();
        while self.step(&changes) {}
    }

    /// Takes the best of `changes`, or the best one of every grip at once, if the objective falls.
    fn step(&mut self, changes: &[Change]) -> bool {
        let alone: Vec<_> = changes.iter().filter_map(|change| self.unseen(vec![*change])).collect();
        let mut tried: Vec<_> =
            parallel::consume(alone, |_, new| self.attempt(new)).into_iter().flatten().collect();
        let value = |(_, hold): &(Vec<Change>, Hold)| hold.value;
        let gain = |grip: usize| {
            let own = tried.iter().filter(|t| t.0[0].grip == grip && value(t) < self.best.value);
            own.min_by(|a, b| value(a).total_cmp(&value(b))).map(|(change, _)| change[0])
        };
        let together: Vec<Change> = (0..self.grips.len()).filter_map(gain).collect();
        if together.len() > 1 {
            let new = self.unseen(together);
            tried.extend(new.and_then(|new| self.attempt(new)));
        }
        tried.sort_by(|a, b| value(a).total_cmp(&value(b)));
        let gained = tried.first().is_some_and(|t| value(t) < self.best.value);
        let mut tried = tried.into_iter();
        if gained && let Some((changes, hold)) = tried.next() {
            self.grips = self.changed(&changes);
            self.others.push(std::mem::replace(&mut self.best, hold));
        }
        self.others.extend(tried.map(|(_, hold)| hold));
        gained
    }

    fn changed(&self, changes: &[Change]) -> Vec<Grip> {
        let mut out = self.grips.clone();
        for change in changes {
            out[change.grip].first += change.first;
            out[change.grip].count += change.count;
        }
        out
    }

    /// `changes` and what is held after them, unless that was tried or cannot be.
    fn unseen(&mut self, changes: Vec<Change>) -> Option<(Vec<Change>, Vec<usize>)> {
        let grips = self.changed(&changes);
        let held = held_by(&self.border, &grips);
        // Every hand holds something that no other one holds.
        let apart = grips.iter().all(|g| g.count > 0)
            && held.len() as isize == grips.iter().map(|g| g.count).sum::<isize>();
        let enough = self.seen.len() > MOST;
        (apart && !enough && self.seen.insert(held.clone())).then_some((changes, held))
    }

    fn attempt(&self, (changes, held): (Vec<Change>, Vec<usize>)) -> Option<(Vec<Change>, Hold)> {
        let attempt = (self.fit)(&held, Some(&self.best.attempt))?;
        let value = attempt.value + self.price * held.len() as f64;
        Some((changes, Hold { held, attempt, value }))
    }
}

/// The stretches of the loop `border` that `held` vertices are.
fn grips_of(border: &[usize], held: &[usize]) -> Vec<Grip> {
    let is_held: Vec<bool> = border.iter().map(|v| held.contains(v)).collect();
    let n = border.len();
    let starts = (0..n).filter(|k| is_held[*k] && !is_held[(*k + n - 1) % n]);
    starts
        .map(|k| {
            let count = (0..n).take_while(|j| is_held[(k + j) % n]).count();
            Grip { first: k as isize, count: count as isize }
        })
        .collect()
}

fn held_by(border: &[usize], grips: &[Grip]) -> Vec<usize> {
    let n = border.len() as isize;
    let at = |g: &Grip| {
        let first = g.first;
        (0..g.count.min(n)).map(move |k| border[(first + k).rem_euclid(n) as usize])
    };
    let mut out: Vec<usize> = grips.iter().flat_map(at).collect();
    out.sort_unstable();
    out.dedup();
    out
}

#[cfg(test)]
mod tests {
    use super::super::forces::Causes;
    use super::*;
    use glam::DVec2;
    use tessuto_core::mesh::grid;

    #[test]
    fn grips_are_stretches_of_the_border() {
        let mesh = grid(5, 4, DVec2::splat(0.4), 1.0);
        let border = border_loop(&mesh);
        assert_eq!(border.len(), 14);
        let held = [0, 1, 4, 5, 9];
        let grips = grips_of(&border, &held);
        assert_eq!(grips.len(), 2);
        assert_eq!(held_by(&border, &grips), held);
        let about = |held: &[usize]| {
            let grips: Vec<Grip> = grips_of(&border, held).into_iter().map(Grip::about).collect();
            held_by(&border, &grips)
        };
        assert_eq!(about(&[0]), [0, 1, 5]);
        assert_eq!(about(&held).len(), 6);
        assert!(grips_of(&border, &[7]).is_empty(), "within the sheet there is no grip");
    }

    #[test]
    fn hands_are_found_where_the_objective_is_least() {
        let mesh = grid(9, 7, DVec2::splat(0.4), 1.0);
        let truth = [2, 3, 17, 26, 35];
        let border = border_loop(&mesh);
        let place = |v: &usize| border.iter().position(|b| b == v).unwrap() as f64;
        // By how far each held vertex is from the nearest true one, and by true ones that are not held.
        let fit = |held: &[usize], _: Option<&Attempt>| {
            let away = |v: &usize, from: &[usize]| {
                let n = border.len() as f64;
                let d = |w: &usize| {
                    ((place(v) - place(w)).rem_euclid(n)).min((place(w) - place(v)).rem_euclid(n))
                };
                from.iter().map(d).fold(f64::INFINITY, f64::min)
            };
            let value = held.iter().map(|v| away(v, &truth)).sum::<f64>()
                + truth.iter().map(|v| away(v, held)).sum::<f64>();
            let causes = Causes {
                ln_stiffness: [0.0; 3],
                down: glam::DVec3::Y,
                ln_drag: 0.0,
                ln_friction: 0.0,
                ln_length: [0.0; 2],
                wind: Vec::new(),
            };
            Some(Attempt { causes, value, misfit: 0.0, steps: Vec::new() })
        };
        let (best, others) = find(&mesh, &[0, 8], 0.0, fit, &mut |_| ()).unwrap();
        assert_eq!(best.held, truth);
        assert!(others.iter().all(|other| other.value > best.value));
        assert!(find(&mesh, &[0, 8], 0.0, |_, _| None, &mut |_| ()).is_none());
    }
}
