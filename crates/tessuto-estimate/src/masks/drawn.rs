//! The outline that was drawn in the first frame holds: how far the mask of that frame may leave it. Corners say
//! where the border is at them, and the less the longer the side to the next one is, for a side may be bent.

use super::beyond::FRAMES;
use super::flow::Flow;
use super::frames::{Colours, Frames, squared};
use super::palette::Palette;
use super::region::{Field, Region, index};
use super::segment::Mark;
use tessuto_core::camera::Rect;

/// How far a side may be bent, inside and outside, as a fraction of its length.
const BENT: [f32; 2] = [0.23, 0.18];
/// Of a mask that was given, as a fraction of the fabric's size.
const GIVEN: f32 = 0.04;
/// At least `[px]`: as exact as clicks are.
const NARROWEST: f32 = 6.0;

/// A notch or bump is deeper than this `[px]` and this fraction of its length, and shorter than this fraction of its
/// side; so deep on either side of the outline colours are sure.
const SURE: f32 = 3.0;
const STEEP: f32 = 0.25;
const RIM: f32 = 1.5;
const PART: f32 = 0.5;
/// From so large a fraction of a side on a colour occurs there; and so many pixels of a notch must have such colours.
const OCCURS: f32 = 0.01;
const ALIKE: f64 = 0.6;

/// Motion says something about a piece where the fabric has moved by so much `[px]`. It stays, or moves, if the other
/// explains its colours worse by this factor, beyond the noise.
const MOVED: f32 = 3.0;
const WORSE: f32 = 2.0;
/// Fabric that moves differs by no more from itself `[grey levels]`, root mean square of a channel.
const UNLIKE: f32 = 9.0;
/// Step between the marks in a piece `[px]`.
const GRID: usize = 4;

/// A notch or a bump of what was found, and what it was given to.
pub(super) struct Piece {
    /// Places of its pixels.
    at: Vec<[usize; 2]>,
    inside: bool,
}

impl Piece {
    /// Marks that take it back, if the motion from the first frame on says that it is not what it was given to.
    /// `noise`: of a channel `[grey levels]`.
    pub fn denied(&self, frames: &Frames, flows: &[Flow], noise: f32) -> Vec<Mark> {
        let (mut stays, mut moves, mut count) = (0.0, 0.0, 0.0_f32);
        for [x, y] in self.at.iter().step_by(self.at.len().div_ceil(200)) {
            let at = [*x as f32, *y as f32];
            let first = frames.images[0].at(*x, *y);
            let mut there = at;
            for (flow, image) in flows.iter().zip(&frames.images[1..]).take(FRAMES) {
                let d = flow.at(there[0], there[1]);
                there = [there[0] + d[0], there[1] + d[1]];
                if (there[0] - at[0]).hypot(there[1] - at[1]) > MOVED {
                    stays += squared(first, image.sample(at[0], at[1]));
                    moves += squared(first, image.sample(there[0], there[1]));
                    count += 1.0;
                }
            }
        }
        // Of two frames, three channels.
        let floor = 6.0 * noise * noise * count;
        let stays_better = moves - floor > WORSE * (stays - floor).max(0.5 * floor);
        let denied = match self.inside {
            true => stays_better || moves - floor > 3.0 * UNLIKE * UNLIKE * count,
            false => stays - floor > WORSE * (moves - floor).max(0.5 * floor),
        };
        if count == 0.0 || !denied {
            return Vec::new();
        }
        let marked = self.at.iter().filter(|[x, y]| x % GRID == 0 && y % GRID == 0);
        marked.map(|at| Mark { at: at.map(|v| v as f32), inside: !self.inside }).collect()
    }
}

/// What was drawn.
pub(super) struct Drawn {
    /// Distance to the outline `[px]`, positive inside.
    distance: Field,
    /// Its sides `[px]`; none where a mask was given or projected.
    sides: Vec<[[f32; 2]; 2]>,
    /// The longest way from the outline `[px]` that is asked for, where there are no sides.
    whole: [f32; 2],
}

impl Drawn {
    /// Of the region in the first frame; `corners` `[px]` of the frames in order around it, `exact` of a given mask.
    pub fn new(first: &Region, corners: &[[f32; 2]], exact: bool) -> Self {
        let size = (first.area() as f32).sqrt();
        let fractions = if exact { [GIVEN; 2] } else { BENT };
        let next = |k: usize| corners[(k + 1) % corners.len()];
        Self {
            distance: first.signed_distance(first.rect),
            sides: corners.iter().enumerate().map(|(k, a)| [*a, next(k)]).collect(),
            whole: fractions.map(|f| (f * size).max(NARROWEST)),
        }
    }

    /// How far what was drawn is to be believed rather than colours at every pixel of `rect`, 0 … 1: where the outline
    /// may be off by half of a `band` `[px]` or less, wholly; by a whole one, not.
    pub fn trust(&self, rect: Rect, band: [f32; 2]) -> Field {
        let mut trust = Field::new(rect, 0.0);
        let width = rect.width();
        for (i, value) in trust.data.iter_mut().enumerate() {
            let at = [(i % width + rect.x0) as f32, (i / width + rect.y0) as f32];
            let limits = self.limits(at, self.distance.sample(at[0], at[1]));
            *value = (2.0 - 2.0 * limits[0] / band[0]).clamp(0.0, 1.0);
        }
        trust
    }

    /// Takes a prediction of the first frame back to what was drawn where it is too far from that: there it is at
    /// least as deep as `band` `[px]`, beyond which nothing is changed.
    pub fn hold(&self, prior: &mut Field, band: [f32; 2]) {
        let (rect, width) = (prior.rect, prior.rect.width());
        for (i, value) in prior.data.iter_mut().enumerate() {
            let at = [(i % width + rect.x0) as f32, (i / width + rect.y0) as f32];
            let drawn = self.distance.sample(at[0], at[1]);
            let [inside, outside] = self.limits(at, drawn);
            if drawn > inside {
                *value = value.max(band[0]);
            } else if drawn < -outside {
                *value = value.min(-band[1]);
            }
        }
    }

    /// Takes back from what was `found` in the first `frame` notches and bumps of the drawn outline in colours that are
    /// on both sides of it. A side that is bent leaves the drawn line along most of its length, a patch of the print
    /// at the border, or a thing behind it, along a part.
    pub fn mended(&self, mut found: Region, frame: &Colours) -> (Region, Vec<Piece>) {
        let mut pieces = Vec::new();
        if self.sides.is_empty() {
            return (found, pieces);
        }
        let (rect, width) = (found.rect, found.rect.width());
        let place = |i: usize| [i % width + rect.x0, i / width + rect.y0];
        let drawn: Vec<f32> = (0..found.inside.len())
            .map(|i| {
                let [x, y] = place(i);
                self.distance.sample(x as f32, y as f32)
            })
            .collect();
        let colour = |i: usize| {
            let [x, y] = place(i);
            frame.at(x, y)
        };
        for inside in [true, false] {
            // Sure colours of the side that a piece goes back to.
            let (mut palette, mut count) = (Palette::new(), 0.0);
            for (i, d) in drawn.iter().enumerate() {
                if found.inside[i] == inside && (if inside { *d } else { -*d }) > SURE {
                    palette.add(colour(i), 1.0);
                    count += 1.0;
                }
            }
            let palette = palette.spread();
            // Without the rim, along which pieces would hang together.
            let here = |d: f32| if inside { d } else { -d };
            let other = found.inside.iter().zip(&drawn).map(|(f, d)| *f != inside && here(*d) > RIM);
            for piece in (Region { rect, inside: other.collect() }).pieces(true) {
                let deep = piece.iter().any(|i| drawn[*i].abs() > SURE);
                let occurs = piece.iter().filter(|i| palette.count(colour(**i)) > OCCURS * count).count();
                if deep
                    && occurs as f64 > ALIKE * piece.len() as f64
                    && self.in_part(&piece, &place, &|i| drawn[i].abs())
                {
                    for i in &piece {
                        let [x, y] = place(*i);
                        let around = (y.saturating_sub(2)..y + 3).flat_map(|y| {
                            (x.saturating_sub(2)..x + 3).filter_map(move |x| index(rect, x, y))
                        });
                        around.filter(|j| here(drawn[*j]) > 0.0).for_each(|j| found.inside[j] = inside);
                    }
                    pieces.push(Piece { at: piece.into_iter().map(place).collect(), inside });
                }
            }
        }
        (found, pieces)
    }

    /// Whether pixels are along a part of a side only.
    fn in_part(
        &self,
        piece: &[usize],
        place: &dyn Fn(usize) -> [usize; 2],
        depth: &dyn Fn(usize) -> f32,
    ) -> bool {
        let at = |i: usize| place(i).map(|v| v as f32);
        let middle = at(piece[piece.len() / 2]);
        let nearest = self.sides.iter().map(|side| (away(middle, *side), side));
        let Some((_, [a, b])) = nearest.reduce(|a, b| if b.0 < a.0 { b } else { a }) else { return false };
        let d = [b[0] - a[0], b[1] - a[1]];
        let square = (d[0] * d[0] + d[1] * d[1]).max(1e-9);
        let along = piece.iter().map(|i| {
            let [x, y] = at(*i);
            ((x - a[0]) * d[0] + (y - a[1]) * d[1]) / square
        });
        let (low, high) = along.fold((f32::MAX, f32::MIN), |(low, high), t| (low.min(t), high.max(t)));
        let deepest = piece.iter().map(|i| depth(*i)).fold(0.0, f32::max);
        high - low < PART && deepest > STEEP * (high - low) * square.sqrt()
    }

    /// How far the outline may be off, inside and outside, at a place `[px]`.
    fn limits(&self, at: [f32; 2], drawn: f32) -> [f32; 2] {
        let nothing_nearer = drawn.abs() > self.whole[0].max(self.whole[1]);
        if self.sides.is_empty() || nothing_nearer {
            return self.whole;
        }
        let nearest = self.sides.iter().map(|side| (away(at, *side), *side));
        let nearest = nearest.reduce(|a, b| if b.0 < a.0 { b } else { a });
        let [a, b] = nearest.map_or([at; 2], |n| n.1);
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        std::array::from_fn(|k| (BENT[k] * length).max(NARROWEST).min(self.whole[k]))
    }
}

/// Distance `[px]` of a place from a side.
fn away([x, y]: [f32; 2], [a, b]: [[f32; 2]; 2]) -> f32 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let along = ((x - a[0]) * d[0] + (y - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]).max(1e-9);
    let t = along.clamp(0.0, 1.0);
    (x - a[0] - t * d[0]).hypot(y - a[1] - t * d[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_of_many_clicks_holds_more_than_one_of_two() {
        // 100 px square; clicks every 10 px along the upper side.
        let rect = Rect { x0: 0, y0: 0, x1: 160, y1: 160 };
        let inside = |i: usize| (30..130).contains(&(i % 160)) && (30..130).contains(&(i / 160));
        let first = Region { rect, inside: (0..160 * 160).map(inside).collect() };
        let mut corners: Vec<[f32; 2]> = (0..=10).map(|k| [29.5 + 10.0 * k as f32, 29.5]).collect();
        corners.extend([[129.5, 129.5], [29.5, 129.5]]);
        let drawn = Drawn::new(&first, &corners, false);
        // A prediction that has lost everything.
        let mut prior = Field::new(rect, -50.0);
        drawn.hold(&mut prior, [8.0, 8.0]);
        let at = |x: f32, y: f32| prior.sample(x, y);
        assert_eq!([at(80.0, 34.0), at(80.0, 37.0)], [-50.0, 8.0], "6 px of the upper side may be off");
        assert_eq!([at(80.0, 110.0), at(80.0, 105.0)], [-50.0, 8.0], "23 px of the lower side may be off");
        // One that has taken in everything.
        let mut prior = Field::new(rect, 50.0);
        drawn.hold(&mut prior, [8.0, 8.0]);
        let at = |x: f32, y: f32| prior.sample(x, y);
        assert_eq!([at(80.0, 25.0), at(80.0, 22.0)], [50.0, -8.0]);
        assert_eq!([at(80.0, 145.0), at(80.0, 149.0)], [50.0, -8.0]);
        assert_eq!(at(80.0, 80.0), 50.0);
    }
}
