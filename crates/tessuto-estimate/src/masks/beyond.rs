//! What reaches beyond the drawn outline in the first frame may be fabric that bulges there, or something behind
//! in the same colours, or a shadow. Motion shows it: the outline of fabric goes along with it, that of other things
//! stays where it is.

use super::flow::Flow;
use super::region::{Field, Region};
use super::segment::{CERTAIN, Mark};

/// So far beyond the drawn outline `[px]` clicks may be wrong.
const BEYOND: f32 = 2.5;
/// The fabric must have moved so far across an outline `[px]`, or nothing can be decided.
const MOVED: f32 = 3.0;
/// Within this many frames.
pub(super) const FRAMES: usize = 16;
/// Step along the outline between the places that are looked at `[px]`.
const STRIDE: usize = 3;
/// The outline has stayed where it is nearer to where it was than to where the motion has led by this factor.
const NEARER: f32 = 0.5;
/// Places of the outline so near count, as a fraction of the fabric's size and at least `[px]`; this many are needed.
const AROUND: (f32, f32) = (0.08, 12.0);
const LEAST: usize = 5;
/// Step between the marks `[px]`, either way.
const GRID: usize = 4;

/// A place of the first frame's outline: how often it has stayed, of the times that can be judged.
struct Place {
    at: [f32; 2],
    stayed: f32,
}

/// Marks in the first frame, where what was found beyond the outline that was drawn stays behind when the fabric moves.
/// `distances`: to the outlines of the first frames, positive inside; `flows`: between them.
pub(super) fn behind(drawn: &Region, distances: &[Field], flows: &[Flow]) -> Vec<Mark> {
    let first = &distances[0];
    let (rect, w) = (first.rect, first.rect.width());
    let beyond = drawn.signed_distance(rect);
    let places = places(distances, &beyond, flows);
    let area = first.data.iter().filter(|d| **d > 0.0).count();
    let reach = (AROUND.0 * (area as f32).sqrt()).max(AROUND.1);
    let grid =
        (rect.y0..rect.y1).step_by(GRID).flat_map(|y| (rect.x0..rect.x1).step_by(GRID).map(move |x| [x, y]));
    let stays_behind = |[x, y]: [usize; 2]| {
        let i = (y - rect.y0) * w + x - rect.x0;
        if first.data[i] <= 0.0 || beyond.data[i] > -BEYOND - CERTAIN {
            return false;
        }
        let near = places.iter().filter(|p| (p.at[0] - x as f32).hypot(p.at[1] - y as f32) < reach);
        let (stayed, all) = near.fold((0.0, 0), |(sum, all), p| (sum + p.stayed, all + 1));
        all >= LEAST && stayed > 0.5 * all as f32
    };
    grid.filter(|at| stays_behind(*at)).map(|at| Mark { at: at.map(|v| v as f32), inside: false }).collect()
}

/// Places of the first outline beyond the drawn one across which the fabric moves.
fn places(distances: &[Field], beyond: &Field, flows: &[Flow]) -> Vec<Place> {
    let first = &distances[0];
    let (rect, w) = (first.rect, first.rect.width());
    let outline = (0..first.data.len()).filter(|i| (0.0..1.0).contains(&first.data[*i]));
    let places = outline.step_by(STRIDE).filter(|i| beyond.data[*i] < -BEYOND).filter_map(|i| {
        let at = [(i % w + rect.x0) as f32, (i / w + rect.y0) as f32];
        stayed(at, distances, flows).map(|stayed| Place { at, stayed })
    });
    places.collect()
}

/// Follows the motion from a place of the first outline: of the frames in which it has led far enough across, the
/// fraction in which the outline is where it was, rather than where the motion has led. `None` where it never
/// leads so far.
fn stayed([x, y]: [f32; 2], distances: &[Field], flows: &[Flow]) -> Option<f32> {
    let first = &distances[0];
    let slope = [
        first.sample(x + 1.0, y) - first.sample(x - 1.0, y),
        first.sample(x, y + 1.0) - first.sample(x, y - 1.0),
    ];
    let length = slope[0].hypot(slope[1]).max(1e-3);
    let (mut px, mut py) = (x, y);
    let (mut told, mut stayed) = (0, 0);
    for (flow, there) in flows.iter().zip(&distances[1..]) {
        let d = flow.at(px, py);
        (px, py) = (px + d[0], py + d[1]);
        let across = ((px - x) * slope[0] + (py - y) * slope[1]) / length;
        if across.abs() < MOVED {
            continue;
        }
        told += 1;
        stayed += usize::from(there.sample(x, y).abs() < NEARER * there.sample(px, py).abs());
    }
    (told > 0).then(|| stayed as f32 / told as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::Rect;

    /// Marks of a square that moves by 2 px a frame to the left, and reaches beyond the drawn outline by a block
    /// that stands still or goes along.
    fn marks(block_moves: bool) -> Vec<Mark> {
        let size = [160, 120];
        let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
        let region = |inside: &dyn Fn(usize, usize) -> bool| Region {
            rect,
            inside: (0..size[0] * size[1]).map(|i| inside(i % size[0], i / size[0])).collect(),
        };
        let square =
            |n: usize, x: usize, y: usize| (50 - 2 * n..110 - 2 * n).contains(&x) && (30..90).contains(&y);
        let distance = |n: usize| {
            let left = if block_moves { 2 * n } else { 0 };
            let found = region(&|x, y| {
                square(n, x, y) || ((100 - left..125 - left).contains(&x) && (40..70).contains(&y))
            });
            found.signed_distance(rect)
        };
        let distances: Vec<Field> = (0..10).map(distance).collect();
        let flows: Vec<Flow> = (0..9).map(|_| Flow::uniform(rect, [-2.0, 0.0])).collect();
        behind(&region(&|x, y| square(0, x, y)), &distances, &flows)
    }

    #[test]
    fn what_stays_where_it_is_is_marked_and_what_goes_along_is_not() {
        let still = marks(false);
        assert!(still.len() >= 8, "{still:?}");
        for mark in still {
            assert!(
                !mark.inside && (115.0..125.0).contains(&mark.at[0]) && (40.0..70.0).contains(&mark.at[1])
            );
        }
        assert!(marks(true).is_empty());
    }
}
