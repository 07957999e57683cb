//! Triangles of even size within a closed outline with holes: points along the borders, a triangular grid of points
//! between them, moved until they are evenly spread, and the Delaunay triangles over all.
//!
//! Where the fabric is narrow the border gets more points, until no point of another border lies in the circle over
//! a side: then all sides are among the Delaunay triangles'.

use glam::DVec2;

use super::sides::Curve;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::math::delaunay::delaunay;

/// Farthest that an outline bulges from its chord, as a part of a triangle's side.
const BULGE: f64 = 0.02;
/// Shortest side along the border at first, and where the fabric is narrow, as parts of a triangle's side.
const SHORT: f64 = 1.0 / 3.0;
const SHORTEST: f64 = 0.08;
/// Fewest sides of a hole.
const SIDES: usize = 8;
/// Points of the grid stay away from the border by this part of a triangle's side.
const CLEAR: f64 = 0.65;
/// Moves of the points to the middle of what surrounds them.
const RELAXATIONS: usize = 12;
/// Rounds in which sides along the border are halved.
const HALVINGS: usize = 40;

/// Triangles in the plane, and which points are on borders.
#[derive(Debug, Clone)]
pub(super) struct Sheet {
    /// Those along the borders first, one border after the other.
    pub(super) points: Vec<DVec2>,
    /// [`DVec2::perp_dot`] of their sides is above 0.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Points of every border, in order; the outer one first.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests look at the borders"))]
    pub(super) borders: Vec<Vec<u32>>,
    /// Sides along the border that were halved since the fabric is narrow there.
    pub(super) halved: usize,
}

/// A border: its line and its corners, as lengths from its first point.
#[derive(Debug, Clone)]
pub(super) struct Border {
    pub(super) curve: Curve,
    pub(super) corners: Vec<f64>,
    /// It may bulge by this from its chords.
    pub(super) fine: f64,
}

/// Triangles with sides of about `side` between the `borders`, the outer one first. `name` says where in the image a
/// place is.
///
/// # Errors
/// [`Error::Input`] at `place` if a hole is smaller than a triangle or the fabric is narrower than a few hundredths
/// of one.
pub(super) fn triangles(
    borders: &[Border],
    side: f64,
    place: &str,
    name: &dyn Fn(DVec2) -> String,
) -> Result<Sheet> {
    let mut lengths = Vec::new();
    for (k, border) in borders.iter().enumerate() {
        let around = border.curve.length();
        if k > 0 && around < SIDES as f64 * SHORT * side {
            let problem = format!(
                "the hole around {} is too small for the mesh: {:.0} mm around, {:.0} mm at least for triangles \
                 of {:.0} mm",
                name(border.curve.at(0.0)),
                1e3 * around,
                1e3 * SIDES as f64 * SHORT * side,
                1e3 * side
            );
            let hint = "make the triangles smaller, or close the hole in the mask";
            return Err(Error::input(place, problem, smaller(hint)));
        }
        lengths.push(divided(border, side, border.fine.max(BULGE * side)));
    }
    let halved = widened(borders, &mut lengths, side, place, name)?;
    let outline = Outline::new(borders, &lengths);
    let count = outline.points.len();
    let mut points = outline.points.clone();
    points.extend(outline.grid(side));
    let mut found = outline.within(&points);
    for _ in 0..RELAXATIONS {
        let mut sums = vec![(DVec2::ZERO, 0.0); points.len()];
        for t in &found {
            let [a, b, c] = t.map(|v| points[v as usize]);
            let area = (b - a).perp_dot(c - a);
            for v in t {
                let (sum, weight) = &mut sums[*v as usize];
                (*sum, *weight) = (*sum + (a + b + c) / 3.0 * area, *weight + area);
            }
        }
        for (p, (sum, weight)) in points.iter_mut().zip(sums).skip(count) {
            let moved = sum / weight;
            if weight > 0.0 && outline.is_clear(moved) {
                *p = moved;
            }
        }
        found = outline.within(&points);
    }
    // A point that no triangle has is of no use.
    let mut used = vec![false; points.len()];
    found.iter().flatten().for_each(|v| used[*v as usize] = true);
    let mut number = vec![0u32; points.len()];
    let mut kept = Vec::new();
    for (k, p) in points.iter().enumerate().filter(|(k, _)| used[*k] || *k < count) {
        number[k] = kept.len() as u32;
        kept.push(*p);
    }
    let triangles: Vec<[u32; 3]> = found.iter().map(|t| t.map(|v| number[v as usize])).collect();
    if let Some([a, _]) = outline.missing(&triangles).first() {
        let hint = "make the triangles smaller, or smooth the mask there";
        let problem = format!(
            "the outline cannot be filled with triangles around {}",
            name(outline.points[*a as usize])
        );
        return Err(Error::input(place, problem, smaller(hint)));
    }
    Ok(Sheet { points: kept, triangles, borders: outline.borders, halved })
}

/// A hint that ends with what sets the size of the triangles.
fn smaller(hint: &str) -> Hint {
    Hint::from(hint).with(Remedy::TriangleSide)
}

/// Where a border is divided, as lengths: at its corners and evenly between them.
fn divided(border: &Border, side: f64, bulge: f64) -> Vec<f64> {
    let around = border.curve.length();
    let (first, fewest) = match border.corners.len() {
        0 => (vec![0.0], SIDES),
        1 => (border.corners.clone(), 3),
        2 => (border.corners.clone(), 2),
        _ => (border.corners.clone(), 1),
    };
    let mut out = Vec::new();
    for (k, &from) in first.iter().enumerate() {
        let to = if k + 1 < first.len() { first[k + 1] } else { first[0] + around };
        let at = |n: usize, j: usize| from + (to - from) * j as f64 / n as f64;
        let most = ((to - from) / (SHORT * side)).floor().max(1.0) as usize;
        let mut n = (((to - from) / side).round() as usize).max(fewest);
        while n < most && (0..n).any(|j| border.curve.bulge(at(n, j), at(n, j + 1)) > bulge) {
            n += 1;
        }
        out.extend((0..n).map(|j| at(n, j)));
    }
    out
}

/// Halves sides of borders until no point of another lies in the circle over one; how many were.
fn widened(
    borders: &[Border],
    lengths: &mut [Vec<f64>],
    side: f64,
    place: &str,
    name: &dyn Fn(DVec2) -> String,
) -> Result<usize> {
    let mut halved = 0;
    let narrow = |p: DVec2| {
        let problem = format!(
            "the fabric is narrower than the mesh can be around {}: triangles have sides of {:.0} mm",
            name(p),
            1e3 * side
        );
        let hint = "make the triangles smaller, or correct the mask there: a slit of pixels, or two parts that touch \
                    in a few";
        Error::input(place, problem, smaller(hint))
    };
    for _ in 0..HALVINGS {
        let outline = Outline::new(borders, lengths);
        let missing = outline.missing(&delaunay(&outline.points));
        let split: Vec<[u32; 2]> = outline
            .edges()
            .filter(|edge| missing.contains(edge) || !outline.is_empty_circle(*edge))
            .collect();
        if let Some(p) = outline.touching(2.0 * SHORTEST * side) {
            return Err(narrow(p));
        }
        if split.is_empty() {
            return Ok(halved);
        }
        halved += split.len();
        for [a, b] in split {
            let [p, q] = [a, b].map(|v| outline.points[v as usize]);
            if p.distance(q) < 2.0 * SHORTEST * side {
                return Err(narrow(p));
            }
            let (k, from) = outline.lengths_of(a);
            let list = &mut lengths[k];
            let at = list.iter().position(|l| *l == from).expect("one of them");
            let to = list.get(at + 1).copied().unwrap_or(list[0] + borders[k].curve.length());
            list.insert(at + 1, (from + to) / 2.0);
        }
    }
    let hint = "make the triangles smaller, or smooth the mask";
    Err(Error::input(place, "the outline crosses or touches itself", smaller(hint)))
}

/// The points along all borders.
struct Outline {
    points: Vec<DVec2>,
    borders: Vec<Vec<u32>>,
    lengths: Vec<(usize, f64)>,
    /// Next and previous point of the same border.
    beside: Vec<[u32; 2]>,
}

impl Outline {
    fn new(borders: &[Border], lengths: &[Vec<f64>]) -> Self {
        let mut out =
            Self { points: Vec::new(), borders: Vec::new(), lengths: Vec::new(), beside: Vec::new() };
        for (k, (border, list)) in borders.iter().zip(lengths).enumerate() {
            let (first, n) = (out.points.len() as u32, list.len() as u32);
            out.points.extend(list.iter().map(|l| border.curve.at(*l)));
            out.lengths.extend(list.iter().map(|l| (k, *l)));
            out.borders.push((first..first + n).collect());
            out.beside.extend((0..n).map(|j| [first + (j + 1) % n, first + (j + n - 1) % n]));
        }
        out
    }

    /// Sides in the direction of their border.
    fn edges(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        (0..self.points.len()).map(|v| [v as u32, self.beside[v][0]])
    }

    /// Border, and length along it, of a point.
    fn lengths_of(&self, v: u32) -> (usize, f64) {
        self.lengths[v as usize]
    }

    /// Whether no other point is in the circle over a side; the points beside it do not count.
    fn is_empty_circle(&self, [a, b]: [u32; 2]) -> bool {
        let near = [a, b, self.beside[a as usize][1], self.beside[b as usize][0]];
        let [p, q] = [a, b].map(|v| self.points[v as usize]);
        let within =
            |k: usize| !near.contains(&(k as u32)) && (self.points[k] - p).dot(self.points[k] - q) < 0.0;
        !(0..self.points.len()).any(within)
    }

    /// A point that is nearer than `least` to another, which is not beside it.
    fn touching(&self, least: f64) -> Option<DVec2> {
        let near = |v: usize| {
            let other = |k: usize| k != v && !self.beside[v].contains(&(k as u32));
            (v + 1..self.points.len()).any(|k| other(k) && self.points[k].distance(self.points[v]) < least)
        };
        (0..self.points.len()).find(|v| near(*v)).map(|v| self.points[v])
    }

    /// Sides that are not those of exactly one of the triangles inside.
    fn missing(&self, triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
        let count = self.points.len() as u32;
        let mut uses = vec![0; count as usize];
        let kept =
            triangles.iter().filter(|t| !t.iter().all(|v| *v < count) || self.is_inside(self.middle(t)));
        for [a, b, c] in kept {
            for [p, q] in [[a, b], [b, c], [c, a]] {
                if *p < count && *q < count {
                    uses[*p as usize] += u8::from(self.beside[*p as usize][0] == *q);
                    uses[*q as usize] += u8::from(self.beside[*q as usize][0] == *p) * 2;
                }
            }
        }
        self.edges().filter(|[a, _]| uses[*a as usize] != 1).collect()
    }

    fn middle(&self, t: &[u32; 3]) -> DVec2 {
        t.iter().map(|v| self.points[*v as usize]).sum::<DVec2>() / 3.0
    }

    /// Whether a point is inside the outer border and outside of the others.
    fn is_inside(&self, p: DVec2) -> bool {
        self.edges()
            .filter(|e| {
                let [a, b] = e.map(|v| self.points[v as usize]);
                (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)
            })
            .count()
            % 2
            == 1
    }

    /// Whether a point is inside, and in no circle over a side.
    fn is_clear(&self, p: DVec2) -> bool {
        let outside = |e: [u32; 2]| {
            let [a, b] = e.map(|v| self.points[v as usize]);
            let middle = (a + b) / 2.0;
            p.distance(middle) > 0.55 * a.distance(b)
        };
        self.edges().all(outside) && self.is_inside(p)
    }

    /// Points of a triangular grid inside that are clear of the border.
    fn grid(&self, side: f64) -> Vec<DVec2> {
        let low = self.points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = self.points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let height = side * 3f64.sqrt() / 2.0;
        let rows = ((high.y - low.y) / height).ceil() as usize;
        let columns = ((high.x - low.x) / side).ceil() as usize + 1;
        let clear = |p: &DVec2| {
            let near = |e: [u32; 2]| {
                let [a, b] = e.map(|v| self.points[v as usize]);
                let t = ((*p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                let own = a.distance(b).clamp(0.6 * side, side);
                p.distance(a.lerp(b, t)) < CLEAR * own
            };
            self.is_inside(*p) && !self.edges().any(near)
        };
        // In the middle of the rows that the outline spans.
        let first = (high.y - low.y - (rows as f64 - 1.0) * height) / 2.0;
        let at = |k: usize| {
            let (row, column) = (k / columns, k % columns);
            let shift = 0.5 * (row % 2) as f64;
            low + DVec2::new((column as f64 + shift) * side, first + row as f64 * height)
        };
        (0..rows * columns).map(at).filter(clear).collect()
    }

    /// The Delaunay triangles of `points`, which begin with the border's, that lie inside.
    fn within(&self, points: &[DVec2]) -> Vec<[u32; 3]> {
        let count = self.points.len() as u32;
        let inside = |t: &[u32; 3]| {
            // A triangle with a point that is on no border is inside: the sides of borders are all there.
            !t.iter().all(|v| *v < count) || self.is_inside(self.middle(t))
        };
        delaunay(points).into_iter().filter(inside).collect()
    }
}

/// Smallest angle of a triangle `[rad]`.
pub(super) fn smallest_angle(corners: [DVec2; 3]) -> f64 {
    let angle = |k: usize| {
        let (a, b) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
        a.perp_dot(b).atan2(a.dot(b))
    };
    (0..3).map(angle).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A border through `points`, with those of `corners`.
    fn border(points: Vec<DVec2>, corners: &[usize]) -> Border {
        let curve = Curve::new(points);
        let corners = corners.iter().map(|k| curve.until(*k)).collect();
        Border { curve, corners, fine: 0.0 }
    }

    fn circle(middle: [f64; 2], radius: f64, sign: f64) -> Border {
        let at = |k: i32| {
            DVec2::from_array(middle)
                + DVec2::from_angle(sign * f64::from(k) / 100.0 * std::f64::consts::TAU / 4.0) * radius
        };
        border((0..400).map(at).collect(), &[])
    }

    fn polygon(corners: &[[f64; 2]]) -> Border {
        border(
            corners.iter().map(|c| DVec2::from_array(*c)).collect(),
            &(0..corners.len()).collect::<Vec<_>>(),
        )
    }

    fn area(sheet: &Sheet) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| sheet.points[v as usize]);
            (b - a).perp_dot(c - a) / 2.0
        };
        assert!(sheet.triangles.iter().all(|t| of(t) > 0.0), "an inverted triangle");
        sheet.triangles.iter().map(of).sum()
    }

    fn worst(sheet: &Sheet) -> f64 {
        let of = |t: &[u32; 3]| smallest_angle(t.map(|v| sheet.points[v as usize])).to_degrees();
        sheet.triangles.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    fn made(borders: &[Border], side: f64) -> Result<Sheet> {
        triangles(borders, side, "mask", &|p| format!("{:.2},{:.2}", p.x, p.y))
    }

    #[test]
    fn discs_and_rings_are_filled_with_good_triangles() {
        for side in [0.02, 0.031, 0.045] {
            let sheet = made(&[circle([0.1, 0.2], 0.25, 1.0)], side).unwrap();
            let exact = std::f64::consts::PI * 0.25 * 0.25;
            assert!(
                (area(&sheet) / exact - 1.0).abs() < 0.01 && worst(&sheet) > 25.0,
                "{side}: {}",
                worst(&sheet)
            );
            // A disc, and a ring: Euler's formula.
            assert_eq!(sheet.triangles.len(), 2 * sheet.points.len() - 2 - sheet.borders[0].len());
            let ring =
                made(&[circle([0.1, 0.2], 0.25, 1.0), circle([0.12, 0.23], 0.08, -1.0)], side).unwrap();
            let exact = std::f64::consts::PI * (0.25 * 0.25 - 0.08 * 0.08);
            assert!(
                (area(&ring) / exact - 1.0).abs() < 0.01 && worst(&ring) > 22.0,
                "{side}: {}",
                worst(&ring)
            );
            let border: usize = ring.borders.iter().map(Vec::len).sum();
            assert_eq!(ring.triangles.len(), 2 * ring.points.len() - border);
        }
    }

    #[test]
    fn straight_sides_and_narrow_straps_are_exact() {
        // A frame with a strap of 6 mm, narrower than the triangles.
        let outer = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.4], [0.0, 0.4]];
        let hole = [[0.05, 0.006], [0.05, 0.2], [0.25, 0.2], [0.25, 0.006]];
        let sheet = made(&[polygon(&outer), polygon(&hole)], 0.02).unwrap();
        assert!((area(&sheet) - (0.12 - 0.2 * 0.194)).abs() < 1e-9, "{}", area(&sheet));
        assert!(sheet.halved > 0 && worst(&sheet) > 15.0, "{}", worst(&sheet));
        for corner in outer.iter().chain(&hole) {
            assert!(sheet.points.iter().any(|p| p.distance(DVec2::from_array(*corner)) < 1e-12));
        }
        let again = made(&[polygon(&outer), polygon(&hole)], 0.02).unwrap();
        assert_eq!((again.points, again.triangles), (sheet.points, sheet.triangles));
    }

    #[test]
    fn sharp_corners_stay_and_nothing_else_is_sharp() {
        let star: Vec<[f64; 2]> = (0..10)
            .map(|k| {
                let r = if k % 2 == 0 { 0.3 } else { 0.16 };
                (DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 10.0) * r).to_array()
            })
            .collect();
        let sheet = made(&[polygon(&star)], 0.03).unwrap();
        let exact = 0.5 * 10.0 * 0.3 * 0.16 * (std::f64::consts::TAU / 10.0).sin();
        assert!((area(&sheet) / exact - 1.0).abs() < 1e-9);
        assert!(worst(&sheet) > 18.0, "{}", worst(&sheet));
    }

    #[test]
    fn holes_and_slits_that_no_triangle_fits_are_refused() {
        let outer = circle([0.0, 0.0], 0.25, 1.0);
        let text = made(&[outer.clone(), circle([0.05, 0.0], 0.01, -1.0)], 0.03).unwrap_err().to_string();
        assert!(
            text.contains("the hole around 0.06,0.00 is too small for the mesh: 63 mm around, 80 mm"),
            "{text}"
        );
        // A hole that nearly touches the outer border.
        let text = made(&[outer, circle([0.1995, 0.0], 0.05, -1.0)], 0.03).unwrap_err().to_string();
        assert!(text.contains("narrower than the mesh"), "{text}");
    }
}
