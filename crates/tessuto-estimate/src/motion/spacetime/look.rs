//! What one camera's images are compared with at one resolution: colours, gains, what is hidden, brightness.

use std::borrow::Cow;

use glam::DVec3;
use tessuto_core::parallel;

use super::eye::{Eye, size_in_image};
use super::gain::{Around, GAIN_FITS, explained, fit_gain};
use super::noise::Asked;
use super::{Positions, Problem};
use crate::motion::observed::occlusion::{Occlusion, Sheet, Shown, turned};
use crate::motion::observed::pyramid::Level;
use crate::motion::observed::samples::{SurfaceSample, SurfaceSamples};
use crate::motion::terms::colour::{Colour, PointColours};
use crate::motion::terms::depth::{Depth, Map};
use crate::motion::terms::outline::Outline;
use crate::motion::terms::robust::Noise;
use crate::motion::terms::shading::{Light, Seen, Shading};
use tessuto_core::scene::Depths;

/// Colours that differ from the fabric's by more than this many cut-offs are treated as something in front of it.
const OUTLIER: f64 = 2.5;

/// Gains of one frame, shape [V, 3].
pub(super) type Gains = Vec<[f32; 3]>;

/// One camera's images at one level of the search.
pub(super) struct Look<'p, 'a> {
    problem: &'p Problem<'a>,
    pub eye: &'p Eye<'a>,
    pub level: usize,
    pub samples: SurfaceSamples,
    /// What the first frame shows of the front at the samples.
    pub reference: PointColours,
    /// What the sides that every frame shows look like, shape `[N]`; empty where all of it is the front.
    expected: Vec<PointColours>,
    /// Gains of every frame, shape [N, V, 3].
    pub gains: Vec<Gains>,
    /// Brightness of every vertex in every frame, shape [N, V]; empty while the light is not known.
    pub brightness: Vec<Vec<Option<Seen>>>,
    /// What of every frame does not count since the sheet is in front of itself, shape `[N]`.
    pub occlusions: Vec<Occlusion>,
    /// What the adjacent frames show at the samples, shape `[N]`; empty while not known.
    adjacent: Vec<PointColours>,
    /// How far every vertex goes from a frame's time until this camera takes it `[m]`, shape [N, V]; empty where it is
    /// not known, or the camera is not late. Held fixed, like all of this.
    ways: Vec<Positions>,
}

impl<'a> Problem<'a> {
    /// What camera `v` shows at the search's `level`, with gains of 1.
    pub(super) fn look(&self, v: usize, level: usize) -> Look<'_, 'a> {
        let (template, eye) = (&self.scene.template, &self.eyes[v]);
        let first = &eye.observed.first[eye.kept(level)];
        // More points than the resolution asks for add nothing.
        let spacing = (size_in_image(template, &first.view) / self.settings.resolution).max(1.0);
        let samples = SurfaceSamples::new(template, &template.positions, &first.view, spacing);
        let frame_count = self.scene.frames.len();
        Look {
            problem: self,
            eye,
            level,
            reference: self.front_of(&samples, first, &template.positions),
            samples,
            expected: vec![PointColours::new(); frame_count],
            gains: vec![vec![[1.0; 3]; template.positions.len()]; frame_count],
            brightness: vec![Vec::new(); frame_count],
            occlusions: vec![Occlusion::default(); frame_count],
            adjacent: vec![PointColours::new(); frame_count],
            ways: vec![Positions::new(); if eye.late == 0.0 { 0 } else { frame_count }],
        }
    }

    /// What the clip's `first` frame shows of the front, the template being at `x`.
    fn front_of(&self, samples: &SurfaceSamples, first: &Level, x: &[DVec3]) -> PointColours {
        let mut seen = samples.observe(first, x, &[]);
        if let Some(front) = self.front() {
            let turned = turned(front, &samples.triangles, &first.view, x);
            let points = samples.points.iter().zip(&mut seen);
            points.filter(|(point, _)| turned[point.triangle as usize]).for_each(|(_, seen)| *seen = None);
        }
        seen
    }

    /// Noise of the colour of one pixel of the finest level, all channels together `[sRGB]`.
    pub(super) fn colour_noise(&self) -> Noise {
        Noise { sigma: self.settings.colour, tail: self.settings.colour_tail }
    }
}

impl Look<'_, '_> {
    /// A frame at this level.
    fn image(&self, frame: usize) -> &Level {
        &self.eye.observed.levels[frame][self.eye.kept(self.level)]
    }

    /// Area of one pixel of this level, in those of [`Eye::pixel`].
    pub fn pixel_area(&self) -> f64 {
        (f64::from(1u32 << self.eye.kept(self.level)) / self.eye.pixel()).powi(2)
    }

    pub fn colour(&self, frame: usize, asked: &Asked) -> Colour<'_> {
        let (p, eye) = (self.problem, self.eye);
        Colour {
            cloth: p.cloth,
            samples: &self.samples,
            level: self.image(frame),
            reference: self.expected(frame),
            gain: &self.gains[frame],
            adjacent: &self.adjacent[frame],
            adjacent_weight: p.settings.neighbour_weight,
            noise: p.colour_noise(),
            weight: eye.independent * eye.print[self.level] * asked.colours * self.pixel_area(),
            hidden: &self.occlusions[frame].hidden,
            shares: &self.occlusions[frame].shares,
            uncovered: self.occlusions[frame].uncovered,
        }
    }

    pub fn outline(&self, frame: usize, asked: &Asked) -> Outline<'_> {
        let (eye, s) = (self.eye, &self.problem.settings);
        Outline {
            cloth: self.problem.cloth,
            boundary: &eye.boundary,
            inner: &self.occlusions[frame].inner,
            folds: &self.occlusions[frame].folds,
            distance: &eye.observed.outlines[frame],
            laid: &self.occlusions[frame].laid,
            seam: eye.seams.get(frame).and_then(Option::as_ref),
            view: &eye.observed.views[frame],
            noise: Noise { sigma: s.outline * eye.pixel(), tail: s.outline_tail },
            weight: eye.independent * asked.outlines / eye.pixel(),
        }
    }

    pub fn shading<'s>(&'s self, frame: usize, light: &'s Light) -> Shading<'s> {
        Shading {
            cloth: self.problem.cloth,
            triangles: &self.samples.triangles,
            light,
            seen: &self.brightness[frame],
        }
    }

    pub fn depth(&self, frame: usize) -> Depth<'_> {
        let Occlusion { hidden, shares, .. } = &self.occlusions[frame];
        let measured = self.eye.scene.depths.as_deref();
        let settings = &self.problem.settings;
        let of_map = |depths: &Depths| {
            let image = &self.image(frame).view.camera;
            let pixels = depths.camera.fx / image.fx * depths.camera.fy / image.fy;
            (depths.noise, pixels * settings.depth_weight / depths.alike)
        };
        let (sigma, weight) = measured.map_or((1.0, 0.0), of_map);
        Depth {
            cloth: self.problem.cloth,
            samples: &self.samples,
            map: measured.map(|depths| Map {
                view: self.eye.observed.views[frame].with_camera(depths.camera),
                z: &depths.maps[frame],
            }),
            noise: Noise { sigma, tail: settings.depth_tail },
            weight,
            hidden,
            shares,
        }
    }

    /// How far the vertices go from the time of `frame` until it is taken; `None` where that is not known, or nowhere.
    pub fn way(&self, frame: usize) -> Option<&[DVec3]> {
        self.ways.get(frame).map(Vec::as_slice).filter(|way| !way.is_empty())
    }

    /// Goes on from each of the `frames` as these are on their way, from now on.
    pub fn set_ways(&mut self, frames: &[Positions]) {
        let last = frames.len().saturating_sub(1);
        for n in 0..self.ways.len().min(frames.len()) {
            let (from, to) = (n.saturating_sub(1), (n + 1).min(last));
            let part = self.eye.late / (to - from).max(1) as f64;
            let way = frames[to].iter().zip(&frames[from]).map(|(q, p)| (*q - *p) * part);
            self.ways[n] = way.collect();
        }
        self.see_reference();
    }

    /// Goes on in `frame` at this `velocity` [m a frame].
    pub fn set_way(&mut self, frame: usize, velocity: impl Iterator<Item = DVec3>) {
        if let Some(way) = self.ways.get_mut(frame) {
            *way = velocity.map(|v| v * self.eye.late).collect();
        }
    }

    /// Sees anew what the clip's first frame shows, where the sheet is when it is taken.
    fn see_reference(&mut self) {
        if !self.ways.is_empty() {
            let (p, first) = (self.problem, &self.eye.observed.first[self.eye.kept(self.level)]);
            let template = &p.scene.template.positions;
            let x = match &p.start.way {
                None => self.then(0, template).into_owned(),
                Some(way) => template.iter().zip(way).map(|(x, way)| *x + *way * self.eye.late).collect(),
            };
            self.reference = p.front_of(&self.samples, first, &x);
        }
    }

    /// What `frame` would show at the samples in the first one's light.
    pub fn expected(&self, frame: usize) -> &PointColours {
        Some(&self.expected[frame]).filter(|expected| !expected.is_empty()).unwrap_or(&self.reference)
    }

    /// The same where the sheet is seen like this; empty where all of it is the front.
    fn expected_with(&self, occlusion: &Occlusion) -> PointColours {
        if occlusion.turned.is_empty() {
            return PointColours::new();
        }
        let back = self.problem.back_colour();
        let of = |(point, front): (&SurfaceSample, &Option<[f32; 3]>)| {
            if occlusion.turned[point.triangle as usize] { back } else { *front }
        };
        self.samples.points.iter().zip(&self.reference).map(of).collect()
    }

    /// Where a mesh at `x` at the time of `frame` is when this is taken.
    fn then<'x>(&self, frame: usize, x: &'x Positions) -> Cow<'x, Positions> {
        match self.way(frame) {
            None => Cow::Borrowed(x),
            Some(way) => Cow::Owned(x.iter().zip(way).map(|(x, way)| *x + *way).collect()),
        }
    }

    /// What `frame` shows at the samples of the mesh at `x`.
    pub fn observe(&self, frame: usize, x: &Positions, compares: bool) -> PointColours {
        self.observe_with(frame, x, &self.occlusion(frame, x, compares))
    }

    pub fn observe_with(&self, frame: usize, x: &Positions, occlusion: &Occlusion) -> PointColours {
        self.samples.observe(self.image(frame), &self.then(frame, x), &occlusion.hidden)
    }

    /// Where the mesh at `x` is in front of itself; drawn at the finest resolution whatever the level is, for
    /// there a flap is behind the sheet long before its border is pixels of a coarse level away from the outline.
    pub fn occlusion(&self, frame: usize, x: &Positions, compares: bool) -> Occlusion {
        let (p, observed) = (self.problem, &self.eye.observed);
        let sheet = Sheet {
            rasterizer: &p.rasterizer,
            boundary: &self.eye.boundary,
            edges: &p.inner_edges,
            first: &p.scene.template.positions,
            first_view: &observed.first[observed.range[0]].view,
            front: p.front(),
            border: &self.eye.border,
        };
        let shown = Shown {
            level: &observed.levels[frame][observed.range[0]],
            outline: &observed.outlines[frame],
            view: &observed.views[frame],
        };
        Occlusion::new(&sheet, &shown, &self.samples, &self.then(frame, x), compares)
    }

    /// Fits the gains of one frame to its positions, and sees what is hidden there; returns what the frame shows
    /// around every vertex.
    pub fn update_gain(&mut self, frame: usize, x: &Positions, compares: bool) -> Vec<Around> {
        self.occlusions[frame] = self.occlusion(frame, x, compares);
        self.expected[frame] = self.expected_with(&self.occlusions[frame]);
        let observed = self.observe_with(frame, x, &self.occlusions[frame]);
        let mut gain = std::mem::take(&mut self.gains[frame]);
        let around = self.fit_gain(self.expected(frame), &observed, &mut gain);
        self.gains[frame] = gain;
        around
    }

    /// Fits the gains of some frames to their positions, from 1 on, and sees what is hidden there: what they were
    /// fitted to before does not count. Returns what each shows around every vertex.
    pub fn fit_anew(&mut self, frames: &[(usize, &Positions)], compares: bool) -> Vec<Vec<Around>> {
        let fit = |&(n, x): &(usize, &Positions)| {
            let occlusion = self.occlusion(n, x, compares);
            let observed = self.observe_with(n, x, &occlusion);
            let of_sides = self.expected_with(&occlusion);
            let expected = if of_sides.is_empty() { &self.reference } else { &of_sides };
            let mut gain = vec![[1.0; 3]; x.len()];
            let around = (0..GAIN_FITS).map(|_| self.fit_gain(expected, &observed, &mut gain)).last();
            (occlusion, of_sides, gain, around.unwrap_or_default())
        };
        let fitted: Vec<_> = parallel::over(frames, fit);
        let mut all = Vec::with_capacity(frames.len());
        for (&(n, _), (occlusion, expected, gain, around)) in frames.iter().zip(fitted) {
            (self.occlusions[n], self.expected[n], self.gains[n]) = (occlusion, expected, gain);
            all.push(around);
        }
        all
    }

    /// Compares `frame` with what `adjacent` shows from now on; with nothing if that is empty.
    pub fn set_adjacent(&mut self, frame: usize, adjacent: PointColours) {
        self.adjacent[frame] = adjacent;
    }

    /// Fits the gains of all frames and what is hidden in them to the present positions; returns what each shows at the
    /// samples, and, from the second frame on, around every vertex.
    pub fn update(&mut self, frames: &[Positions], compares: bool) -> (Vec<PointColours>, Vec<Vec<Around>>) {
        self.set_ways(frames);
        self.occlusions = parallel::numbered(frames, |(n, x)| self.occlusion(n, x, compares));
        self.expected = self.occlusions.iter().map(|occlusion| self.expected_with(occlusion)).collect();
        let observe = |(n, x): (usize, &Positions)| self.observe_with(n, x, &self.occlusions[n]);
        let observed: Vec<PointColours> = parallel::numbered(frames, observe);
        let mut gains = std::mem::take(&mut self.gains);
        let fit = |(n, (gain, seen)): (usize, (&mut Gains, &PointColours))| {
            self.fit_gain(self.expected(n), seen, gain)
        };
        // Those of the clip's first frame are 1.
        if self.problem.start.way.is_some() {
            fit((0, (&mut gains[0], &observed[0])));
        }
        let around: Vec<Vec<Around>> =
            parallel::consume(gains.iter_mut().zip(&observed).enumerate().skip(1).collect(), |_, of| fit(of));
        self.gains = gains;
        (observed, around)
    }

    /// Compares every frame from now on with what its adjacent ones showed, `observed` at the present positions.
    pub fn update_adjacent(&mut self, observed: Vec<PointColours>) {
        let seen = |(n, seen): (usize, PointColours)| self.explained([n, n], seen);
        let observed: Vec<PointColours> = parallel::consume(observed, |n, of_frame| seen((n, of_frame)));
        self.adjacent = (0..observed.len()).map(|n| adjacent_mean(&observed, n)).collect();
    }

    /// `observed` in `frame` without what is not the fabric, by the gains of the frame `lit`.
    pub fn explained(&self, [lit, frame]: [usize; 2], observed: PointColours) -> PointColours {
        let limit = OUTLIER * self.problem.colour_noise().cut_off();
        explained(&self.samples, self.expected(frame), observed, &self.gains[lit], limit)
    }

    fn fit_gain(
        &self,
        expected: &PointColours,
        observed: &PointColours,
        gain: &mut [[f32; 3]],
    ) -> Vec<Around> {
        let p = self.problem;
        let (smoothness, noise) = (p.settings.gain_smoothness, p.colour_noise());
        fit_gain(&self.samples, &p.adjacency, expected, observed, smoothness, noise, gain)
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
