//! The search for the sheet in a whole frame.

use glam::{DMat2, DVec2};

use super::agreement::agreeing;
use super::patch::{Patch, Searched};
use super::{Positions, Problem};
use crate::math::factor::Scratch;
use crate::motion::observed::samples::{SurfaceSample, SurfaceSamples};
use crate::motion::spacetime::size_in_image;

/// Distance between the points that are looked for, and how far they are, as parts of the sheet's size in the image.
const SPACING: f64 = 0.07;
const REACH: f64 = 0.4;
/// Least distance between them [px of the level].
const LEAST_SPACING: f64 = 2.0;
/// A patch turns and stretches as points within so many spacings do, by no more than this factor.
const SURROUNDINGS: f64 = 2.5;
const MOST_STRETCH: f64 = 3.0;
/// Share of the unmoved patch in that, where those points hardly tell.
const SHARE: f64 = 1e-2;
/// Fewest matches that a frame is found by.
const LEAST_MATCHES: usize = 8;

/// Looks for the sheet in whole frames, at one level coarser than the finest.
pub(super) struct Finder<'p, 'a> {
    pub problem: &'p Problem<'a>,
    pub level: usize,
    pub samples: SurfaceSamples,
    /// Points that are looked for.
    pub points: Vec<SurfaceSample>,
    /// Where they are in the first frame [px of the level].
    places: Vec<DVec2>,
    /// Size of the sheet there.
    pub size: f64,
}

impl<'p, 'a> Finder<'p, 'a> {
    pub fn new(problem: &'p Problem<'a>) -> Self {
        let observed = &problem.observed;
        let level = (observed.range[0] + 1).min(observed.range[1]);
        let (template, view) = (&problem.scene.template, &observed.levels[0][level].view);
        let first = &template.positions;
        let samples = SurfaceSamples::new(template, first, view, 1.0);
        let size = size_in_image(template, view);
        let (mut points, mut places): (Vec<SurfaceSample>, Vec<DVec2>) = Default::default();
        for point in &samples.points {
            let place = view.project(samples.position(point, first));
            if places.iter().all(|p| p.distance(place) >= spacing(size)) {
                points.push(*point);
                places.push(place);
            }
        }
        Self { problem, level, samples, points, places, size }
    }

    /// Positions of frame `n` that its patches lead to from those of frame `start`, given the `good` of the `frames`, ascending.
    pub fn find(
        &self,
        n: usize,
        start: usize,
        frames: &[Positions],
        good: &[usize],
        scratch: &mut Scratch,
    ) -> Option<Positions> {
        let mut sources = vec![0];
        sources.extend(good.iter().rev().find(|m| **m < n));
        sources.extend(good.iter().find(|m| **m > n));
        sources.dedup();
        let x = &frames[start];
        let expected = self.images(n, x);
        let found = self.matches(n, &sources, frames, &expected);
        let moved: Vec<Option<DVec2>> = found.iter().zip(&expected).map(|(f, e)| Some((*f)? - *e)).collect();
        let kept = agreeing(&self.places, &moved);
        let matches: Vec<(SurfaceSample, DVec2)> = (self.points.iter().zip(&found).zip(&kept))
            .filter_map(|((point, found), kept)| Some((*point, found.filter(|_| *kept)?)))
            .collect();
        (matches.len() >= LEAST_MATCHES).then(|| self.drawn(n, x, &matches, scratch))
    }

    /// Where the points are in the image that frame `n` would show of the sheet at `x`.
    fn images(&self, n: usize, x: &Positions) -> Vec<DVec2> {
        let view = &self.problem.observed.levels[n][self.level].view;
        self.points.iter().map(|point| view.project(self.samples.position(point, x))).collect()
    }

    /// Where frame `n` shows every point, by the best correlating of its patches in the frames `sources`, which turn and stretch
    /// as if it were where it is `expected`.
    fn matches(
        &self,
        n: usize,
        sources: &[usize],
        frames: &[Positions],
        expected: &[DVec2],
    ) -> Vec<Option<DVec2>> {
        let levels = &self.problem.observed.levels;
        let searched = Searched::new(&levels[n][self.level]);
        let images: Vec<Vec<DVec2>> = sources.iter().map(|m| self.images(*m, &frames[*m])).collect();
        let best = |i: usize| {
            let of_source = |(m, images): (&usize, &Vec<DVec2>)| {
                let patch = Patch::new(&levels[*m][self.level], images[i], self.warp(i, expected, images))?;
                searched.find(&patch, expected[i], REACH * self.size)
            };
            let found = sources.iter().zip(&images).filter_map(of_source);
            found.reduce(|a, b| if b.correlation > a.correlation { b } else { a })
        };
        (0..self.points.len()).map(|i| best(i).map(|found| found.place)).collect()
    }

    /// How the surroundings of a point in one image, `from`, become those in another, `to`: least squares over the points there.
    fn warp(&self, i: usize, from: &[DVec2], to: &[DVec2]) -> DMat2 {
        let reach = SURROUNDINGS * spacing(self.size);
        let (mut square, mut product) = (DMat2::ZERO, DMat2::ZERO);
        for j in (0..from.len()).filter(|&j| self.places[i].distance(self.places[j]) <= reach) {
            let (a, b) = (from[j] - from[i], to[j] - to[i]);
            square += DMat2::from_cols(a * a.x, a * a.y);
            product += DMat2::from_cols(b * a.x, b * a.y);
        }
        let own = DMat2::IDENTITY * (SHARE * square.determinant().abs().sqrt()).max(1e-9);
        let warp = (product + own) * (square + own).inverse();
        let stretch = warp.determinant().abs().sqrt();
        let usable = warp.is_finite() && (1.0 / MOST_STRETCH..MOST_STRETCH).contains(&stretch);
        if usable { warp } else { DMat2::IDENTITY }
    }
}

fn spacing(size: f64) -> f64 {
    (SPACING * size).max(LEAST_SPACING)
}
