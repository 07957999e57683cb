//! The search at one resolution: what the frames are compared with, and the terms of each.

use rayon::prelude::*;

use super::gain::{Around, GAIN_FITS, explained, fit_gain};
use super::noise::Asked;
use super::{Positions, Problem, acceleration, size_in_image};
use crate::motion::observed::occlusion::{Occlusion, Sheet, Shown};
use crate::motion::observed::samples::SurfaceSamples;
use crate::motion::terms::colour::{Colour, PointColours};
use crate::motion::terms::depth::{Depth, Map};
use crate::motion::terms::outline::Outline;
use crate::motion::terms::robust::Noise;
use crate::motion::terms::shading::{HARMONICS, Light, Seen, Shading};
use crate::motion::terms::still::Still;
use crate::motion::terms::{FrameTerms, PriorTerms, TERMS};
use tessuto_core::scene::Depths;

/// Colours that differ from the fabric's by more than this many cut-offs are treated as something in front of it.
const OUTLIER: f64 = 2.5;

/// State of the search at one level of the pyramid.
pub(super) struct LevelSearch<'p, 'a> {
    pub problem: &'p Problem<'a>,
    pub level: usize,
    pub samples: SurfaceSamples,
    /// What the first frame shows at the samples.
    pub reference: PointColours,
    /// Gains of every frame, shape [N, V, 3].
    pub gains: Vec<Vec<[f32; 3]>>,
    priors: PriorTerms<'a>,
    /// Whether motions are compared: pixels that mask or mesh cover alone count (see [`Colour::uncovered`]).
    pub compares: bool,
    /// Vertices that stand still.
    pub still: Vec<u32>,
    /// What the clip asks for.
    pub asked: Asked,
    /// The light; zero while not known.
    pub light: Light,
    /// Brightness of every vertex in every frame, shape [N, V]; empty while the light is not known.
    pub brightness: Vec<Vec<Option<Seen>>>,
    /// What of every frame does not count since the sheet is in front of itself, shape `[N]`.
    pub occlusions: Vec<Occlusion>,
    /// What the adjacent frames show at the samples, shape `[N]`; empty while not known.
    adjacent: Vec<PointColours>,
    /// A motion of the accelerations that are expected, shape [N, V]; empty where none are.
    expected: Vec<Positions>,
    /// 1/σ_a² of the acceleration term [1/m²].
    pub acceleration_weight: f64,
}

impl<'a> Problem<'a> {
    /// The search at `level`, with gains of 1.
    pub(super) fn at_level(&self, level: usize) -> LevelSearch<'_, 'a> {
        let template = &self.scene.template;
        let first = &self.observed.levels[0][level];
        // More points than the resolution asks for add nothing.
        let spacing = (size_in_image(template, &first.view) / self.settings.resolution).max(1.0);
        let samples = SurfaceSamples::new(template, &template.positions, &first.view, spacing);
        let frame_count = self.scene.frames.len();
        LevelSearch {
            problem: self,
            level,
            reference: samples.observe(first, &template.positions, &[]),
            samples,
            gains: vec![vec![[1.0; 3]; template.positions.len()]; frame_count],
            priors: self.priors.clone(),
            compares: false,
            still: Vec::new(),
            asked: Asked::default(),
            light: self.light,
            brightness: vec![Vec::new(); frame_count],
            occlusions: vec![Occlusion::default(); frame_count],
            adjacent: vec![PointColours::new(); frame_count],
            expected: Vec::new(),
            acceleration_weight: self.acceleration_weight(),
        }
    }
}

impl Problem<'_> {
    /// Noise of the colour of one pixel of the finest level, all channels together `[sRGB]`.
    pub(super) fn colour_noise(&self) -> Noise {
        Noise { sigma: self.settings.colour, tail: self.settings.colour_tail }
    }

    /// Every term of E at `frames`, summed over them, at the finest resolution; what mask or mesh cover alone counts.
    pub fn objective(&self, frames: &[Positions]) -> Vec<(&'static str, f64)> {
        let mut search = self.at_level(self.observed.range[0]);
        search.compares = true;
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
        let p = self.problem;
        let s = &p.settings;
        FrameTerms {
            priors: &self.priors,
            colour: Colour {
                cloth: p.cloth,
                samples: &self.samples,
                level: &p.observed.levels[frame][self.level],
                reference: &self.reference,
                gain: &self.gains[frame],
                adjacent: &self.adjacent[frame],
                adjacent_weight: s.neighbour_weight,
                noise: p.colour_noise(),
                weight: p.independent * p.print[self.level] * self.asked.colours * self.pixel_area(),
                hidden: &self.occlusions[frame].hidden,
                shares: &self.occlusions[frame].shares,
                uncovered: self.occlusions[frame].uncovered,
            },
            outline: Outline {
                cloth: p.cloth,
                boundary: &p.boundary,
                inner: &self.occlusions[frame].inner,
                folds: &self.occlusions[frame].folds,
                distance: &p.observed.outlines[frame],
                view: &p.observed.views[frame],
                noise: Noise { sigma: s.outline * p.pixel(), tail: s.outline_tail },
                weight: p.independent * self.asked.outlines / p.pixel(),
            },
            shading: Shading {
                cloth: p.cloth,
                triangles: &self.samples.triangles,
                light: &self.light,
                seen: &self.brightness[frame],
            },
            still: Still {
                cloth: p.cloth,
                first: &p.scene.template.positions,
                vertices: &self.still,
                sigma: s.still,
            },
            depth: self.depth(frame),
        }
    }

    fn depth(&self, frame: usize) -> Depth<'_> {
        let p = self.problem;
        let Occlusion { hidden, shares, .. } = &self.occlusions[frame];
        let measured = p.scene.depths.as_ref();
        let of_map = |depths: &'_ Depths| {
            let ratio = depths.camera.fx / p.observed.levels[frame][self.level].view.camera.fx;
            (depths.noise, ratio * ratio * depths.camera.fy / depths.camera.fx)
        };
        let (sigma, area) = measured.map_or((1.0, 0.0), of_map);
        Depth {
            cloth: p.cloth,
            samples: &self.samples,
            map: measured.map(|depths| Map {
                view: p.observed.views[frame].with_camera(depths.camera),
                z: &depths.maps[frame],
            }),
            noise: Noise { sigma, tail: p.settings.depth_tail },
            area,
            hidden,
            shares,
        }
    }

    /// Area of one pixel of this level, in those of [`Problem::pixel`].
    pub fn pixel_area(&self) -> f64 {
        (f64::from(1u32 << self.level) / self.problem.pixel()).powi(2)
    }

    /// What `frame` shows at the samples of the mesh at `x`.
    pub fn observe(&self, frame: usize, x: &Positions) -> PointColours {
        self.observe_with(frame, x, &self.occlusion(frame, x))
    }

    fn observe_with(&self, frame: usize, x: &Positions, occlusion: &Occlusion) -> PointColours {
        self.samples.observe(&self.problem.observed.levels[frame][self.level], x, &occlusion.hidden)
    }

    /// Where the mesh at `x` is in front of itself; drawn at the finest resolution whatever the level is, for
    /// there a flap is behind the sheet long before its border is pixels of a coarse level away from the outline.
    fn occlusion(&self, frame: usize, x: &Positions) -> Occlusion {
        let p = self.problem;
        let observed = &p.observed;
        let sheet = Sheet {
            rasterizer: &p.rasterizer,
            boundary: &p.boundary,
            edges: &p.inner_edges,
            first: &p.scene.template.positions,
            first_view: &observed.levels[0][observed.range[0]].view,
        };
        let shown = Shown {
            level: &observed.levels[frame][observed.range[0]],
            outline: &observed.outlines[frame],
            view: &observed.views[frame],
        };
        Occlusion::new(&sheet, &shown, &self.samples, x, self.compares)
    }

    /// Fits the gains of one frame to its positions, and sees what is hidden there.
    pub fn update_gain(&mut self, frame: usize, x: &Positions) {
        self.occlusions[frame] = self.occlusion(frame, x);
        let observed = self.observe_with(frame, x, &self.occlusions[frame]);
        let mut gain = std::mem::take(&mut self.gains[frame]);
        let around = self.fit_gain(&observed, &mut gain);
        self.gains[frame] = gain;
        if self.light != [0.0; HARMONICS] {
            self.update_brightness(frame, x, &around);
        }
    }

    /// Fits the gains of some frames to their positions, from 1 on, and sees what is hidden there: what they were
    /// fitted to before does not count.
    pub fn fit_anew(&mut self, frames: &[(usize, &Positions)]) {
        let fit = |&(n, x): &(usize, &Positions)| {
            let occlusion = self.occlusion(n, x);
            let observed = self.observe_with(n, x, &occlusion);
            let mut gain = vec![[1.0; 3]; x.len()];
            let around = (0..GAIN_FITS).map(|_| self.fit_gain(&observed, &mut gain)).last();
            (occlusion, gain, around.unwrap_or_default())
        };
        let fitted: Vec<_> = frames.par_iter().map(fit).collect();
        for (&(n, x), (occlusion, gain, around)) in frames.iter().zip(fitted) {
            (self.occlusions[n], self.gains[n]) = (occlusion, gain);
            if self.light != [0.0; HARMONICS] {
                self.update_brightness(n, x, &around);
            }
        }
    }

    /// Compares `frame` with what `adjacent` shows from now on; with nothing if that is empty.
    pub fn set_adjacent(&mut self, frame: usize, adjacent: PointColours) {
        self.adjacent[frame] = adjacent;
    }

    /// Fits the gains of all frames, what is hidden in them and what their adjacent frames show, to the present
    /// positions.
    pub fn update_references(&mut self, frames: &[Positions]) {
        self.occlusions = frames.par_iter().enumerate().map(|(n, x)| self.occlusion(n, x)).collect();
        let observe = |(n, x): (usize, &Positions)| self.observe_with(n, x, &self.occlusions[n]);
        let observed: Vec<PointColours> = frames.par_iter().enumerate().map(observe).collect();
        let mut gains = std::mem::take(&mut self.gains);
        let fit = |(gain, seen): (&mut Vec<[f32; 3]>, &PointColours)| self.fit_gain(seen, gain);
        let around: Vec<Vec<Around>> = gains.par_iter_mut().zip(&observed).skip(1).map(fit).collect();
        self.gains = gains;
        if self.problem.settings.shading_tail > 0.0 {
            self.update_light(frames, &around);
        }
        if self.problem.settings.neighbour_weight > 0.0 {
            let seen = |(n, seen): (usize, PointColours)| self.explained(n, seen);
            let observed: Vec<PointColours> = observed.into_par_iter().enumerate().map(seen).collect();
            self.adjacent = (0..frames.len()).map(|n| adjacent_mean(&observed, n)).collect();
        }
    }

    /// `observed` in `frame` without what is not the fabric.
    pub fn explained(&self, frame: usize, observed: PointColours) -> PointColours {
        let limit = OUTLIER * self.problem.colour_noise().cut_off();
        explained(&self.samples, &self.reference, observed, &self.gains[frame], limit)
    }

    fn fit_gain(&self, observed: &PointColours, gain: &mut [[f32; 3]]) -> Vec<Around> {
        let p = self.problem;
        let (smoothness, noise) = (p.settings.gain_smoothness, p.colour_noise());
        fit_gain(&self.samples, &p.adjacency, &self.reference, observed, smoothness, noise, gain)
    }
}

/// Mean of what the frames before and after `n` show; of the one that there is at the ends and where only one sees
/// a point.
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
