//! The sheet drawn to matches.

use super::Positions;
use super::finder::Finder;
use super::places::Places;
use crate::math::damping::Damping;
use crate::math::factor::Scratch;
use crate::motion::observed::samples::SurfaceSample;
use crate::motion::spacetime::settle::PULL;
use crate::motion::terms::low_rank::FrameFactor;
use crate::motion::terms::{FrameSystem, PriorTerms, Term};
use glam::DVec2;

/// Spreads of the matches' places, as parts of the sheet's size in the image, and of strain and shear, relative to those of a start, from
/// stage to stage: first a soft sheet that heeds all matches, at last a firm one that heeds those that fit.
const STAGES: [[f64; 2]; 3] = [[0.1, 30.0], [0.05, 5.0], [0.02, 1.0]];
/// Most steps of each stage, and most attempts to shorten one of them.
const STEPS: usize = 12;
const ATTEMPTS: usize = 6;
/// A stage ends with a step that lowers the objective by less than this part.
const LEAST_GAIN: f64 = 1e-3;
const DAMPING: Damping =
    Damping { lambda: 1e-4, accepted: 0.3, rejected: 10.0, least: 1e-8, least_rejected: 1e-4 };

impl Finder<'_, '_> {
    /// The sheet at `start` drawn to the `matches`.
    pub fn drawn(
        &self,
        start: &Positions,
        matches: &[(SurfaceSample, DVec2)],
        scratch: &mut Scratch,
    ) -> Positions {
        let (p, s) = (self.problem, &self.problem.settings);
        let mut x = start.clone();
        let mut damping = DAMPING;
        // A match stands for its share of the sheet's image.
        let area = self.size.powi(2) / self.points.len() as f64;
        for [part, spread] in STAGES {
            let mut priors = p.priors.clone();
            priors.loosen([s.start_spread * spread, spread.min(s.start_bend)], s.start_tail);
            let sigma = part * self.size;
            let places = Places {
                cloth: p.cloth,
                samples: &self.samples,
                matches,
                camera: &p.observed.levels[0][self.level].camera,
                sigma,
                weight: area / (s.colour_area * p.scale) / sigma.powi(2),
            };
            for _ in 0..STEPS {
                if !self.step(&mut x, start, &priors, &places, &mut damping, scratch) {
                    break;
                }
            }
        }
        x
    }

    /// One step; whether it made a difference.
    fn step(
        &self,
        x: &mut Positions,
        start: &Positions,
        priors: &PriorTerms,
        places: &Places,
        damping: &mut Damping,
        scratch: &mut Scratch,
    ) -> bool {
        let cloth = self.problem.cloth;
        let kappa = self.problem.acceleration_weight();
        let terms: [&dyn Term; 5] =
            [places, &priors.strain, &priors.signed_bend, &priors.bend, &priors.shear];
        let pull = |x: &Positions| -> f64 {
            0.5 * PULL * kappa * x.iter().zip(start).map(|(x, p)| x.distance_squared(*p)).sum::<f64>()
        };
        let mut system = FrameSystem::zeros(cloth);
        let value = terms.iter().map(|term| term.add_system(x, &mut system)).sum::<f64>() + pull(x);
        let gradient: Positions =
            (0..x.len()).map(|i| system.gradient[i] + (x[i] - start[i]) * (PULL * kappa)).collect();
        for _ in 0..ATTEMPTS {
            let factor = FrameFactor::new(cloth, &system, kappa * (PULL + damping.lambda), scratch);
            let change = factor.solve(cloth, &gradient, scratch);
            factor.recycle(scratch);
            let next: Positions = x.iter().zip(&change).map(|(x, s)| *x - *s).collect();
            let next_value = terms.iter().map(|term| term.value(&next)).sum::<f64>() + pull(&next);
            if next_value <= value {
                *x = next;
                damping.accept();
                return value - next_value > LEAST_GAIN * value;
            }
            damping.reject();
        }
        false
    }
}
