//! The environment map as it is optimised: the logarithm of the radiance on a coarse grid, later on finer ones.

use serde::{Deserialize, Serialize};

use tessuto_core::optim::Adam;
use tessuto_render::pbr::EnvironmentMap;

/// Radiance on the fine grid is the bilinear interpolation of exp(parameters), partly made grey, times a tint.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct EnvironmentParameters {
    rows: usize,
    tint: [f64; 3],
    /// Logarithm of the radiance, shape [rows, 2·rows, 3].
    logs: Vec<f64>,
    adam: Adam,
}

impl EnvironmentParameters {
    /// The same `radiance` from every direction.
    pub fn new(rows: usize, radiance: f64) -> Self {
        let logs = vec![radiance.ln(); 6 * rows * rows];
        Self { rows, tint: [1.0; 3], adam: Adam::new(logs.len(), 1.0), logs }
    }

    /// Multiplies the light by a factor per channel.
    pub fn rescale(&mut self, factors: [f64; 3]) {
        (0..3).for_each(|c| self.tint[c] *= factors[c]);
    }

    /// Whether its values are those of its grid.
    pub fn matches(&self) -> bool {
        let len = self.rows.checked_mul(self.rows).and_then(|n| n.checked_mul(6));
        len == Some(self.logs.len()) && self.adam.matches(self.logs.len())
    }

    /// Rows of the present grid.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Goes on with grid of `rows` rows.
    pub fn refine(&mut self, rows: usize) {
        let mut logs = vec![0.0; 6 * rows * rows];
        resample(self.rows, rows, |from, to, weight| {
            (0..3).for_each(|c| logs[3 * to + c] += weight * self.logs[3 * from + c]);
        });
        *self = Self { rows, tint: self.tint, adam: Adam::new(logs.len(), 1.0), logs };
    }

    /// The light on a grid of `rows` rows; `colour` 0 is grey, 1 is as it is.
    pub fn environment(&self, rows: usize, colour: f64) -> EnvironmentMap {
        let coarse: Vec<[f64; 3]> = self.radiance(colour);
        let mut sums = vec![[0.0; 3]; 2 * rows * rows];
        resample(self.rows, rows, |from, to, weight| {
            (0..3).for_each(|c| sums[to][c] += weight * coarse[from][c]);
        });
        let texels = sums.into_iter().map(|s| s.map(|v| v as f32)).collect();
        EnvironmentMap { width: 2 * rows, height: rows, texels }
    }

    fn radiance(&self, colour: f64) -> Vec<[f64; 3]> {
        let mix = |l: &[f64]| {
            let e = [l[0].exp(), l[1].exp(), l[2].exp()];
            let grey = (e[0] + e[1] + e[2]) / 3.0;
            [0, 1, 2].map(|c| self.tint[c] * (grey + colour * (e[c] - grey)))
        };
        self.logs.chunks_exact(3).map(mix).collect()
    }

    /// Moves against the gradient with respect to the radiance on the fine grid of `rows` rows.
    pub fn step(&mut self, rows: usize, gradient: &[[f32; 3]], colour: f64, smoothness: f64, rate: f64) {
        let total = self.gradient(rows, gradient, colour, smoothness);
        self.adam.set_learning_rate(rate);
        self.adam.step(&mut self.logs, &total, 1.0);
    }

    /// The gradient with respect to the parameters, from that with respect to the radiance on the fine grid.
    fn gradient(&self, rows: usize, gradient: &[[f32; 3]], colour: f64, smoothness: f64) -> Vec<f64> {
        let mut coarse = vec![[0.0; 3]; 2 * self.rows * self.rows];
        resample(self.rows, rows, |from, to, weight| {
            (0..3).for_each(|c| coarse[from][c] += weight * f64::from(gradient[to][c]));
        });
        self.add_smoothness(smoothness, colour, &mut coarse);
        let mut total = Vec::with_capacity(self.logs.len());
        for (g, l) in coarse.iter().zip(self.logs.chunks_exact(3)) {
            let g = [0, 1, 2].map(|c| g[c] * self.tint[c]);
            let mean = (g[0] + g[1] + g[2]) / 3.0;
            total.extend((0..3).map(|c| l[c].exp() * (colour * g[c] + (1.0 - colour) * mean)));
        }
        total
    }

    /// Adds the gradient of `weight` times the mean absolute difference between neighbours.
    fn add_smoothness(&self, weight: f64, colour: f64, gradient: &mut [[f64; 3]]) {
        let radiance = self.radiance(colour);
        let (h, w) = (self.rows, 2 * self.rows);
        let weight = weight / (3 * h * w) as f64;
        for y in 0..h {
            for x in 0..w {
                let i = y * w + x;
                let mut add = |j: usize| {
                    for c in 0..3 {
                        let d = radiance[j][c] - radiance[i][c];
                        let g = weight * d / (d * d + 1e-4).sqrt();
                        gradient[j][c] += g;
                        gradient[i][c] -= g;
                    }
                };
                add(y * w + (x + 1) % w);
                if y + 1 < h {
                    add(i + w);
                }
            }
        }
    }
}

/// Calls `f(coarse texel, fine texel, weight)` for bilinear interpolation from a grid of `coarse` rows to one of
/// `fine` rows; columns go on around.
fn resample(coarse: usize, fine: usize, mut f: impl FnMut(usize, usize, f64)) {
    let (h, w) = (coarse as isize, 2 * coarse as isize);
    let scale = coarse as f64 / fine as f64;
    for row in 0..fine {
        let y = (row as f64 + 0.5) * scale - 0.5;
        let fy = y - y.floor();
        for column in 0..2 * fine {
            let x = (column as f64 + 0.5) * scale - 0.5;
            let fx = x - x.floor();
            for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
                let r = (y.floor() as isize + dy).clamp(0, h - 1);
                for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
                    let c = (x.floor() as isize + dx).rem_euclid(w);
                    if wx * wy > 0.0 {
                        f((r * w + c) as usize, row * 2 * fine + column, wx * wy);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn a_uniform_sky_stays_uniform_at_any_size() {
        let mut parameters = EnvironmentParameters::new(4, 1.5);
        parameters.refine(8);
        let e = parameters.environment(32, 1.0);
        assert!(e.texels.iter().flatten().all(|v| (v - 1.5).abs() < 1e-6));
    }

    #[test]
    fn gradient_of_a_tinted_light_matches_differences() {
        let mut rng = Rng::new(3, 0);
        let mut parameters = EnvironmentParameters::new(4, 1.2);
        parameters.logs.iter_mut().for_each(|l| *l += 0.5 * rng.signed());
        parameters.rescale([1.4, 0.9, 0.6]);
        let weights: Vec<[f32; 3]> = (0..2 * 64).map(|_| [0; 3].map(|_| rng.signed() as f32)).collect();
        let (colour, smoothness) = (0.7, 0.3);
        let gradient = parameters.gradient(8, &weights, colour, smoothness);
        let value = |logs: &[f64]| {
            let moved = EnvironmentParameters { logs: logs.to_vec(), ..parameters.clone() };
            // In double precision: the light on the fine grid is rounded.
            let coarse = moved.radiance(colour);
            let mut sum = 0.0;
            resample(4, 8, |from, to, weight| {
                sum += (0..3).map(|c| weight * coarse[from][c] * f64::from(weights[to][c])).sum::<f64>();
            });
            let (h, w) = (4, 8);
            for i in 0..h * w {
                let right = i / w * w + (i + 1) % w;
                for j in [Some(right), (i + w < h * w).then_some(i + w)].into_iter().flatten() {
                    let term = |c: usize| ((coarse[j][c] - coarse[i][c]).powi(2) + 1e-4).sqrt();
                    sum += smoothness / (3 * h * w) as f64 * (0..3).map(term).sum::<f64>();
                }
            }
            sum
        };
        let worst = check(&parameters.logs, &gradient, 1e-4, 8, 5, value);
        assert!(worst.relative_error < 1e-6, "{:.1e}", worst.relative_error);
    }

    #[test]
    fn a_step_goes_against_the_gradient() {
        let mut parameters = EnvironmentParameters::new(4, 1.0);
        let mut gradient = vec![[0.0; 3]; 2 * 16 * 16];
        gradient[5 * 32 + 9] = [1.0, 0.0, -1.0];
        parameters.step(16, &gradient, 1.0, 0.0, 0.1);
        let texel = parameters.environment(16, 1.0).texels[5 * 32 + 9];
        assert!(texel[0] < 1.0 && texel[1] == 1.0 && texel[2] > 1.0, "{texel:?}");
    }
}
