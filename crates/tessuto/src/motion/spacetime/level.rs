//! The search at one resolution: what the frames are compared with, and the terms of each.

use glam::DVec3;
use rayon::prelude::*;

use super::gain::fit_gain;
use super::{Positions, Problem, acceleration};
use crate::motion::observed::samples::SurfaceSamples;
use crate::motion::terms::{FrameTerms, PriorTerms, TERMS};
use crate::motion::terms::angles::Angles;
use crate::sim::cloth::arms;
use crate::motion::terms::colour::{Colour, PointColours};
use crate::motion::terms::outline::Outline;

/// State of the search at one level of the pyramid.
pub(super) struct LevelSearch<'p, 'a> {
    pub problem: &'p Problem<'a>,
    level: usize,
    samples: SurfaceSamples,
    /// What the first frame shows at the samples.
    reference: PointColours,
    /// Gains of every frame, shape [N, V, 3].
    pub gains: Vec<Vec<[f32; 3]>>,
    pub sheared: Vec<Vec<f64>>,
    pub priors: PriorTerms<'a>,
    pub shear: [f64; 2],
    /// What the adjacent frames show at the samples, shape `[N]`; empty while not known.
    adjacent: Vec<PointColours>,
}

impl<'a> Problem<'a> {
    /// The search at `level`, with gains of 1.
    pub(super) fn at_level(&self, level: usize) -> LevelSearch<'_, 'a> {
        let template = &self.scene.template;
        let first = &self.observed.levels[0][level];
        let samples = SurfaceSamples::new(template, &template.positions, &first.camera);
        let frame_count = self.scene.frames.len();
        LevelSearch {
            problem: self,
            level,
            reference: samples.observe(first, &template.positions),
            samples,
            gains: vec![vec![[1.0; 3]; template.positions.len()]; frame_count],
            sheared: vec![Vec::new(); frame_count],
            priors: self.priors.clone(),
            shear: [self.settings.shear, self.settings.shear_tail],
            adjacent: vec![PointColours::new(); frame_count],
        }
    }
}

impl Problem<'_> {
    /// Every term of E at `frames`, summed over them, at the finest resolution.
    pub fn objective(&self, frames: &[Positions]) -> Vec<(&'static str, f64)> {
        let mut search = self.at_level(self.observed.range[0]);
        search.update_references(frames);
        let terms_of = |(n, x): (usize, &Positions)| search.terms(n).list().map(|term| term.value(x));
        let values: Vec<_> = frames.par_iter().enumerate().skip(1).map(terms_of).collect();
        let names = search.terms(0).list().map(|term| term.name());
        let mut terms: Vec<_> =
            (0..TERMS).map(|k| (names[k], values.iter().map(|v| v[k]).sum::<f64>())).collect();
        terms.push(("acceleration", acceleration::value(frames, self.acceleration_weight())));
        terms
    }
}

impl Problem<'_> {
    fn smooth_shear(&self, x: &[DVec3]) -> Vec<f64> {
        if std::env::var("SMOOTH").is_err() { return Vec::new(); }
        let s = &self.settings;
        let uv = crate::mesh::vertex_uvs(&self.scene.template, 1e-3).unwrap();
        let mut rows = Vec::new();
        for spring in &self.cloth.shears {
            let [u, w] = arms(x, spring.vertices);
            let d = crate::sim::angle::angle(u, w) - spring.rest_angle;
            let [a, o, c] = spring.vertices.map(|v| uv[v as usize]);
            let e = (a - o) + (c - o);
            let sign = (e.x * e.y).signum();
            let (p, q) = (2.0 * o.x - 1.0, 2.0 * o.y - 1.0);
            rows.push(([sign, sign * p, sign * q, sign * p * q], d));
        }
        let mut m = [0.0f64; 4];
        let ridge = (s.shear / 0.2).powi(2) * 1.0;
        for _ in 0..10 {
            let mut a = [[0.0; 5]; 4];
            for (b, d) in &rows {
                let r = d - (0..4).map(|i| b[i] * m[i]).sum::<f64>();
                let w = 1.0 / (1.0 + (r / (s.shear * s.shear_tail)).powi(2));
                for i in 0..4 {
                    for j in 0..4 { a[i][j] += w * b[i] * b[j]; }
                    a[i][4] += w * b[i] * d;
                }
            }
            for i in 0..4 { a[i][i] += ridge; }
            for i in 0..4 {
                let p = a[i][i];
                for j in 0..5 { a[i][j] /= p; }
                for k in 0..4 { if k != i { let f = a[k][i]; for j in 0..5 { a[k][j] -= f * a[i][j]; } } }
            }
            for i in 0..4 { m[i] = a[i][4]; }
        }
        rows.iter().map(|(b, _)| (0..4).map(|i| b[i] * m[i]).sum()).collect()
    }
}

pub fn env(name: &str, otherwise: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(otherwise)
}

impl LevelSearch<'_, '_> {
    /// Loose at t = 0, as set at t = 1.
    pub fn anneal(&mut self, t: f64) {
        let s = &self.problem.settings;
        let t = t.min(1.0);
        let mix = |name: &str, last: f64| (env(name, last).ln() * (1.0 - t) + last.ln() * t).exp();
        self.priors.strain.sigma = mix("A_STRAIN", s.strain);
        self.priors.strain.tail = mix("A_TAIL", s.tail);
        self.priors.signed_bend.tail = mix("A_BTAIL", s.tail);
        self.shear = [mix("A_SHEAR", s.shear), mix("A_STAIL", s.shear_tail)];
    }

    /// The terms of one frame.
    pub fn terms(&self, frame: usize) -> FrameTerms<'_> {
        let p = self.problem;
        let s = &p.settings;
        // Pixels of level 0 in one of this level.
        let area = (1usize << (2 * self.level)) as f64;
        FrameTerms {
            priors: &self.priors,
            shear: Angles {
                name: "shear",
                cloth: p.cloth,
                springs: &p.cloth.shears,
                offset: &self.sheared[frame],
                sigma: self.shear[0],
                tail: self.shear[1],
            },
            colour: Colour {
                cloth: p.cloth,
                samples: &self.samples,
                level: &p.observed.levels[frame][self.level],
                reference: &self.reference,
                gain: &self.gains[frame],
                adjacent: &self.adjacent[frame],
                adjacent_weight: s.neighbour_weight,
                sigma: s.colour,
                weight: area / (s.colour * s.colour * s.colour_area),
            },
            outline: Outline {
                cloth: p.cloth,
                boundary: &p.boundary,
                distance: &p.observed.outlines[frame],
                camera: &p.scene.camera,
                sigma: s.outline,
                weight: 1.0 / (s.outline * s.outline * s.outline_length),
            },
        }
    }

    /// What `frame` shows at the samples of the mesh at `x`.
    pub fn observe(&self, frame: usize, x: &Positions) -> PointColours {
        self.samples.observe(&self.problem.observed.levels[frame][self.level], x)
    }

    /// Fits the gains of one frame to its positions.
    pub fn update_gain(&mut self, frame: usize, x: &Positions) {
        let observed = self.observe(frame, x);
        let mut gain = std::mem::take(&mut self.gains[frame]);
        self.fit_gain(&observed, &mut gain);
        self.gains[frame] = gain;
        self.sheared[frame] = self.problem.smooth_shear(x);
    }

    /// Compares `frame` with what `adjacent` shows from now on; with nothing if that is empty.
    pub fn set_adjacent(&mut self, frame: usize, adjacent: PointColours) {
        self.adjacent[frame] = adjacent;
    }

    /// Fits the gains of all frames, and what their adjacent frames show, to the present positions.
    pub fn update_references(&mut self, frames: &[Positions]) {
        let observed: Vec<PointColours> =
            frames.par_iter().enumerate().map(|(n, x)| self.observe(n, x)).collect();
        let mut gains = std::mem::take(&mut self.gains);
        gains.par_iter_mut().zip(&observed).skip(1).for_each(|(gain, seen)| self.fit_gain(seen, gain));
        self.gains = gains;
        self.sheared = frames.par_iter().map(|x| self.problem.smooth_shear(x)).collect();
        if self.problem.settings.neighbour_weight > 0.0 {
            self.adjacent = (0..frames.len()).map(|n| adjacent_mean(&observed, n)).collect();
        }
    }

    fn fit_gain(&self, observed: &PointColours, gain: &mut [[f32; 3]]) {
        let s = &self.problem.settings;
        let adjacency = &self.problem.adjacency;
        fit_gain(&self.samples, adjacency, &self.reference, observed, s.gain_smoothness, s.colour, gain);
    }
}

/// Mean of what the frames before and after `n` show; of the one that there is at the ends and where only one sees a point.
fn adjacent_mean(observed: &[PointColours], n: usize) -> PointColours {
    let mean = |a: &Option<[f32; 3]>, b: &Option<[f32; 3]>| match (a, b) {
        (Some(a), Some(b)) => Some([0, 1, 2].map(|k| 0.5 * (a[k] + b[k]))),
        (a, b) => a.or(*b),
    };
    let before = &observed[n.saturating_sub(1)];
    match observed.get(n + 1) {
        Some(after) => before.iter().zip(after).map(|(a, b)| mean(a, b)).collect(),
        None => before.clone(),
    }
}
