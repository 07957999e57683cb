//! The outline of a fabric as a smooth closed line with corners: the steps of pixels and ragged edges go, corners stay.

use glam::{DMat3, DVec2, DVec3};

/// Pixels along the outline that a corner is judged by, at least and at most.
const REACH: [f64; 2] = [12.0, 40.0];
/// Farthest pixel that the straight lines at a corner go through: sides are curved.
const STRAIGHT: usize = 20;
/// A turn by more than this `[rad]` within that reach is a corner, if it does not shrink with the reach, as that of a
/// curve.
const TURN: f64 = 0.6;
const SUDDEN: f64 = 0.7;
/// A corner is not moved farther than this part of the reach.
const MOVED: f64 = 0.35;
/// Half width of the smoothing `[px]`, at least and at most, and as a part of a closed line without corners.
const SMOOTH: [f64; 2] = [3.0, 16.0];
const PART: f64 = 0.08;

/// A closed line, points one pixel apart.
#[derive(Debug, Clone)]
pub(super) struct Line {
    /// `[px]`.
    pub(super) points: Vec<DVec2>,
    /// Indices of its corners, ascending.
    pub(super) corners: Vec<usize>,
    /// How far what was traced is from it, root mean square `[px]`: how ragged the mask is.
    pub(super) ragged: f64,
}

/// The line through the closed sequence `traced` `[px]`, whose details smaller than `detail` `[px]` do not matter.
pub(super) fn smooth(traced: &[DVec2], detail: f64) -> Line {
    let mut points = evenly(traced);
    let n = points.len();
    let reach = detail.clamp(REACH[0], REACH[1]).min(n as f64 / 8.0).max(2.0) as usize;
    let corners = corners(&points, reach);
    let moved: Vec<DVec2> = corners.iter().map(|k| sharpened(&points, *k, reach)).collect();
    corners.iter().zip(&moved).for_each(|(k, p)| points[*k] = *p);
    let width = (0.5 * detail).clamp(SMOOTH[0], SMOOTH[1]).min(PART * n as f64).max(2.0);
    let mut out = points.clone();
    if corners.is_empty() {
        out = (0..n)
            .map(|k| {
                regressed(
                    &|j| (points[(k as i64 + j).rem_euclid(n as i64) as usize], 1.0),
                    width,
                    [i64::MIN, i64::MAX],
                )
            })
            .collect();
    }
    for (c, &first) in corners.iter().enumerate() {
        let length = (corners[(c + 1) % corners.len()] + n - first - 1) % n + 1;
        for k in 1..length {
            // The pixel next to a corner is cut by it.
            let datum = |j: i64| {
                let at = k as i64 + j;
                let end = at == 0 || at == length as i64;
                let cut = (at == 1 || at + 1 == length as i64) && length > 8;
                let weight = if end { 4.0 } else { f64::from(u8::from(!cut)) };
                (points[(first + at as usize) % n], weight)
            };
            out[(first + k) % n] = regressed(&datum, width, [-(k as i64), (length - k) as i64]);
        }
    }
    let square: f64 = points.iter().zip(&out).map(|(a, b)| a.distance_squared(*b)).sum();
    Line { points: out, corners, ragged: (square / n as f64).sqrt() }
}

/// Points one pixel apart, or a little less, along a closed sequence.
fn evenly(traced: &[DVec2]) -> Vec<DVec2> {
    let curve = Curve::new(traced.to_vec());
    let count = curve.length().ceil().max(8.0) as usize;
    (0..count).map(|k| curve.at(curve.length() * k as f64 / count as f64)).collect()
}

/// Where the line turns suddenly; ascending.
fn corners(points: &[DVec2], reach: usize) -> Vec<usize> {
    let n = points.len();
    let mean = |from: i64, to: i64| {
        let at = |j: i64| points[j.rem_euclid(n as i64) as usize];
        (from..=to).map(at).sum::<DVec2>() / (to - from + 1) as f64
    };
    let turn = |k: usize, reach: usize| {
        let (k, half, whole) = (k as i64, (reach / 2).max(1) as i64, reach.max(2) as i64);
        let forward = mean(k + half + 1, k + whole) - mean(k + 1, k + half);
        let backward = mean(k - half, k - 1) - mean(k - whole, k - half - 1);
        backward.perp_dot(forward).atan2(backward.dot(forward)).abs()
    };
    let turns: Vec<f64> = (0..n).map(|k| turn(k, reach)).collect();
    // The first of equal turns.
    let highest =
        |k: usize| (1..=reach).all(|j| turns[k] > turns[(k + n - j) % n] && turns[k] >= turns[(k + j) % n]);
    (0..n).filter(|k| turns[*k] > TURN && highest(*k) && turn(*k, reach / 2) > SUDDEN * turns[*k]).collect()
}

/// Where the straight lines through both sides of a corner meet, if that is near it.
fn sharpened(points: &[DVec2], corner: usize, reach: usize) -> DVec2 {
    let n = points.len();
    let line = |sign: i64| {
        let at = |j: i64| points[(corner as i64 + sign * j).rem_euclid(n as i64) as usize];
        fit_line((2..=reach.clamp(4, STRAIGHT) as i64).map(at))
    };
    let ((a, d), (b, e)) = (line(-1), line(1));
    let sine = d.perp_dot(e);
    let p = a + d * ((b - a).perp_dot(e) / sine);
    let near = p.distance(points[corner]) <= MOVED * reach as f64;
    if sine.abs() > 0.2 && near { p } else { points[corner] }
}

/// Mean and main direction.
fn fit_line(points: impl Iterator<Item = DVec2> + Clone) -> (DVec2, DVec2) {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p - mean;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    (mean, DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy)))
}

/// The value at 0 of the parabola nearest to the data `datum(j)`, a point and its weight, with |j| < `width` and j
/// within `ends`.
fn regressed(datum: &dyn Fn(i64) -> (DVec2, f64), width: f64, [low, high]: [i64; 2]) -> DVec2 {
    let reach = width.ceil() as i64;
    let (mut matrix, mut x, mut y) = (DMat3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for j in (-reach).max(low)..=reach.min(high) {
        let (p, own) = datum(j);
        let t = j as f64 / (width + 1.0);
        let weight = own * (1.0 - t.abs().powi(3)).max(0.0).powi(3);
        let row = DVec3::new(1.0, t, t * t);
        matrix += DMat3::from_cols(row, row * t, row * t * t) * weight;
        x += row * (weight * p.x);
        y += row * (weight * p.y);
    }
    // Of fewer than three places, or all on one side, the point itself.
    if matrix.determinant().abs() < 1e-12 {
        return datum(0).0;
    }
    let first = matrix.inverse().transpose().x_axis;
    DVec2::new(first.dot(x), first.dot(y))
}

/// A closed line by its length.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    points: Vec<DVec2>,
    /// Length from the first point to each, and all around.
    lengths: Vec<f64>,
}

impl Curve {
    pub(super) fn new(points: Vec<DVec2>) -> Self {
        let n = points.len();
        let mut lengths = vec![0.0];
        for k in 0..n {
            lengths.push(lengths[k] + points[k].distance(points[(k + 1) % n]));
        }
        Self { points, lengths }
    }

    /// All around.
    pub(super) fn length(&self) -> f64 {
        self.lengths[self.points.len()]
    }

    /// Length from the first point to point `k`.
    pub(super) fn until(&self, k: usize) -> f64 {
        self.lengths[k]
    }

    /// The point after a `length` from the first, of any number of rounds.
    pub(super) fn at(&self, length: f64) -> DVec2 {
        let n = self.points.len();
        let length = length.rem_euclid(self.length());
        let k = (self.lengths.partition_point(|l| *l <= length).max(1) - 1).min(n - 1);
        let step = self.lengths[k + 1] - self.lengths[k];
        let t = if step > 0.0 { (length - self.lengths[k]) / step } else { 0.0 };
        self.points[k].lerp(self.points[(k + 1) % n], t)
    }

    /// Farthest that the line between two lengths is from the chord.
    pub(super) fn bulge(&self, from: f64, to: f64) -> f64 {
        let (a, b) = (self.at(from), self.at(to));
        let off = |k: i32| {
            let p = self.at(from + (to - from) * f64::from(k) / 8.0);
            (b - a).perp_dot(p - a).abs() / (b - a).length().max(f64::MIN_POSITIVE)
        };
        (1..8).map(off).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::table::trace::{Traced, trace};
    use tessuto_core::image::Image;

    /// Pixels whose centres are inside: the hardest mask.
    fn traced(size: [usize; 2], inside: impl Fn(DVec2) -> bool) -> Traced {
        let mut mask = Image::new(size[0], size[1], 1);
        for y in 0..size[1] {
            for x in 0..size[0] {
                mask.pixel_mut(x, y)[0] = f32::from(u8::from(inside(DVec2::new(x as f64, y as f64))));
            }
        }
        trace(&mask, "mask").unwrap()
    }

    #[test]
    fn a_disc_is_round_and_has_no_corners() {
        let middle = DVec2::new(110.3, 104.8);
        for radius in [12.0, 30.0, 90.0] {
            let traced = traced([220, 220], |p| p.distance(middle) < radius);
            let line = smooth(&traced.outer, 15.0);
            assert!(line.corners.is_empty(), "{radius}: {:?}", line.corners);
            let off: Vec<f64> = line.points.iter().map(|p| p.distance(middle) - radius).collect();
            let rms = (off.iter().map(|e| e * e).sum::<f64>() / off.len() as f64).sqrt();
            let worst = off.iter().map(|e| e.abs()).fold(0.0, f64::max);
            assert!(line.ragged > 0.05 && line.ragged < 0.4, "{radius}: {}", line.ragged);
            assert!(rms < 0.15 && worst < 0.5, "{radius}: {rms} {worst}");
        }
    }

    #[test]
    fn corners_are_kept_wherever_the_square_is_turned_to() {
        for turn in [0.0, 0.13, 0.4, 0.78] {
            let (middle, half) = (DVec2::new(100.2, 99.6), 60.0);
            let back = DVec2::from_angle(-turn);
            let traced = traced([200, 200], |p| {
                let q = back.rotate(p - middle).abs();
                q.x < half && q.y < half
            });
            let line = smooth(&traced.outer, 20.0);
            assert_eq!(line.corners.len(), 4, "{turn}: {:?}", line.corners);
            for k in &line.corners {
                let q = back.rotate(line.points[*k] - middle).abs();
                assert!(q.distance(DVec2::splat(half)) < 0.9, "{turn}: {q}");
            }
            let off = |p: &DVec2| back.rotate(*p - middle).abs().max_element() - half;
            let worst = line.points.iter().map(|p| off(p).abs()).fold(0.0, f64::max);
            assert!(worst < 0.9, "{turn}: {worst}");
        }
    }

    #[test]
    fn a_curve_is_walked_by_its_length() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from_array);
        let curve = Curve::new(square.to_vec());
        assert_eq!((curve.length(), curve.until(3)), (8.0, 6.0));
        assert!(curve.at(3.0).distance(DVec2::new(2.0, 1.0)) < 1e-12);
        assert!(curve.at(-1.0).distance(DVec2::new(0.0, 1.0)) < 1e-12 && curve.at(8.0).length() < 1e-12);
        assert!((curve.bulge(1.0, 3.0) - 0.5f64.sqrt()).abs() < 1e-12 && curve.bulge(0.5, 1.5) < 1e-12);
    }
}
