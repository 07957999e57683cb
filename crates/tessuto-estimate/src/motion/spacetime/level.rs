//! The search at one resolution: what every camera shows there, and the terms of each frame.

use tessuto_core::parallel;

use super::look::Look;
use super::noise::Asked;
use super::{Positions, Problem, acceleration};
use crate::motion::terms::plane::Planes;
use crate::motion::terms::robust::Noise;
use crate::motion::terms::shading::{HARMONICS, Light};
use crate::motion::terms::still::Still;
use crate::motion::terms::{FrameTerms, OfViews, PriorTerms, TERMS};

/// State of the search at one level, 0 the finest.
pub(super) struct LevelSearch<'p, 'a> {
    pub problem: &'p Problem<'a>,
    /// What every camera shows, the scene's own first.
    pub looks: Vec<Look<'p, 'a>>,
    priors: PriorTerms<'a>,
    /// Whether motions are compared: pixels that mask or mesh cover alone count
    /// (see [`uncovered`](crate::motion::terms::colour::Colour::uncovered)).
    pub compares: bool,
    /// Vertices that stand still.
    pub still: Vec<u32>,
    /// What the clip asks for.
    pub asked: Asked,
    /// The light; zero while not known.
    pub light: Light,
    /// A motion of the accelerations that are expected, shape [N, V]; empty where none are.
    expected: Vec<Positions>,
    /// 1/σ_a² of the acceleration term [1/m²].
    pub acceleration_weight: f64,
}

impl<'a> Problem<'a> {
    /// The search at `level`, with gains of 1.
    pub(super) fn at_level(&self, level: usize) -> LevelSearch<'_, 'a> {
        LevelSearch {
            problem: self,
            looks: (0..self.eyes.len()).map(|v| self.look(v, level)).collect(),
            priors: self.priors.clone(),
            compares: false,
            still: Vec::new(),
            asked: Asked::default(),
            light: self.light,
            expected: Vec::new(),
            acceleration_weight: self.acceleration_weight(),
        }
    }
}

impl Problem<'_> {
    /// Every term of E at `frames`, summed over them, at the finest resolution; what mask or mesh cover alone counts.
    pub fn objective(&self, frames: &[Positions]) -> Vec<(&'static str, f64)> {
        let mut search = self.at_level(0);
        search.compares = true;
        search.update_references(frames);
        let terms_of = |(n, x): (usize, &Positions)| search.terms(n).list().map(|term| term.value(x));
        let values: Vec<_> = parallel::later(frames, terms_of);
        let names = search.terms(0).list().map(|term| term.name());
        let mut terms: Vec<_> =
            (0..TERMS).map(|k| (names[k], values.iter().map(|v| v[k]).sum::<f64>())).collect();
        terms.push(("acceleration", acceleration::value(frames, self.acceleration_weight())));
        terms
    }
}

impl LevelSearch<'_, '_> {
    /// Sets the priors: close to least squares at `t` = 0, as the settings want them from 1 on, in equal ratios
    /// between.
    pub fn anneal(&mut self, t: f64) {
        let s = &self.problem.settings;
        let left = (1.0 - t).max(0.0);
        self.loosen([s.start_spread.powf(left), 1.0], s.start_tail.powf(left));
    }

    /// Sets the priors: those of the settings with spreads of strain and shear, and of signed bending, times
    /// `spreads`, tails times `tail`.
    pub fn loosen(&mut self, spreads: [f64; 2], tail: f64) {
        self.priors = self.problem.priors.clone();
        self.priors.loosen(spreads, tail);
        self.priors.strain.sigma *= self.asked.strain;
        self.asked.bent.apply(&mut self.priors.signed_bend);
    }

    /// Expects the accelerations of the motion `made` from now on, about which those of `found` give the spread.
    pub fn expect(&mut self, found: &[Positions], made: &[Positions]) {
        self.expected = made.to_vec();
        let spread = self.problem.acceleration_spread(&self.departure(found));
        self.acceleration_weight = self.problem.weight_of(spread);
    }

    /// `frames` less a motion of the accelerations that are expected: what the acceleration term is of.
    pub fn departure(&self, frames: &[Positions]) -> Vec<Positions> {
        if self.expected.is_empty() {
            return frames.to_vec();
        }
        let of = |(x, e): (&Positions, &Positions)| x.iter().zip(e).map(|(x, e)| *x - *e).collect();
        frames.iter().zip(&self.expected).map(of).collect()
    }

    /// The terms of one frame.
    pub fn terms(&self, frame: usize) -> FrameTerms<'_> {
        let (p, asked) = (self.problem, &self.asked);
        let ways = || self.looks.iter().map(|look| look.way(frame));
        FrameTerms {
            priors: &self.priors,
            colour: OfViews::new(self.looks.iter().map(|look| look.colour(frame, asked)), ways()),
            outline: OfViews::new(self.looks.iter().map(|look| look.outline(frame, asked)), ways()),
            shading: OfViews::new(self.looks.iter().map(|look| look.shading(frame, &self.light)), ways()),
            depth: OfViews::new(self.looks.iter().map(|look| look.depth(frame)), ways()),
            still: Still {
                cloth: p.cloth,
                first: &p.start.known[0],
                vertices: &self.still,
                sigma: p.settings.still,
            },
            planes: Planes {
                cloth: p.cloth,
                planes: asked.plane.as_ref().map_or(&p.scene.known.planes, std::slice::from_ref),
                noise: Noise { sigma: p.settings.plane, tail: p.settings.depth_tail },
            },
        }
    }

    /// Fits the gains of one frame to its positions, and sees what is hidden there.
    pub fn update_gain(&mut self, frame: usize, x: &Positions) {
        for v in 0..self.looks.len() {
            let around = self.looks[v].update_gain(frame, x, self.compares);
            if self.light != [0.0; HARMONICS] {
                self.update_brightness(v, (frame, x), &around);
            }
        }
    }

    /// Fits the gains of some frames to their positions, from 1 on, and sees what is hidden there: what they were
    /// fitted to before does not count.
    pub fn fit_anew(&mut self, frames: &[(usize, &Positions)]) {
        for v in 0..self.looks.len() {
            let around = self.looks[v].fit_anew(frames, self.compares);
            if self.light != [0.0; HARMONICS] {
                frames
                    .iter()
                    .zip(&around)
                    .for_each(|(frame, around)| self.update_brightness(v, *frame, around));
            }
        }
    }

    /// Fits the gains of all frames, what is hidden in them and what their adjacent frames show, to the present
    /// positions.
    pub fn update_references(&mut self, frames: &[Positions]) {
        let compares = self.compares;
        let updated = self.looks.iter_mut().map(|look| look.update(frames, compares));
        let (observed, around): (Vec<_>, Vec<_>) = updated.unzip();
        if self.problem.settings.shading_tail > 0.0 {
            self.update_light(frames, &around);
        }
        if self.problem.settings.neighbour_weight > 0.0 {
            self.looks.iter_mut().zip(observed).for_each(|(look, observed)| look.update_adjacent(observed));
        }
    }
}
