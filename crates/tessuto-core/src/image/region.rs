//! Sets of pixels in a part of the image: polygons, distances to the border, pieces, holes.

use glam::DVec2;

use crate::camera::Rect;

/// A set of pixels; those outside of `rect` are not in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    pub rect: Rect,
    /// Shape [rows of rect · columns of rect].
    pub inside: Vec<bool>,
}

/// Values in a part of the image.
#[derive(Debug, Clone)]
pub struct Field {
    pub rect: Rect,
    /// Shape [rows of rect · columns of rect].
    pub data: Vec<f32>,
}

impl Field {
    pub fn new(rect: Rect, value: f32) -> Self {
        Self { rect, data: vec![value; rect.width() * rect.height()] }
    }

    /// The value at a place of the image `[px]`, between pixels linear, beyond the border that of the border.
    #[inline]
    pub fn sample(&self, x: f32, y: f32) -> f32 {
        let (w, h) = (self.rect.width(), self.rect.height());
        let x = (x - self.rect.x0 as f32).clamp(0.0, (w - 1) as f32);
        let y = (y - self.rect.y0 as f32).clamp(0.0, (h - 1) as f32);
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
        let (s, t) = (x - x0 as f32, y - y0 as f32);
        let row = |y: usize| {
            let (a, b) = (self.data[y * w + x0], self.data[y * w + x1]);
            a + s * (b - a)
        };
        let (a, b) = (row(y0), row(y1));
        a + t * (b - a)
    }
}

/// Number of the pixel (column, row) of the image within a rectangle, if it is there.
#[inline]
pub fn index(rect: Rect, x: usize, y: usize) -> Option<usize> {
    let inside = x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
    inside.then(|| (y - rect.y0) * rect.width() + x - rect.x0)
}

impl Region {
    /// The pixels of an image of this size whose centres are in the polygon (even-odd rule).
    pub fn polygon(corners: &[DVec2], [width, height]: [usize; 2]) -> Self {
        let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };
        let mut inside = vec![false; width * height];
        for y in 0..height {
            let row = y as f64;
            let mut crossings: Vec<f64> = Vec::new();
            for (k, a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if (a.y <= row) != (b.y <= row) {
                    crossings.push(a.x + (row - a.y) / (b.y - a.y) * (b.x - a.x));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let first = pair[0].ceil().max(0.0) as usize;
                let end = (pair[1].floor() + 1.0).clamp(0.0, width as f64) as usize;
                (first..end).for_each(|x| inside[y * width + x] = true);
            }
        }
        Self { rect, inside }
    }

    /// Where a field is positive.
    pub fn positive(field: &Field) -> Self {
        Self { rect: field.rect, inside: field.data.iter().map(|v| *v > 0.0).collect() }
    }

    #[inline]
    pub fn at(&self, x: usize, y: usize) -> bool {
        index(self.rect, x, y).is_some_and(|i| self.inside[i])
    }

    pub fn area(&self) -> usize {
        self.inside.iter().filter(|i| **i).count()
    }

    /// The smallest rectangle around it.
    pub fn bounds(&self) -> Option<Rect> {
        let w = self.rect.width();
        let rows = self.inside.chunks_exact(w).enumerate().filter_map(|(y, row)| {
            let first = row.iter().position(|i| *i)?;
            let last = row.iter().rposition(|i| *i)?;
            Some([(first, y), (last, y)])
        });
        let found = Rect::around(rows.flatten())?;
        let (x, y) = (self.rect.x0, self.rect.y0);
        Some(Rect { x0: found.x0 + x, y0: found.y0 + y, x1: found.x1 + x, y1: found.y1 + y })
    }

    /// The same set, kept in another rectangle; what is outside of that is lost.
    pub fn within(&self, rect: Rect) -> Self {
        let mut inside = Vec::with_capacity(rect.width() * rect.height());
        for y in rect.y0..rect.y1 {
            inside.extend((rect.x0..rect.x1).map(|x| self.at(x, y)));
        }
        Self { rect, inside }
    }

    /// Distance `[px]` of every pixel's centre of `rect` to the border of the set, positive inside. The border of the
    /// image is none.
    pub fn signed_distance(&self, rect: Rect) -> Field {
        let own = self.within(rect);
        let w = rect.width();
        let to_inside = squared_distance(&own.inside, w, true);
        let to_outside = squared_distance(&own.inside, w, false);
        // From centre to centre it is half a pixel farther than to the border.
        let data = own
            .inside
            .iter()
            .zip(to_inside.iter().zip(&to_outside))
            .map(|(inside, (i, o))| if *inside { o.sqrt() - 0.5 } else { 0.5 - i.sqrt() });
        Field { rect, data: data.collect() }
    }

    /// Intersection over union.
    pub fn overlap(&self, other: &Self) -> f64 {
        let (mut both, mut any) = (0_usize, self.area() + other.area());
        for (k, _) in self.inside.iter().enumerate().filter(|(_, i)| **i) {
            let (x, y) = (k % self.rect.width() + self.rect.x0, k / self.rect.width() + self.rect.y0);
            both += usize::from(other.at(x, y));
        }
        any -= both;
        both as f64 / any.max(1) as f64
    }

    /// Pieces that hang together along sides, as lists of pixel numbers, of the set or of what is not in it.
    pub fn pieces(&self, inside: bool) -> Vec<Vec<usize>> {
        let (w, h) = (self.rect.width(), self.rect.height());
        let mut open: Vec<bool> = self.inside.iter().map(|i| *i == inside).collect();
        let mut pieces = Vec::new();
        for start in 0..open.len() {
            if !std::mem::take(&mut open[start]) {
                continue;
            }
            let mut piece = vec![start];
            let mut next = 0;
            while next < piece.len() {
                let i = piece[next];
                next += 1;
                let (x, y) = (i % w, i / w);
                let neighbours = [
                    (x > 0).then(|| i - 1),
                    (x + 1 < w).then(|| i + 1),
                    (y > 0).then(|| i - w),
                    (y + 1 < h).then(|| i + w),
                ];
                for j in neighbours.into_iter().flatten() {
                    if std::mem::take(&mut open[j]) {
                        piece.push(j);
                    }
                }
            }
            pieces.push(piece);
        }
        pieces
    }

    /// Drops pieces of less than `fraction` of the largest, and fills holes of less than `holes` of it.
    pub fn tidied(mut self, fraction: f64, holes: f64) -> Self {
        let pieces = self.pieces(true);
        let largest = pieces.iter().map(Vec::len).max().unwrap_or(0) as f64;
        for piece in pieces.iter().filter(|p| (p.len() as f64) < fraction * largest) {
            piece.iter().for_each(|i| self.inside[*i] = false);
        }
        for hole in self.pieces(false).iter().filter(|p| (p.len() as f64) < holes * largest) {
            hole.iter().for_each(|i| self.inside[*i] = true);
        }
        self
    }
}

/// Squared distance of every pixel to the nearest one that is (`target`) in the set: two passes of lower envelopes of
/// parabolas, P. Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions" (2012). A large number where
/// there is none.
fn squared_distance(inside: &[bool], width: usize, target: bool) -> Vec<f32> {
    const FAR: f32 = 1e8;
    let height = inside.len() / width.max(1);
    let mut field: Vec<f32> = inside.iter().map(|i| if *i == target { 0.0 } else { FAR }).collect();
    let longest = width.max(height);
    let (mut line, mut out) = (vec![0.0; longest], vec![0.0; longest]);
    let (mut roots, mut starts) = (vec![0_usize; longest], vec![0.0_f32; longest + 1]);
    let mut transform = |n: usize, field: &mut [f32], first: usize, step: usize| {
        (0..n).for_each(|k| line[k] = field[first + k * step]);
        let mut top = 0;
        (roots[0], starts[0], starts[1]) = (0, f32::MIN, f32::MAX);
        for q in 1..n {
            let meet = |p: usize| {
                let (p, q) = (p as f32, q as f32);
                ((line[q as usize] + q * q) - (line[p as usize] + p * p)) / (2.0 * (q - p))
            };
            while top > 0 && meet(roots[top]) <= starts[top] {
                top -= 1;
            }
            let start = meet(roots[top]);
            top += 1;
            (roots[top], starts[top], starts[top + 1]) = (q, start, f32::MAX);
        }
        top = 0;
        for q in 0..n {
            while starts[top + 1] < q as f32 {
                top += 1;
            }
            let d = q as f32 - roots[top] as f32;
            out[q] = d * d + line[roots[top]];
        }
        (0..n).for_each(|k| field[first + k * step] = out[k]);
    };
    (0..width).for_each(|x| transform(height, &mut field, x, width));
    (0..height).for_each(|y| transform(width, &mut field, y * width, 1));
    field
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn distances_are_those_of_the_plain_twin() {
        let mut random = Rng::new(3, 0);
        for (w, h) in [(1, 9), (17, 13), (30, 8)] {
            let inside: Vec<bool> = (0..w * h).map(|_| random.uniform() < 0.2).collect();
            for target in [true, false] {
                let fast = squared_distance(&inside, w, target);
                for i in 0..w * h {
                    let to = |j: usize| (i % w).abs_diff(j % w).pow(2) + (i / w).abs_diff(j / w).pow(2);
                    let plain = (0..w * h).filter(|j| inside[*j] == target).map(to).min().unwrap();
                    assert_eq!(fast[i], plain as f32, "{w}×{h}, pixel {i}");
                }
            }
        }
    }

    #[test]
    fn a_polygon_covers_the_centres_inside_of_it() {
        let corners = [(1.5, 0.5), (6.5, 0.5), (6.5, 4.5), (1.5, 4.5)].map(|(x, y)| DVec2::new(x, y));
        let region = Region::polygon(&corners, [9, 7]);
        assert_eq!(region.area(), 5 * 4);
        assert_eq!(region.bounds(), Some(Rect { x0: 2, y0: 1, x1: 7, y1: 5 }));
        let distance = region.signed_distance(region.rect);
        assert_eq!(
            [distance.sample(2.0, 2.0), distance.sample(1.0, 2.0), distance.sample(4.0, 2.0)],
            [0.5, -0.5, 1.5]
        );
        assert_eq!(distance.sample(1.5, 2.0), 0.0);
    }

    #[test]
    fn crumbs_are_dropped_and_pinholes_filled() {
        let rows = ["####...", "#.##..#", "####...", "......."];
        let inside = rows.iter().flat_map(|r| r.chars().map(|c| c == '#')).collect();
        let region = Region { rect: Rect { x0: 10, y0: 5, x1: 17, y1: 9 }, inside };
        assert_eq!((region.pieces(true).len(), region.pieces(false).len()), (2, 2));
        let tidy = region.clone().tidied(0.2, 0.2);
        assert_eq!((tidy.area(), tidy.at(11, 6), tidy.at(16, 6)), (12, true, false));
        assert!((region.overlap(&tidy) - 11.0 / 13.0).abs() < 1e-12);
        assert_eq!(region.within(Rect { x0: 12, y0: 0, x1: 40, y1: 7 }).area(), 5);
    }
}
