//! What is neither the fabric nor the place behind it: hands that hold or cross the fabric, people. Their colours are
//! none of those that the fabric has in the first frame, and they hang together with something beside the fabric
//! that moves before the place behind. What they hide is not in the mask.

use tessuto_core::parallel;

use super::frames::Frames;
use super::palette::Palette;
use super::plate::Plate;
use super::region::{Region, index};
use super::track::Tracked;
use tessuto_core::camera::Rect;

/// Light on the fabric changes its companded colours by these factors.
const GAINS: [f32; 3] = [0.9, 1.0, 1.1];
/// Fraction of the fabric from which on a colour, and those a cell beside it, is one of its own.
const OWN: f64 = 0.03;
/// A pixel that differs so much from the place behind shows something else `[grey levels]`, and by so many deviations
/// of the noise.
const ELSE: (f32, f32) = (22.0, 5.0);
/// Nothing narrower than twice this `[px]`.
const NARROW: f32 = 1.6;
/// Least fraction of the fabric that is hidden.
const LEAST: f64 = 0.004;
/// So near to the outline `[px]` the place behind may never have been seen.
const UNSEEN: f32 = 12.0;
/// It reaches so far beyond the fabric at least, as a fraction of its size: a flap of the fabric's back does not.
const REACH: f32 = 0.12;
/// A colour is theirs if it is more frequent beside the fabric than on it by this factor.
const THEIRS: f64 = 4.0;

/// What is in front of, or beside, the fabric of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Front {
    /// Fraction of the fabric that is hidden.
    pub hidden: f64,
    /// Whether something that is no fabric moves and touches it.
    pub touches: bool,
}

/// Takes what is in front of the fabric out of the regions of all frames, without the first where it `binds`. `noise`:
/// of a channel `[grey levels]`.
pub(super) fn take_out(frames: &Frames, tracked: &mut Tracked, binds: bool, noise: f32) -> Vec<Front> {
    let mut own = Palette::new();
    let first = &tracked.regions[0];
    for i in (0..first.inside.len()).filter(|i| first.inside[*i]) {
        let (x, y) = place(first.rect, i);
        let colour = frames.images[0].at(x, y);
        GAINS.iter().for_each(|g| own.add(colour.map(|c| g * c), 1.0));
    }
    let own = own.spread();
    let area = first.area().max(1) as f64;
    let own = |colour: [f32; 3]| f64::from(own.count(colour)) / area;
    let found: Vec<(Region, Front)> = parallel::map(frames.images.len(), |n| {
        of_frame(frames, n, &tracked.regions[n], &tracked.plate, &own, noise)
    });
    let (mut regions, mut fronts): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    if binds {
        regions[0] = tracked.regions[0].clone();
        fronts[0].hidden = 0.0;
    }
    tracked.regions = regions;
    fronts
}

fn place(rect: Rect, i: usize) -> (usize, usize) {
    (i % rect.width() + rect.x0, i / rect.width() + rect.y0)
}

fn of_frame(
    frames: &Frames,
    n: usize,
    region: &Region,
    plate: &Plate,
    own: &dyn Fn([f32; 3]) -> f64,
    noise: f32,
) -> (Region, Front) {
    let image = &frames.images[n];
    let area = region.area();
    let size = (area as f32).sqrt();
    let rect = region.bounds().unwrap_or(region.rect).padded((0.25 * size) as usize + 8, frames.size);
    let distance = region.signed_distance(rect);
    let colour = |i: usize| {
        let (x, y) = place(rect, i);
        image.at(x, y)
    };
    // Whether something else is before the place behind; none where that was never seen.
    let moved = |i: usize| {
        let (x, y) = place(rect, i);
        let (behind, sure, _) = plate.at(x, y);
        let limit = ELSE.0.max(ELSE.1 * noise);
        (sure > 0.5).then(|| (0..3).any(|c| (image.at(x, y)[c] - behind[c]).abs() > limit))
    };
    let strange = (0..distance.data.len())
        .map(|i| (distance.data[i] > 0.0 || moved(i).unwrap_or(true)) && own(colour(i)) < OWN);
    let strange = opened(Region { rect, inside: strange.collect() });
    let mut front = Front::default();
    let mut visible = region.clone();
    for piece in strange.pieces(true) {
        let is_beside = |i: &usize| distance.data[*i] <= 0.0 && moved(*i) == Some(true);
        let beside: Vec<usize> = piece.iter().copied().filter(is_beside).collect();
        let far = beside.iter().map(|i| -distance.data[*i]).fold(0.0, f32::max);
        if far < REACH * size {
            continue;
        }
        front.touches |= piece.iter().any(|i| distance.data[*i] > -2.0);
        let mut theirs = Palette::new();
        beside.iter().for_each(|i| theirs.add(colour(*i), 1.0));
        let theirs = theirs.spread();
        let is_theirs = |i: &usize| {
            let fraction = f64::from(theirs.count(colour(*i))) / beside.len() as f64;
            fraction > THEIRS * own(colour(*i)).max(LEAST)
        };
        let mut both = Region { rect, inside: vec![false; distance.data.len()] };
        beside.iter().for_each(|i| both.inside[*i] = true);
        // Where the place behind was never seen, between what is beside and what is within.
        let within = piece.iter().filter(|i| distance.data[**i] > -UNSEEN && is_theirs(i));
        within.for_each(|i| both.inside[*i] = true);
        let both = opened(both);
        let hanging = both.pieces(true).into_iter().filter(|p| p.iter().any(|i| distance.data[*i] < -UNSEEN));
        let inside: Vec<usize> = hanging.flatten().filter(|i| distance.data[*i] > 0.0).collect();
        if (inside.len() as f64) < LEAST * area as f64 {
            continue;
        }
        front.hidden += inside.len() as f64 / area.max(1) as f64;
        for i in inside {
            let (x, y) = place(rect, i);
            if let Some(j) = index(visible.rect, x, y) {
                visible.inside[j] = false;
            }
        }
    }
    (visible, front)
}

/// Without what is narrow.
fn opened(region: Region) -> Region {
    let rect = region.rect;
    let deep = region.signed_distance(rect);
    let core = Region { rect, inside: deep.data.iter().map(|d| *d > NARROW).collect() };
    let near = core.signed_distance(rect);
    let inside = region.inside.iter().zip(&near.data).map(|(inside, d)| *inside && *d > -NARROW - 0.5);
    Region { rect, inside: inside.collect() }
}
