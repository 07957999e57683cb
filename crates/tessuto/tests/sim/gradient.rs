//! Derivatives of the simulation against central differences. The worst direction is printed.

use glam::{DVec2, DVec3};
use tessuto::math::block_matrix::BlockMatrix;
use tessuto::math::gradient_check::{Worst, check};
use tessuto::math::rng::Rng;
use tessuto::math::{dot, flat, vectors};
use tessuto::mesh::grid;
use tessuto::sim::{
    Accelerations, Cloth, HessianKind, Integrator, RolloutInputs, State, StepSettings, Stiffness, rollout,
    rollout_vjp,
};
use tessuto::{Mesh, Positions};

const FRAMES: usize = 4;
const SUBSTEPS: usize = 4;

fn report(name: &str, worst: Worst, bound: f64) {
    println!("{name}: {worst:?}");
    assert!(worst.relative_error <= bound, "{name}: {worst:?} exceeds {bound}");
}

/// A wavy 5×4 grid whose quads are not planar, and a mesh of mixed polygons.
fn meshes() -> Vec<Mesh> {
    let mut quads = grid(5, 4, DVec2::new(0.12, 0.09), 1.2);
    let mut rng = Rng::new(3, 0);
    for p in &mut quads.positions {
        p.z += 0.01 * (30.0 * p.x).sin();
        *p += rng.vector() * 0.002;
    }
    let mut mixed = quads.clone();
    let face = mixed.faces.remove(4);
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        let pick = |from: &[u32]| vec![from[a], from[b], from[c]];
        mixed.faces.push(tessuto::mesh::Face { vertices: pick(&face.vertices), uvs: pick(&face.uvs) });
    }
    vec![quads, mixed]
}

fn moved(x: &[DVec3], amount: f64, seed: u64) -> Positions {
    let mut rng = Rng::new(seed, 1);
    x.iter().map(|x| *x + rng.vector() * amount).collect()
}

/// Different for every element, so that a swapped index shows.
fn stiffness(cloth: &Cloth) -> Stiffness {
    let mut k = Stiffness::uniform(cloth, [200.0, 2e-3, 5e-4]);
    let mut rng = Rng::new(5, 0);
    for list in [&mut k.stretch, &mut k.bend, &mut k.shear] {
        list.iter_mut().for_each(|k| *k *= 1.0 + 0.5 * rng.signed());
    }
    k
}

#[test]
fn energy_gradient_hessian_and_third_derivative() {
    for mesh in meshes() {
        let cloth = Cloth::new(&mesh);
        assert!(cloth.bends.len() > 3 && cloth.shears.len() > 10);
        let k = stiffness(&cloth);
        let x = moved(&mesh.positions, 0.002, 9);
        let gradient = |x: &[DVec3]| {
            let mut g = vec![DVec3::ZERO; x.len()];
            let energy = cloth.add_gradient(&k, x, 1.0, &mut g);
            let plain = cloth.energy(&k, x).total();
            assert!((energy - plain).abs() < 1e-12 * plain, "{energy} {plain}");
            g
        };
        let energy = |x: &[f64]| cloth.energy(&k, &vectors(x)).total();
        report("∂E", check(flat(&x), flat(&gradient(&x)), 1e-6, 20, 1, energy), 1e-7);

        let (a, b) = (moved(&vec![DVec3::ZERO; x.len()], 1.0, 2), moved(&vec![DVec3::ZERO; x.len()], 1.0, 3));
        let mut hessian = BlockMatrix::zeros(&cloth.pattern);
        cloth.add_hessian(&k, &x, HessianKind::Exact, 1.0, &mut hessian);
        let hb = hessian.multiply(&cloth.pattern, &b);
        let along_b = |x: &[f64]| dot(&gradient(&vectors(x)), &b);
        report("∂²E", check(flat(&x), flat(&hb), 1e-6, 20, 2, along_b), 1e-6);

        let mut third = vec![DVec3::ZERO; x.len()];
        cloth.add_third(&k, &x, [&a, &b], 1.0, &mut third);
        let a_h_b = |x: &[f64]| {
            let mut h = BlockMatrix::zeros(&cloth.pattern);
            cloth.add_hessian(&k, &vectors(x), HessianKind::Exact, 1.0, &mut h);
            dot(&a, &h.multiply(&cloth.pattern, &b))
        };
        report("∂³E", check(flat(&x), flat(&third), 1e-6, 20, 3, a_h_b), 1e-6);
    }
}

#[test]
fn projected_hessian_is_positive_and_equals_the_exact_one_at_rest() {
    let mesh = &meshes()[0];
    let cloth = Cloth::new(mesh);
    let k = stiffness(&cloth);
    let assemble = |x: &[DVec3], curvature| {
        let mut h = BlockMatrix::zeros(&cloth.pattern);
        cloth.add_hessian(&k, x, curvature, 1.0, &mut h);
        h
    };
    for positive in [HessianKind::Projected, HessianKind::GaussNewton] {
        let (difference, largest) =
            assemble(&mesh.positions, HessianKind::Exact).difference(&assemble(&mesh.positions, positive));
        assert!(largest > 100.0 && difference < 1e-9 * largest, "{difference} of {largest}");
    }
    // Strong compression: the exact Hessian has negative directions, the projected one has none.
    let x: Positions = mesh.positions.iter().map(|p| *p * 0.9).collect();
    let (exact, projected) = (assemble(&x, HessianKind::Exact), assemble(&x, HessianKind::Projected));
    let mut lowest: f64 = 0.0;
    for seed in 0..200 {
        let d = moved(&vec![DVec3::ZERO; x.len()], 1.0, seed);
        let d: Positions = d.iter().map(|d| DVec3::new(0.0, 0.0, d.z)).collect();
        lowest = lowest.min(dot(&d, &exact.multiply(&cloth.pattern, &d)));
        assert!(dot(&d, &projected.multiply(&cloth.pattern, &d)) > -1e-12);
    }
    assert!(lowest < 0.0);
}

struct Problem {
    cloth: Cloth,
    settings: StepSettings,
    weights: Vec<Positions>,
    parts: usize,
    x: Positions,
}

/// All inputs of a rollout in one list of numbers.
#[derive(Clone)]
struct Inputs {
    initial: State,
    accelerations: Accelerations,
    stiffness: Stiffness,
}

impl Problem {
    fn new(integrator: Integrator, mesh: &Mesh, parts: usize) -> Self {
        let settings =
            StepSettings { integrator, step: 5e-3, damping: 0.9, tolerance: 1e-12, newton_limit: 100 };
        let zeros = vec![DVec3::ZERO; mesh.positions.len()];
        let weights = (0..FRAMES as u64).map(|f| moved(&zeros, 1.0, 100 + f)).collect();
        Self { cloth: Cloth::new(mesh), settings, weights, parts, x: mesh.positions.clone() }
    }

    fn inputs(&self) -> Inputs {
        let n = self.cloth.vertex_count();
        let zeros = vec![DVec3::ZERO; n];
        let mut accelerations = Accelerations::zeros(FRAMES, self.parts, n);
        accelerations.constant = DVec3::new(0.3, 2.0, -1.0);
        for (i, d) in accelerations.dynamic.iter_mut().enumerate() {
            *d = moved(&zeros, 5.0, 40 + i as u64);
        }
        let initial = State { x: self.x.clone(), v: moved(&zeros, 0.1, 30) };
        Inputs { initial, accelerations, stiffness: stiffness(&self.cloth) }
    }

    /// A weighted sum of all positions of all frames, so that every part of the adjoint is exercised.
    fn loss(&self, inputs: &Inputs) -> f64 {
        let inputs = RolloutInputs {
            initial: &inputs.initial,
            accelerations: &inputs.accelerations,
            stiffness: &inputs.stiffness,
        };
        let motion = rollout(&self.cloth, &self.settings, SUBSTEPS, FRAMES, &inputs).unwrap();
        let frame_loss = |(x, w): (&Positions, &Positions)| {
            let d = self.displacement(x);
            dot(&d, w) + 30.0 * dot(&d, &d)
        };
        motion.frames.iter().zip(&self.weights).map(frame_loss).sum()
    }

    /// From the template, so that the loss keeps its digits.
    fn displacement(&self, x: &[DVec3]) -> Positions {
        x.iter().zip(&self.x).map(|(x, t)| *x - *t).collect()
    }

    fn gradients(&self, inputs: &Inputs) -> tessuto::sim::RolloutGradients {
        let inputs = RolloutInputs {
            initial: &inputs.initial,
            accelerations: &inputs.accelerations,
            stiffness: &inputs.stiffness,
        };
        let motion = rollout(&self.cloth, &self.settings, SUBSTEPS, FRAMES, &inputs).unwrap();
        let grad_frames: Vec<Positions> = motion
            .frames
            .iter()
            .zip(&self.weights)
            .map(|(x, w)| self.displacement(x).iter().zip(w).map(|(d, w)| *w + *d * 60.0).collect())
            .collect();
        rollout_vjp(&self.cloth, &self.settings, &inputs, &motion, &grad_frames)
    }
}

fn check_rollout(integrator: Integrator, parts: usize) {
    for mesh in meshes() {
        let mut problem = Problem::new(integrator, &mesh, parts);
        let inputs = problem.inputs();
        let g = problem.gradients(&inputs);
        let name = |what: &str| format!("{integrator:?}, {parts} part(s), {what}");
        let bound = 1e-5;

        let c = inputs.accelerations.constant.to_array();
        let worst = check(&c, &g.constant.to_array(), 1e-3, 5, 1, |c| {
            let mut moved = inputs.clone();
            moved.accelerations.constant = DVec3::from_slice(c);
            problem.loss(&moved)
        });
        report(&name("constant force"), worst, bound);

        let d: Vec<f64> = inputs.accelerations.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
        let gd: Vec<f64> = g.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
        let n = 3 * problem.cloth.vertex_count();
        let worst = check(&d, &gd, 1e-2, 10, 2, |d| {
            let mut moved = inputs.clone();
            moved.accelerations.dynamic = d.chunks_exact(n).map(vectors).collect();
            problem.loss(&moved)
        });
        report(&name("dynamic force"), worst, bound);

        let worst = check(flat(&inputs.initial.x), flat(&g.initial.x), 1e-6, 10, 3, |x| {
            let mut moved = inputs.clone();
            moved.initial.x = vectors(x);
            problem.loss(&moved)
        });
        report(&name("initial position"), worst, bound);

        let worst = check(flat(&inputs.initial.v), flat(&g.initial.v), 1e-4, 10, 4, |v| {
            let mut moved = inputs.clone();
            moved.initial.v = vectors(v);
            problem.loss(&moved)
        });
        report(&name("initial velocity"), worst, bound);

        type Field = fn(&mut Stiffness) -> &mut Vec<f64>;
        let fields: [(&str, Field); 3] =
            [("stretch", |k| &mut k.stretch), ("bend", |k| &mut k.bend), ("shear", |k| &mut k.shear)];
        for (which, field) in fields {
            let k = field(&mut inputs.stiffness.clone()).clone();
            let gk = field(&mut g.stiffness.clone()).clone();
            // The loss hardly sees the stretch stiffness, but is sharply curved in the others.
            let step = if which == "stretch" { 3e-2 } else { 1e-3 } * k[0];
            let worst = check(&k, &gk, step, 10, 5, |k| {
                let mut moved = inputs.clone();
                *field(&mut moved.stiffness) = k.to_vec();
                problem.loss(&moved)
            });
            report(&name(which), worst, bound);
        }

        let rest: Vec<f64> = problem.cloth.edges.iter().map(|e| e.rest_length).collect();
        let worst = check(&rest, &g.rest_lengths, 1e-6, 10, 6, |lengths| {
            problem.cloth.edges.iter_mut().zip(lengths).for_each(|(e, l)| e.rest_length = *l);
            problem.loss(&inputs)
        });
        report(&name("rest length"), worst, bound);
    }
}

#[test]
fn linearized_euler_over_twelve_steps() {
    check_rollout(Integrator::LinearizedEuler, 1);
}

#[test]
fn implicit_euler_over_twelve_steps() {
    check_rollout(Integrator::ImplicitEuler, 1);
}

#[test]
fn forces_of_every_substep() {
    check_rollout(Integrator::LinearizedEuler, SUBSTEPS);
    check_rollout(Integrator::ImplicitEuler, SUBSTEPS);
}

#[test]
fn log10_stiffness_is_the_sum_over_elements_times_k_ln_10() {
    let problem = Problem::new(Integrator::ImplicitEuler, &meshes()[0], 1);
    let mut inputs = problem.inputs();
    let log_k = [2.2, -2.7, -3.3];
    let stiffness = |log_k: &[f64]| {
        let k = [10f64.powf(log_k[0]), 10f64.powf(log_k[1]), 10f64.powf(log_k[2])];
        (Stiffness::uniform(&problem.cloth, k), k)
    };
    inputs.stiffness = stiffness(&log_k).0;
    let gradient = problem.gradients(&inputs).stiffness.grad_log10(stiffness(&log_k).1);
    let worst = check(&log_k, &gradient, 1e-3, 5, 7, |log_k| {
        let mut moved = inputs.clone();
        moved.stiffness = stiffness(log_k).0;
        problem.loss(&moved)
    });
    report("log10 stiffness", worst, 1e-5);
}
