//! Gains: the brightness of every vertex and channel relative to the first frame that explains a frame best.

use crate::motion::observed::samples::{SurfaceSample, SurfaceSamples};
use crate::motion::terms::colour::PointColours;
use crate::motion::terms::robust::Noise;

/// Fits of the gains before what depends on them is taken: each goes on from the last.
pub(super) const GAIN_FITS: usize = 3;
/// Jacobi iterations; each starts from the last, so that the gains of a frame settle over the steps of the search.
const ITERATIONS: usize = 30;
/// Pull to 1, relative to the smoothness, that keeps the gains of what is never seen defined.
const PULL: f64 = 1e-3;

/// What a frame shows around a vertex, of the points that the first frame knows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Around {
    /// Σ w b T I and Σ w b T² of every channel, b the vertex's barycentric weight at a point, w the point's robust
    /// weight.
    pub products: [[f64; 2]; 3],
    /// Area of the points [px of the level], each by b.
    pub area: f64,
}

/// Moves `gain`, shape [V, 3], towards the minimum of
///
///   ½ Σ_p w_p (g_p T_p − I_p)² + ½ λ [ Σ_edges (g_a − g_b)² + 1e-3 Σ_v (g_v − 1)² ]
///
/// in each channel, by Jacobi iterations. I is `observed`, T `reference`, g_p linear over p's triangle (its products of
/// two corners are lumped onto the diagonal), w_p the robust weight of `noise` at the start, and λ is
/// `smoothness` times the mean diagonal of the data. Returns what the frame shows around every vertex.
pub fn fit_gain(
    samples: &SurfaceSamples,
    adjacency: &[Vec<u32>],
    reference: &PointColours,
    observed: &PointColours,
    smoothness: f64,
    noise: Noise,
    gain: &mut [[f32; 3]],
) -> Vec<Around> {
    let data = normal_equations(samples, reference, observed, noise, gain);
    let seen = data.iter().filter(|d| d.products[1][1] > 0.0).count().max(1);
    let lambda = [0, 1, 2].map(|k| {
        let mean = data.iter().map(|d| d.products[k][1]).sum::<f64>() / seen as f64;
        (smoothness * mean).max(1e-12)
    });
    // Four numbers a vertex, side by side in a register; the last stays 1.
    let lambda = [lambda[0], lambda[1], lambda[2], 0.0];
    let pull = lambda.map(|lambda| PULL * lambda);
    let fourth = |[a, b, c]: [f64; 3]| [a, b, c, 1.0];
    let numerators: Vec<[f64; 4]> = data.iter().map(|d| fourth(d.products.map(|[num, _]| num))).collect();
    let denominators: Vec<[f64; 4]> = (data.iter().zip(adjacency))
        .map(|(d, around)| {
            let den = fourth(d.products.map(|[_, den]| den));
            std::array::from_fn(|k| den[k] + lambda[k] * around.len() as f64 + pull[k])
        })
        .collect();
    let mut new: Vec<[f32; 4]> = gain.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let mut old = new.clone();
    for _ in 0..ITERATIONS {
        std::mem::swap(&mut old, &mut new);
        for (v, around) in adjacency.iter().enumerate() {
            let mut sum = [0.0; 4];
            for &n in around {
                let g = old[n as usize];
                (0..4).for_each(|k| sum[k] += f64::from(g[k]));
            }
            let (num, den) = (numerators[v], denominators[v]);
            new[v] = std::array::from_fn(|k| ((num[k] + lambda[k] * sum[k] + pull[k]) / den[k]) as f32);
        }
    }
    gain.iter_mut().zip(&new).for_each(|(gain, [r, g, b, _])| *gain = [*r, *g, *b]);
    data
}

/// ‖g_p T_p − I_p‖² of a point.
fn sq_residual(
    point: &SurfaceSample,
    corners: [u32; 3],
    gain: &[[f32; 3]],
    t: &[f32; 3],
    i: &[f32; 3],
) -> f64 {
    let predicted = |k: usize| -> f32 {
        (0..3).map(|c| point.weights[c] as f32 * gain[corners[c] as usize][k]).sum::<f32>() * t[k]
    };
    (0..3).map(|k| f64::from(predicted(k) - i[k]).powi(2)).sum()
}

/// `observed` without the colours that no gain explains, farther than `limit` from g T: something else is in front of
/// the fabric there. Where the first frame says nothing, nothing is left out.
pub fn explained(
    samples: &SurfaceSamples,
    reference: &PointColours,
    mut observed: PointColours,
    gain: &[[f32; 3]],
    limit: f64,
) -> PointColours {
    for ((point, t), i) in samples.points.iter().zip(reference).zip(&mut observed) {
        let (Some(t), Some(colour)) = (t, &*i) else { continue };
        let corners = samples.triangles[point.triangle as usize];
        if sq_residual(point, corners, gain, t, colour) > limit * limit {
            *i = None;
        }
    }
    observed
}

fn normal_equations(
    samples: &SurfaceSamples,
    reference: &PointColours,
    observed: &PointColours,
    noise: Noise,
    gain: &[[f32; 3]],
) -> Vec<Around> {
    let mut data = vec![Around::default(); gain.len()];
    for ((point, t), i) in samples.points.iter().zip(reference).zip(observed) {
        let (Some(t), Some(i)) = (t, i) else { continue };
        let corners = samples.triangles[point.triangle as usize];
        let ratio = noise.geman_mcclure(sq_residual(point, corners, gain, t, i)).1;
        for (c, &v) in corners.iter().enumerate() {
            let around = &mut data[v as usize];
            around.area += point.weights[c] * point.area;
            for k in 0..3 {
                let w = point.weights[c] * ratio * f64::from(t[k]);
                around.products[k][0] += w * f64::from(i[k]);
                around.products[k][1] += w * f64::from(t[k]);
            }
        }
    }
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::camera::Camera;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    const NOISE: Noise = Noise { sigma: 0.03, tail: 3.3 };

    /// Samples of a flat cloth, its adjacency, colours T and colours I = gain·T.
    fn clip(gain: f32) -> (SurfaceSamples, Vec<Vec<u32>>, PointColours, PointColours) {
        let mesh = grid(5, 4, DVec2::new(0.2, 0.15), 1.0);
        let camera = Camera { fx: 200.0, fy: 200.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let samples = SurfaceSamples::new(&mesh, &mesh.positions, &camera.into(), 1.0);
        let mut rng = Rng::new(1, 0);
        let mut colour = || 0.5 + 0.3 * rng.signed() as f32;
        let reference: PointColours =
            samples.points.iter().map(|_| Some([colour(), colour(), colour()])).collect();
        let observed = reference.iter().map(|t| t.map(|t| t.map(|t| gain * t))).collect();
        (samples, mesh.neighbours(), reference, observed)
    }

    #[test]
    fn the_normal_equations_are_the_derivative_of_the_squares() {
        let (samples, _, reference, observed) = clip(1.2);
        let mut rng = Rng::new(2, 0);
        let gain: Vec<[f32; 3]> = (0..20).map(|_| [1.0 + 0.05 * rng.signed() as f32; 3]).collect();
        let data = normal_equations(&samples, &reference, &observed, Noise { sigma: 1.0, tail: 1e9 }, &gain);
        let gradient: Vec<f64> = data
            .iter()
            .zip(&gain)
            .map(|(d, g)| d.products[1][1] * f64::from(g[1]) - d.products[1][0])
            .collect();
        let squares = |g: &[f64]| -> f64 {
            let colours = reference.iter().zip(&observed).map(|(t, i)| [t.unwrap()[1], i.unwrap()[1]]);
            let of_point =
                |(point, [t, i]): (&crate::motion::observed::samples::SurfaceSample, [f32; 2])| -> f64 {
                    let corners = samples.triangles[point.triangle as usize];
                    let term = |c: usize| (g[corners[c] as usize] * f64::from(t) - f64::from(i)).powi(2);
                    (0..3).map(|c| 0.5 * point.weights[c] * term(c)).sum()
                };
            samples.points.iter().zip(colours).map(of_point).sum()
        };
        let at: Vec<f64> = gain.iter().map(|g| f64::from(g[1])).collect();
        let worst = check(&at, &gradient, 1e-4, 10, 3, squares);
        println!("{worst:?}");
        assert!(worst.relative_error < 1e-6, "{worst:?}");
    }

    #[test]
    fn a_change_of_brightness_is_found_and_outliers_are_not() {
        let (samples, adjacency, reference, mut observed) = clip(1.2);
        // One point in fifty shows something else.
        observed.iter_mut().step_by(50).for_each(|i| *i = Some([0.0, 1.0, 0.0]));
        let mut gain = vec![[1.0f32; 3]; 20];
        for _ in 0..30 {
            fit_gain(&samples, &adjacency, &reference, &observed, 1.0, NOISE, &mut gain);
        }
        for g in gain.iter().flatten() {
            assert!((g - 1.2).abs() < 0.01, "{g}");
        }
    }

    #[test]
    fn what_is_in_front_of_the_fabric_is_left_out() {
        let (samples, _, mut reference, mut observed) = clip(1.2);
        observed[3] = Some([0.0, 1.0, 0.0]);
        observed[7] = Some([0.0, 1.0, 0.0]);
        reference[7] = None;
        let seen = explained(&samples, &reference, observed.clone(), &[[1.2; 3]; 20], 2.5 * NOISE.cut_off());
        let left_out: Vec<usize> = (0..seen.len()).filter(|p| seen[*p].is_none()).collect();
        assert_eq!(left_out, [3], "of the two, only the one that the first frame knows");
        assert_eq!(seen[7], observed[7]);
    }
}
