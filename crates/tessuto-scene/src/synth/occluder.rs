//! Opaque things that move in front of the sheet: hands, and patterned bars.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use tessuto_core::camera::Camera;
use tessuto_core::math::rng::Rng;

/// Part of the sheet's area that one thing covers, from and to.
const SHARE: [f64; 2] = [0.08, 0.12];
/// Time until it is in front of the sheet, from and to `[s]`.
const ENTRY: [f64; 2] = [0.3, 0.5];
/// How far it moves about the sheet's middle, as a fraction of the square root of the sheet's area.
const ROAM: f64 = 0.28;
/// Colours of skin, sRGB.
const SKINS: [[f64; 3]; 4] = [[0.93, 0.76, 0.67], [0.80, 0.59, 0.46], [0.58, 0.39, 0.28], [0.36, 0.24, 0.18]];
/// A hand with its wrist, fingers along +y: ends of capsules and their radii, in widths of a hand.
const HAND: [([f64; 4], f64); 7] = [
    ([0.0, -0.15, 0.0, 0.2], 0.42),
    ([0.0, -0.4, 0.05, -1.0], 0.26),
    ([-0.3, 0.4, -0.42, 0.95], 0.1),
    ([-0.1, 0.5, -0.13, 1.15], 0.11),
    ([0.12, 0.5, 0.15, 1.1], 0.11),
    ([0.32, 0.4, 0.42, 0.85], 0.09),
    ([-0.35, -0.1, -0.72, 0.3], 0.12),
];
/// A bar.
const BAR: [([f64; 4], f64); 1] = [([0.0, -0.6, 0.0, 0.6], 0.4)];
/// Widths by which the table of `HAND` and `BAR` reaches from its middle.
const REACH: f64 = 1.3;

/// What the things are in front of.
#[derive(Debug, Clone, Copy)]
pub struct Behind {
    /// Middle of the sheet in the first frame `[m]`.
    pub centre: DVec3,
    /// Its area `[m²]`, as large as the camera sees it.
    pub area: f64,
    /// Radius of a circle around it `[m]`.
    pub radius: f64,
}

/// One thing. Its place and size are those of its projection on the plane of the sheet's middle, parallel to the image:
/// nearer, it would be smaller.
#[derive(Debug, Clone)]
pub struct Occluder {
    behind: Behind,
    parts: &'static [([f64; 4], f64)],
    /// Metres per unit of `parts`.
    scale: f64,
    /// Direction that it comes from, and distance at the beginning `[m]`.
    from: DVec2,
    /// Time until it has come `[s]`.
    entry: f64,
    /// Frequencies [1/s] and phases of its ways along x and y and of its turns.
    roam: [(f64, f64); 3],
    /// Two colours and how often they alternate along it; skin has one.
    colours: [[f64; 3]; 2],
    stripes: f64,
}

impl Occluder {
    /// The thing number `index` of `seed`: outside of the sheet at the beginning.
    pub fn new(seed: u64, index: usize, behind: Behind) -> Self {
        let mut rng = Rng::new(seed, 16 + index as u64);
        let mut between = |[a, b]: [f64; 2]| a + (b - a) * rng.uniform();
        let angle = between([0.0, TAU]);
        let share = between(SHARE);
        let entry = between(ENTRY);
        let roam = [0, 1, 2].map(|_| (between([0.2, 0.5]), between([0.0, 1.0])));
        let hand = between([0.0, 1.0]) < 0.7;
        let tone = between([0.0, 3.0]);
        let parts: &[_] = if hand { &HAND } else { &BAR };
        let scale = (share * behind.area / area(parts)).sqrt();
        let (low, part) = (tone as usize, tone.fract());
        let skin = [0, 1, 2].map(|c| SKINS[low][c] + part * (SKINS[low + 1][c] - SKINS[low][c]));
        let inks = [[0, 1, 2].map(|_| between([0.1, 0.9])), [0, 1, 2].map(|_| between([0.1, 0.9]))];
        Self {
            behind,
            parts,
            scale,
            from: DVec2::from_angle(angle) * (behind.radius + REACH * scale),
            entry,
            roam,
            colours: if hand { [skin, skin.map(|c| 0.93 * c)] } else { inks },
            stripes: if hand { 9.0 } else { 3.0 },
        }
    }

    /// Middle `[m]`, relative to the sheet's, and direction of its +y axis, `time` `[s]` after the first frame.
    pub fn place(&self, time: f64) -> (DVec2, DVec2) {
        let wave = |(frequency, phase): (f64, f64)| (TAU * (frequency * time + phase)).sin();
        let there = DVec2::new(wave(self.roam[0]), wave(self.roam[1])) * (ROAM * self.behind.area.sqrt());
        let s = (time / self.entry).clamp(0.0, 1.0);
        let inwards = -self.from.normalize();
        let turned = DVec2::from_angle(0.5 * wave(self.roam[2]));
        (self.from.lerp(there, s * s * (3.0 - 2.0 * s)), turned.rotate(inwards))
    }

    /// Pixels that its tips move by while the shutter is open for `exposure` `[s]` about `time` `[s]`.
    pub fn way(&self, camera: &Camera, time: f64, exposure: f64) -> f64 {
        let tip = |s: f64| {
            let (place, up) = self.place(time + s * exposure);
            place + up * (REACH * self.scale)
        };
        let way = tip(-0.5).distance(tip(0.0)) + tip(0.0).distance(tip(0.5));
        way * camera.fx.max(camera.fy) / self.behind.centre.z
    }

    /// Index, coverage and sRGB colour of every pixel of the camera's image that it covers at `time` `[s]`.
    pub fn pixels<'a>(
        &'a self,
        camera: &'a Camera,
        time: f64,
    ) -> impl Iterator<Item = (usize, f32, [f32; 3])> + 'a {
        let (place, up) = self.place(time);
        let z = self.behind.centre.z;
        let pixels_per_unit = DVec2::new(camera.fx, camera.fy) * (self.scale / z);
        let middle = camera.project(self.behind.centre + place.extend(0.0));
        let span = |m: f64, r: f64, n: usize| {
            let clamped = |v: f64| v.clamp(0.0, n as f64) as usize;
            clamped((m - r).floor())..clamped((m + r).ceil() + 1.0)
        };
        let columns = span(middle.x, REACH * pixels_per_unit.x, camera.width);
        let rows = span(middle.y, REACH * pixels_per_unit.y, camera.height);
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y))).filter_map(move |(x, y)| {
            let offset = (DVec2::new(x as f64, y as f64) - middle) / pixels_per_unit;
            let p = DVec2::new(up.perp_dot(offset), up.dot(offset));
            let (distance, height) = depth_inside(self.parts, p);
            let alpha = (0.5 - distance * pixels_per_unit.x).clamp(0.0, 1.0);
            (alpha > 0.0).then(|| (y * camera.width + x, alpha as f32, self.colour(p, height)))
        })
    }

    /// sRGB colour at `p`, whose surface is as high as `height` in [0, 1].
    fn colour(&self, p: DVec2, height: f64) -> [f32; 3] {
        let stripe = 0.5 + 0.5 * (TAU * self.stripes * (p.y + 0.06 * (9.0 * p.x).sin())).sin();
        let light = 0.55 + 0.45 * height;
        [0, 1, 2].map(|c| {
            let [a, b] = self.colours.map(|colour| colour[c]);
            (light * (a + stripe * (b - a))) as f32
        })
    }
}

/// Distance to the outline of `parts`, negative inside, and height of a rounded surface over them in [0, 1].
fn depth_inside(parts: &[([f64; 4], f64)], p: DVec2) -> (f64, f64) {
    parts.iter().fold((f64::INFINITY, 0.0), |(distance, height), ([ax, ay, bx, by], radius)| {
        let (a, b) = (DVec2::new(*ax, *ay), DVec2::new(*bx, *by));
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        let off = p.distance(a.lerp(b, t));
        (f64::min(distance, off - radius), f64::max(height, (1.0 - off / radius).max(0.0).sqrt()))
    })
}

/// Area of `parts`, in squared units.
fn area(parts: &[([f64; 4], f64)]) -> f64 {
    let n = 400;
    let side = 2.0 * REACH / n as f64;
    let at = |k: usize| (k as f64 + 0.5) * side - REACH;
    let cells = (0..n * n).filter(|k| depth_inside(parts, DVec2::new(at(k % n), at(k / n))).0 < 0.0);
    cells.count() as f64 * side * side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_comes_from_outside_and_covers_its_share_at_any_size_of_the_image() {
        assert!((area(&BAR) - (0.96 + TAU / 2.0 * 0.16)).abs() < 0.02);
        for seed in 0..12 {
            let behind = Behind { centre: DVec3::new(0.0, 0.0, 1.1), area: 0.25, radius: 0.36 };
            let thing = Occluder::new(seed, 0, behind);
            let (place, _) = thing.place(0.0);
            assert!(place.length() > behind.radius + thing.scale, "seed {seed}: {place}");
            for size in [200, 400] {
                let f = 0.8 * size as f64;
                let c = 0.5 * (size as f64 - 1.0);
                let camera = Camera { fx: f, fy: f, cx: c, cy: c, width: size, height: size };
                let covered: f32 = thing.pixels(&camera, 1.0).map(|(_, alpha, _)| alpha).sum();
                let share = f64::from(covered) * (1.1 / f) * (1.1 / f) / behind.area;
                assert!((SHARE[0] - 0.003..SHARE[1] + 0.003).contains(&share), "seed {seed}: {share}");
            }
        }
    }

    #[test]
    fn its_way_is_smooth() {
        for seed in 0..12 {
            let behind = Behind { centre: DVec3::Z, area: 0.25, radius: 0.36 };
            let thing = Occluder::new(seed, 1, behind);
            let speed = |k: usize| {
                let t = k as f64 * 1e-3;
                thing.place(t + 1e-3).0.distance(thing.place(t).0) / 1e-3
            };
            let fastest = (0..3000).map(speed).fold(0.0, f64::max);
            assert!((0.1..4.0).contains(&fastest), "seed {seed}: {fastest} m/s");
        }
    }
}
