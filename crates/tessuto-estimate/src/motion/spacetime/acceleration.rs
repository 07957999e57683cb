//! The acceleration term ½ Σ_n ‖x_{n+1} − 2 x_n + x_{n−1}‖²/σ² = ½ ‖D x‖²/σ² over all frames: the only one that couples
//! them, by second differences D in time.

use glam::DVec3;

use tessuto_core::math::dot;
use tessuto_core::mesh::Positions;

/// Diagonal of DᵀD in the middle of the clip.
pub const DIAGONAL: f64 = 6.0;

/// D x: x_{n+1} − 2 x_n + x_{n−1} for n = 1 … N−2, shape [N−2, V].
pub fn second_differences(frames: &[Positions]) -> Vec<Positions> {
    let middle = |w: &[Positions]| (0..w[0].len()).map(|i| w[2][i] - w[1][i] * 2.0 + w[0][i]).collect();
    frames.windows(3).map(middle).collect()
}

/// Dᵀ a, the transpose of [`second_differences`] of N frames of V vertices, `shape` = [N, V]; shape [N, V].
pub fn second_differences_transposed(differences: &[Positions], shape: [usize; 2]) -> Vec<Positions> {
    let mut out = vec![vec![DVec3::ZERO; shape[1]]; shape[0]];
    for (n, a) in differences.iter().enumerate() {
        for (i, a) in a.iter().enumerate() {
            out[n][i] += *a;
            out[n + 1][i] -= *a * 2.0;
            out[n + 2][i] += *a;
        }
    }
    out
}

/// ½ `weight` ‖D x‖², where `weight` is 1/σ² [1/m²].
pub fn value(frames: &[Positions], weight: f64) -> f64 {
    let sum: f64 = second_differences(frames).iter().map(|a| dot(a, a)).sum();
    0.5 * weight * sum
}

/// The part of [`value`] of three frames in sequence.
pub fn of_three([a, b, c]: [&Positions; 3], weight: f64) -> f64 {
    let squares = (0..a.len()).map(|i| (c[i] - b[i] * 2.0 + a[i]).length_squared());
    0.5 * weight * squares.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn the_transpose_is_one_and_its_diagonal_is_six() {
        let mut rng = Rng::new(3, 0);
        let mut random =
            |n: usize| -> Vec<Positions> { (0..n).map(|_| (0..5).map(|_| rng.vector()).collect()).collect() };
        let (x, a) = (random(9), random(7));
        let product = |a: &[Positions], b: &[Positions]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f64>();
        let forward = product(&second_differences(&x), &a);
        let back = product(&x, &second_differences_transposed(&a, [9, 5]));
        assert!(forward.abs() > 0.1 && (forward - back).abs() < 1e-12 * forward.abs(), "{forward} {back}");
        let mut unit = vec![vec![DVec3::ZERO; 1]; 9];
        unit[4][0].x = 1.0;
        let diagonal = second_differences_transposed(&second_differences(&unit), [9, 1])[4][0].x;
        assert_eq!(diagonal, DIAGONAL);
    }
}
