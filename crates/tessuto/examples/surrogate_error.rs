//! The surrogate of a simulation step against the solver that it stands for: error of single steps, of rollouts of
//! 50 frames, and time; the linearised integrator beside it.
//!
//! ```sh
//! cargo run --release -p tessuto --example surrogate_error
//! ```

use std::time::Instant;

use glam::{DVec2, DVec3};
use tessuto::math::factor::Scratch;
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::sim::state::StepGradients;
use tessuto::sim::step::{step, step_vjp};
use tessuto::sim::{Cloth, Integrator, State, StepSettings, Stiffness};

const FRAMES: usize = 50;
const SUBSTEPS: usize = 4;
/// Vertices along an edge, spacing [m], stretch [N/m], bend and shear stiffness [J/rad²].
const FABRICS: [(usize, f64, [f64; 3]); 4] = [
    (26, 0.02, [200.0, 1e-3, 1e-4]),
    (32, 0.03, [200.0, 1e-4, 1e-3]),
    (25, 0.02, [900.0, 1e-5, 1e-4]),
    (25, 0.02, [20.0, 5e-3, 5e-3]),
];

/// Mean distance [mm].
fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f64>() * 1e3 / a.len() as f64
}

fn main() {
    for (n, spacing, k) in FABRICS {
        let mut mesh = grid(n, n, DVec2::splat(spacing * (n - 1) as f64), 1.2);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, k);
        let of = |integrator| StepSettings {
            integrator,
            step: 5e-3,
            damping: 0.9,
            tolerance: 1e-8,
            newton_limit: 50,
        };
        let all = [Integrator::ImplicitEuler, Integrator::Surrogate, Integrator::LinearizedEuler].map(of);
        mesh.positions.iter_mut().for_each(|p| p.z += 0.002 * (p.x / (3.0 * spacing)).sin());
        let start = State { v: vec![DVec3::ZERO; n * n], x: mesh.positions.clone() };
        let mut states = [start.clone(), start.clone(), start.clone()];
        let (mut rng, mut scratch) = (Rng::new(1, 0), Scratch::default());
        let (mut forward, mut adjoint, mut single) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let (mut rollouts, mut force) = (String::new(), Vec::new());
        let count = (FRAMES * SUBSTEPS) as f64;
        for s in 0..FRAMES * SUBSTEPS {
            if s % SUBSTEPS == 0 {
                let direction = DVec2::new(rng.signed(), rng.signed()) * 6.2 / (spacing * n as f64);
                let (gust, phase) = (rng.vector() * 12.0, rng.uniform() * std::f64::consts::TAU);
                let wave = |p: &DVec3| gust * (direction.dot(p.truncate()) + phase).sin();
                force = mesh.positions.iter().map(|p| wave(p) + rng.vector() * 2.0).collect();
            }
            // Single steps from where the solver is.
            let before = states[0].clone();
            let mut exact = before.x.clone();
            for (k, settings) in all.iter().enumerate() {
                let clock = Instant::now();
                let tape =
                    step(&cloth, settings, &stiffness, before.clone(), &force, &mut scratch).expect("a step");
                forward[k] += clock.elapsed().as_secs_f64() * 1e3 / count;
                let mut gradients = StepGradients::zeros(&cloth);
                gradients.x.fill(DVec3::ONE);
                let clock = Instant::now();
                step_vjp(&cloth, settings, &stiffness, &tape, &mut gradients, &mut scratch);
                adjoint[k] += clock.elapsed().as_secs_f64() * 1e3 / count;
                if k == 0 {
                    exact.clone_from(&tape.after.x);
                    single[0] += apart(&before.x, &exact) / count;
                } else {
                    single[k] += apart(&tape.after.x, &exact) / count;
                }
            }
            for (state, settings) in states.iter_mut().zip(&all) {
                *state = step(&cloth, settings, &stiffness, state.clone(), &force, &mut scratch)
                    .expect("a step")
                    .after;
            }
            if [10, 20, 30, 50].contains(&((s + 1) / SUBSTEPS)) && (s + 1) % SUBSTEPS == 0 {
                let [exact, surrogate, linear] = &states;
                rollouts += &format!(
                    "  {}: {:.2}, {:.2} of {:.1}",
                    (s + 1) / SUBSTEPS,
                    apart(&surrogate.x, &exact.x),
                    apart(&linear.x, &exact.x),
                    apart(&exact.x, &start.x)
                );
            }
        }
        println!("{n}×{n} vertices, stiffnesses {k:?}");
        println!(
            "  a step moves {:.4} mm; surrogate off by {:.4}, linearised by {:.4} mm",
            single[0], single[1], single[2]
        );
        println!("  off after frames (surrogate, linearised, of the way from the start) [mm]:{rollouts}");
        println!("  forward (solved, surrogate, linearised) {forward:.2?} ms, adjoint {adjoint:.2?} ms");
    }
}
