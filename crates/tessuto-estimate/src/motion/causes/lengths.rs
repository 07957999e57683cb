//! How long the edges are.

use tessuto_core::mesh::{Mesh, Positions};

/// Of all frames, the fraction in which an edge is shorter than the length that counts.
const QUANTILE: f64 = 0.9;
/// Lengths in found positions are off by this fraction; only what exceeds it counts.
const NOISE: f64 = 0.02;

/// Lengths of the edges of `template` without load `[m]`: as in the template, and longer where the positions
/// `found`, shape [N, V], say that a fold of it hid some.
pub fn rest_lengths(template: &Mesh, found: &[Positions]) -> Vec<f64> {
    let length = |x: &Positions, [a, b]: [u32; 2]| x[a as usize].distance(x[b as usize]);
    let rest = |edge: [u32; 2]| {
        let mut lengths: Vec<f64> = found.iter().map(|x| length(x, edge)).collect();
        lengths.sort_by(f64::total_cmp);
        let seen = lengths[((lengths.len() - 1) as f64 * QUANTILE) as usize];
        // As it is written: a replay starts from the same bits.
        f64::from(length(&template.positions, edge).max(seen / (1.0 + NOISE)) as f32)
    };
    template.edges().into_iter().map(rest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use tessuto_core::mesh::grid;

    #[test]
    fn only_what_opens_for_long_is_longer() {
        let mesh = grid(3, 2, DVec2::new(0.2, 0.1), 1.0);
        let mut frames = vec![mesh.positions.clone(); 10];
        for (n, x) in frames.iter_mut().enumerate() {
            x[2] += DVec3::X * if n > 3 { 0.051 } else { 0.0 };
            x[5] += DVec3::X * if n == 3 { 0.05 } else { 1e-3 };
        }
        let lengths = rest_lengths(&mesh, &frames);
        for ([a, b], l) in mesh.edges().into_iter().zip(lengths) {
            let own = mesh.positions[a as usize].distance(mesh.positions[b as usize]);
            let expected = match [a, b] {
                [1, 2] => 0.151 / 1.02,
                // Only the edge between the moved vertices is much longer by their difference.
                [2, 5] => own.max(0.05f64.hypot(0.1) / 1.02),
                _ => own,
            };
            assert!((l - expected).abs() < 1e-7, "{a} {b}: {l}, {expected}");
        }
    }
}
