//! What motion says about an outline. Things behind in the fabric's colours deceive every frame alike, and the
//! evidence of colours is clear on either side of them; but the fabric moves, and their outline stands still.

use rayon::prelude::*;
use tessuto_core::parallel;

use super::frames::Frames;
use super::region::{Field, index};
use super::track::Tracked;

/// The fabric must have moved so far across the outline `[px]`, or nothing can be decided.
const MOVED: f32 = 3.0;
/// Within this many frames, ahead or back.
const FRAMES: usize = 16;
/// Step along the outline between the places that are looked at `[px]`.
const STRIDE: usize = 3;
/// How near the outline of the other frame is to where it was `[px]`, and how far at least from where the motion
/// has led.
const STAYED: [f32; 2] = [1.0, 2.0];
/// In this fraction of the clip's frames the outline is so near `[px]`.
const OFTEN: f64 = 0.5;
const NEAR: f32 = 1.6;
/// What is so near to the border of the image `[px]` leaves it; that is another matter.
const BORDER: f32 = 8.0;
/// The outline that was drawn is right within this distance `[px]` of it, where what lies this deep inside of it `[px]`
/// looks as in the first frame: within this difference of a channel `[grey levels]`, and so many deviations.
const DRAWN: f32 = 3.0;
const DEPTHS: [f32; 5] = [2.0, 4.0, 6.0, 10.0, 14.0];
const ALIKE: (f32, f32) = (8.0, 4.0);
/// What deceives one frame deceives those around: means over this many before and after.
const AROUND: usize = 5;

/// What the first frame says about an outline that rests.
pub(super) struct Rest<'a> {
    /// Distances `[px]` to the outline that was given, and to the one that was found from it.
    pub drawn: &'a Field,
    pub found: &'a Field,
    /// Of a channel `[grey levels]`.
    pub noise: f32,
}

/// How much of every frame's mask is wrong at least, as a fraction: where the outline stands still, so far as the
/// fabric moves across it. `distances`: to the outlines, positive inside.
pub(super) fn standing_still(
    frames: &Frames,
    tracked: &Tracked,
    distances: &[Field],
    drawn: &Rest,
) -> Vec<f64> {
    let often = often(frames, distances);
    let own: Vec<f64> =
        parallel::map(distances.len(), |n| of_frame(frames, tracked, distances, (&often, drawn), n));
    let around = |n: usize| &own[n.saturating_sub(AROUND)..(n + AROUND + 1).min(own.len())];
    (0..own.len()).map(|n| around(n).iter().sum::<f64>() / around(n).len() as f64).collect()
}

/// Where the outline is in so much of the clip. A fabric that turns away from the camera moves across its own
/// outline, too, but not for long.
fn often(frames: &Frames, distances: &[Field]) -> Vec<bool> {
    let [width, height] = frames.size;
    let least = OFTEN * distances.len() as f64;
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        (0..width).map(move |x| {
            let there =
                distances.iter().filter(|d| index(d.rect, x, y).is_some_and(|i| d.data[i].abs() < NEAR));
            there.count() as f64 >= least
        })
    });
    rows.collect()
}

/// Whether a place of the outline is where it was in the first frame, and the print beside it rests, too: a half that
/// lies on a table.
fn rests(frames: &Frames, drawn: &Rest, n: usize, at: [f32; 2], inward: [f32; 2]) -> bool {
    let off = drawn.found.sample(at[0], at[1]).abs();
    if off > DRAWN || drawn.drawn.sample(at[0], at[1]).abs() > DRAWN {
        return false;
    }
    let limit = ALIKE.0.hypot(ALIKE.1 * drawn.noise);
    DEPTHS.iter().all(|depth| {
        let [x, y] = [at[0] + depth * inward[0], at[1] + depth * inward[1]];
        let (first, now) = (frames.images[0].sample(x, y), frames.images[n].sample(x, y));
        (0..3).all(|c| (first[c] - now[c]).abs() < limit)
    })
}

fn of_frame(
    frames: &Frames,
    tracked: &Tracked,
    distances: &[Field],
    (often, drawn): (&[bool], &Rest),
    n: usize,
) -> f64 {
    let distance = &distances[n];
    let rect = distance.rect;
    let w = rect.width();
    let last = frames.size.map(|s| (s - 1) as f32 - BORDER);
    let area = distance.data.iter().filter(|d| **d > 0.0).count();
    let mut still = 0.0;
    let outline = (0..distance.data.len()).filter(|i| (0.0..1.0).contains(&distance.data[*i]));
    for i in outline.step_by(STRIDE) {
        let [x, y] = [(i % w + rect.x0) as f32, (i / w + rect.y0) as f32];
        if x < BORDER || y < BORDER || x > last[0] || y > last[1] {
            continue;
        }
        let slope = [
            distance.sample(x + 1.0, y) - distance.sample(x - 1.0, y),
            distance.sample(x, y + 1.0) - distance.sample(x, y - 1.0),
        ];
        let length = slope[0].hypot(slope[1]).max(1e-3);
        let inward = slope.map(|s| s / length);
        if !often[y as usize * frames.size[0] + x as usize] || rests(frames, drawn, n, [x, y], inward) {
            continue;
        }
        // Both ways, where both show something.
        let led = [true, false].map(|ahead| led(tracked, distances, n, [x, y], inward, ahead));
        let least = led.iter().flatten().copied().reduce(f32::min);
        if least.is_some_and(|l| l > 0.0) {
            still += led.into_iter().flatten().fold(0.0, f32::max) * STRIDE as f32;
        }
    }
    f64::from(still) / area.max(1) as f64
}

/// Follows the motion from a place of the outline: how far it leads across `[px]` while the outline is there still
/// where it was; 0 if the outline goes along. `None` where the motion never leads far enough to decide.
fn led(
    tracked: &Tracked,
    distances: &[Field],
    n: usize,
    [x, y]: [f32; 2],
    inward: [f32; 2],
    ahead: bool,
) -> Option<f32> {
    let (mut px, mut py, mut m) = (x, y, n);
    let mut farthest = None;
    for _ in 0..FRAMES {
        let d = match ahead {
            true => tracked.flows.get(m).map(|flow| flow.at(px, py)),
            false => m.checked_sub(1).map(|before| tracked.flows[before].to(px, py).map(|v| -v)),
        };
        let Some(d) = d else { break };
        (px, py) = (px + d[0], py + d[1]);
        m = if ahead { m + 1 } else { m - 1 };
        let there = &distances[m];
        let stayed = there.sample(x, y).abs();
        let off = there.sample(px, py).abs();
        let across = ((px - x) * inward[0] + (py - y) * inward[1]).abs();
        match farthest {
            None if across < MOVED => {}
            None if stayed < STAYED[0] && off > STAYED[1] => farthest = Some(across.min(off)),
            None => return Some(0.0),
            Some(far) if stayed < NEAR => farthest = Some(across.min(off).max(far)),
            Some(_) => break,
        }
    }
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::flow::Flow;
    use crate::masks::plate::Plate;
    use crate::masks::region::Region;
    use tessuto_core::camera::Rect;

    /// Fractions that stand still, of a square that moves by 2 px a frame, with or without something behind it
    /// that is treated as a part of it.
    fn fractions(behind: bool) -> Vec<f64> {
        let size = [160, 120];
        let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
        let inside = |n: usize, x: usize, y: usize| {
            let square = (30 + 2 * n..90 + 2 * n).contains(&x) && (30..80).contains(&y);
            square || (behind && (60..100).contains(&x) && (15..50).contains(&y))
        };
        let region = |n: usize| Region {
            rect,
            inside: (0..size[0] * size[1]).map(|i| inside(n, i % size[0], i / size[0])).collect(),
        };
        let regions: Vec<Region> = (0..10).map(region).collect();
        let distances: Vec<Field> = regions.iter().map(|r| r.signed_distance(rect)).collect();
        let flows = (0..9).map(|_| Flow::uniform(rect, [2.0, 0.0])).collect();
        let tracked = Tracked { regions, evidence: distances.clone(), flows, plate: Plate::unknown(size) };
        let frames = Frames { size, factor: 1, images: Vec::new() };
        // Drawn far away: nothing of the outline is known to be right.
        let far = Field::new(rect, -99.0);
        let rest = Rest { drawn: &far, found: &far, noise: 1.0 };
        standing_still(&frames, &tracked, &distances, &rest)
    }

    #[test]
    fn what_stands_still_behind_is_seen_and_the_fabric_is_not() {
        let alone = fractions(false);
        assert!(alone.iter().all(|f| *f < 0.003), "{alone:?}");
        // Both upright sides of what is behind, 15 px of height and more, across which the fabric moves by up to
        // 18 px, of 3500 px.
        let with = fractions(true);
        assert!(with.iter().all(|f| (0.03..0.25).contains(f)), "{with:?}");
    }
}
