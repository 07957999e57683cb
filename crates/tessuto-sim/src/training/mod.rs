//! Training of the surrogate of a simulation step, [`crate::surrogate`]: no data, only the energy of the step.
//! Built with the cargo feature `decoder`, for the crate `burn`.
//!
//! Cloths of random shape, fabric, motion and forces are moved on by the network itself. Every step of the weights
//! looks at one step of a batch of them, in all its iterations: with ΔΦ the change of the incremental potential by
//! an iteration, and r·p/2 the decrease that the smoother's step promises, the loss is the mean of
//! arsinh(ΔΦ/(r·p/2)), whatever the stiffness and the size of the step. Iterations are trained one by one; the
//! gradient does not flow from one to the one before.
//!
//! Source: \[PG-SfT\], which trains on the energy of a step and on what the network itself makes; the loss is ours.

mod pool;
pub mod twin;

use glam::DVec3;
use rayon::prelude::*;

use crate::surrogate::network::{layers, weight_count};
use crate::surrogate::planes::Planes;
use crate::surrogate::{Descent, ITERATIONS};
use pool::Subject;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Positions;
use tessuto_core::optim::Adam;

/// Largest norm of a gradient.
const LARGEST_GRADIENT: f64 = 1.0;

/// How the network is trained.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Steps of the weights.
    pub steps: usize,
    /// Cloths in one step.
    pub batch: usize,
    /// Cloths in all, for each of the sizes.
    pub pool: usize,
    /// Largest length of the steps; it grows to it in the first hundredth, and falls to 0 along a cosine.
    pub rate: f64,
    /// Of everything random.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { steps: 400, batch: 8, pool: 24, rate: 2e-3, seed: 0 }
    }
}

/// Weights that keep the variance of a signal, no biases, and small outputs.
pub fn initial_weights(rng: &mut Rng) -> Vec<f32> {
    let mut weights = Vec::with_capacity(weight_count());
    let layers = layers();
    for (k, [inputs, outputs]) in layers.iter().enumerate() {
        let gain = if k + 1 == layers.len() { 0.1 } else { 1.0 };
        let bound = gain / (*inputs as f64).sqrt();
        weights.extend((0..inputs * outputs * 9).map(|_| (bound * rng.signed()) as f32));
        weights.extend(std::iter::repeat_n(0.0, *outputs));
    }
    weights
}

/// Trains from `weights`; `tell` hears the number of every step and the losses of its iterations. The same
/// weights, to the bit, on the same machine.
pub fn train(
    settings: &Settings,
    weights: &[f32],
    mut tell: impl FnMut(usize, [f64; ITERATIONS]),
) -> Vec<f32> {
    let Settings { steps, batch, pool, rate, seed } = *settings;
    let mut groups: Vec<Vec<Subject>> = (0..3)
        .map(|size| {
            (0..pool).map(|k| Subject::new(Rng::new(seed, (3 * k + size + 1) as u64), size)).collect()
        })
        .collect();
    let mut master: Vec<f64> = weights.iter().map(|w| f64::from(*w)).collect();
    let mut weights = weights.to_vec();
    let mut adam = Adam::new(master.len(), rate);
    for step in 0..steps {
        let group = &mut groups[step % 3];
        let first = (step / 3 * batch) % pool;
        group.rotate_left(first.min(batch));
        let (mut gradient, losses) = batch_gradient(&weights, &mut group[..batch]);
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let shrink = (LARGEST_GRADIENT / norm).min(1.0);
        gradient.iter_mut().for_each(|g| *g *= shrink);
        let part = step as f64 / steps as f64;
        let length = (100.0 * (part + 0.5 / steps as f64)).min(1.0)
            * 0.5
            * (1.0 + (std::f64::consts::PI * part).cos());
        adam.step(&mut master, &gradient, length);
        weights = master.iter().map(|w| *w as f32).collect();
        tell(step, losses);
    }
    weights
}

/// ∂loss/∂weights over one step of all `subjects`, which it moves on, and the loss of every iteration.
fn batch_gradient(weights: &[f32], subjects: &mut [Subject]) -> (Vec<f64>, [f64; ITERATIONS]) {
    let share = 1.0 / subjects.len() as f64;
    let inertial: Vec<Positions> = subjects
        .par_iter_mut()
        .map(|s| {
            let g = s.accelerations();
            let parts = s.state.x.iter().zip(&s.state.v).zip(&g);
            parts.map(|((x, v), g)| *x + *v * (s.h * s.damping) + *g * (s.h * s.h)).collect()
        })
        .collect();
    let mut shapes = inertial.clone();
    let mut gradient = vec![0.0; weights.len()];
    let mut losses = [0.0; ITERATIONS];
    for loss in &mut losses {
        let problem = |k: usize| {
            let s = &subjects[k];
            let lattice = s.cloth.lattice.as_deref().expect("made of quads");
            Descent::new(&s.cloth, lattice, &s.stiffness, s.h, inertial[k].clone())
        };
        let views: Vec<_> =
            (0..shapes.len()).into_par_iter().map(|k| problem(k).view::<f32>(&shapes[k])).collect();
        let inputs: Vec<Planes<f32>> = views.iter().map(|v| v.inputs.clone()).collect();
        let graph = twin::forward(weights, &inputs);
        let outputs = graph.outputs();
        let results: Vec<(Positions, f64, Planes<f32>)> = (0..shapes.len())
            .into_par_iter()
            .map(|k| {
                let (problem, view) = (problem(k), &views[k]);
                let moves = problem.moves(view, &outputs[k]);
                let after: Positions = shapes[k].iter().zip(&moves).map(|(z, m)| *z + *m).collect();
                let promised = view.promised();
                let change = (problem.potential(&after) - problem.potential(&shapes[k])) / promised;
                let slope = share / (promised * (1.0 + change * change).sqrt());
                let mut by_moves: Vec<DVec3> = problem.residual(&after).iter().map(|r| *r * -slope).collect();
                let by_output = problem.moves_vjp(view, &mut by_moves);
                (after, change.asinh() * share, by_output)
            })
            .collect();
        *loss = results.iter().map(|(_, loss, _)| loss).sum();
        let by_outputs: Vec<Planes<f32>> = results.iter().map(|(_, _, by)| by.clone()).collect();
        let by_weights = graph.backward(&by_outputs);
        gradient.iter_mut().zip(&by_weights).for_each(|(sum, g)| *sum += f64::from(*g));
        shapes = results.into_iter().map(|(after, _, _)| after).collect();
    }
    subjects.iter_mut().zip(shapes).for_each(|(s, x)| s.advance(x));
    (gradient, losses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_bytes_for_any_threads_and_a_lower_loss() {
        let settings = Settings { steps: 12, batch: 2, pool: 2, ..Settings::default() };
        let start = initial_weights(&mut Rng::new(0, 0));
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut losses = Vec::new();
            (pool.install(|| train(&settings, &start, |_, of| losses.push(of[0]))), losses)
        };
        let (one, losses) = run(1);
        assert!(one == run(2).0 && one != start);
        let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
        assert!(mean(&losses[9..]) < mean(&losses[..3]), "{losses:?}");
    }
}
