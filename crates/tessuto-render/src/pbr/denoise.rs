//! Denoising: irradiance varies slowly along the cloth, so neighbouring pixels share their samples.
//!
//! Light is averaged before it meets the material: colour = diffuse · E + F0 · S + R, with E the irradiance over π and
//! S, R what the microfacets send on. E, S and R are averaged over pixels of one surface that face the same way (a
//! cross bilateral filter), each pixel then takes its own texel. So the texture stays as sharp as it is; the price is
//! that edges of shadows are softened over a few pixels. With radius 0 nothing is averaged.

use glam::Vec3;
use rayon::prelude::*;

/// Pixels that a pixel's own share its light with: those of the square of this radius.
pub(super) const RADIUS: usize = 4;
/// Normals whose difference is longer share no irradiance.
const IRRADIANCE_TURN: f32 = 0.15;
/// The same for the microfacets, per α: a lobe is about α wide.
const LOBE_TURN: f32 = 0.3;
/// Differences of roughness and metallic from which on the microfacets share nothing.
const MATERIAL_STEP: f32 = 0.15;
/// Points farther than this many pixels' widths off the tangent plane are another layer.
const OFF_PLANE: f32 = 3.0;

/// Light at one pixel and what says which others may share it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lit {
    /// Position, seen from the eye `[m]`.
    pub from_eye: Vec3,
    pub normal: Vec3,
    pub roughness: f32,
    pub metallic: f32,
    /// E, S, R by red, green, blue.
    pub parts: [[f32; 3]; 3],
}

/// The parts of every pixel, averaged; shape [height, width], `None` where there is no cloth. `pixel_size` is that
/// of a pixel at unit distance.
pub(super) fn denoise(
    lit: &[Option<Lit>],
    width: usize,
    pixel_size: f32,
    radius: usize,
) -> Vec<[[f32; 3]; 3]> {
    let height = lit.len() / width.max(1);
    let average = |i: usize| {
        let Some(own) = &lit[i] else { return [[0.0; 3]; 3] };
        let (x, y) = (i % width, i / width);
        let gate = Gate::new(own, pixel_size);
        let (mut sums, mut weights) = ([[0.0; 3]; 3], [0.0; 2]);
        for row in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            for column in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                let Some(other) = &lit[row * width + column] else { continue };
                let similarity = gate.similarity(other);
                let apart = (row.abs_diff(y).pow(2) + column.abs_diff(x).pow(2)) as f32;
                let near = bump(apart / ((radius + 1) * (radius + 1)) as f32);
                for (k, part) in other.parts.iter().enumerate() {
                    let w = near * similarity[k.min(1)];
                    (0..3).for_each(|c| sums[k][c] += w * part[c]);
                }
                (0..2).for_each(|k| weights[k] += near * similarity[k]);
            }
        }
        [0, 1, 2].map(|k| sums[k].map(|s| s / weights[k.min(1)]))
    };
    (0..lit.len()).into_par_iter().with_min_len(1024).map(average).collect()
}

/// (1 − t)² up to t = 1, then 0.
fn bump(t: f32) -> f32 {
    let rest = (1.0 - t).max(0.0);
    rest * rest
}

/// What a pixel asks of those that it shares with.
struct Gate<'a> {
    own: &'a Lit,
    off_plane: f32,
    irradiance_turn: f32,
    lobe_turn: f32,
}

impl<'a> Gate<'a> {
    fn new(own: &'a Lit, pixel_size: f32) -> Self {
        let alpha = own.roughness * own.roughness;
        let inverse_square = |s: f32| 1.0 / (s * s);
        Self {
            own,
            off_plane: inverse_square(OFF_PLANE * pixel_size * own.from_eye.length()),
            irradiance_turn: inverse_square(IRRADIANCE_TURN),
            lobe_turn: inverse_square((LOBE_TURN * alpha).min(IRRADIANCE_TURN)),
        }
    }

    /// Weights of the other's irradiance and microfacets.
    fn similarity(&self, other: &Lit) -> [f32; 2] {
        let own = self.own;
        let off = (other.from_eye - own.from_eye).dot(own.normal);
        let layer = bump(off * off * self.off_plane);
        let turn = other.normal.distance_squared(own.normal);
        let step = (other.roughness - own.roughness).abs().max((other.metallic - own.metallic).abs());
        let alike = bump((step / MATERIAL_STEP).powi(2));
        [layer * bump(turn * self.irradiance_turn), layer * alike * bump(turn * self.lobe_turn)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    /// A plane in two halves, the right one far behind, with noise on the light.
    fn plane(width: usize) -> Vec<Option<Lit>> {
        let mut rng = Rng::new(5, 0);
        let pixel = |i: usize| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let behind = i % width >= width / 2;
            let light = if behind { 2.0 } else { 1.0 } + 0.3 * rng.signed() as f32;
            Some(Lit {
                from_eye: Vec3::new(0.001 * x, 0.001 * y, if behind { 1.2 } else { 1.0 }),
                normal: Vec3::NEG_Z,
                roughness: 0.5,
                metallic: 0.0,
                parts: [[light; 3]; 3],
            })
        };
        (0..width * width).map(pixel).collect()
    }

    #[test]
    fn noise_falls_and_layers_do_not_mix() {
        let width = 40;
        let lit = plane(width);
        let spread = |values: &[[[f32; 3]; 3]], part: usize| {
            let square = |i: usize| {
                let truth = if i % width >= width / 2 { 2.0 } else { 1.0 };
                (values[i][part][0] - truth).powi(2)
            };
            ((0..values.len()).map(square).sum::<f32>() / values.len() as f32).sqrt()
        };
        let raw = denoise(&lit, width, 0.001, 0);
        assert!(raw.iter().zip(&lit).all(|(a, b)| *a == b.unwrap().parts));
        let smooth = denoise(&lit, width, 0.001, RADIUS);
        for part in 0..3 {
            let (before, after) = (spread(&raw, part), spread(&smooth, part));
            assert!(after < 0.25 * before, "part {part}: {before} → {after}");
        }
    }
}
