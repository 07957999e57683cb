//! The fabric's outline in a mask, and the four corners of a rectangle of fabric in it.

use glam::DVec2;

use super::hidden::mended;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_render::raster::coverage::fill_triangle;

/// Corners of the convex hull that are compared; more would only cost time.
const HULL_CORNERS: usize = 48;
/// Outline points within this fraction of a side's length of its line, root mean square, are a straight side.
const STRAIGHT: f64 = 0.006;
/// A refined corner stays within this fraction of the mean side of the one it replaces.
const REFINED: f64 = 0.03;

/// The border of the largest piece of fabric.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Points between pixels `[px]`, clockwise as seen in the image, closed.
    pub points: Vec<DVec2>,
    /// Pixels of the piece, shape [height · width].
    pub inside: Vec<bool>,
    /// Width and height of the image `[px]`.
    pub size: [usize; 2],
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Outline {
    /// The outline of the largest piece where `mask` ≥ ½.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if there is none.
    pub fn new(mask: &Image, place: &str) -> Result<Self> {
        let size = [mask.width, mask.height];
        let (inside, pieces) = largest_piece(mask);
        let Some(first) = inside.iter().position(|i| *i) else {
            return Err(Error::input(
                place,
                "the mask is empty",
                "white is fabric; give the mask of the first frame",
            ));
        };
        let mut notes = Vec::new();
        if pieces > 1 {
            notes.push(format!("{place}: the mask has {pieces} pieces; the largest is taken"));
        }
        let count = inside.iter().filter(|i| **i).count();
        let touches = |k: usize| {
            let (x, y) = (k % size[0], k / size[0]);
            x == 0 || y == 0 || x == size[0] - 1 || y == size[1] - 1
        };
        let border = (0..inside.len()).filter(|k| inside[*k] && touches(*k)).count();
        if border * 100 > (count as f64).sqrt() as usize * 5 {
            notes.push(format!(
                "{place}: the fabric reaches the border of the image; corners outside it cannot be found"
            ));
        }
        let points = contour(&inside, size, first);
        Ok(Self { points, inside, size, notes })
    }

    /// The four corners `[px]` of the fabric: upper left, upper right, lower right, lower left. Those that are hidden
    /// are where the sides meet; the outline then goes through them, and a note says so.
    pub fn corners(&mut self) -> [DVec2; 4] {
        let found = self.quadrilateral();
        let is_shown = |p: DVec2| {
            let (x, y) = (p.x.round(), p.y.round());
            let in_picture = x >= 0.0 && y >= 0.0 && x < self.size[0] as f64 && y < self.size[1] as f64;
            in_picture && !self.inside[y as usize * self.size[0] + x as usize]
        };
        let Some(mended) = mended(&self.points, found, is_shown) else { return found };
        for k in mended.hidden {
            let (name, p) =
                (["upper left", "upper right", "lower right", "lower left"][k], mended.corners[k]);
            self.notes.push(format!(
                "the {name} corner is hidden; it is taken where the straight sides meet, at {:.1},{:.1}",
                p.x, p.y
            ));
        }
        self.points = mended.points;
        mended.corners
    }

    /// The corners `[px]` of the quadrilateral that fits the outline best, clockwise from the upper left.
    pub(super) fn quadrilateral(&self) -> [DVec2; 4] {
        let quad = widest_quad(&simplified(hull(&self.points), HULL_CORNERS));
        let refined = self.refined(quad);
        let corners = if self.overlap(refined) >= self.overlap(quad) { refined } else { quad };
        from_upper_left(corners.map(|c| self.on_fabric(c)))
    }

    /// `p`, or the outline's point nearest to it if it is outside: sides that bulge have corners inside their lines.
    fn on_fabric(&self, p: DVec2) -> DVec2 {
        let (x, y) = (p.x.round(), p.y.round());
        let in_picture = x >= 0.0 && y >= 0.0 && x < self.size[0] as f64 && y < self.size[1] as f64;
        if in_picture && self.inside[y as usize * self.size[0] + x as usize] {
            return p;
        }
        let nearest =
            self.points.iter().min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)));
        nearest.copied().unwrap_or(p)
    }

    /// Intersection over union of the piece and a quadrilateral.
    pub fn overlap(&self, quad: [DVec2; 4]) -> f64 {
        let mut covered = vec![false; self.inside.len()];
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            fill_triangle(triangle.map(|k| quad[k]), self.size, true, |x, y| {
                covered[y * self.size[0] + x] = true
            });
        }
        let both = covered.iter().zip(&self.inside).filter(|(a, b)| **a && **b).count();
        let either = covered.iter().zip(&self.inside).filter(|(a, b)| **a || **b).count();
        both as f64 / either.max(1) as f64
    }

    /// The quadrilateral with the lines through the outline in place of its sides, where that is straight: single
    /// pixels at a corner count for less then.
    fn refined(&self, quad: [DVec2; 4]) -> [DVec2; 4] {
        let lines: Vec<Option<(DVec2, DVec2)>> =
            (0..4).map(|k| self.side_line(quad[k], quad[(k + 1) % 4])).collect();
        let mean: f64 = (0..4).map(|k| quad[k].distance(quad[(k + 1) % 4])).sum::<f64>() / 4.0;
        std::array::from_fn(|k| {
            let (Some((a, d)), Some((b, e))) = (lines[(k + 3) % 4], lines[k]) else { return quad[k] };
            let sine = d.perp_dot(e);
            let p = a + d * ((b - a).perp_dot(e) / sine);
            if sine.abs() > 0.2 && p.distance(quad[k]) < REFINED * mean { p } else { quad[k] }
        })
    }

    /// Point and direction of the line through the outline along the middle of the side from `a` to `b`, if straight.
    fn side_line(&self, a: DVec2, b: DVec2) -> Option<(DVec2, DVec2)> {
        let length = a.distance(b);
        let along = (b - a) / length;
        let near = |p: &&DVec2| {
            let t = (**p - a).dot(along) / length;
            (0.12..0.88).contains(&t) && along.perp_dot(**p - a).abs() < 0.05 * length
        };
        let mut points: Vec<DVec2> = self.points.iter().filter(near).copied().collect();
        let mut line = fit_line(&points)?;
        // Outliers, such as a pin or a ragged edge, are dropped twice.
        for _ in 0..2 {
            let rms = spread(&points, line);
            points.retain(|p| line.1.perp_dot(*p - line.0).abs() <= 2.0 * rms + 1e-9);
            line = fit_line(&points)?;
        }
        (spread(&points, line) < STRAIGHT * length).then_some(line)
    }
}

fn spread(points: &[DVec2], (p, d): (DVec2, DVec2)) -> f64 {
    (points.iter().map(|q| d.perp_dot(*q - p).powi(2)).sum::<f64>() / points.len().max(1) as f64).sqrt()
}

/// Mean and main direction of `points`; `None` of fewer than 8.
pub(super) fn fit_line(points: &[DVec2]) -> Option<(DVec2, DVec2)> {
    if points.len() < 8 {
        return None;
    }
    let mean = points.iter().sum::<DVec2>() / points.len() as f64;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = *p - mean;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    Some((mean, DVec2::from_angle(angle)))
}

/// Where the largest 4-connected piece of fabric is, and the number of pieces.
fn largest_piece(mask: &Image) -> (Vec<bool>, usize) {
    let (w, h) = (mask.width, mask.height);
    let mut label = vec![0u32; w * h];
    let (mut best, mut pieces, mut stack) = ((0, 0), 0, Vec::new());
    for start in 0..w * h {
        if mask.data[start] < 0.5 || label[start] != 0 {
            continue;
        }
        pieces += 1;
        label[start] = pieces;
        stack.push(start);
        let mut count = 0;
        while let Some(k) = stack.pop() {
            count += 1;
            let (x, y) = (k % w, k / w);
            let neighbours = [
                (x > 0).then(|| k - 1),
                (x + 1 < w).then_some(k + 1),
                (y > 0).then(|| k - w),
                (y + 1 < h).then_some(k + w),
            ];
            for n in neighbours.into_iter().flatten() {
                if mask.data[n] >= 0.5 && label[n] == 0 {
                    label[n] = pieces;
                    stack.push(n);
                }
            }
        }
        if count > best.0 {
            best = (count, pieces);
        }
    }
    (label.iter().map(|l| *l != 0 && *l == best.1).collect(), pieces as usize)
}

/// The border from the upper left corner of pixel `first`, the first of the piece in reading order, clockwise.
fn contour(inside: &[bool], [w, h]: [usize; 2], first: usize) -> Vec<DVec2> {
    // Corners of pixels as integers; pixel (x, y) is to the lower right of corner (x, y).
    let pixel = |x: i64, y: i64| {
        x >= 0 && y >= 0 && x < w as i64 && y < h as i64 && inside[y as usize * w + x as usize]
    };
    let start = ((first % w) as i64, (first / w) as i64);
    let (mut x, mut y, mut heading) = (start.0, start.1, 0);
    let mut points = Vec::new();
    loop {
        points.push(DVec2::new(x as f64 - 0.5, y as f64 - 0.5));
        let (dx, dy) = [(1, 0), (0, 1), (-1, 0), (0, -1)][heading];
        (x, y) = (x + dx, y + dy);
        // The pixels ahead, to the left and to the right; fabric stays on the right.
        let [nw, ne, se, sw] = [pixel(x - 1, y - 1), pixel(x, y - 1), pixel(x, y), pixel(x - 1, y)];
        let (left, right) = [(ne, se), (se, sw), (sw, nw), (nw, ne)][heading];
        if !right {
            heading = (heading + 1) % 4;
        } else if left {
            heading = (heading + 3) % 4;
        }
        if (x, y) == start && heading == 0 {
            return points;
        }
    }
}

/// Convex hull, in the direction from x to y.
fn hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(*p - b) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(*p);
        }
        chain.pop();
        chain
    };
    let mut all = half(&mut sorted.iter());
    all.extend(half(&mut sorted.iter().rev()));
    all
}

/// The polygon with `count` corners at most: again and again the one that cuts off the least is left out.
fn simplified(mut polygon: Vec<DVec2>, count: usize) -> Vec<DVec2> {
    while polygon.len() > count.max(4) {
        let n = polygon.len();
        let cut = |k: usize| {
            (polygon[k] - polygon[(k + n - 1) % n]).perp_dot(polygon[(k + 1) % n] - polygon[k]).abs()
        };
        let least = (0..n).min_by(|a, b| cut(*a).total_cmp(&cut(*b))).expect("not empty");
        polygon.remove(least);
    }
    polygon
}

/// The quadrilateral of largest area with its corners among those of a convex polygon.
pub(super) fn widest_quad(polygon: &[DVec2]) -> [DVec2; 4] {
    widest_quad_indices(polygon).map(|k| polygon[k])
}

/// [`widest_quad`] as indices, ascending.
pub(super) fn widest_quad_indices(polygon: &[DVec2]) -> [usize; 4] {
    let n = polygon.len();
    assert!(n >= 4, "a quadrilateral needs 4 corners, not {n}");
    let mut best = (-1.0, [0, 1, 2, 3]);
    for i in 0..n {
        for k in i + 2..n {
            let area = |j: usize| (polygon[k] - polygon[i]).perp_dot(polygon[j] - polygon[i]).abs();
            let widest =
                |range: &mut dyn Iterator<Item = usize>| range.max_by(|a, b| area(*a).total_cmp(&area(*b)));
            let (Some(j), Some(l)) = (widest(&mut (i + 1..k)), widest(&mut (k + 1..n).chain(0..i))) else {
                continue;
            };
            if area(j) + area(l) > best.0 {
                let mut corners = [i, j, k, l];
                corners.sort_unstable();
                best = (area(j) + area(l), corners);
            }
        }
    }
    best.1
}

/// The corners clockwise as seen in the image, the upper left one first.
pub(super) fn from_upper_left(mut quad: [DVec2; 4]) -> [DVec2; 4] {
    if (quad[1] - quad[0]).perp_dot(quad[2] - quad[1]) < 0.0 {
        quad.reverse();
    }
    let middle = quad.iter().sum::<DVec2>() / 4.0;
    // The upper side is the one whose middle is highest.
    let height = |k: usize| (quad[k] + quad[(k + 1) % 4]).y / 2.0 - middle.y;
    let first = (0..4).min_by(|a, b| height(*a).total_cmp(&height(*b))).expect("four sides");
    std::array::from_fn(|k| quad[(first + k) % 4])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted(quad: [DVec2; 4], more: impl Fn(usize, usize) -> bool) -> Image {
        let mut mask = Image::new(200, 160, 1);
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            fill_triangle(triangle.map(|k| quad[k]), [200, 160], true, |x, y| mask.pixel_mut(x, y)[0] = 1.0);
        }
        for y in 0..160 {
            for x in 0..200 {
                if more(x, y) {
                    mask.pixel_mut(x, y)[0] = 1.0;
                }
            }
        }
        mask
    }

    #[test]
    fn corners_of_a_quadrilateral_with_a_pin_and_crumbs() {
        let quad =
            [(40.3, 30.2), (161.7, 21.4), (170.1, 130.6), (31.8, 121.9)].map(|(x, y)| DVec2::new(x, y));
        // A pin that sticks out of a corner, and pieces elsewhere.
        let crumbs = |x: usize, y: usize| (160..163).contains(&x) && (19..24).contains(&y) || x < 3 && y < 3;
        let mut outline = Outline::new(&painted(quad, crumbs), "mask").unwrap();
        assert_eq!(outline.notes.len(), 1, "{:?}", outline.notes);
        let found = outline.corners();
        for k in 0..4 {
            assert!(found[k].distance(quad[k]) < 1.0, "corner {k}: {} instead of {}", found[k], quad[k]);
        }
        assert!(outline.overlap(found) > 0.98);
    }

    #[test]
    fn the_contour_goes_once_around() {
        let mut mask = Image::new(6, 5, 1);
        for (x, y) in [(1, 1), (2, 1), (2, 2), (3, 2), (2, 3)] {
            mask.pixel_mut(x, y)[0] = 1.0;
        }
        let outline = Outline::new(&mask, "mask").unwrap();
        assert_eq!(outline.points.len(), 12);
        assert_eq!(outline.points[0], DVec2::new(0.5, 0.5));
        let n = outline.points.len();
        let area: f64 =
            (0..n).map(|k| outline.points[k].perp_dot(outline.points[(k + 1) % n])).sum::<f64>() / 2.0;
        assert_eq!(area, 5.0);
        assert!(Outline::new(&Image::new(3, 3, 1), "mask").is_err());
    }
}
