//! A clip by a camera that moves, as one that stands still would have filmed it. What is behind the fabric is treated
//! as one plane. With the known poses it says where each pixel of the first frame is in every other: a point with ray x
//! in the first camera's axes is at R x + t (m·x) in another's, where m·X = 1 is the plane. The m that makes the
//! surroundings look alike in all frames is found, all frames are carried onto the first, and masks are made of them;
//! these are carried back. Where the surroundings are no plane they do not stand still afterwards, which `steady` sees.

use std::path::Path;

use glam::{DMat3, DVec3};
use tessuto_core::parallel;

use super::frames::{Colours, Frames};
use super::plate::Plate;
use super::refuse::{Origin, unseen};
use super::region::{Field, Region};
use super::segment::Mark;
use crate::io::scene::read_poses;
use tessuto_core::camera::{Camera, Pose, Rect};
use tessuto_core::error::Result;

/// Frames that are compared with the first.
const LOOKS: usize = 12;
/// Places of the first frame that are compared.
const PLACES: usize = 4000;
/// How far from the outline they are, in sizes of the fabric: nearer it may be in front of them, farther off there may
/// be something else than behind it.
const NEAR: f32 = 0.12;
const FAR: f32 = 1.0;
/// The largest parallax that is looked for, in widths of the image, and the steps between, in pixels of the level.
const PARALLAX: f64 = 0.4;
const STEP: f64 = 0.5;
/// Levels of the pyramid, coarse to fine.
const LEVELS: [usize; 3] = [2, 1, 0];
/// Steps of the search at each.
const STEPS: usize = 10;
/// The least parallax `[px]` that is worth a search.
const LEAST: f64 = 0.05;
/// A difference `[grey levels]` that counts half of the most, beyond noise.
const ELSE: f64 = 6.0;
/// What a place costs that a frame does not show.
const UNSEEN: f64 = 0.5;
/// The least fraction of the first frame that all others show, if masks are to be made of them.
const SHOWN: f64 = 0.3;
/// How far the canvas reaches beyond the first frame, in widths and heights of it.
const BEYOND: f64 = 0.5;

/// A clip that stands still, and the way back.
pub(super) struct Steadied {
    /// The frames on a canvas that holds the first one whole.
    pub frames: Frames,
    /// From a place of the first frame to that of every frame, homogeneous `[px]`.
    maps: Vec<DMat3>,
    /// Where the canvas begins in the first frame `[px]`.
    start: [f64; 2],
    /// Size of the recording's frames, and the pixels of the first of them in the canvas.
    size: [usize; 2],
}

/// The clip in `folder` as a camera that stands still saw it; `None` where the camera did.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) naming the pose that is none, and a frame that shows too little of what
/// the first one does.
pub(super) fn steadied(
    folder: &Path,
    camera: &Camera,
    frames: &Frames,
    fabric: &Region,
    (noise, origin): (f32, Origin),
) -> Result<Option<Steadied>> {
    let Some(poses) = read_poses(folder, frames.images.len())? else { return Ok(None) };
    let back = poses[0].inverse();
    let ways: Vec<Pose> = poses.iter().map(|pose| pose.after(&back)).collect();
    let lens = lens(camera, frames.factor);
    let plane = Search::new(frames, fabric, &ways, lens, noise).plane();
    let maps = maps(&ways, lens, plane);
    // What is filled from other frames stands still whatever the poses are.
    if let Some(n) = maps.iter().position(|map| shown(map, frames.size) < SHOWN) {
        return Err(unseen(n, origin));
    }
    Ok(Some(carried(frames, maps)))
}

/// Pixels from the camera's axes, on frames that are smaller by `factor`.
fn lens(camera: &Camera, factor: usize) -> DMat3 {
    let by = factor as f64;
    let at = |c: f64| (c + 0.5) / by - 0.5;
    DMat3::from_cols(
        DVec3::X * (camera.fx / by),
        DVec3::Y * (camera.fy / by),
        DVec3::new(at(camera.cx), at(camera.cy), 1.0),
    )
}

/// Where the first frame's pixels are in every frame, if they lie in `plane`.
fn maps(ways: &[Pose], lens: DMat3, plane: DVec3) -> Vec<DMat3> {
    let inverse = lens.inverse();
    let map = |way: &Pose| {
        let by_plane =
            DMat3::from_cols(way.translation * plane.x, way.translation * plane.y, way.translation * plane.z);
        lens * (way.rotation + by_plane) * inverse
    };
    ways.iter().map(map).collect()
}

/// The pixel that `map` sends (x, y) to; `None` behind the camera.
fn sent(map: &DMat3, x: f64, y: f64) -> Option<[f64; 2]> {
    let p = *map * DVec3::new(x, y, 1.0);
    (p.z > 1e-9).then(|| [p.x / p.z, p.y / p.z])
}

fn is_inside([x, y]: [f64; 2], [width, height]: [usize; 2]) -> bool {
    x >= -0.5 && y >= -0.5 && x <= width as f64 - 0.5 && y <= height as f64 - 0.5
}

/// Fraction of the first frame's pixels that the frame with this `map` shows.
fn shown(map: &DMat3, [width, height]: [usize; 2]) -> f64 {
    let row = |y: usize| (0..width).step_by(4).map(move |x| (x as f64, y as f64));
    let is_shown = |(x, y)| sent(map, x, y).is_some_and(|at| is_inside(at, [width, height]));
    let places = (0..height).step_by(4).flat_map(row);
    let (seen, all) =
        places.fold((0, 0), |(seen, all), place| (seen + usize::from(is_shown(place)), all + 1));
    seen as f64 / f64::from(all.max(1))
}

/// Green channels of a pyramid's levels, each half as wide as the one before.
struct Pyramid(Vec<(usize, usize, Vec<f32>)>);

impl Pyramid {
    fn new(image: &Colours) -> Self {
        let width = image.width;
        let mut levels = vec![(
            width,
            image.data.len() / 3 / width,
            image.data.iter().skip(1).step_by(3).map(|v| f32::from(*v)).collect::<Vec<f32>>(),
        )];
        for _ in 0..LEVELS[0] {
            let (w, h, data) = &levels[levels.len() - 1];
            let (half_w, half_h) = ((w / 2).max(1), (h / 2).max(1));
            let at = |x: usize, y: usize| data[y.min(h - 1) * w + x.min(w - 1)];
            let mean = |k: usize| {
                let (x, y) = (2 * (k % half_w), 2 * (k / half_w));
                (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0
            };
            levels.push((half_w, half_h, (0..half_w * half_h).map(mean).collect()));
        }
        Self(levels)
    }

    /// The value of a level at a place of the finest one.
    fn sample(&self, level: usize, [x, y]: [f64; 2]) -> f64 {
        let (w, h, data) = &self.0[level];
        let by = (1 << level) as f64;
        let place = |v: f64, n: usize| ((v + 0.5) / by - 0.5).clamp(0.0, (n - 1) as f64);
        let (x, y) = (place(x, *w), place(y, *h));
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
        let (s, t) = (x - x0 as f64, y - y0 as f64);
        let at = |x: usize, y: usize| f64::from(data[y * w + x]);
        let (a, b) = (at(x0, y0), at(x0, y1));
        let (a, b) = (a + s * (at(x1, y0) - a), b + s * (at(x1, y1) - b));
        a + t * (b - a)
    }
}

/// The search for the plane.
struct Search<'a> {
    size: [usize; 2],
    lens: DMat3,
    /// Those of the frames that are compared.
    ways: Vec<&'a Pose>,
    images: Vec<Pyramid>,
    first: Pyramid,
    places: Vec<[f64; 2]>,
    /// Parallax `[px]` of the farthest frame, of a plane across the view at distance 1.
    unit: f64,
    scale: f64,
}

impl<'a> Search<'a> {
    fn new(frames: &Frames, fabric: &Region, ways: &'a [Pose], lens: DMat3, noise: f32) -> Self {
        let [width, height] = frames.size;
        let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };
        let size = (fabric.area() as f32).sqrt();
        let distance = fabric.signed_distance(rect);
        let around = |far: f32| {
            let all = (0..width * height).filter(|i| {
                let d = -distance.data[*i];
                d > NEAR * size && d < far * size
            });
            all.collect::<Vec<usize>>()
        };
        let mut all = around(FAR);
        if all.len() < PLACES {
            all = around(f32::INFINITY);
        }
        let every = all.len().div_ceil(PLACES).max(1);
        let place = |i: &usize| [(i % width) as f64, (i / width) as f64];
        let places = all.iter().step_by(every).map(place).collect();
        let last = ways.len() - 1;
        let mut looks: Vec<usize> = (1..=LOOKS).map(|k| (k * last).div_ceil(LOOKS)).collect();
        looks.dedup();
        let images = parallel::over(&looks, |n| Pyramid::new(&frames.images[*n]));
        let far = ways.iter().map(|way| way.translation.length()).fold(0.0, f64::max);
        Self {
            size: frames.size,
            lens,
            ways: looks.iter().map(|n| &ways[*n]).collect(),
            images,
            first: Pyramid::new(&frames.images[0]),
            places,
            unit: far * lens.x_axis.x,
            scale: ELSE.hypot(2.0 * f64::from(noise)),
        }
    }

    /// Differences `[grey levels]` of the places in all frames; NaN where one is out of sight.
    fn differences(&self, plane: DVec3, level: usize) -> Vec<f64> {
        let ways: Vec<Pose> = self.ways.iter().map(|way| **way).collect();
        let maps = maps(&ways, self.lens, plane);
        let of = |(map, image): (&DMat3, &Pyramid)| -> Vec<f64> {
            let one = |place: &[f64; 2]| match sent(map, place[0], place[1]) {
                Some(at) if is_inside(at, self.size) => {
                    image.sample(level, at) - self.first.sample(level, *place)
                }
                _ => f64::NAN,
            };
            self.places.iter().map(one).collect()
        };
        parallel::numbered(&maps, |(k, map)| of((map, &self.images[k]))).into_iter().flatten().collect()
    }

    /// Mean cost, each of at most 1.
    fn cost(&self, differences: &[f64]) -> f64 {
        // A plane that sends the surroundings out of sight explains nothing.
        let one = |e: &f64| if e.is_finite() { e * e / (e * e + self.scale * self.scale) } else { UNSEEN };
        differences.iter().map(one).sum::<f64>() / differences.len().max(1) as f64
    }

    /// m of the plane that makes the surroundings alike.
    fn plane(&self) -> DVec3 {
        if self.unit < 1e-12 || self.places.is_empty() {
            return DVec3::ZERO;
        }
        // In pixels of parallax, which have the same size whatever the unit of the poses is.
        let (coarse, widest) = (LEVELS[0], PARALLAX * self.size[0] as f64);
        let step = STEP * (1 << coarse) as f64;
        let candidates = (0..=(widest / step) as usize).map(|k| DVec3::Z * (k as f64 * step));
        let costs = candidates.map(|p| (self.cost(&self.differences(p / self.unit, coarse)), p));
        let best = costs.reduce(|a, b| if b.0 < a.0 { b } else { a });
        let mut plane = best.map_or(DVec3::ZERO, |(_, p)| p);
        for level in LEVELS {
            plane = self.refined(plane, level);
        }
        plane / self.unit
    }

    /// Gauss-Newton of the robust cost, with numerical slopes.
    fn refined(&self, mut plane: DVec3, level: usize) -> DVec3 {
        let by = |p: DVec3| self.differences(p / self.unit, level);
        let mut now = by(plane);
        let mut damping = 1e-3;
        let delta = 0.25 * (1 << level) as f64;
        for _ in 0..STEPS {
            let slopes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| by(plane + axis * delta));
            let (mut matrix, mut side) = (DMat3::ZERO, DVec3::ZERO);
            for (k, e) in now.iter().enumerate() {
                let slope = DVec3::from_array([0, 1, 2].map(|c: usize| (slopes[c][k] - e) / delta));
                if !(e.is_finite() && slope.is_finite()) {
                    continue;
                }
                let weight = (self.scale / (e * e + self.scale * self.scale)).powi(2);
                matrix += DMat3::from_cols(slope * slope.x, slope * slope.y, slope * slope.z) * weight;
                side -= slope * (e * weight);
            }
            let before = self.cost(&now);
            let diagonal = DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
            let damped = matrix + DMat3::from_diagonal(diagonal * damping + DVec3::splat(1e-12));
            let change = damped.inverse() * side;
            let next = plane + change;
            let there = by(next);
            if change.is_finite() && self.cost(&there) < before {
                (plane, now, damping) = (next, there, damping * 0.3);
                if change.length() < LEAST {
                    break;
                }
            } else {
                damping *= 10.0;
            }
        }
        plane
    }
}

/// All frames on one canvas; what one does not show is filled from the nearest frame that does.
fn carried(frames: &Frames, maps: Vec<DMat3>) -> Steadied {
    let [width, height] = frames.size;
    let (w, h) = (width as f64, height as f64);
    let (mut low, mut high) = ([-0.5_f64; 2], [w - 0.5, h - 0.5]);
    for back in maps.iter().map(DMat3::inverse) {
        for [x, y] in [[-0.5, -0.5], [w - 0.5, -0.5], [-0.5, h - 0.5], [w - 0.5, h - 0.5]] {
            let Some(p) = sent(&back, x, y) else { continue };
            for (c, side) in [w, h].into_iter().enumerate() {
                low[c] = low[c].min(p[c]).max(-BEYOND * side);
                high[c] = high[c].max(p[c]).min((1.0 + BEYOND) * side);
            }
        }
    }
    let start = low.map(f64::floor);
    let size: [usize; 2] = std::array::from_fn(|c| (high[c] - start[c]).ceil() as usize + 1);
    let place = |i: usize| [(i % size[0]) as f64 + start[0], (i / size[0]) as f64 + start[1]];
    let count = size[0] * size[1];
    let drawn: Vec<(Colours, Vec<bool>)> = parallel::numbered(&maps, |(n, map)| {
        let image = &frames.images[n];
        let mut data = Vec::with_capacity(3 * count);
        let mut seen = Vec::with_capacity(count);
        for [x, y] in (0..count).map(place) {
            let at = sent(map, x, y).filter(|at| is_inside(*at, frames.size));
            let colour = at.map_or([0.0; 3], |[x, y]| image.sample(x as f32, y as f32));
            seen.push(at.is_some());
            data.extend(colour.map(|v| v.round() as u8));
        }
        (Colours { width: size[0], data }, seen)
    });
    let filled = |n: usize| {
        let (image, seen) = &drawn[n];
        let mut data = image.data.clone();
        for i in (0..count).filter(|i| !seen[*i]) {
            let nearest = (1..drawn.len())
                .flat_map(|d| [n.checked_sub(d), Some(n + d)])
                .flatten()
                .find(|k| drawn.get(*k).is_some_and(|(_, seen)| seen[i]));
            if let Some((other, _)) = nearest.map(|k| &drawn[k]) {
                data[3 * i..3 * i + 3].copy_from_slice(&other.data[3 * i..3 * i + 3]);
            }
        }
        Colours { width: size[0], data }
    };
    let images = parallel::map(drawn.len(), filled);
    let steady = Frames { size, factor: frames.factor, images };
    Steadied { frames: steady, maps, start, size: frames.size }
}

impl Steadied {
    /// Pixels that the canvas has before the first frame's.
    pub fn before(&self) -> [usize; 2] {
        self.start.map(|v| -v as usize)
    }

    /// A region of the first frame, on the canvas.
    pub fn region(&self, region: &Region) -> Region {
        let [width, height] = self.frames.size;
        let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };
        let [left, top] = self.before();
        let at = |i: usize| {
            let place = (i % width).checked_sub(left).zip((i / width).checked_sub(top));
            place.is_some_and(|(x, y)| x < self.size[0] && y < self.size[1] && region.at(x, y))
        };
        Region { rect, inside: (0..width * height).map(at).collect() }
    }

    /// The empty place as the first camera sees it, on the canvas.
    pub fn plate(&self, plate: &Plate) -> Plate {
        plate.placed(self.before(), self.frames.size)
    }

    /// What was clicked in every frame, on the canvas.
    pub fn marks(&self, marks: &[Vec<Mark>]) -> Vec<Vec<Mark>> {
        let one = |back: &DMat3, mark: &Mark| {
            let [x, y] = sent(back, f64::from(mark.at[0]), f64::from(mark.at[1]))?;
            Some(Mark { at: [(x - self.start[0]) as f32, (y - self.start[1]) as f32], ..*mark })
        };
        let backs = self.maps.iter().map(DMat3::inverse);
        backs.zip(marks).map(|(back, of)| of.iter().filter_map(|mark| one(&back, mark)).collect()).collect()
    }

    /// Coverage of frame `n`, found on the canvas, as that frame has it.
    pub fn back(&self, coverage: &Field, n: usize) -> Field {
        let Rect { x0, y0, x1, y1 } = coverage.rect;
        let [left, top] = self.start;
        let ends = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
        let at = |(x, y): (usize, usize)| sent(&self.maps[n], x as f64 + left, y as f64 + top);
        let ends: Vec<[f64; 2]> = ends.into_iter().filter_map(at).collect();
        let bound = |c: usize, value: f64| value.clamp(0.0, self.size[c] as f64) as usize;
        let low = |c: usize| bound(c, ends.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min).floor() - 1.0);
        let high = |c: usize| bound(c, ends.iter().map(|p| p[c]).fold(0.0, f64::max).ceil() + 2.0);
        let rect = Rect {
            x0: low(0).min(self.size[0] - 1),
            y0: low(1).min(self.size[1] - 1),
            x1: high(0).max(low(0) + 1).min(self.size[0]),
            y1: high(1).max(low(1) + 1).min(self.size[1]),
        };
        let back = self.maps[n].inverse();
        let mut out = Field::new(rect, 0.0);
        for (i, value) in out.data.iter_mut().enumerate() {
            let (x, y) = (i % rect.width() + rect.x0, i / rect.width() + rect.y0);
            let Some([x, y]) = sent(&back, x as f64, y as f64) else { continue };
            let (x, y) = (x - left, y - top);
            let is_there = x > x0 as f64 - 1.0 && y > y0 as f64 - 1.0 && x < x1 as f64 && y < y1 as f64;
            if is_there {
                *value = coverage.sample(x as f32, y as f32);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 110.0, fy: 108.0, cx: 58.0, cy: 46.0, width: 120, height: 90 };
    const COUNT: usize = 6;
    /// m of the wall.
    const WALL: DVec3 = DVec3::new(0.08, -0.05, 0.45);

    fn way(n: usize) -> Pose {
        let t = n as f64;
        Pose {
            rotation: DMat3::from_rotation_y(0.02 * t) * DMat3::from_rotation_z(0.01 * t),
            translation: DVec3::new(-0.05 * t, 0.02 * t, 0.01 * t),
        }
    }

    /// Whether a pixel of the first frame shows the fabric, which hangs in front of the wall.
    fn is_fabric(x: f64, y: f64) -> bool {
        (44.0..76.0).contains(&x) && (30.0..62.0).contains(&y)
    }

    /// A print on the wall, and a bright sheet in the middle of every frame.
    fn clip() -> (Frames, Region, Vec<Pose>) {
        let inverse = lens(&CAMERA, 1).inverse();
        let image = |n: usize| {
            let pose = way(n);
            let value = |i: usize| {
                let (x, y) = ((i % CAMERA.width) as f64, (i / CAMERA.width) as f64);
                if is_fabric(x + n as f64, y) {
                    return 230;
                }
                let ray = pose.rotation.transpose() * (inverse * DVec3::new(x, y, 1.0));
                let eye = -(pose.rotation.transpose() * pose.translation);
                let p = eye + ray * ((1.0 - WALL.dot(eye)) / WALL.dot(ray));
                let print = (9.0 * p.x).sin() + (7.0 * p.y + 2.0 * p.x).cos() + (21.0 * p.x * p.y).sin();
                (110.0 + 25.0 * print) as u8
            };
            let data = (0..CAMERA.width * CAMERA.height).flat_map(|i| [value(i); 3]).collect();
            Colours { width: CAMERA.width, data }
        };
        let size = [CAMERA.width, CAMERA.height];
        let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
        let inside = (0..size[0] * size[1]).map(|i| is_fabric((i % size[0]) as f64, (i / size[0]) as f64));
        let fabric = Region { rect, inside: inside.collect() };
        (
            Frames { size, factor: 1, images: (0..COUNT).map(image).collect() },
            fabric,
            (0..COUNT).map(way).collect(),
        )
    }

    #[test]
    fn the_wall_is_found_and_stands_still() {
        let (frames, fabric, ways) = clip();
        let lens = lens(&CAMERA, 1);
        let found = maps(&ways, lens, Search::new(&frames, &fabric, &ways, lens, 0.5).plane());
        for (n, (a, b)) in found.iter().zip(maps(&ways, lens, WALL)).enumerate() {
            for (x, y) in [(20.0, 20.0), (60.0, 15.0), (100.0, 70.0), (30.0, 75.0)] {
                let ([ax, ay], [bx, by]) = (sent(a, x, y).unwrap(), sent(&b, x, y).unwrap());
                assert!((ax - bx).hypot(ay - by) < 0.5, "frame {n}: {ax},{ay} {bx},{by}");
            }
        }
        let far = sent(&found[COUNT - 1], 60.0, 45.0).unwrap();
        assert!((far[0] - 60.0).hypot(far[1] - 45.0) > 5.0, "it does move: {far:?}");
        let steady = carried(&frames, found);
        let [left, top] = steady.before();
        for n in 1..COUNT {
            for (x, y) in [(22, 20), (60, 15), (95, 70), (30, 75)] {
                let at = |k: usize| steady.frames.images[k].at(x + left, y + top)[1];
                assert!((at(n) - at(0)).abs() < 8.0, "frame {n}: {} {}", at(n), at(0));
            }
        }
    }

    #[test]
    fn what_is_found_on_the_canvas_goes_back_to_its_frame() {
        let (frames, fabric, ways) = clip();
        let steady = carried(&frames, maps(&ways, lens(&CAMERA, 1), WALL));
        let first = steady.region(&fabric);
        assert_eq!(first.area(), fabric.area());
        let coverage =
            Field { rect: first.rect, data: first.inside.iter().map(|i| f32::from(u8::from(*i))).collect() };
        let back = steady.back(&coverage, 0);
        let there = back.data.iter().filter(|v| **v > 0.5).count();
        assert_eq!(there, fabric.area(), "the first frame is as it was");
        // A click and the region below it stay together in every frame.
        let n = COUNT - 1;
        let [x, y] = sent(&steady.maps[n], 60.0, 46.0).unwrap().map(|v| v as f32);
        let mut clicks = vec![Vec::new(); COUNT];
        clicks[n].push(Mark { at: [x, y], inside: true });
        let mark = steady.marks(&clicks)[n][0];
        let [left, top] = steady.before();
        assert!(
            (mark.at[0] - 60.0 - left as f32).abs() < 1e-3 && (mark.at[1] - 46.0 - top as f32).abs() < 1e-3
        );
        assert!(steady.back(&coverage, n).sample(x, y) > 0.99);
    }
}
