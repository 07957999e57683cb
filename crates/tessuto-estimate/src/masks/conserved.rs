//! Fabric neither comes nor goes: followed along its motion, what is fabric in one frame is fabric in those before
//! and after. What comes from outside of the outline and goes there again was never fabric: somebody who walks
//! past behind.

use tessuto_core::parallel;

use super::frames::Frames;
use super::region::Field;
use super::track::Tracked;

/// It is followed for this many frames, ahead and back.
const FRAMES: usize = 8;
/// So far outside of the outline, as a fraction of the fabric's size and of the way that was followed, it is outside.
const OUTSIDE: (f32, f32) = (0.012, 0.3);
/// Step between the pixels that are followed, either way.
const STRIDE: usize = 3;
/// Fabric that turns is followed badly near its outline: what it shows counts less and less where its image grows
/// or shrinks by more than this fraction, and by as much again not at all.
const TURNS: (f64, f64) = (0.1, 0.1);
/// Depth inside of the outline from which that is measured, as a fraction of the fabric's size.
const DEEP: f32 = 0.1;
/// A place looks the same within this difference of a channel `[grey levels]`, and so many deviations.
const ALIKE: (f32, f32) = (8.0, 4.0);
/// What one direction alone shows, near the ends of the clip, is believed by half: folds open and close.
const ALONE: f64 = 0.5;

/// Fraction of each frame's mask that comes from outside of the outline and goes there. `distances`: to the
/// outlines `[px]`, positive inside; `noise`: of a channel `[grey levels]`.
pub(super) fn comes_and_goes(
    frames: &Frames,
    tracked: &Tracked,
    distances: &[Field],
    noise: f32,
) -> Vec<f64> {
    parallel::map(distances.len(), |n| {
        let told = [true, false].map(|ahead| outside(frames, tracked, distances, (n, ahead), noise));
        match told {
            [Some(goes), Some(comes)] => goes.min(comes),
            [Some(one), None] | [None, Some(one)] => ALONE * one,
            [None, None] => 0.0,
        }
    })
}

/// Fraction of the mask of frame `n` that is outside of the outline some frames on. `None` where the clip ends before.
fn outside(
    frames: &Frames,
    tracked: &Tracked,
    distances: &[Field],
    (n, ahead): (usize, bool),
    noise: f32,
) -> Option<f64> {
    let other = if ahead { n + FRAMES } else { n.checked_sub(FRAMES)? };
    let there = distances.get(other)?;
    let own = &distances[n];
    let (rect, w) = (own.rect, own.rect.width());
    let size = (own.data.iter().filter(|d| **d > 0.0).count() as f32).sqrt();
    let (mut all, mut outside) = (0_usize, 0_usize);
    let mut extents = [Extent::default(); 2];
    // Fabric that lies still, and is plain: the motion of the rest of it was carried there.
    let limit = ALIKE.0.hypot(ALIKE.1 * noise);
    let rests = |x: usize, y: usize| {
        let (now, then) = (frames.images[n].at(x, y), frames.images[other].at(x, y));
        (0..3).all(|c| (now[c] - then[c]).abs() < limit)
    };
    for y in (rect.y0..rect.y1).step_by(STRIDE) {
        for x in (rect.x0..rect.x1).step_by(STRIDE) {
            let depth = own.data[(y - rect.y0) * w + x - rect.x0];
            if depth <= 0.0 {
                continue;
            }
            let (from, mut at) = ([x as f32, y as f32], [x as f32, y as f32]);
            for k in 0..FRAMES {
                let d = match ahead {
                    true => tracked.flows[n + k].at(at[0], at[1]),
                    false => tracked.flows[n - 1 - k].to(at[0], at[1]).map(|v| -v),
                };
                at = [at[0] + d[0], at[1] + d[1]];
            }
            let way = (at[0] - from[0]).hypot(at[1] - from[1]);
            if depth > DEEP * size {
                extents[0].add(from);
                extents[1].add(at);
            }
            all += 1;
            let goes = there.sample(at[0], at[1]) < -(OUTSIDE.0 * size).max(OUTSIDE.1 * way);
            outside += usize::from(goes && !(there.sample(from[0], from[1]) > 0.0 && rests(x, y)));
        }
    }
    let grown = extents[1].area() / extents[0].area().max(1e-9);
    let turned = ((grown.max(1.0 / grown) - 1.0 - TURNS.0) / TURNS.1).clamp(0.0, 1.0);
    Some((1.0 - turned) * outside as f64 / all.max(1) as f64)
}

/// Moments of points of the image.
#[derive(Debug, Clone, Copy, Default)]
struct Extent {
    count: f64,
    sum: [f64; 2],
    squares: [f64; 3],
}

impl Extent {
    fn add(&mut self, [x, y]: [f32; 2]) {
        let (x, y) = (f64::from(x), f64::from(y));
        self.count += 1.0;
        self.sum = [self.sum[0] + x, self.sum[1] + y];
        self.squares = [self.squares[0] + x * x, self.squares[1] + y * y, self.squares[2] + x * y];
    }

    /// Proportional to the area over which the points are spread `[px²]`.
    fn area(&self) -> f64 {
        let n = self.count.max(1.0);
        let [x, y] = self.sum.map(|s| s / n);
        let [xx, yy, xy] =
            [self.squares[0] / n - x * x, self.squares[1] / n - y * y, self.squares[2] / n - x * y];
        (xx * yy - xy * xy).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::flow::Flow;
    use crate::masks::frames::Colours;
    use crate::masks::plate::Plate;
    use crate::masks::region::Region;
    use tessuto_core::camera::Rect;

    /// A square that moves by 2 px a frame, to whose mask something is added in frames 12 to 15.
    #[test]
    fn what_comes_and_goes_is_told_from_the_fabric() {
        let size = [160, 120];
        let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
        let inside = |n: usize, x: usize, y: usize| {
            let square = (20 + 2 * n..80 + 2 * n).contains(&x) && (30..80).contains(&y);
            square || ((12..16).contains(&n) && (60..100).contains(&x) && (80..100).contains(&y))
        };
        let region = |n: usize| Region {
            rect,
            inside: (0..size[0] * size[1]).map(|i| inside(n, i % size[0], i / size[0])).collect(),
        };
        let regions: Vec<Region> = (0..30).map(region).collect();
        let distances: Vec<Field> = regions.iter().map(|r| r.signed_distance(rect)).collect();
        let flows = (0..29).map(|_| Flow::uniform(rect, [2.0, 0.0])).collect();
        let tracked = Tracked { regions, evidence: distances.clone(), flows, plate: Plate::unknown(size) };
        let image = || Colours { width: size[0], data: vec![0; 3 * size[0] * size[1]] };
        let frames = Frames { size, factor: 1, images: (0..30).map(|_| image()).collect() };
        for (n, fraction) in comes_and_goes(&frames, &tracked, &distances, 1.0).into_iter().enumerate() {
            // 800 px of 3800, less a rim.
            let expected = if (12..16).contains(&n) { 0.12..0.22 } else { 0.0..1e-9 };
            assert!(expected.contains(&fraction), "frame {n}: {fraction}");
        }
    }
}
