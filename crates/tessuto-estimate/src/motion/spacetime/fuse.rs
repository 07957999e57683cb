//! Of several explanations of a clip the best one in every part of the sheet and of the clip.
//!
//! The best path (`best_path`) takes whole frames. But a motion that has one fold right has another one wrong, and of
//! the two ways that a dent may go each part of the sheet has its own. So a motion proposed is compared with the
//! present one around every vertex in every frame, by what the pictures there cost with either, averaged over a patch
//! of the sheet and over adjacent frames; what is explained better by the other is taken from it, the seams are
//! refined, and the outcome is the new present motion if its E is lower. So no proposal raises E; the error it may.
//!
//! Proposed are the motions that contended when all frames were refined, and reflected reliefs (`relief`); and, as a
//! whole, motions in which the worst stretch of frames is followed otherwise (`stretch`).

use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use super::best_path::Pool;
use super::gain::GAIN_FITS;
use super::joint::{Joint, POLICY};
use super::noise::Asked;
use super::refine::ANNEALED;
use super::relief::RELIEFS;
use super::stretch::MENDINGS;
use super::{LevelSearch, Positions, Problem, acceleration};
use crate::motion::terms::bend::NOMINAL_ARMS;
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::Result;

/// Averages over adjacent frames.
const TIMES: usize = 2;

/// What [`Problem::fuse`] goes on from.
#[derive(Serialize, Deserialize)]
pub(super) struct Fused {
    /// The present motion.
    pub(super) frames: Vec<Positions>,
    /// Its E.
    value: f64,
    /// Motions that were proposed so far.
    tried: usize,
    /// What the clip asks for, and vertices that stand still, by the motion that was there first.
    pub(super) asked: Asked,
    still: Vec<u32>,
}

#[cfg(test)]
impl Fused {
    /// Nothing tried yet, by the settings' own spreads.
    pub(super) fn of(frames: Vec<Positions>) -> Self {
        Self { frames, value: 0.0, tried: 0, asked: Asked::default(), still: Vec::new() }
    }
}

impl<'a> Problem<'a> {
    /// Takes from other motions what they explain better than `frames`, which [`refine`](Self::refine) made of the
    /// `pool`.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] if it is to go on from a state that does not match; what the session's
    /// observer returns.
    pub fn fuse(&self, frames: Vec<Positions>, pool: &Pool, session: &mut Session) -> Result<Vec<Positions>> {
        let others = if pool.agreed { &[][..] } else { &pool.motions };
        let proposals = others.len() + RELIEFS.len() + MENDINGS.len();
        let mut fused: Fused = match session.restore("fuse")? {
            Some(fused) => fused,
            None => {
                let asked = pool.asked.clone().unwrap_or_else(|| self.asked(&frames));
                let still = self.still_vertices(&frames);
                let mut fused = Fused { frames: Vec::new(), value: 0.0, tried: 0, asked, still };
                fused.frames = self.settled(&fused, frames, 1.0, self.settings.iterations);
                fused.value = self.value(&fused, &fused.frames);
                fused
            }
        };
        if !self.matches(&fused.frames, &[]) || fused.frames.len() != self.scene.frames.len() {
            return Err(foreign_state("fuse"));
        }
        let iterations = self.settings.iterations.div_ceil(2);
        while fused.tried < proposals {
            if let Some(proposed) = self.proposed(&fused, others) {
                let frames = self.settled(&fused, proposed, 1.0, iterations);
                let value = self.value(&fused, &frames);
                if value < fused.value {
                    (fused.frames, fused.value) = (frames, value);
                }
            }
            fused.tried += 1;
            let epoch = Epoch {
                stage: "fuse".into(),
                step: fused.tried,
                of: proposals,
                active_frames: fused.frames.len(),
                losses: named([("total", fused.value)]),
                parameters: named([]),
            };
            session.step(&epoch, &fused.frames, Some(&fused))?;
        }
        session.finish("fuse", &fused);
        Ok(fused.frames)
    }

    /// The motion that is proposed next, before its seams are refined.
    fn proposed(&self, fused: &Fused, others: &[Vec<Positions>]) -> Option<Vec<Positions>> {
        if let Some(other) = others.get(fused.tried) {
            return Some(self.joined(fused, other));
        }
        let of_own = fused.tried - others.len();
        match RELIEFS.get(of_own) {
            Some(relief) => {
                let reflected = self.reflected(&fused.frames, *relief);
                let iterations = self.settings.iterations.div_ceil(2);
                Some(self.joined(fused, &self.settled(fused, reflected, 0.0, iterations)))
            }
            None => self.mended(fused, MENDINGS[of_own - RELIEFS.len()]),
        }
    }

    /// E at `frames` as it is refined, but that every pixel counts once.
    fn value(&self, fused: &Fused, frames: &[Positions]) -> f64 {
        let mut search = self.search(fused);
        search.compares = true;
        search.anneal(1.0);
        (0..GAIN_FITS).for_each(|_| search.update_references(frames));
        let of_frame = |n: usize| search.terms(n).value(&frames[n]);
        let values: Vec<f64> = parallel::later(frames, |(n, _)| of_frame(n));
        values.iter().sum::<f64>() + acceleration::value(frames, search.acceleration_weight)
    }

    /// A search at the finest level, by what the clip asks for.
    pub(super) fn search(&self, fused: &Fused) -> LevelSearch<'_, 'a> {
        let mut search = self.at_level(0);
        search.still.clone_from(&fused.still);
        search.asked.clone_from(&fused.asked);
        search
    }

    /// `frames` after some iterations at the finest level, by the priors as they are `annealed` at first.
    fn settled(
        &self,
        fused: &Fused,
        mut frames: Vec<Positions>,
        annealed: f64,
        iterations: usize,
    ) -> Vec<Positions> {
        let mut search = self.search(fused);
        let mut lambda = POLICY.lambda;
        for iteration in 0..iterations {
            let mut joint = Joint::new(&mut search);
            joint.annealed = annealed + iteration as f64 / (ANNEALED * iterations as f64);
            POLICY.iterate(&mut joint, &mut frames, &mut lambda);
        }
        frames
    }

    /// The present motion with what `other` explains better.
    fn joined(&self, fused: &Fused, other: &[Positions]) -> Vec<Positions> {
        let frames = &fused.frames;
        let light = self.light_of(frames);
        let [costs, costs_of_other] = [frames, other].map(|motion| {
            let mut finest = self.search(fused);
            finest.light = light;
            finest.looks.iter_mut().for_each(|look| look.set_ways(motion));
            finest.fit_anew(&motion.iter().enumerate().skip(1).collect::<Vec<_>>());
            let of_frame = |n: usize| finest.terms(n).shares_of_pictures(&motion[n]);
            parallel::later(motion, |(n, _)| of_frame(n))
        });
        let more = |(a, b): (&Vec<f64>, &Vec<f64>)| b.iter().zip(a).map(|(b, a)| b - a).collect();
        let more = self.smooth_over_patches(costs.iter().zip(&costs_of_other).map(more).collect());
        let takes = |more: &Vec<f64>| more.iter().map(|more| f64::from(*more < 0.0)).collect();
        let parts = self.smooth_over_patches(more.iter().map(takes).collect());
        let mut joined = frames.clone();
        for ((x, other), parts) in joined[1..].iter_mut().zip(&other[1..]).zip(&parts) {
            x.iter_mut().zip(other).zip(parts).for_each(|((x, other), part)| *x = x.lerp(*other, *part));
        }
        joined
    }

    /// `values` of the vertices, shape [N−1, V], averaged over a nominal arm's length and over adjacent frames.
    fn smooth_over_patches(&self, values: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut values: Vec<Vec<f64>> =
            parallel::consume(values, |_, values| self.smoothed(values, 1.0 / NOMINAL_ARMS));
        for _ in 0..TIMES {
            let last = values.len().saturating_sub(1);
            let mean = |n: usize| {
                let [before, now, after] = [n.saturating_sub(1), n, (n + 1).min(last)].map(|n| &values[n]);
                let of = |v: usize| 0.5 * now[v] + 0.25 * (before[v] + after[v]);
                (0..now.len()).map(of).collect()
            };
            values = (0..values.len()).map(mean).collect();
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::*;
    use crate::session::Checkpoints;
    use crate::synth::{Settings, make};
    use tessuto_sim::Cloth;

    fn off(frames: &[Positions], right: &[Positions]) -> f64 {
        let pairs = frames.iter().flatten().zip(right.iter().flatten());
        pairs.map(|(a, b)| a.distance(*b)).sum::<f64>() / (frames.len() * right[0].len()) as f64
    }

    /// `frames` with the vertices on one side moved, except in the first frame.
    fn spoiled(frames: &[Positions], left: bool, by: DVec3) -> Vec<Positions> {
        let mut out = frames.to_vec();
        let side = |x: &&mut DVec3| (x.x < 0.0) == left;
        out[1..].iter_mut().flatten().filter(side).for_each(|x| *x += by);
        out
    }

    #[test]
    fn of_two_motions_each_gives_the_side_that_it_has_right() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
        let right = vec![scene.template.positions.clone(); scene.frames.len()];
        let by = DVec3::new(8e-3, 4e-3, 0.0);
        let [left, other] = [true, false].map(|side| spoiled(&right, side, by));
        let fused = Fused::of(left.clone());
        let joined = problem.joined(&fused, &other);
        println!("{} m off before, {} after", off(&left, &right), off(&joined, &right));
        assert_eq!(joined[0], right[0]);
        assert!(off(&joined, &right) < 0.5 * off(&left, &right).min(off(&other, &right)));
        // Nothing is taken from one that is right nowhere.
        let nowhere = spoiled(&other, true, by * 2.0);
        assert!(off(&problem.joined(&fused, &nowhere), &right) < 1.05 * off(&left, &right));
    }

    #[test]
    fn a_dent_that_was_taken_for_a_bulge_is_found() {
        for seed in [4, 5] {
            let settings = Settings::default().with(|s| {
                s.frames = 6;
                s.size = 192;
                s.grid = [13, 13];
                s.wind = 6.0;
                s.seed = seed;
            });
            let scene = make(&settings).unwrap();
            let cloth = Cloth::new(&scene.template);
            let mut problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
            let truth: Vec<Positions> = scene.truth.vertices.as_ref().unwrap().iter().cloned().collect();
            problem.light = problem.light_of(&truth);
            problem.acceleration = problem.acceleration_spread(&truth);
            let (asked, still) = (problem.asked(&truth), Vec::new());
            let fused = Fused { frames: truth.clone(), value: 0.0, tried: 0, asked, still };
            let best = problem.settled(&fused, truth.clone(), 1.0, 20);
            let wrong = problem.settled(&fused, problem.reflected(&truth, 0.4), 0.0, 20);
            let pool = Pool::of(wrong.clone());
            let found = problem.fuse(wrong.clone(), &pool, &mut Session::silent()).unwrap();
            let [best, wrong, found] =
                [best, wrong, found].map(|frames| (off(&frames, &truth), problem.value(&fused, &frames)));
            println!("seed {seed}: from the truth {best:?}, reflected {wrong:?}, fused {found:?}");
            assert!(wrong.0 > 10.0 * best.0, "a minimum of its own");
            assert!(found.1 < wrong.1 && found.0 < 0.1 * wrong.0);
        }
    }

    #[test]
    fn nothing_gets_worse_and_a_stopped_search_ends_with_the_same_bytes() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { iterations: 2, ..at_the_finest_level() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let right = vec![scene.template.positions.clone(); scene.frames.len()];
        let by = DVec3::new(4e-3, 0.0, 0.0);
        let [left, other] = [true, false].map(|side| spoiled(&right, side, by));
        let pool = Pool { motions: vec![other], best: left.clone(), agreed: false, asked: None };
        let mut values = Vec::new();
        let mut counting = Session::new(|epoch: &Epoch, _: &[Positions]| {
            values.push(epoch.losses[0].1);
            Ok(())
        });
        let whole = problem.fuse(left.clone(), &pool, &mut counting).unwrap();
        drop(counting);
        println!("{values:?}");
        assert_eq!(values.len(), 1 + RELIEFS.len() + MENDINGS.len());
        assert!(values.is_sorted_by(|a, b| a >= b), "{values:?}");
        let folder = tempfile::tempdir().unwrap();
        let open = || Checkpoints::open(folder.path(), "scene".into(), std::time::Duration::ZERO);
        for until in 1..=values.len() {
            let mut done = 0;
            let mut killed = Session::new(|_, _| {
                done += 1;
                if done == until { Err(foreign_state("stopped")) } else { Ok(()) }
            });
            killed.keep_in(open(), None).unwrap();
            assert!(problem.fuse(left.clone(), &pool, &mut killed).is_err());
            drop(killed);
            let mut session = Session::silent();
            session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
            assert_eq!(problem.fuse(left.clone(), &pool, &mut session).unwrap(), whole, "from step {until}");
        }
    }
}
