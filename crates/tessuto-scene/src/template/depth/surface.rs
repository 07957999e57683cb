//! A smooth surface through noisy measurements with holes: the depths that fit what was measured and bend least.
//!
//! What is measured has the error `noise`; of the fabric is expected that its curvature is about [`CURVATURE`].
//! The most probable surface under both is a thin plate; measurements far off it count less and less (Geman and
//! McClure).

/// Curvature of folds `[1/m]`: radii of 5 cm.
const CURVATURE: f64 = 20.0;
/// A measurement off by this many standard deviations counts a quarter.
const OUTLIER: f64 = 3.0;
/// Rounds of weighting, and steps of conjugate gradients in each at most.
const ROUNDS: usize = 5;
const STEPS: usize = 400;

/// Depths on a grid of `width` columns: those of `measured` `[m]` (NaN: none) made smooth, holes filled. `pixel`
/// is the distance of two neighbours on the fabric `[m]`, `noise` the standard deviation of a measurement `[m]`.
pub(super) fn smooth(measured: &[f64], width: usize, pixel: f64, noise: f64) -> Vec<f64> {
    let stiffness = (noise / (CURVATURE * pixel * pixel)).powi(2);
    let mut z = plane(measured, width);
    for round in 0..ROUNDS {
        let weight = |(m, z): (&f64, &f64)| {
            if m.is_nan() {
                0.0
            } else if round == 0 {
                1.0
            } else {
                (1.0 + ((m - z) / (OUTLIER * noise)).powi(2)).powi(-2)
            }
        };
        let weights: Vec<f64> = measured.iter().zip(&z).map(weight).collect();
        solve(&mut z, measured, &weights, width, stiffness);
    }
    z
}

/// The plane nearest to the measurements: where the thin plate's solution begins, which does not resist it.
fn plane(measured: &[f64], width: usize) -> Vec<f64> {
    let at = |k: usize| glam::DVec3::new((k % width) as f64, (k / width) as f64, 1.0);
    let (mut matrix, mut right) = (glam::DMat3::ZERO, glam::DVec3::ZERO);
    for (k, m) in measured.iter().enumerate().filter(|(_, m)| !m.is_nan()) {
        let a = at(k);
        matrix += glam::DMat3::from_cols(a * a.x, a * a.y, a * a.z);
        right += a * *m;
    }
    // A trace of damping, for measurements in one line.
    let damped = matrix + glam::DMat3::from_diagonal(glam::DVec3::new(1e-6, 1e-6, 0.0));
    let solution = damped.inverse() * right;
    (0..measured.len()).map(|k| solution.dot(at(k))).collect()
}

/// Conjugate gradients on (W + λ DᵀD) z = W m, from `z` on; D has the second differences along and across, and
/// twice the mixed one.
fn solve(z: &mut [f64], measured: &[f64], weights: &[f64], width: usize, stiffness: f64) {
    let n = z.len();
    let product = |x: &[f64]| {
        let mut out: Vec<f64> = x.iter().zip(weights).map(|(x, w)| x * w).collect();
        bending(x, width, stiffness, &mut out);
        out
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Twelve second differences touch a point, with squares of 1, 4 and 2 between them: 20 times the stiffness.
    let scale: Vec<f64> = weights.iter().map(|w| 1.0 / (w + 20.0 * stiffness)).collect();
    let applied = product(z);
    let right = |k: usize| if weights[k] > 0.0 { weights[k] * measured[k] } else { 0.0 };
    let mut residual: Vec<f64> = (0..n).map(|k| right(k) - applied[k]).collect();
    let mut scaled: Vec<f64> = residual.iter().zip(&scale).map(|(r, s)| r * s).collect();
    let (mut direction, mut square) = (scaled.clone(), dot(&residual, &scaled));
    let enough = 1e-12 * square.max(1e-300);
    for _ in 0..STEPS {
        if square <= enough {
            break;
        }
        let applied = product(&direction);
        let step = square / dot(&direction, &applied);
        for k in 0..n {
            z[k] += step * direction[k];
            residual[k] -= step * applied[k];
            scaled[k] = residual[k] * scale[k];
        }
        let next = dot(&residual, &scaled);
        let turn = next / square;
        direction.iter_mut().zip(&scaled).for_each(|(d, s)| *d = s + turn * *d);
        square = next;
    }
}

/// Adds λ DᵀD x to `out`.
fn bending(x: &[f64], width: usize, stiffness: f64, out: &mut [f64]) {
    let height = x.len() / width;
    let mut add = |points: [usize; 4], factors: [f64; 4], weight: f64| {
        let difference: f64 = points.iter().zip(factors).map(|(p, f)| f * x[*p]).sum();
        points.iter().zip(factors).for_each(|(p, f)| out[*p] += weight * stiffness * f * difference);
    };
    for row in 0..height {
        for column in 0..width {
            let k = row * width + column;
            if column + 2 < width {
                add([k, k + 1, k + 2, k], [1.0, -2.0, 1.0, 0.0], 1.0);
            }
            if row + 2 < height {
                add([k, k + width, k + 2 * width, k], [1.0, -2.0, 1.0, 0.0], 1.0);
            }
            if column + 1 < width && row + 1 < height {
                add([k, k + 1, k + width, k + width + 1], [1.0, -1.0, -1.0, 1.0], 2.0);
            }
        }
    }
}

/// Standard deviation of a measurement `[m]` from what its neighbours let expect: second differences, of which
/// noise makes √6 times its own, by their median.
pub(super) fn noise(measured: &[f64], width: usize) -> Option<f64> {
    let along =
        measured.chunks_exact(width).flat_map(|row| row.windows(3)).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
    let mut known: Vec<f64> = along.filter(|d| !d.is_nan()).collect();
    if known.len() < 16 {
        return None;
    }
    known.sort_by(f64::total_cmp);
    Some(1.4826 * known[known.len() / 2] / 6f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn noise_holes_and_flying_pixels_go_the_fold_stays() {
        let (width, height, pixel, sigma) = (60, 50, 0.006, 0.003);
        let truth = |k: usize| {
            let (x, y) = ((k % width) as f64 * pixel, (k / width) as f64 * pixel);
            1.2 + 0.2 * x + 0.01 * (40.0 * y).sin()
        };
        let mut rng = Rng::new(5, 0);
        let measured: Vec<f64> = (0..width * height)
            .map(|k| match (k % width, k / width) {
                (20..30, 15..25) => f64::NAN,
                _ if rng.uniform() < 0.04 => truth(k) + 0.3,
                _ => truth(k) + sigma * rng.normal(),
            })
            .collect();
        let found = noise(&measured, width).unwrap();
        assert!((found / sigma - 1.0).abs() < 0.3, "{found}");
        let z = smooth(&measured, width, pixel, found);
        let error = |f: &dyn Fn(usize) -> bool| {
            let errors: Vec<f64> =
                (0..z.len()).filter(|k| f(*k)).map(|k| (z[k] - truth(k)).powi(2)).collect();
            (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
        };
        let hole = |k: usize| (20..30).contains(&(k % width)) && (15..25).contains(&(k / width));
        assert!(error(&|k| !hole(k)) < 0.5 * sigma, "{}", error(&|k| !hole(k)));
        assert!(error(&hole) < 1.2 * sigma, "{}", error(&hole));
    }

    #[test]
    fn the_solution_satisfies_its_equations() {
        let measured: Vec<f64> =
            (0..48).map(|k| if k % 7 == 3 { f64::NAN } else { (k * k % 11) as f64 }).collect();
        let weights: Vec<f64> = measured.iter().map(|m| if m.is_nan() { 0.0 } else { 0.7 }).collect();
        let mut z = vec![0.0; 48];
        solve(&mut z, &measured, &weights, 8, 0.3);
        let mut left: Vec<f64> = z.iter().zip(&weights).map(|(z, w)| z * w).collect();
        bending(&z, 8, 0.3, &mut left);
        for k in 0..48 {
            let right = if measured[k].is_nan() { 0.0 } else { 0.7 * measured[k] };
            assert!((left[k] - right).abs() < 1e-5, "{k}: {} {right}", left[k]);
        }
    }
}
