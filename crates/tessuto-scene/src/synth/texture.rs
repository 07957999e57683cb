//! A colourful texture with features at many scales: noise in two colours under motifs from large to small.

use std::f64::consts::TAU;

use tessuto_core::image::Image;
use tessuto_core::math::rng::Rng;

/// Colours of the motifs, sRGB.
const INKS: [[f32; 3]; 8] = [
    [0.93, 0.33, 0.24],
    [0.98, 0.76, 0.22],
    [0.10, 0.45, 0.52],
    [0.97, 0.94, 0.86],
    [0.16, 0.20, 0.42],
    [0.95, 0.55, 0.60],
    [0.36, 0.62, 0.33],
    [0.60, 0.26, 0.50],
];
/// Colours that the ground varies between, sRGB.
const GROUNDS: [[f32; 3]; 2] = [[0.90, 0.86, 0.76], [0.52, 0.70, 0.74]];

/// The texture of `seed`, `size`×`size` texels, sRGB.
pub fn texture(size: usize, seed: u64) -> Image {
    let mut rng = Rng::new(seed, 0);
    let octaves = [(4, 0.45), (9, 0.3), (21, 0.25)].map(|(n, weight)| (Lattice::new(n, &mut rng), weight));
    let mut image = Image::new(size, size, 3);
    for y in 0..size {
        for x in 0..size {
            let (u, v) = ((x as f64 + 0.5) / size as f64, (y as f64 + 0.5) / size as f64);
            let noise: f64 = octaves.iter().map(|(lattice, weight)| weight * lattice.at(u, v)).sum();
            let t = ((noise - 0.5) * 2.2 + 0.5).clamp(0.0, 1.0) as f32;
            for (c, out) in image.pixel_mut(x, y).iter_mut().enumerate() {
                *out = GROUNDS[0][c] + t * (GROUNDS[1][c] - GROUNDS[0][c]);
            }
        }
    }
    for (count, radius) in [(16, 0.085), (60, 0.04), (220, 0.018), (420, 0.009)] {
        for _ in 0..count {
            Motif::random(radius, &mut rng).draw(&mut image);
        }
    }
    image
}

/// Value noise: random numbers on a lattice, smooth in between.
pub(super) struct Lattice {
    cells: usize,
    values: Vec<f64>,
}

impl Lattice {
    pub fn new(cells: usize, rng: &mut Rng) -> Self {
        Self { cells, values: (0..(cells + 1) * (cells + 1)).map(|_| rng.uniform()).collect() }
    }

    /// In [0, 1], for u and v in [0, 1).
    pub fn at(&self, u: f64, v: f64) -> f64 {
        let split = |t: f64| {
            let t = t * self.cells as f64;
            let f = t.fract();
            (t as usize, f * f * (3.0 - 2.0 * f))
        };
        let ((i, a), (j, b)) = (split(u), split(v));
        let value = |i: usize, j: usize| self.values[j * (self.cells + 1) + i];
        let row = |j: usize| value(i, j) + a * (value(i + 1, j) - value(i, j));
        row(j) + b * (row(j + 1) - row(j))
    }
}

/// A flower or ring with a heart, in two colours.
struct Motif {
    centre: [f64; 2],
    radius: f64,
    angle: f64,
    petals: f64,
    /// Depth of the cuts between petals, as a fraction of the radius.
    cut: f64,
    /// Radius of the heart, as a fraction of the radius.
    heart: f64,
    inks: [[f32; 3]; 2],
}

impl Motif {
    fn random(radius: f64, rng: &mut Rng) -> Self {
        let first = rng.next_u32() as usize % INKS.len();
        let second = (first + 1 + rng.next_u32() as usize % (INKS.len() - 1)) % INKS.len();
        Self {
            centre: [rng.uniform(), rng.uniform()],
            radius: radius * (1.0 + 0.35 * rng.signed()),
            angle: TAU * rng.uniform(),
            petals: 3.0 + (rng.next_u32() % 6) as f64,
            cut: 0.5 * rng.uniform(),
            heart: 0.25 + 0.4 * rng.uniform(),
            inks: [INKS[first], INKS[second]],
        }
    }

    fn draw(&self, image: &mut Image) {
        let size = image.width as f64;
        let range = |c: f64| {
            let first = ((c - self.radius) * size).floor().max(0.0) as usize;
            first..(((c + self.radius) * size).ceil() as usize).min(image.width)
        };
        let (columns, rows) = (range(self.centre[0]), range(self.centre[1]));
        for y in rows {
            for x in columns.clone() {
                let dx = (x as f64 + 0.5) / size - self.centre[0];
                let dy = (y as f64 + 0.5) / size - self.centre[1];
                let wave = 0.5 + 0.5 * (self.petals * dy.atan2(dx) + self.angle).cos();
                let distance = dx.hypot(dy);
                // Edges are soft over one texel.
                let inside = |r: f64| ((r - distance) * size + 0.5).clamp(0.0, 1.0) as f32;
                let petal = inside(self.radius * (1.0 - self.cut * wave));
                let heart = inside(self.radius * self.heart * (1.0 - self.cut));
                for (c, out) in image.pixel_mut(x, y).iter_mut().enumerate() {
                    *out += petal * (self.inks[0][c] - *out);
                    *out += heart * (self.inks[1][c] - *out);
                }
            }
        }
    }
}
