//! The search itself: all frames together.

use serde::{Deserialize, Serialize};

use super::again::{AGAIN, Followers};
use super::best_path::Pool;
use super::joint::{Joint, POLICY};
use super::look::Gains;
use super::noise::Asked;
use super::{Fitted, Positions, Problem, diverged};
use crate::motion::terms::TERMS;
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::{Error, Result};

/// Part of the iterations over which the priors go from the start's to their own.
pub(super) const ANNEALED: f64 = 0.7;

/// What [`Problem::refine`] goes on from.
#[derive(Serialize, Deserialize)]
struct Refined {
    /// What was made of the first motions of the pool.
    done: Vec<Vec<Positions>>,
    /// Those that follow the fabric again once all that tracking found are refined.
    again: Followers,
    /// The motion at work.
    frames: Vec<Positions>,
    /// Iterations on it so far, over all levels.
    steps: usize,
    lambda: f64,
    /// Vertices that stand still in what its search started from.
    still: Vec<u32>,
    /// What the clip asks for; the settings' own at the first level.
    asked: Asked,
    /// Gains at the present level, shape [N, C].
    gains: Vec<Vec<Gains>>,
}

/// How many motions are refined.
struct Rounds {
    /// Those that tracking found.
    first: usize,
    /// And those that are followed again, and the best path through all.
    all: usize,
}

impl Problem<'_> {
    /// Lowers E over all frames together, coarse to fine, from every motion of the `pool`: positions that were
    /// followed frame by frame are not at rest, and which of them end lowest shows only there. What these became
    /// shows what the clip asks for; with that the fabric is followed again, and E lowered from what is found
    /// then, and at last from the best path through all. Where all followers agree, one motion is refined once.
    /// The pool then holds the motions that contend with what was found, and what its frames started from.
    ///
    /// If the objective is no longer finite, the positions before that are returned with the failure.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] if it is to go on from a state that does not match; what the session's
    /// observer returns.
    pub fn refine(&self, pool: &mut Pool, session: &mut Session) -> Result<Fitted> {
        let (first, several) = (pool.motions.len(), !pool.agreed);
        let rounds = Rounds { first, all: if several { first + AGAIN + 1 } else { first } };
        let mut refined: Refined = match session.restore("refine")? {
            Some(refined) => refined,
            None => self.unrefined(Vec::new(), Vec::new(), pool.motions[0].clone()),
        };
        let count = self.scene.frames.len();
        let iterations = self.iterations(refined.done.len(), &rounds);
        let within_level = !refined.steps.is_multiple_of(iterations.max(1));
        let gains = refined.gains.len() == count || (!within_level && refined.gains.is_empty());
        let whole = |frames: &Vec<Positions>| frames.len() == count && self.matches(frames, &refined.gains);
        let all_whole = refined.done.iter().chain([&refined.frames]).all(whole);
        if !gains || !all_whole || refined.done.len() >= rounds.all {
            return Err(foreign_state("refine"));
        }
        let whole_motion = |frames: &Vec<Positions>| frames.len() == count && self.matches(frames, &[]);
        loop {
            let round = refined.done.len();
            if several && round >= first && pool.motions.len() == first {
                if refined.again.first().is_none_or(|follower| follower.frames.len() < count) {
                    self.follow_refined(&mut refined, &rounds, session)?;
                }
                pool.motions.extend(self.followed_again(&refined.again));
                if pool.motions.len() != first + AGAIN || !pool.motions.iter().all(whole_motion) {
                    return Err(foreign_state("refine"));
                }
                if round == first && refined.steps == 0 {
                    let Refined { done, again, .. } = refined;
                    refined = self.unrefined(done, again, pool.motions[first].clone());
                }
            }
            let failure = self.refine_round(&mut refined, &rounds, session)?;
            if round + 1 == rounds.all {
                session.finish("refine", &refined);
                if several {
                    *pool = self.contenders(&pool.motions, refined.done, first);
                }
                pool.asked = Some(refined.asked);
                return Ok((refined.frames, failure));
            }
            // A motion whose objective is no longer finite stays as it is: others are better.
            let Refined { mut done, again, frames, .. } = refined;
            done.push(frames);
            let next = pool.motions.get(round + 1).cloned().unwrap_or_else(|| self.best_path(&done));
            refined = self.unrefined(done, again, next);
        }
    }

    /// Follows the fabric again from the best path through what the first motions became, which is the one at work
    /// until then.
    fn follow_refined(&self, refined: &mut Refined, rounds: &Rounds, session: &mut Session) -> Result<()> {
        let mut again = std::mem::take(&mut refined.again);
        let best = refined.frames.clone();
        let asked = self.asked(&best);
        self.follow_again(&best, &asked, &mut again, |followers, value| {
            refined.again = std::mem::take(followers);
            let done = refined.again[0].frames.len() - 1;
            let epoch = Epoch {
                stage: "refine".into(),
                step: self.steps_until(rounds.first, rounds) - self.again_steps() + done,
                of: self.steps_until(rounds.all, rounds),
                active_frames: best.len(),
                losses: named([("total", value)]),
                parameters: named([]),
            };
            session.step(&epoch, &best, Some(&*refined))?;
            *followers = std::mem::take(&mut refined.again);
            Ok(())
        })?;
        refined.again = again;
        Ok(())
    }

    /// What other searches found: what those motions `became` of which the best path takes a frame, and the best
    /// path through what the `first` of them became, before the sheet was followed again; and what the frames of
    /// the best path `started` from.
    fn contenders(&self, started: &[Vec<Positions>], became: Vec<Vec<Positions>>, first: usize) -> Pool {
        let (path, before) = (self.best_path(&became), self.best_path(&became[..first]));
        let took = |motion: &Vec<Positions>, n: usize| motion[n] == path[n];
        let start = |n: usize| {
            let of = became.iter().position(|motion| took(motion, n)).expect("the path is of them");
            started[of][n].clone()
        };
        let best = (0..path.len()).map(start).collect();
        let contends = |motion: &Vec<Positions>| (1..path.len()).any(|n| took(motion, n));
        let motions = became.into_iter().filter(contends).chain([before]).collect();
        Pool { motions, best, agreed: false, asked: None }
    }

    fn unrefined(&self, done: Vec<Vec<Positions>>, again: Followers, frames: Vec<Positions>) -> Refined {
        let still = self.still_vertices(&frames);
        let (asked, gains) = (Asked::default(), Vec::new());
        Refined { done, again, still, frames, asked, steps: 0, lambda: 0.0, gains }
    }

    /// Iterations at each level of a round: of what another round follows half as many, which shows as well what
    /// will be lower.
    fn iterations(&self, round: usize, rounds: &Rounds) -> usize {
        let all = self.settings.iterations;
        if round + 1 < rounds.all { all.div_ceil(2) } else { all }
    }

    /// Steps that are done once round `until` begins: iterations and, before the first motion that is followed
    /// again, frames.
    fn steps_until(&self, until: usize, rounds: &Rounds) -> usize {
        let levels = self.refined_levels().len();
        let followed =
            if rounds.all > rounds.first && until >= rounds.first { self.again_steps() } else { 0 };
        (0..until).map(|k| levels * self.iterations(k, rounds)).sum::<usize>() + followed
    }

    /// Refines the motion at work, one of `rounds`; returns why it is not better if it failed.
    fn refine_round(
        &self,
        refined: &mut Refined,
        rounds: &Rounds,
        session: &mut Session,
    ) -> Result<Option<Error>> {
        let ladder = self.refined_levels();
        let round = refined.done.len();
        let iterations = self.iterations(round, rounds);
        let steps = ladder.len() * iterations;
        for (k, level) in ladder.into_iter().enumerate() {
            if refined.steps >= (k + 1) * iterations {
                continue;
            }
            let (mut search, kept) = (self.at_level(level), self.eyes[0].kept(level));
            search.still.clone_from(&refined.still);
            let first = refined.steps - k * iterations;
            match first {
                0 => {
                    refined.lambda = POLICY.lambda;
                    // Of the start only how it bends matters much.
                    refined.asked = match k {
                        0 => self.asked_at_start(&refined.frames),
                        _ => self.asked(&refined.frames),
                    };
                }
                _ => refined.gains.iter().enumerate().for_each(|(n, gains)| search.set_gains(n, gains)),
            }
            search.asked = refined.asked.clone();
            for iteration in first..iterations {
                let mut joint = Joint::new(&mut search);
                joint.annealed = refined.steps as f64 / (ANNEALED * steps as f64);
                let outcome = POLICY.iterate(&mut joint, &mut refined.frames, &mut refined.lambda);
                if !outcome.value.is_finite() {
                    let place = format!("level {kept}, iteration {iteration}");
                    return Ok(Some(diverged(&place, outcome.value)));
                }
                refined.steps += 1;
                let (terms, acceleration) = joint.before;
                let mut losses = vec![("total", terms.iter().sum::<f64>() + acceleration)];
                let names = search.terms(0).list().map(|term| term.name());
                losses.extend((0..TERMS).map(|k| (names[k], terms[k])));
                losses.push(("acceleration", acceleration));
                let epoch = Epoch {
                    stage: "refine".into(),
                    step: self.steps_until(round, rounds) + refined.steps,
                    of: self.steps_until(rounds.all, rounds),
                    active_frames: refined.frames.len(),
                    losses: named(losses),
                    parameters: named([("level", kept as f64)]),
                };
                refined.gains = (0..refined.frames.len()).map(|n| search.gains(n)).collect();
                session.step(&epoch, &refined.frames, Some(&*refined))?;
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use crate::session::Checkpoints;
    use tessuto_sim::Cloth;

    /// `frames` with every vertex moved by `by`, except in the first frame.
    fn aside(frames: &[Positions], by: DVec3) -> Vec<Positions> {
        let mut out = frames.to_vec();
        out[1..].iter_mut().flatten().for_each(|x| *x += by);
        out
    }

    fn off(frames: &[Positions], right: &[Positions]) -> f64 {
        let pairs = frames.iter().flatten().zip(right.iter().flatten());
        pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    #[test]
    fn of_several_starts_the_one_counts_that_ends_lower() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let right = vec![scene.template.positions.clone(); scene.frames.len()];
        let (near, far) = (aside(&right, DVec3::X * 2e-3), aside(&right, DVec3::new(0.05, 0.02, 0.0)));
        let refined = |mut pool: Pool| {
            let (frames, failure) = problem.refine(&mut pool, &mut Session::silent()).unwrap();
            assert!(failure.is_none());
            (frames, pool)
        };
        let alone = off(&refined(Pool::of(far.clone())).0, &right);
        // One alone, on which followers did not agree, is followed again.
        let again = off(&refined(Pool { agreed: false, ..Pool::of(far.clone()) }).0, &right);
        println!("{again} m off where it is followed again");
        assert!(again < 0.1 * alone);
        for motions in [[far.clone(), near.clone()], [near, far]] {
            let (frames, pool) =
                refined(Pool { motions: motions.to_vec(), best: right.clone(), agreed: false, asked: None });
            let ends: Vec<f64> = pool.motions.iter().map(|motion| off(motion, &right)).collect();
            println!(
                "{alone} m off from the farther start alone, {} from both, which end at {ends:?}",
                off(&frames, &right)
            );
            assert!(ends.len() > 1 && ends.iter().all(|end| *end < 0.1 * alone), "those that contend");
            assert!(off(&frames, &right) < 0.1 * alone);
        }
    }

    #[test]
    fn it_goes_on_within_any_motion_of_the_pool() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { iterations: 3, ..at_the_finest_level() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let right = vec![scene.template.positions.clone(); scene.frames.len()];
        let motions = [2e-3, 4e-3].map(|by| aside(&right, DVec3::X * by)).to_vec();
        let start = || Pool { motions: motions.clone(), best: right.clone(), agreed: false, asked: None };
        let mut whole = start();
        let mut steps = 0;
        let mut counting = Session::new(|_, _| {
            steps += 1;
            Ok(())
        });
        let expected = problem.refine(&mut whole, &mut counting).unwrap().0;
        drop(counting);
        // Two iterations of either start, every frame but the first followed again, two of each that was found so,
        // three of the best path.
        assert_eq!(steps, 2 + 2 + (scene.frames.len() - 1) + 2 * AGAIN + 3);
        let folder = tempfile::tempdir().unwrap();
        let open = || Checkpoints::open(folder.path(), "scene".into(), std::time::Duration::ZERO);
        // Every other step: of each kind some.
        for until in (1..steps).step_by(2) {
            let mut done = 0;
            let mut killed = Session::new(|_, _| {
                done += 1;
                if done == until { Err(foreign_state("stopped")) } else { Ok(()) }
            });
            killed.keep_in(open(), None).unwrap();
            assert!(problem.refine(&mut start(), &mut killed).is_err());
            drop(killed);
            let mut session = Session::silent();
            session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
            let mut pool = start();
            let found = problem.refine(&mut pool, &mut session).unwrap().0;
            assert_eq!((found, pool), (expected.clone(), whole.clone()), "stopped after {until}");
        }
    }
}
