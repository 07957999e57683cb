//! How the fabric moves from one frame to another: small windows matched by their gradients, coarse to fine (B.
//! Lucas, T. Kanade, "An iterative image registration technique", 1981; pyramid of J.-Y. Bouguet, 2000), only from
//! pixels of the fabric, joined by a membrane that carries the motion over windows without texture and out beyond
//! the outline.

use tessuto_core::parallel;

use super::frames::Colours;
use super::region::{Field, Region};
use tessuto_core::camera::Rect;

/// Windows are 2·RADIUS + 1 wide `[px]` at every level of the pyramid.
const RADIUS: usize = 6;
/// Coarsest level: the shorter side is at least this long `[px]`.
const COARSEST: usize = 24;
const LEVELS: usize = 5;
const STEPS: usize = 7;
/// Stiffness of the membrane, in squared grey levels per pixel of image gradient.
const MEMBRANE: f32 = 12.0;
const SWEEPS: usize = 80;
/// A difference `[grey levels]` after matching at which a window counts half.
const MISMATCH: f32 = 10.0;

/// Displacements `[px]` on a grid.
pub(super) struct Flow {
    rect: Rect,
    step: usize,
    columns: usize,
    rows: usize,
    /// To the other frame.
    data: Vec<[f32; 2]>,
    /// Of what comes to the grid's places in the other frame.
    arriving: Vec<[f32; 2]>,
}

impl Flow {
    /// The same displacement everywhere.
    #[cfg(test)]
    pub fn uniform(rect: Rect, displacement: [f32; 2]) -> Self {
        let step = 8;
        let (columns, rows) = (rect.width().div_ceil(step) + 1, rect.height().div_ceil(step) + 1);
        let data = vec![displacement; columns * rows];
        Self { rect, step, columns, rows, arriving: data.clone(), data }
    }

    /// The displacement at a place of the image.
    pub fn at(&self, x: f32, y: f32) -> [f32; 2] {
        self.between(&self.data, x, y)
    }

    /// The displacement of what comes to this place.
    pub fn to(&self, x: f32, y: f32) -> [f32; 2] {
        self.between(&self.arriving, x, y)
    }

    fn between(&self, data: &[[f32; 2]], x: f32, y: f32) -> [f32; 2] {
        let place = |v: f32, start: usize, n: usize| {
            let v = ((v - start as f32) / self.step as f32).clamp(0.0, (n - 1) as f32);
            (v as usize, ((v as usize) + 1).min(n - 1), v.fract())
        };
        let (x0, x1, s) = place(x, self.rect.x0, self.columns);
        let (y0, y1, t) = place(y, self.rect.y0, self.rows);
        let d = |i: usize, j: usize| data[j * self.columns + i];
        std::array::from_fn(|c| {
            let (a, b) = (
                d(x0, y0)[c] + s * (d(x1, y0)[c] - d(x0, y0)[c]),
                d(x0, y1)[c] + s * (d(x1, y1)[c] - d(x0, y1)[c]),
            );
            a + t * (b - a)
        })
    }

    /// Where what comes to the grid's places has been: a fixed point.
    fn turned(mut self) -> Self {
        let place = |i: usize| {
            [self.rect.x0 + i % self.columns * self.step, self.rect.y0 + i / self.columns * self.step]
        };
        let origin = |i: usize| {
            let [x, y] = place(i).map(|v| v as f32);
            (0..4).fold([0.0; 2], |d: [f32; 2], _| self.at(x - d[0], y - d[1]))
        };
        self.arriving = (0..self.data.len()).map(origin).collect();
        self
    }

    /// Largest displacement, of either coordinate.
    pub fn largest(&self) -> f32 {
        self.data.iter().flatten().fold(0.0, |m, v| v.abs().max(m))
    }

    /// A field of the first frame, carried to the second.
    pub fn forward(&self, field: &Field, rect: Rect) -> Field {
        carried(rect, |x, y| {
            let d = self.to(x, y);
            field.sample(x - d[0], y - d[1])
        })
    }

    /// A field of the second frame, carried back to the first.
    pub fn back(&self, field: &Field, rect: Rect) -> Field {
        carried(rect, |x, y| {
            let d = self.at(x, y);
            field.sample(x + d[0], y + d[1])
        })
    }
}

fn carried(rect: Rect, value: impl Fn(f32, f32) -> f32) -> Field {
    let mut out = Field::new(rect, 0.0);
    for (y, row) in out.data.chunks_exact_mut(rect.width()).enumerate() {
        for (x, v) in row.iter_mut().enumerate() {
            *v = value((x + rect.x0) as f32, (y + rect.y0) as f32);
        }
    }
    out
}

/// One level of the pyramid.
struct Level {
    width: usize,
    height: usize,
    from: Vec<f32>,
    to: Vec<f32>,
    /// Fraction of the pixel that is fabric, in the first frame.
    weight: Vec<f32>,
}

impl Level {
    fn coarser(&self) -> Self {
        let (w, h) = (self.width / 2, self.height / 2);
        let half = |v: &[f32]| {
            let mean = |i: usize| {
                let k = (i / w) * 2 * self.width + (i % w) * 2;
                0.25 * (v[k] + v[k + 1] + v[k + self.width] + v[k + self.width + 1])
            };
            (0..w * h).map(mean).collect::<Vec<f32>>()
        };
        Self { width: w, height: h, from: half(&self.from), to: half(&self.to), weight: half(&self.weight) }
    }
}

/// Both frames in `rect`, finest first.
fn pyramid(from: &Colours, to: &Colours, inside: &Region, rect: Rect) -> Vec<Level> {
    let grey = |frame: &Colours| {
        let value = |c: [f32; 3]| (c[0] + c[1] + c[2]) / 3.0;
        let pixels = (rect.y0..rect.y1).flat_map(|y| (rect.x0..rect.x1).map(move |x| (x, y)));
        pixels.map(|(x, y)| value(frame.at(x, y))).collect::<Vec<f32>>()
    };
    let weight = inside.within(rect).inside.iter().map(|i| f32::from(u8::from(*i))).collect();
    let (width, height) = (rect.width(), rect.height());
    let mut levels = vec![Level { width, height, from: grey(from), to: grey(to), weight }];
    while levels.len() < LEVELS {
        let next = levels[levels.len() - 1].coarser();
        if next.width.min(next.height) < COARSEST {
            break;
        }
        levels.push(next);
    }
    levels
}

/// The motion of the fabric in `inside` of the first frame; displacements are given within `rect`.
pub(super) fn flow(from: &Colours, to: &Colours, inside: &Region, rect: Rect) -> Flow {
    let step = (rect.width().min(rect.height()) / 48).max(4);
    let (columns, rows) = (rect.width().div_ceil(step) + 1, rect.height().div_ceil(step) + 1);
    let levels = pyramid(from, to, inside, rect);
    let mut data = vec![[0.0_f32; 2]; columns * rows];
    for (k, level) in levels.iter().enumerate().rev() {
        let scale = (1 << k) as f32;
        let matched: Vec<Matched> = parallel::map(columns * rows, |i| {
            let at = [i % columns, i / columns].map(|v| (v * step) as f32 / scale);
            let start = data[i].map(|v| v / scale);
            level.matched(at.map(|v| v.round()), start)
        });
        data.iter_mut().flatten().for_each(|v| *v /= scale);
        membrane(&mut data, &matched, columns);
        data.iter_mut().flatten().for_each(|v| *v *= scale);
    }
    Flow { rect, step, columns, rows, data, arriving: Vec::new() }.turned()
}

/// A textured window of the surroundings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    /// Place in the first frame `[px]`.
    pub at: [f32; 2],
    /// Displacement `[px]`; none where what was there is not found again.
    pub moved: Option<[f32; 2]>,
}

/// The textured windows outside of `region`, spread evenly over `rect`; `None` where there are too few to tell.
/// `noise`: standard deviation of a channel `[grey levels]`.
pub(super) fn outside(
    from: &Colours,
    to: &Colours,
    region: &Region,
    rect: Rect,
    noise: f32,
) -> Option<Vec<Window>> {
    const SIDE: usize = 20;
    const FEWEST: usize = 8;
    let outside = Region { rect, inside: region.within(rect).inside.iter().map(|i| !i).collect() };
    let levels = pyramid(from, to, &outside, rect);
    let size = [rect.width(), rect.height()];
    let of = |k: usize| {
        let at = [k % SIDE, k / SIDE];
        let at: [f32; 2] = std::array::from_fn(|c| (at[c] as f32 + 0.5) * size[c] as f32 / SIDE as f32);
        let place = [at[0] + rect.x0 as f32, at[1] + rect.y0 as f32];
        Some(Window { at: place, moved: window(&levels, at, noise)? })
    };
    let windows: Vec<Window> = parallel::filter_map(SIDE * SIDE, of);
    (windows.iter().filter(|w| w.moved.is_some()).count() >= FEWEST).then_some(windows)
}

/// The displacement `[px]` of the window around `at`, if it is textured; within that none if it is not found again.
fn window(levels: &[Level], at: [f32; 2], noise: f32) -> Option<Option<[f32; 2]>> {
    /// Mean squared gradient in every direction, beyond noise.
    const TEXTURED: f32 = 6.0;
    /// Levels that show whether something stands still: the finest sees least of a smooth wall, the coarser ones see
    /// only what moves beside it.
    const SEEN: usize = 3;
    /// How far what stands still may be off there `[px]`.
    const STILL: f32 = 0.4;
    let place = |k: usize| at.map(|v| (v / (1 << k) as f32).round());
    let mut textured = false;
    for (k, level) in levels.iter().enumerate().take(SEEN) {
        let m = level.matched(place(k), [0.0; 2]);
        textured |= m.texture > TEXTURED;
        // What noise and compression leave; the noise that was measured has motion in it.
        let alike = m.mismatch < noise.min(2.0).powi(2) + 4.0;
        if alike && m.weakest() > TEXTURED && m.displacement[0].hypot(m.displacement[1]) < STILL {
            return Some(Some(m.displacement.map(|v| v * (1 << k) as f32)));
        }
    }
    // What moves, by the finest level that sees its texture.
    let (mut start, mut found) = ([0.0; 2], None);
    for (k, level) in levels.iter().enumerate().rev() {
        let m = level.matched(place(k), start);
        if m.texture > TEXTURED && k < SEEN {
            found = (m.weakest() > TEXTURED).then(|| m.displacement.map(|v| v * (1 << k) as f32));
        }
        start = m.displacement.map(|v| 2.0 * v);
    }
    textured.then_some(found)
}

/// A window's displacement, and how sure each direction of it is.
struct Matched {
    displacement: [f32; 2],
    /// xx, xy, yy of the mean squared gradient, less where the match is bad.
    tensor: [f32; 3],
    /// Mean squared difference that is left, without that of the means.
    mismatch: f32,
    /// Mean squared gradient of the first frame in its weakest direction.
    texture: f32,
}

impl Matched {
    /// That of the tensor.
    fn weakest(&self) -> f32 {
        weakest(self.tensor)
    }
}

/// The lesser eigenvalue of a symmetric matrix xx, xy, yy.
fn weakest([a, b, c]: [f32; 3]) -> f32 {
    0.5 * (a + c - ((a - c).powi(2) + 4.0 * b * b).sqrt())
}

impl Level {
    fn at(&self, image: &[f32], x: f32, y: f32) -> f32 {
        let x = x.clamp(0.0, (self.width - 1) as f32);
        let y = y.clamp(0.0, (self.height - 1) as f32);
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(self.width - 1), (y0 + 1).min(self.height - 1));
        let (s, t) = (x - x0 as f32, y - y0 as f32);
        let row = |y: usize| image[y * self.width + x0] * (1.0 - s) + image[y * self.width + x1] * s;
        row(y0) * (1.0 - t) + row(y1) * t
    }

    /// Matches the window around `at`, beginning with a displacement.
    fn matched(&self, at: [f32; 2], start: [f32; 2]) -> Matched {
        let nothing = Matched { displacement: start, tensor: [0.0; 3], mismatch: f32::MAX, texture: 0.0 };
        let (w, h) = (self.width, self.height);
        let clamp = |v: f32, n: usize| (v.max(0.0) as usize).min(n - 1);
        let (cx, cy) = (clamp(at[0], w), clamp(at[1], h));
        let (x0, x1) = (cx.saturating_sub(RADIUS).max(1), (cx + RADIUS + 1).min(w - 1));
        let (y0, y1) = (cy.saturating_sub(RADIUS).max(1), (cy + RADIUS + 1).min(h - 1));
        // Place, grey level, gradient, weight of each pixel of fabric.
        let mut pixels: Vec<[f32; 6]> = Vec::with_capacity((2 * RADIUS + 1) * (2 * RADIUS + 1));
        let mut mean = [0.0_f32; 3];
        let mut total = 0.0;
        for y in y0..y1 {
            for x in x0..x1 {
                let i = y * w + x;
                let weight = self.weight[i];
                if weight > 0.5 {
                    let gradient = [
                        0.5 * (self.from[i + 1] - self.from[i - 1])
                            * self.weight[i - 1].min(self.weight[i + 1]),
                        0.5 * (self.from[i + w] - self.from[i - w])
                            * self.weight[i - w].min(self.weight[i + w]),
                    ];
                    mean[0] += weight * gradient[0];
                    mean[1] += weight * gradient[1];
                    total += weight;
                    pixels.push([x as f32, y as f32, self.from[i], gradient[0], gradient[1], weight]);
                }
            }
        }
        if total < RADIUS as f32 {
            return nothing;
        }
        mean[0] /= total;
        mean[1] /= total;
        let mut tensor = [1e-3_f32, 0.0, 1e-3];
        for p in &mut pixels {
            // Without their means, so that a change of light is no motion.
            p[3] -= mean[0];
            p[4] -= mean[1];
            tensor[0] += p[5] * p[3] * p[3];
            tensor[1] += p[5] * p[3] * p[4];
            tensor[2] += p[5] * p[4] * p[4];
        }
        let determinant = tensor[0] * tensor[2] - tensor[1] * tensor[1];
        let mut d = start;
        let mut mismatch = 0.0;
        for step in 0..=STEPS {
            let (mut sum, mut slope, mut squares) = (0.0, [0.0_f32; 2], 0.0);
            for p in &pixels {
                let r = p[5] * (p[2] - self.at(&self.to, p[0] + d[0], p[1] + d[1]));
                sum += r;
                slope[0] += r * p[3];
                slope[1] += r * p[4];
                squares += r * r;
            }
            mismatch = (squares / total - (sum / total).powi(2)).max(0.0);
            if step == STEPS || determinant <= 1e-4 * tensor[0].max(tensor[2]) * total {
                break;
            }
            let change = [
                (tensor[2] * slope[0] - tensor[1] * slope[1]) / determinant,
                (tensor[0] * slope[1] - tensor[1] * slope[0]) / determinant,
            ];
            d = [d[0] + change[0], d[1] + change[1]];
            if change[0].hypot(change[1]) < 0.02 {
                break;
            }
        }
        // Seldom whole windows of fabric: those at the border count less.
        let sure = total / ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f32;
        let texture = weakest(tensor.map(|v| v * sure / total));
        // A window that ran away has lost what it followed.
        let away = (d[0] - start[0]).hypot(d[1] - start[1]);
        if away.is_nan() || away > RADIUS as f32 {
            return Matched { texture, ..nothing };
        }
        let weight = sure / (1.0 + mismatch / (MISMATCH * MISMATCH)).powi(2) / total;
        Matched { displacement: d, tensor: tensor.map(|v| v * weight), mismatch, texture }
    }
}

/// The smooth field nearest to the matched windows: Gauss-Seidel sweeps of (T + λ) u = T d + λ Σ neighbours.
fn membrane(data: &mut [[f32; 2]], matched: &[Matched], columns: usize) {
    let rows = data.len() / columns;
    for (value, m) in data.iter_mut().zip(matched) {
        if m.tensor[0] + m.tensor[2] > MEMBRANE {
            *value = m.displacement;
        }
    }
    for sweep in 0..SWEEPS {
        for k in 0..data.len() {
            // There and back, so that a displacement gets across the grid in either direction.
            let i = if sweep % 2 == 0 { k } else { data.len() - 1 - k };
            let (x, y) = (i % columns, i / columns);
            let neighbours = [
                (x > 0).then(|| i - 1),
                (x + 1 < columns).then(|| i + 1),
                (y > 0).then(|| i - columns),
                (y + 1 < rows).then(|| i + columns),
            ];
            let (mut sum, mut count) = ([0.0_f32; 2], 0.0);
            for j in neighbours.into_iter().flatten() {
                sum = [sum[0] + data[j][0], sum[1] + data[j][1]];
                count += 1.0;
            }
            let Matched { displacement: d, tensor: [a, b, c], .. } = &matched[i];
            let stiff = MEMBRANE * count;
            let right = [a * d[0] + b * d[1] + MEMBRANE * sum[0], b * d[0] + c * d[1] + MEMBRANE * sum[1]];
            let (a, c) = (a + stiff, c + stiff);
            let determinant = a * c - b * b;
            data[i] =
                [(c * right[0] - b * right[1]) / determinant, (a * right[1] - b * right[0]) / determinant];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waves without a repeat, turned and moved.
    fn waves(shift: [f32; 2]) -> Colours {
        let mut data = Vec::new();
        for y in 0..120 {
            for x in 0..120 {
                let (u, v) = (x as f32 - shift[0], y as f32 - shift[1]);
                let wave = (0.31 * u + 0.05 * v).sin()
                    + (0.11 * u - 0.27 * v).sin()
                    + (0.07 * u * 0.3 + 0.19 * v).cos();
                data.extend([(128.0 + 35.0 * wave) as u8; 3]);
            }
        }
        Colours { width: 120, data }
    }

    #[test]
    fn a_shift_is_found_and_carries_the_outline_along() {
        let rect = Rect { x0: 0, y0: 0, x1: 120, y1: 120 };
        let mut region = Region { rect, inside: vec![false; 120 * 120] };
        for y in 30..85 {
            (35..80).for_each(|x| region.inside[y * 120 + x] = true);
        }
        for shift in [[3.0, -2.0], [-0.5, 0.25], [9.0, 6.0]] {
            let flow = flow(&waves([0.0; 2]), &waves(shift), &region, rect);
            for (x, y) in [(40.0, 40.0), (60.0, 70.0), (78.0, 33.0), (20.0, 60.0)] {
                let found = flow.at(x, y);
                let off = (found[0] - shift[0]).hypot(found[1] - shift[1]);
                assert!(off < 0.4, "{found:?} for {shift:?} at ({x}, {y})");
            }
            let distance = region.signed_distance(rect);
            let moved = flow.forward(&distance, rect);
            let there = distance.sample(40.0, 50.0);
            assert!((moved.sample(40.0 + shift[0], 50.0 + shift[1]) - there).abs() < 0.4);
            assert!((flow.back(&moved, rect).sample(40.0, 50.0) - there).abs() < 0.5);
        }
    }
}
