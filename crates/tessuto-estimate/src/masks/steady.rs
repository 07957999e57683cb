//! Whether the clip is what masks can be made of: one take of a camera that stands still.

use tessuto_core::parallel;

use super::flow::{Window, outside};
use super::frames::Frames;
use super::region::Region;
use tessuto_core::camera::Rect;

/// A pixel that differs by more `[grey levels]` shows something else.
const ELSE: f32 = 24.0;
/// Fraction of the surroundings that shows something else from one frame to the next after a cut.
const CUT: f64 = 0.5;
/// Shifts of the surroundings `[px]` of an image of 640 columns: doubtful, and too much.
const SHAKEN: f32 = 1.5;
const MOVED: f32 = 6.0;
/// Where the camera stands still, so does this fraction of the textured surroundings in the left quarter of the image
/// and in the right one, of this many windows each at least: people sway, and cover most of the place between.
const STILL: (f64, usize) = (0.15, 4);
const SIDE: f32 = 0.25;
/// Windows agree on a motion within this, of a shift and `[px]` of an image of 640 columns.
const AGREE: (f32, f32) = (0.2, 1.5);
/// Fraction of the surroundings whose motion is worth a note.
const SWAYING: f64 = 0.2;
/// Frames at which the shift is looked at, before the one in which it begins is looked for.
const LOOKS: usize = 16;

/// What the surroundings of the fabric do.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Steadiness {
    /// The frame before which everything changes.
    pub cut: Option<usize>,
    /// First frame whose surroundings are too far from those of the first, and how far `[px]` of the recording.
    pub moved: Option<(usize, f32)>,
    /// The frame with the largest smaller shift that is seen.
    pub shaken: Option<(usize, f32)>,
    /// The frame in which the largest part of the surroundings moves while the rest stands still, and that part.
    pub swaying: Option<(usize, f64)>,
}

/// What the textured surroundings did since the first frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shift {
    /// Of the whole `[px]`: of what stands still if that is enough, else of the most that agree.
    pixels: f32,
    /// Fraction that moves by too much while the rest stands still.
    swaying: f64,
}

/// The shift of the whole, from those of windows of an image so many `columns` wide.
fn shift(windows: &[Window], columns: usize) -> Shift {
    let unit = columns as f32 / 640.0;
    let length = |d: &[f32; 2]| d[0].hypot(d[1]);
    let median = |mut lengths: Vec<f32>| {
        lengths.sort_by(f32::total_cmp);
        lengths[lengths.len() / 2]
    };
    let is_still = |w: &&Window| w.moved.is_some_and(|d| length(&d) <= SHAKEN * unit);
    // What is not found again does not stand still.
    let side_is_still = |right: bool| {
        let place = |w: &Window| if right { columns as f32 - w.at[0] } else { w.at[0] };
        let side: Vec<&Window> = windows.iter().filter(|w| place(w) < SIDE * columns as f32).collect();
        let still = side.iter().filter(|w| is_still(w)).count();
        side.len() >= STILL.1 && still as f64 >= STILL.0 * side.len() as f64
    };
    let moved: Vec<[f32; 2]> = windows.iter().filter_map(|w| w.moved).collect();
    if side_is_still(false) && side_is_still(true) {
        let still = moved.iter().map(length).filter(|l| *l <= SHAKEN * unit).collect();
        let away = windows.iter().filter(|w| w.moved.is_none_or(|d| length(&d) > MOVED * unit)).count();
        return Shift { pixels: median(still), swaying: away as f64 / windows.len() as f64 };
    }
    let agree = |a: &[f32; 2]| {
        let near = AGREE.0 * length(a) + AGREE.1 * unit;
        moved.iter().filter(|b| (a[0] - b[0]).hypot(a[1] - b[1]) < near).count()
    };
    let most = moved.iter().map(|d| (agree(d), d)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    let clear = most.filter(|(count, _)| 2 * count > moved.len()).map(|(_, d)| length(d));
    // Turned or moved near things: no two windows agree, and none stands still.
    Shift { pixels: clear.unwrap_or_else(|| median(moved.iter().map(length).collect())), swaying: 0.0 }
}

/// Looks at what is outside of `fabric`, the region in the first frame. `noise`: of a channel `[grey levels]`.
pub(super) fn steadiness(frames: &Frames, fabric: &Region, noise: f32) -> Steadiness {
    let [width, height] = frames.size;
    let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };
    let margin = (fabric.area() as f32).sqrt() * 0.15;
    let near = fabric.signed_distance(rect);
    let near = Region { rect, inside: near.data.iter().map(|d| *d > -margin).collect() };
    let changes: Vec<f64> = parallel::later(&frames.images, |(n, _)| changed(frames, n, &near));
    // Everything changes once, not all the time as in a clip of flashing lights.
    let cut = (0..changes.len()).find(|k| {
        let around = [k.checked_sub(1), Some(k + 1)];
        let before_and_after = around.into_iter().flatten().filter_map(|j| changes.get(j));
        changes[*k] > CUT && before_and_after.into_iter().all(|c| *c < 0.5 * changes[*k])
    });
    if let Some(cut) = cut {
        return Steadiness { cut: Some(cut + 1), ..Steadiness::default() };
    }
    let unit = width as f32 / 640.0;
    let of = |n: usize| {
        let windows = outside(&frames.images[0], &frames.images[n], &near, rect, noise)?;
        Some((n, shift(&windows, width)))
    };
    let last = frames.images.len() - 1;
    let looked: Vec<usize> =
        (1..=last).filter(|n| n % last.div_ceil(LOOKS).max(1) == 0 || *n == last).collect();
    let shifts: Vec<(usize, Shift)> = parallel::filter_map(looked.len(), |k| of(looked[k]));
    let recorded = |(n, s): (usize, Shift)| (n, s.pixels * frames.factor as f32);
    let moved = shifts.iter().find(|(_, s)| s.pixels > MOVED * unit).copied();
    // Frames between two that were looked at.
    let first = moved.and_then(|(n, _)| {
        (n.saturating_sub(last / LOOKS).max(1)..=n).filter_map(of).find(|(_, s)| s.pixels > MOVED * unit)
    });
    let moved = first.or(moved).map(recorded);
    let most = shifts.iter().copied().max_by(|a, b| a.1.pixels.total_cmp(&b.1.pixels));
    let shaken = most.filter(|(_, s)| s.pixels > SHAKEN * unit).map(recorded).filter(|_| moved.is_none());
    let swaying = shifts.iter().map(|(n, s)| (*n, s.swaying)).reduce(|a, b| if b.1 > a.1 { b } else { a });
    Steadiness { cut: None, moved, shaken, swaying: swaying.filter(|s| s.1 > SWAYING) }
}

/// Fraction of the surroundings that looks otherwise than in the frame before.
fn changed(frames: &Frames, n: usize, near: &Region) -> f64 {
    let [width, height] = frames.size;
    let (a, b) = (&frames.images[n - 1], &frames.images[n]);
    let (mut other, mut all) = (0_usize, 0_usize);
    for y in (0..height).step_by(4) {
        for x in (0..width).step_by(4).filter(|x| !near.at(*x, y)) {
            let (p, q) = (a.at(x, y), b.at(x, y));
            all += 1;
            other += usize::from((0..3).any(|c| (p[c] - q[c]).abs() > ELSE));
        }
    }
    other as f64 / all.max(1) as f64
}

/// Where things move: the fraction of the region's pixels that ever change, and the middle of what changes
/// elsewhere, with the fraction of the image that it is. What changes beside the region is its own border at work,
/// of plain cloth all that is seen to move, and counts neither way.
pub(super) fn movement(frames: &Frames, fabric: &Region, noise: f32) -> (f64, Option<([f32; 2], f64)>) {
    let [width, height] = frames.size;
    let limit = (8.0 * noise).max(ELSE);
    let stride = frames.images.len().div_ceil(12).max(1);
    let beside =
        fabric.bounds().map(|r| r.padded(r.width().max(r.height()).div_ceil(10).max(4), frames.size));
    let is_beside =
        |x: usize, y: usize| beside.is_some_and(|r| (r.x0..r.x1).contains(&x) && (r.y0..r.y1).contains(&y));
    let rows: Vec<[f64; 6]> = parallel::map(height.div_ceil(3), |row| {
        let y = 3 * row;
        let mut sums = [0.0; 6];
        for x in (0..width).step_by(3) {
            let first = frames.images[0].at(x, y);
            let changes = frames.images.iter().step_by(stride).skip(1).any(|image| {
                let now = image.at(x, y);
                (0..3).any(|c| (now[c] - first[c]).abs() > limit)
            });
            let inside = fabric.at(x, y);
            let changes = f64::from(u8::from(changes && (inside || !is_beside(x, y))));
            if inside {
                sums[0] += changes;
                sums[1] += 1.0;
            } else {
                sums[2] += changes;
                sums[3] += 1.0;
                sums[4] += changes * x as f64;
                sums[5] += changes * y as f64;
            }
        }
        sums
    });
    let mut sums = [0.0; 6];
    rows.iter().for_each(|row| (0..6).for_each(|k| sums[k] += row[k]));
    let middle = [sums[4], sums[5]].map(|s| (s / sums[2].max(1.0)) as f32 * frames.factor as f32);
    let elsewhere = sums[2] / (sums[1] + sums[3]).max(1.0);
    (sums[0] / sums[1].max(1.0), (sums[2] > 0.0).then_some((middle, elsewhere)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows every 20 px of a wall of 640×480 px before which somebody covers columns 140 to 500; how both moved.
    fn windows(wall: Option<[f32; 2]>, somebody: Option<[f32; 2]>) -> Vec<Window> {
        let at = (0..32 * 24).map(|k| [20 * (k % 32) + 10, 20 * (k / 32) + 10].map(|v| v as f32));
        let moved = |x: f32| if (140.0..500.0).contains(&x) { somebody } else { wall };
        at.map(|at| Window { at, moved: moved(at[0]) }).collect()
    }

    #[test]
    fn the_camera_stands_still_where_both_sides_do() {
        let sways = shift(&windows(Some([0.1, 0.0]), Some([14.0, 3.0])), 640);
        assert!(sways.pixels < 0.2 && (0.5..0.6).contains(&sways.swaying), "{sways:?}");
        // Somebody whom the camera follows, the wall still found, and found by a few windows only.
        let pans = windows(Some([-9.0, 0.0]), None);
        assert_eq!(shift(&pans, 640), Shift { pixels: 9.0, swaying: 0.0 });
        let mut followed = windows(Some([-9.0, 0.0]), Some([0.0; 2]));
        followed.retain(|w| !(140.0..500.0).contains(&w.at[0]) || w.at[1] < 240.0);
        assert_eq!(shift(&followed, 640).pixels, 9.0);
        let turns = windows(None, Some([0.0; 2]));
        assert_eq!(shift(&turns, 640).swaying, 0.0, "what is not found again does not stand still");
    }

    #[test]
    fn one_side_alone_says_nothing() {
        let mut half = windows(Some([0.0; 2]), Some([20.0, 0.0]));
        half.iter_mut().filter(|w| w.at[0] > 320.0).for_each(|w| w.moved = Some([20.0, 0.0]));
        assert_eq!(shift(&half, 640), Shift { pixels: 20.0, swaying: 0.0 });
    }
}
