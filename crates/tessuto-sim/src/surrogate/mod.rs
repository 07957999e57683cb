//! A step of springs on a regular grid, taken by a small convolutional network instead of a solver.
//!
//! The inertial positions y = x + h δ v + h² g are moved [`ITERATIONS`] times towards the minimum of the
//! incremental potential Φ that implicit Euler minimises ([`super::implicit_euler`]). Each time the residual −∂Φ
//! makes two steps: p = A⁻¹ (−∂Φ) with masses and a Laplacian that bound ∂²Φ, and q = n A'⁻¹ (−n·∂Φ) along the
//! normals n, with a softer Laplacian. The network sees, in the frame of every vertex, p and q in units of p's
//! root mean square, the vectors to the next vertices, their tensions, and the three stiffnesses. It answers with
//! factors: of p along each vector of the frame, and of q. What they make is added to p, without its net momentum.
//!
//! So turned cloth moves alike, turned; a cloth in balance stays; and a network that answers 0 leaves a step of
//! projective dynamics, which is also what is taken where the answer would not lower Φ: else stiff, limp cloth can
//! explode.
//!
//! Source of the idea: \[PG-SfT\]; there the network sees the state alone and answers with accelerations. Such a
//! network was tried first (docs/experiments/log/methods.md): the errors of its long waves add up.

mod descent;
mod frames;
pub mod network;
pub mod planes;
mod smoother;

use glam::DVec3;

pub use descent::{Descent, DescentGradients, Iteration, View};
use network::{Network, trained};
use planes::Float;

use super::cloth::Cloth;
use super::lattice::Lattice;
use super::state::{State, StepGradients, StepSettings, StepTape, check_finite};
use super::stiffness::Stiffness;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;

/// How often the network moves the shape.
pub const ITERATIONS: usize = 2;

/// One step; see the module and [`super::step::step`] for the arguments.
pub fn step(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
) -> Result<StepTape> {
    step_with(trained(), cloth, settings, stiffness, before, acceleration)
}

/// Adjoint of [`step`]; see [`super::step::step_vjp`].
pub fn step_vjp(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    tape: &StepTape,
    gradients: &mut StepGradients,
    scratch: &mut Scratch,
) {
    step_vjp_with(trained(), cloth, settings, stiffness, tape, gradients, scratch);
}

/// The image of `cloth`.
///
/// # Errors
/// [`Error::Input`] if it is of another elastic model, or not on a regular grid.
pub fn lattice(cloth: &Cloth) -> Result<&Lattice> {
    let refused = || {
        let hint = Hint::from("make a regular grid of it").with(Remedy::Regrid);
        Error::input(
            "template",
            "is no regular grid of quads, and the surrogate (dynamics.integrator) takes no other",
            hint,
        )
    };
    cloth.lattice.as_deref().ok_or_else(refused)
}

fn inertial(settings: &StepSettings, before: &State, acceleration: &[DVec3]) -> Positions {
    let h = settings.step;
    let parts = before.x.iter().zip(&before.v).zip(acceleration);
    parts.map(|((x, v), g)| *x + *v * (h * settings.damping) + *g * (h * h)).collect()
}

/// [`step`] with any network.
///
/// # Errors
/// As [`lattice`]; [`Error::Numerical`] if the result is not finite.
pub fn step_with<T: Float>(
    network: &Network<T>,
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
) -> Result<StepTape> {
    let h = settings.step;
    check_finite("surrogate step", &before, acceleration)?;
    let y = inertial(settings, &before, acceleration);
    let descent = Descent::new(cloth, lattice(cloth)?, stiffness, h, y.clone());
    let mut x = descent.start().clone();
    for _ in 0..ITERATIONS {
        descent.iterate(network, &mut x);
    }
    if let Some(vertex) = x.iter().position(|x| !x.is_finite()) {
        let hint = "use the implicit_euler integrator, more sub-steps or smaller forces";
        let problem = format!("position {} m", x[vertex]);
        return Err(Error::numerical(format!("surrogate step, vertex {vertex}"), problem, hint));
    }
    let v = x.iter().zip(&before.x).map(|(after, before)| (*after - *before) / h).collect();
    Ok(StepTape { after: State { x, v }, before, factor: None, inertial: Some(y) })
}

/// Adjoint of [`step_with`].
///
/// # Panics
/// If the cloth is not on a regular grid: then there was no step.
pub fn step_vjp_with<T: Float>(
    network: &Network<T>,
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    tape: &StepTape,
    gradients: &mut StepGradients,
    scratch: &mut Scratch,
) {
    let h = settings.step;
    let lattice = lattice(cloth).expect("the step was taken");
    // What the iterations computed is not on the tape, which would be ten times as large: they are taken again.
    let descent =
        Descent::new(cloth, lattice, stiffness, h, tape.inertial.clone().expect("a surrogate's step"));
    let mut x = descent.start().clone();
    let iterations: Vec<_> = (0..ITERATIONS).map(|_| descent.iterate(network, &mut x)).collect();
    let mut grad: Positions = gradients.x.iter().zip(&gradients.v).map(|(x, v)| *x + *v / h).collect();
    let mut by = DescentGradients {
        y: vec![DVec3::ZERO; x.len()],
        stiffness: &mut gradients.stiffness,
        rest_lengths: &mut gradients.rest_lengths,
    };
    for iteration in iterations.iter().rev() {
        descent.iterate_vjp(network, iteration, &mut grad, &mut by, scratch);
    }
    for (i, (by_y, grad)) in by.y.iter().zip(&grad).enumerate() {
        let by_y = *by_y + *grad;
        gradients.x[i] = by_y - gradients.v[i] / h;
        gradients.v[i] = by_y * (h * settings.damping);
        gradients.acceleration[i] = by_y * (h * h);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::{Accelerations, Integrator, RolloutInputs, rollout, rollout_vjp};
    use tessuto_core::math::gradient_check::{Worst, check, check_coarse};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::math::{dot, flat, vectors};
    use tessuto_core::mesh::grid;

    const SETTINGS: StepSettings = StepSettings {
        integrator: Integrator::Surrogate,
        step: 5e-3,
        damping: 0.9,
        tolerance: 1e-9,
        newton_limit: 50,
    };

    /// A bent, shaken cloth at rest in another bent shape.
    fn problem() -> (Cloth, State, Positions) {
        let mut rng = Rng::new(3, 0);
        let mut mesh = grid(6, 5, DVec2::new(0.1, 0.09), 1.0);
        mesh.positions.iter_mut().for_each(|p| p.z += 0.01 * (40.0 * p.x).sin());
        let cloth = Cloth::new(&mesh);
        let mut shaken =
            |x: &DVec3| DVec3::new(x.x, x.y, x.z + 0.01 * (50.0 * x.y).cos()) + rng.vector() * 2e-4;
        let x: Positions = mesh.positions.iter().map(&mut shaken).collect();
        let v = x.iter().map(|_| rng.vector() * 0.1).collect();
        let g = x.iter().map(|_| rng.vector() * 5.0).collect();
        (cloth, State { x, v }, g)
    }

    fn check_adjoint(network: &Network<f64>, is_answered: bool) {
        let (mut cloth, state, g) = problem();
        let k = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let y = inertial(&SETTINGS, &state, &g);
        let descent = Descent::new(&cloth, lattice(&cloth).unwrap(), &k, SETTINGS.step, y.clone());
        assert_eq!(descent.iterate(network, &mut y.clone()).is_answered(), is_answered);
        let mut rng = Rng::new(7, 0);
        let [by_x, by_v]: [Positions; 2] = [(); 2].map(|()| g.iter().map(|_| rng.vector()).collect());
        let value = |cloth: &Cloth, k: &Stiffness, x: &[DVec3], v: &[DVec3], g: &[DVec3]| {
            let before = State { x: x.to_vec(), v: v.to_vec() };
            let after = step_with(network, cloth, &SETTINGS, k, before, g).unwrap().after;
            dot(&after.x, &by_x) + dot(&after.v, &by_v) * 0.01
        };
        let tape = step_with(network, &cloth, &SETTINGS, &k, state.clone(), &g).unwrap();
        let mut gradients = StepGradients::zeros(&cloth);
        gradients.x.clone_from(&by_x);
        gradients.v = by_v.iter().map(|v| *v * 0.01).collect();
        step_vjp_with(network, &cloth, &SETTINGS, &k, &tape, &mut gradients, &mut Scratch::default());
        let report = |name: &str, worst: Worst| {
            println!("{name}: {worst:?}");
            assert!(worst.relative_error < 1e-6, "{name}: {worst:?}");
        };
        let (x, v) = (&state.x, &state.v);
        let of_x = |x: &[f64]| value(&cloth, &k, &vectors(x), v, &g);
        report("x", check(flat(x), flat(&gradients.x), 1e-7, 10, 1, of_x));
        let of_v = |v: &[f64]| value(&cloth, &k, x, &vectors(v), &g);
        report("v", check(flat(v), flat(&gradients.v), 1e-5, 10, 2, of_v));
        let of_g = |g: &[f64]| value(&cloth, &k, x, v, &vectors(g));
        report("g", check(flat(&g), flat(&gradients.acceleration), 1e-3, 10, 3, of_g));
        for (name, pick) in [("stretch", 0), ("bend", 1), ("shear", 2)] {
            let list = |k: &Stiffness| [&k.stretch, &k.bend, &k.shear][pick].clone();
            let own = list(&k);
            // Stiffnesses in units of themselves.
            let unit = own[0];
            let gradient: Vec<f64> = list(&gradients.stiffness).iter().map(|g| g * unit).collect();
            let of = |values: &[f64]| {
                let mut other = k.clone();
                *[&mut other.stretch, &mut other.bend, &mut other.shear][pick] =
                    values.iter().map(|k| k * unit).collect();
                value(&cloth, &other, x, v, &g)
            };
            report(name, check(&vec![1.0; own.len()], &gradient, 1e-4, 10, 4, of));
        }
        let lengths: Vec<f64> = cloth.edges.iter().map(|e| e.rest_length).collect();
        let gradient = gradients.rest_lengths.clone();
        let of_lengths = |lengths: &[f64]| {
            cloth.edges.iter_mut().zip(lengths).for_each(|(e, l)| e.rest_length = *l);
            value(&cloth, &k, x, v, &g)
        };
        report("rest lengths", check(&lengths, &gradient, 1e-7, 10, 5, of_lengths));
    }

    /// With the network, and with one whose answers are refused.
    #[test]
    fn the_adjoint_is_differences() {
        let weights = network::trained_weights();
        check_adjoint(&Network::new(&weights).unwrap(), true);
        let wild: Vec<f32> = weights.iter().map(|w| w * 30.0).collect();
        check_adjoint(&Network::new(&wild).unwrap(), false);
    }

    #[test]
    fn single_precision_is_enough() {
        let (cloth, state, g) = problem();
        let k = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let wide = Network::<f64>::new(&network::trained_weights()).unwrap();
        let exact = step_with(&wide, &cloth, &SETTINGS, &k, state.clone(), &g).unwrap().after;
        let found = step(&cloth, &SETTINGS, &k, state.clone(), &g).unwrap().after;
        let far =
            |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max(a.distance(*b)));
        let (off, moved) = (far(&exact.x, &found.x), far(&exact.x, &state.x));
        assert!(off < 1e-5 * moved && moved > 1e-4, "{off} of {moved}");
    }

    /// As programs use it: in single precision, over several frames.
    #[test]
    fn the_adjoint_of_a_rollout_is_differences() {
        let (cloth, initial, g) = problem();
        let mut rng = Rng::new(9, 0);
        let mut accelerations = Accelerations::zeros(4, 1, g.len());
        accelerations.dynamic.iter_mut().flatten().for_each(|d| *d = rng.vector() * 4.0);
        let (by_last, k) = (&g, [2.0, -2.5, -3.3]);
        let of = |accelerations: &Accelerations, log_k: &[f64]| {
            let k = Stiffness::uniform(&cloth, [0, 1, 2].map(|i| 10f64.powf(log_k[i])));
            let inputs = RolloutInputs { initial: &initial, accelerations, stiffness: &k };
            let motion = rollout(&cloth, &SETTINGS, 4, 4, &inputs).unwrap();
            let value = dot(&motion.frames[3], by_last);
            let mut by_frames = vec![vec![DVec3::ZERO; g.len()]; 4];
            by_frames[3].clone_from(by_last);
            (value, rollout_vjp(&cloth, &SETTINGS, &inputs, &motion, &by_frames))
        };
        let gradients = of(&accelerations, &k).1;
        let numbers = |field: &[Positions]| field.iter().flat_map(|f| flat(f).to_vec()).collect::<Vec<f64>>();
        let worst =
            check_coarse(&numbers(&accelerations.dynamic), &numbers(&gradients.dynamic), 0.1, 10, 1, |d| {
                let dynamic = d.chunks_exact(3 * g.len()).map(vectors).collect();
                of(&Accelerations { dynamic, ..accelerations.clone() }, &k).0
            });
        println!("forces: {worst:?}");
        assert!(worst.relative_error < 1e-3, "{worst:?}");
        let by_k = gradients.stiffness.grad_log10(k.map(|k| 10f64.powf(k)));
        let worst = check(&k, &by_k, 1e-2, 6, 2, |k| of(&accelerations, k).0);
        println!("log10 stiffness: {worst:?}");
        assert!(worst.relative_error < 1e-3, "{worst:?}");
    }

    #[test]
    fn momentum_is_kept() {
        let (cloth, state, g) = problem();
        let k = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let tape = step(&cloth, &SETTINGS, &k, state, &g).unwrap();
        let y = tape.inertial.unwrap();
        let moved: DVec3 = (0..y.len()).map(|i| (tape.after.x[i] - y[i]) * cloth.masses[i]).sum();
        let size: f64 = (0..y.len()).map(|i| tape.after.x[i].distance(y[i]) * cloth.masses[i]).sum();
        assert!(moved.length() < 1e-9 * size && size > 0.0, "{moved} of {size}");
    }

    #[test]
    fn an_irregular_mesh_is_refused() {
        let mut mesh = grid(6, 5, DVec2::new(0.1, 0.09), 1.0);
        mesh.faces.pop();
        let cloth = Cloth::new(&mesh);
        let k = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let zeros = vec![DVec3::ZERO; 30];
        let before = State { x: mesh.positions.clone(), v: zeros.clone() };
        let refused = step(&cloth, &SETTINGS, &k, before, &zeros).unwrap_err();
        assert!(refused.to_string().contains("no regular grid"), "{refused}");
    }
}
