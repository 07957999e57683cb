//! Small pieces of the print and where a frame shows them.

use glam::{DMat2, DVec2};

use crate::motion::observed::pyramid::Level;

/// Pixels of a patch to either side of its centre.
pub const RADIUS: i32 = 4;
/// Least share of a patch that is fabric, in the patch itself and where it is looked for.
const LEAST_SEEN: f32 = 0.6;
/// A patch whose colours have a smaller standard deviation, summed over the channels, shows no print `[sRGB]`.
const LEAST_CONTRAST: f32 = 0.02;
/// Least correlation of a match.
const LEAST_CORRELATION: f64 = 0.6;

/// Colours around a point, less those off the fabric.
pub struct Patch {
    texels: Vec<([i32; 2], [f32; 3])>,
}

/// Where a patch was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Pixel position, at the level at which it was looked for.
    pub place: DVec2,
    /// Correlation of the colours there, at most 1.
    pub correlation: f64,
}

impl Patch {
    /// What `level` shows around `centre`, turned and stretched by `warp`: offsets in the frame that will be searched to offsets in this
    /// one. `None` if too little of it is fabric, or it shows no print.
    pub fn new(level: &Level, centre: DVec2, warp: DMat2) -> Option<Self> {
        let side = || -RADIUS..=RADIUS;
        let at = |x: i32, y: i32| {
            let offset = warp * DVec2::new(f64::from(x), f64::from(y));
            level.colour(centre + offset).map(|colour| ([x, y], colour))
        };
        let texels: Vec<_> = side().flat_map(|y| side().filter_map(move |x| at(x, y))).collect();
        let all = (2 * RADIUS + 1).pow(2) as f32;
        let count = texels.len() as f32;
        if count < LEAST_SEEN * all {
            return None;
        }
        let mut variance = 0.0;
        for c in 0..3 {
            let sum = |power: i32| texels.iter().map(|(_, t)| t[c].powi(power)).sum::<f32>() / count;
            variance += sum(2) - sum(1).powi(2);
        }
        (variance > LEAST_CONTRAST.powi(2)).then_some(Self { texels })
    }
}

/// A frame to be searched: colours, zero off the fabric, and whether there is any, as planes with a border of [`RADIUS`].
pub struct Searched {
    /// Size without the border.
    size: [usize; 2],
    stride: usize,
    colours: [Vec<f32>; 3],
    squares: Vec<f32>,
    fabric: Vec<f32>,
}

/// Sums over the fabric under a patch, for a row of its positions.
#[derive(Default)]
struct Sums {
    count: Vec<f32>,
    seen: [Vec<f32>; 3],
    seen_squares: Vec<f32>,
    own: [Vec<f32>; 3],
    own_squares: Vec<f32>,
    products: Vec<f32>,
}

impl Sums {
    fn clear(&mut self, length: usize) {
        let planes = self.seen.iter_mut().chain(&mut self.own);
        let rest = [&mut self.count, &mut self.seen_squares, &mut self.own_squares, &mut self.products];
        planes.chain(rest).for_each(|plane| {
            plane.clear();
            plane.resize(length, 0.0);
        });
    }

    /// Correlation of all channels together, each about its own mean.
    fn correlation(&self, k: usize) -> Option<f32> {
        let n = self.count[k];
        if n < LEAST_SEEN * ((2 * RADIUS + 1).pow(2)) as f32 {
            return None;
        }
        let (mut product, mut seen, mut own) = (self.products[k], self.seen_squares[k], self.own_squares[k]);
        for c in 0..3 {
            let [a, b] = [self.seen[c][k], self.own[c][k]];
            product -= a * b / n;
            seen -= a * a / n;
            own -= b * b / n;
        }
        let least = n * LEAST_CONTRAST.powi(2);
        (seen > least && own > least).then(|| product / (seen * own).sqrt())
    }
}

impl Searched {
    /// What `level` shows.
    pub fn new(level: &Level) -> Self {
        let (w, h) = (level.view.camera.width, level.view.camera.height);
        let border = RADIUS as usize;
        let stride = w + 2 * border;
        let plane = || vec![0.0; stride * (h + 2 * border)];
        let (mut colours, mut squares, mut fabric) = ([plane(), plane(), plane()], plane(), plane());
        for y in 0..h {
            for x in 0..w {
                let Some(colour) = level.texel(x, y) else { continue };
                let i = (y + border) * stride + x + border;
                (0..3).for_each(|c| colours[c][i] = colour[c]);
                squares[i] = colour.iter().map(|c| c * c).sum();
                fabric[i] = 1.0;
            }
        }
        Self { size: [w, h], stride, colours, squares, fabric }
    }

    /// The place within `reach` pixels of `around` where `patch` correlates best, to a fraction of a pixel.
    pub fn find(&self, patch: &Patch, around: DVec2, reach: f64) -> Option<Match> {
        let range = |centre: f64, size: usize| {
            let from = (centre - reach).round().clamp(0.0, size as f64) as usize;
            let to = ((centre + reach).round() + 1.0).clamp(0.0, size as f64) as usize;
            from..to.max(from)
        };
        let (columns, rows) = (range(around.x, self.size[0]), range(around.y, self.size[1]));
        let width = columns.len();
        let mut sums = Sums::default();
        let mut correlations: Vec<Option<f32>> = Vec::with_capacity(width * rows.len());
        for y in rows.clone() {
            sums.clear(width);
            self.add(patch, columns.start, y, &mut sums);
            correlations.extend((0..width).map(|k| sums.correlation(k)));
        }
        let value = |k: usize| correlations[k].unwrap_or(-1.0);
        let best = (0..correlations.len()).fold(None, |best: Option<usize>, k| match best {
            Some(b) if value(b) >= value(k) => best,
            _ => Some(k),
        })?;
        let (x, y) = (best % width, best / width);
        let along = |step: usize, inner: bool| match inner {
            true => vertex([best - step, best, best + step].map(|k| f64::from(value(k)))),
            false => 0.0,
        };
        let fraction =
            DVec2::new(along(1, (1..width - 1).contains(&x)), along(width, (1..rows.len() - 1).contains(&y)));
        let place = DVec2::new((columns.start + x) as f64, (rows.start + y) as f64) + fraction;
        let correlation = f64::from(value(best));
        (correlation >= LEAST_CORRELATION).then_some(Match { place, correlation })
    }

    /// Adds the sums of `patch` with its centre in row `y` and columns from `first` on.
    fn add(&self, patch: &Patch, first: usize, y: usize, sums: &mut Sums) {
        let length = sums.count.len();
        for ([dx, dy], own) in &patch.texels {
            let row = (y as i32 + RADIUS + dy) as usize * self.stride;
            let from = row + (first as i32 + RADIUS + dx) as usize;
            let [r, g, b] = self.colours.each_ref().map(|plane| &plane[from..from + length]);
            let (squares, fabric) = (&self.squares[from..][..length], &self.fabric[from..][..length]);
            let own_square: f32 = own.iter().map(|c| c * c).sum();
            for k in 0..length {
                sums.count[k] += fabric[k];
                sums.seen_squares[k] += squares[k];
                sums.own_squares[k] += own_square * fabric[k];
                sums.products[k] += own[0] * r[k] + own[1] * g[k] + own[2] * b[k];
            }
            for (c, seen) in [r, g, b].into_iter().enumerate() {
                for k in 0..length {
                    sums.seen[c][k] += seen[k];
                    sums.own[c][k] += own[c] * fabric[k];
                }
            }
        }
    }
}

/// Where the parabola through values at −1, 0 and 1, the middle one largest, is largest.
fn vertex([a, b, c]: [f64; 3]) -> f64 {
    let bend = a - 2.0 * b + c;
    if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::image::Image;
    use crate::math::rng::Rng;
    use crate::motion::observed::pyramid::pyramid;
    use crate::video::Frame;

    const SIZE: [usize; 2] = [44, 36];

    /// A frame of random colours, moved by `shift`, with fabric in all but its left part.
    fn level(shift: [usize; 2], gain: f32) -> Level {
        let [w, h] = SIZE;
        let mut rng = Rng::new(6, 0);
        let print: Vec<f32> = (0..3 * (w + 8) * (h + 8)).map(|_| rng.uniform() as f32).collect();
        let (mut rgb, mut mask) = (Image::new(w, h, 3), Image::new(w, h, 1));
        for y in 0..h {
            for x in 0..w {
                let at = 3 * ((y + 8 - shift[1]) * (w + 8) + x + 8 - shift[0]);
                rgb.pixel_mut(x, y).iter_mut().zip(&print[at..]).for_each(|(c, print)| *c = gain * print);
                mask.pixel_mut(x, y)[0] = f32::from(x > 6);
            }
        }
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: w, height: h };
        pyramid(&Frame { rgb, mask }, &camera.into(), [0, 0]).remove(0)
    }

    /// The correlation of `patch` at a place, one pixel after the other.
    fn plain(level: &Level, patch: &Patch, [x, y]: [usize; 2]) -> Option<f64> {
        let mut pairs = Vec::new();
        for ([dx, dy], own) in &patch.texels {
            let (x, y) = (x as i32 + dx, y as i32 + dy);
            let inside = x >= 0 && y >= 0 && x < SIZE[0] as i32 && y < SIZE[1] as i32;
            let seen = if inside { level.texel(x as usize, y as usize) } else { None };
            pairs.extend(seen.map(|seen| (seen, own)));
        }
        if (pairs.len() as f32) < LEAST_SEEN * 81.0 {
            return None;
        }
        let mut sums = [0.0; 3];
        for c in 0..3 {
            let count = pairs.len() as f64;
            let means = pairs.iter().fold([0.0; 2], |[a, b], (seen, own)| {
                [a + f64::from(seen[c]) / count, b + f64::from(own[c]) / count]
            });
            for (seen, own) in &pairs {
                let [a, b] = [f64::from(seen[c]) - means[0], f64::from(own[c]) - means[1]];
                (sums[0], sums[1], sums[2]) = (sums[0] + a * b, sums[1] + a * a, sums[2] + b * b);
            }
        }
        Some(sums[0] / (sums[1] * sums[2]).sqrt())
    }

    #[test]
    fn a_patch_is_found_where_the_plain_search_finds_it() {
        let (first, moved) = (level([0, 0], 1.0), level([5, 3], 0.7));
        let searched = Searched::new(&moved);
        let mut compared = 0;
        for centre in [[20, 15], [30, 24], [12, 20], [26, 10]] {
            let at = DVec2::from(centre.map(f64::from));
            let patch = Patch::new(&first, at, DMat2::IDENTITY).unwrap();
            let found = searched.find(&patch, at, 9.0).unwrap();
            assert!(
                found.place.distance(at + DVec2::new(5.0, 3.0)) < 0.5 && found.correlation > 0.99,
                "{found:?}"
            );
            for place in [[20, 15], [8, 30], [40, 34], [1, 5], [25, 18]] {
                let around = DVec2::new(place[0] as f64, place[1] as f64);
                let mut sums = Sums::default();
                sums.clear(1);
                searched.add(&patch, place[0], place[1], &mut sums);
                let (fast, slow) = (sums.correlation(0), plain(&moved, &patch, place));
                assert_eq!(fast.is_some(), slow.is_some(), "{around}");
                let (Some(fast), Some(slow)) = (fast, slow) else { continue };
                assert!((f64::from(fast) - slow).abs() < 1e-4, "{fast} {slow}");
                compared += 1;
            }
        }
        assert!(compared > 10, "{compared}");
    }

    #[test]
    fn what_shows_no_print_is_no_patch() {
        let level = level([0, 0], 1.0);
        assert!(Patch::new(&level, DVec2::new(3.0, 15.0), DMat2::IDENTITY).is_none(), "off the fabric");
        let plain = self::level([0, 0], 0.02);
        assert!(Patch::new(&plain, DVec2::new(20.0, 15.0), DMat2::IDENTITY).is_none(), "no contrast");
        assert!(Patch::new(&level, DVec2::new(20.0, 15.0), DMat2::from_angle(0.3)).is_some());
    }
}
