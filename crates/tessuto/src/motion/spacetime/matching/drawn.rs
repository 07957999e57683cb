//! The sheet drawn to matches.

use super::Positions;
use super::finder::Finder;
use super::places::Places;
use crate::math::factor::Scratch;
use crate::math::minimise::{Model, Policy};
use crate::motion::observed::samples::SurfaceSample;
use crate::motion::spacetime::settle::PULL;
use crate::motion::terms::low_rank::FrameFactor;
use crate::motion::terms::robust::Noise;
use crate::motion::terms::{FrameSystem, PriorTerms, Term};
use crate::sim::Cloth;
use glam::DVec2;

/// Cut-offs of the matches' places, as parts of the sheet's size in the image, and of strain and shear, relative to those of a start, from
/// stage to stage: first a soft sheet that heeds all matches, at last a firm one that heeds those that fit.
const STAGES: [[f64; 2]; 3] = [[0.1, 30.0], [0.05, 5.0], [0.02, 1.0]];
/// Most steps of each stage.
const STEPS: usize = 12;
/// Damping, which goes on from stage to stage, is relative to the acceleration term. A stage ends where steps gain little, or none helps.
const POLICY: Policy = Policy {
    lambda: 1e-4,
    accepted: [0.3, 1e-8],
    rejected: [10.0, 1e-4],
    attempts: 6,
    least_gain: [0.0, 1e-3],
    most: 0.0,
    ..Policy::PATIENT
};

impl Finder<'_, '_> {
    /// The sheet at `start` drawn to the `matches` in frame `n`.
    pub fn drawn(
        &self,
        n: usize,
        start: &Positions,
        matches: &[(SurfaceSample, DVec2)],
        scratch: &mut Scratch,
    ) -> Positions {
        let (p, s) = (self.problem, &self.problem.settings);
        let (mut x, mut lambda) = (start.clone(), POLICY.lambda);
        // A match stands for its part of the sheet's image, and has the tail of its colours: beyond it, it lets go.
        let area = self.size.powi(2) / self.points.len() as f64;
        let tail = s.colour_tail;
        for [part, spread] in STAGES {
            let mut priors = p.priors.clone();
            priors.loosen([s.start_spread * spread, spread.min(s.start_bend)], s.start_tail);
            let places = Places {
                cloth: p.cloth,
                samples: &self.samples,
                matches,
                view: &p.observed.levels[n][self.level].view,
                noise: Noise { sigma: part * self.size / tail, tail },
                weight: area * p.independent,
            };
            let kappa = p.acceleration_weight();
            let mut model = Drawn { cloth: p.cloth, priors, places, start, kappa, scratch: &mut *scratch };
            for _ in 0..STEPS {
                if POLICY.iterate(&mut model, &mut x, &mut lambda).ended {
                    break;
                }
            }
        }
        x
    }
}

/// The sheet between `places` of matches, its priors and a weak pull to where it starts.
struct Drawn<'s> {
    cloth: &'s Cloth,
    priors: PriorTerms<'s>,
    places: Places<'s>,
    start: &'s Positions,
    /// Weight of the acceleration term [1/m²].
    kappa: f64,
    scratch: &'s mut Scratch,
}

impl Drawn<'_> {
    fn terms(&self) -> [&dyn Term; 5] {
        let p = &self.priors;
        [&self.places, &p.strain, &p.signed_bend, &p.bend, &p.shear]
    }

    fn pull(&self, x: &Positions) -> f64 {
        0.5 * PULL * self.kappa * x.iter().zip(self.start).map(|(x, p)| x.distance_squared(*p)).sum::<f64>()
    }
}

impl Model for Drawn<'_> {
    type Point = Positions;
    type System = FrameSystem;

    fn linearise(&mut self, x: &Positions) -> (f64, FrameSystem) {
        let mut system = FrameSystem::zeros(self.cloth);
        let value = self.terms().iter().map(|term| term.add_system(x, &mut system)).sum::<f64>();
        let gradient = system.gradient.iter_mut().zip(x.iter().zip(self.start));
        gradient.for_each(|(g, (x, p))| *g += (*x - *p) * (PULL * self.kappa));
        (value + self.pull(x), system)
    }

    fn step(&mut self, x: &Positions, system: &FrameSystem, lambda: f64) -> Option<(Positions, f64)> {
        let factor = FrameFactor::new(self.cloth, system, self.kappa * (PULL + lambda), self.scratch);
        let change = factor.solve(self.cloth, &system.gradient, self.scratch);
        factor.recycle(self.scratch);
        let next: Positions = x.iter().zip(&change).map(|(x, s)| *x - *s).collect();
        let value = self.terms().iter().map(|term| term.value(&next)).sum::<f64>() + self.pull(&next);
        Some((next, value))
    }
}
