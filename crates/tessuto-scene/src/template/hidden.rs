//! Corners of a rectangle of fabric that something hides, such as a finger: they are where the neighbouring sides meet,
//! if these are straight.
//!
//! Each side's line is the one that explains most points of the outline between two corners, so that a cut corner does
//! not count. A side is straight if these are enough ([`FEWEST`]) and bend by no more than [`BENT`]. Sides of a bent
//! sheet, and those that a lens bends, are not, and their corners stay as they were found. A corner is hidden if its
//! lines meet off the fabric, farther than [`CUT`] from the outline.

use glam::DVec2;

/// A point this near to a line is on it: `[px]`, and as a fraction of the side.
const ON_LINE: (f64, f64) = (1.0, 0.002);
/// The least fraction of a side's points on the line.
const FEWEST: f64 = 0.4;
/// The most by which the mean heights of a line's five parts may differ: `[px]`, and as a fraction of the side.
const BENT: (f64, f64) = (0.5, 0.002);
const PARTS: usize = 5;
/// A corner is hidden farther from the outline than this: `[px]`, and as a fraction of the mean side.
const CUT: (f64, f64) = (3.0, 0.02);
/// And nearer than this fraction of the mean side.
const FAR: f64 = 0.25;
/// Points between which lines are tried, and points that judge them.
const TRIED: usize = 32;
const JUDGES: usize = 200;

/// Corners of which some are hidden.
#[derive(Debug, Clone)]
pub struct Mended {
    /// In the order of those that were found `[px]`.
    pub corners: [DVec2; 4],
    /// Which of them are hidden.
    pub hidden: Vec<usize>,
    /// The outline with the hidden corners `[px]`, clockwise, closed.
    pub points: Vec<DVec2>,
}

/// A straight side: a point and the direction of its line, and the numbers of the first and the last point on it.
#[derive(Debug, Clone, Copy)]
struct Side {
    at: DVec2,
    along: DVec2,
    first: usize,
    last: usize,
}

/// The corners of an outline (`points`, clockwise, closed) whose corners seem to be at `found`, clockwise, with those
/// that are hidden in their place; `None` if none is. `is_shown` says whether a place is of the image, and no fabric.
pub fn mended(points: &[DVec2], found: [DVec2; 4], is_shown: impl Fn(DVec2) -> bool) -> Option<Mended> {
    let nearest = |c: DVec2| {
        let distance = |k: &usize| points[*k].distance_squared(c);
        (0..points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut ends = [0; 4];
    for (end, corner) in ends.iter_mut().zip(found) {
        *end = nearest(corner)?;
    }
    let sides: [Option<Side>; 4] = std::array::from_fn(|k| side(points, ends[k], ends[(k + 1) % 4]));
    let mean = (0..4).map(|k| found[k].distance(found[(k + 1) % 4])).sum::<f64>() / 4.0;
    let meet: [Option<DVec2>; 4] = std::array::from_fn(|k| {
        let (before, after) = (sides[(k + 3) % 4]?, sides[k]?);
        let sine = before.along.perp_dot(after.along);
        let p = before.at + before.along * ((after.at - before.at).perp_dot(after.along) / sine);
        (sine.abs() > 0.2 && p.distance(found[k]) < FAR * mean).then_some(p)
    });
    let is_hidden = |k: &usize| {
        meet[*k].is_some_and(|p| {
            let off = nearest(p).map_or(0.0, |k| points[k].distance(p));
            is_shown(p) && off > CUT.0.max(CUT.1 * mean) && off < FAR * mean
        })
    };
    let hidden: Vec<usize> = (0..4).filter(is_hidden).collect();
    if hidden.is_empty() {
        return None;
    }
    // A hidden corner leads the search for those beside it astray.
    let beside = |k: usize| [k, (k + 1) % 4, (k + 3) % 4].iter().any(|k| hidden.contains(k));
    let corners = std::array::from_fn(|k| meet[k].filter(|_| beside(k)).unwrap_or(found[k]));
    let mut all = points.to_vec();
    for k in &hidden {
        let (Some(before), Some(after)) = (sides[(k + 3) % 4], sides[*k]) else { continue };
        let n = points.len();
        // The points between the sides go onto the two lines, evenly.
        let between = (after.first + n - before.last) % n;
        for j in 1..between {
            let i = (before.last + j) % n;
            let t = 2.0 * j as f64 / between as f64;
            let [from, to] = [points[before.last], points[after.first]];
            all[i] = if t < 1.0 { from.lerp(corners[*k], t) } else { corners[*k].lerp(to, t - 1.0) };
        }
    }
    Some(Mended { corners, hidden, points: all })
}

/// The line along the outline's points from number `start` to `end`, if most of them are on it and it is straight.
fn side(points: &[DVec2], start: usize, end: usize) -> Option<Side> {
    let n = points.len();
    let count = (end + n - start) % n + 1;
    let at = |j: usize| points[(start + j) % n];
    let length = at(0).distance(at(count - 1));
    if count < TRIED || length < 1.0 {
        return None;
    }
    let near = ON_LINE.0 + ON_LINE.1 * length;
    let judges: Vec<DVec2> = (0..count).step_by(count.div_ceil(JUDGES)).map(at).collect();
    let tried: Vec<DVec2> = (0..TRIED).map(|k| at(k * (count - 1) / (TRIED - 1))).collect();
    let mut best: (usize, Option<(DVec2, DVec2)>) = (0, None);
    for (k, a) in tried.iter().enumerate() {
        for b in tried.iter().skip(k + TRIED / 4) {
            let Some(along) = (*b - *a).try_normalize() else { continue };
            let on_line = judges.iter().filter(|p| along.perp_dot(**p - *a).abs() <= near).count();
            if on_line > best.0 {
                best = (on_line, Some((*a, along)));
            }
        }
    }
    let (mut from, mut along) = best.1?;
    let mut on_line: Vec<usize> = Vec::new();
    for _ in 0..3 {
        on_line = (0..count).filter(|j| along.perp_dot(at(*j) - from).abs() <= near).collect();
        let (mean, direction) =
            super::outline::fit_line(&on_line.iter().map(|j| at(*j)).collect::<Vec<_>>())?;
        (from, along) = (mean, if direction.dot(along) < 0.0 { -direction } else { direction });
    }
    let near: Vec<DVec2> = on_line.iter().map(|j| at(*j) - from).collect();
    let is_straight =
        near.len() as f64 >= FEWEST * count as f64 && bend(&near, along) <= BENT.0.max(BENT.1 * length);
    let (first, last) = (on_line.first()?, on_line.last()?);
    is_straight.then_some(Side { at: from, along, first: (start + first) % n, last: (start + last) % n })
}

/// How far apart the mean heights `[px]` over a line are of its five parts.
fn bend(points: &[DVec2], along: DVec2) -> f64 {
    let ends = points.iter().map(|p| along.dot(*p));
    let (low, high) = ends.fold((f64::MAX, f64::MIN), |(low, high), t| (low.min(t), high.max(t)));
    let mut parts = [(0.0, 0.0); PARTS];
    for p in points {
        let t = PARTS as f64 * (along.dot(*p) - low) / (high - low).max(1e-9);
        let part = &mut parts[(t as usize).min(PARTS - 1)];
        *part = (part.0 + along.perp_dot(*p), part.1 + 1.0);
    }
    let means = parts.iter().filter(|p| p.1 > 0.0).map(|p| p.0 / p.1);
    let (low, high) = means.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
    high - low
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use crate::template::outline::Outline;
    use tessuto_core::image::Image;

    /// Rectangles in perspective [px], clockwise from the upper left.
    const QUADS: [[[f64; 2]; 4]; 3] = [
        [[120.3, 80.6], [498.2, 121.7], [452.8, 391.1], [88.4, 352.9]],
        [[220.1, 60.2], [420.7, 64.9], [521.4, 402.6], [102.2, 398.3]],
        [[60.8, 236.1], [318.9, 40.4], [560.2, 260.7], [330.5, 440.2]],
    ];
    const SIDES: [&str; 4] = ["upper left", "upper right", "lower right", "lower left"];

    const ARC: fn(f64) -> f64 = |t| 4.0 * t * (1.0 - t);
    const WAVE: fn(f64) -> f64 = |t| (std::f64::consts::TAU * t).sin();

    /// A mask of the quadrilateral whose sides bend outwards by a curve of this height, in parts of their length,
    /// without discs of a radius around places.
    fn painted(
        quad: [DVec2; 4],
        (curve, bend): (fn(f64) -> f64, [f64; 4]),
        discs: &[(DVec2, f64)],
    ) -> Outline {
        let mut mask = Image::new(640, 480, 1);
        for y in 0..480 {
            for x in 0..640 {
                let p = DVec2::new(x as f64, y as f64);
                let within = (0..4).all(|k| {
                    let (a, side) = (quad[k], quad[(k + 1) % 4] - quad[k]);
                    let t = (p - a).dot(side) / side.length_squared();
                    let height = side.perp_dot(p - a) / side.length();
                    height >= -bend[k] * side.length() * curve(t)
                });
                let hidden = discs.iter().any(|(c, r)| c.distance(p) < *r);
                mask.pixel_mut(x, y)[0] = f32::from(u8::from(within && !hidden));
            }
        }
        Outline::new(&mask, "mask").unwrap()
    }

    /// Mean side [px].
    fn mean(quad: [DVec2; 4]) -> f64 {
        (0..4).map(|k| quad[k].distance(quad[(k + 1) % 4])).sum::<f64>() / 4.0
    }

    #[test]
    fn corners_under_fingers_are_where_the_sides_meet() {
        let mut worst = [0.0_f64; 2];
        for (q, quad) in QUADS.iter().enumerate() {
            let quad = quad.map(DVec2::from_array);
            for part in [0.05, 0.08, 0.12] {
                for cut in [vec![0], vec![1], vec![2], vec![3], vec![0, 1], vec![0, 2], vec![1, 2]] {
                    // A finger's tip is not quite at the corner.
                    let middle = quad.iter().sum::<DVec2>() / 4.0;
                    let disc = |k: &usize| {
                        let inwards = (middle - quad[*k]).normalize();
                        (quad[*k] + 0.2 * part * mean(quad) * inwards.rotate(DVec2::Y), part * mean(quad))
                    };
                    let discs: Vec<_> = cut.iter().map(disc).collect();
                    let mut outline = painted(quad, (ARC, [0.0; 4]), &discs);
                    let before = outline.quadrilateral();
                    let after = outline.corners();
                    let error = |found: [DVec2; 4]| {
                        (0..4).map(|k| found[k].distance(quad[k])).fold(0.0_f64, f64::max)
                    };
                    let errors = [error(before), error(after)];
                    println!("{q} {part} {cut:?}: {:.2} px before, {:.2} px after", errors[0], errors[1]);
                    worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
                    assert!(errors[1] < 1.0, "{q} {part} {cut:?}: {errors:?}");
                    for (k, side) in SIDES.iter().enumerate() {
                        let said =
                            outline.notes.iter().any(|n| n.contains(&format!("{side} corner is hidden")));
                        assert_eq!(said, cut.contains(&k), "{q} {part} {cut:?}: {:?}", outline.notes);
                    }
                    // The outline goes through the corners again.
                    for c in after {
                        let off = outline.points.iter().map(|p| p.distance(c)).fold(f64::MAX, f64::min);
                        assert!(off < 1.5, "{off}");
                    }
                }
            }
        }
        println!("at most {:.1} px before, {:.2} px after", worst[0], worst[1]);
        assert!(worst[0] > 20.0);
    }

    #[test]
    fn corners_that_are_seen_and_those_of_bent_sides_stay() {
        for quad in QUADS {
            let quad = quad.map(DVec2::from_array);
            let bends = [0.0, 0.004, -0.004, 0.01, -0.01, 0.03, -0.03, 0.06];
            let alike = bends.map(|b| [b; 4]).into_iter();
            let mixed = [[0.03, 0.0, -0.03, 0.0], [-0.05, 0.0, 0.0, 0.0]];
            for (curve, bend) in alike.chain(mixed).flat_map(|bend| [(ARC, bend), (WAVE, bend)]) {
                let mut outline = painted(quad, (curve, bend), &[]);
                let before = outline.quadrilateral();
                assert_eq!(outline.corners(), before, "{bend:?}: {:?}", outline.notes);
            }
            // A finger at the corner of sides that bend: as it was found.
            for (curve, bend) in [(ARC, 0.02), (ARC, -0.02), (ARC, 0.04), (WAVE, 0.02)] {
                let mut outline = painted(quad, (curve, [bend; 4]), &[(quad[1], 0.08 * mean(quad))]);
                let before = outline.quadrilateral();
                assert_eq!(outline.corners(), before, "{bend}: {:?}", outline.notes);
            }
        }
    }
}
