//! One sub-step, forward and adjoint, of both elastic models and integrators; a rollout, which
//! `crates/tessuto-py/benchmarks/overhead.py` repeats.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use tessuto::math::factor::Scratch;
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::sim::Fabric;
use tessuto::sim::contact::{Body, ContactSettings, Shape};
use tessuto::sim::state::StepGradients;
use tessuto::sim::step::{step, step_vjp};
use tessuto::sim::{
    Accelerations, Cloth, Integrator, RolloutInputs, State, StepSettings, Stiffness, play, rollout,
    rollout_vjp,
};

/// A woven cotton, about.
const FABRIC: Fabric = Fabric { warp: 300.0, weft: 200.0, poisson: 0.2, shear: 20.0, bend: 1e-5 };

/// Cloth in motion: a wavy sheet with random velocities and forces of the size of gravity.
fn bench(c: &mut Criterion) {
    for n in [26, 101] {
        let spacing = 0.02;
        let mut mesh = grid(n, n, DVec2::splat(spacing * (n - 1) as f64), 1.2);
        let models = [("", Cloth::new(&mesh)), ("continuum ", Cloth::continuum(&mesh))];
        let mut rng = Rng::new(1, 0);
        for p in &mut mesh.positions {
            p.z += 0.002 * (p.x / (3.0 * spacing)).sin();
            *p += rng.vector() * 1e-4;
        }
        let v: Vec<DVec3> = mesh.positions.iter().map(|_| rng.vector() * 0.05).collect();
        let acceleration: Vec<DVec3> = v.iter().map(|_| rng.vector() * 3.0 + DVec3::Y * 9.81).collect();
        let grad: Vec<DVec3> = v.iter().map(|_| rng.vector()).collect();
        let runs = models.iter().flat_map(|model| {
            [Integrator::LinearizedEuler, Integrator::ImplicitEuler].map(|integrator| (model, integrator))
        });
        for ((model, cloth), integrator) in runs {
            let stiffness = match &cloth.continuum {
                None => Stiffness::uniform(cloth, [200.0, 1e-3, 1e-4]),
                Some(_) => FABRIC.stiffness(cloth),
            };
            let settings =
                StepSettings { integrator, step: 5e-3, damping: 0.9, tolerance: 1e-7, newton_limit: 50 };
            let mut scratch = Scratch::default();
            let start = || State { x: mesh.positions.clone(), v: v.clone() };
            c.bench_function(&format!("{model}substep {n}x{n} {integrator:?} forward"), |b| {
                b.iter_batched(
                    start,
                    |s| step(cloth, &settings, &stiffness, s, &acceleration, &mut scratch).unwrap(),
                    BatchSize::LargeInput,
                );
            });
            c.bench_function(&format!("{model}substep {n}x{n} {integrator:?} forward+adjoint"), |b| {
                b.iter_batched(
                    || {
                        let mut gradients = StepGradients::zeros(cloth);
                        gradients.x.clone_from(&grad);
                        (start(), gradients)
                    },
                    |(s, mut gradients)| {
                        let mut tape =
                            step(cloth, &settings, &stiffness, s, &acceleration, &mut scratch).unwrap();
                        step_vjp(cloth, &settings, &stiffness, &tape, &mut gradients, &mut scratch);
                        // The next step's factor takes its memory, as in a rollout whose factors do not all fit.
                        tape.forget_factor(&mut scratch);
                        (tape, gradients)
                    },
                    BatchSize::LargeInput,
                );
            });
        }
    }
}

/// 10 frames of 4 sub-steps, forward and adjoint, from nothing but arrays.
fn bench_rollout(c: &mut Criterion) {
    let (n, frames, spacing) = (26, 10, 0.02);
    let mesh = grid(n, n, DVec2::splat(spacing * (n - 1) as f64), 1.2);
    let cloth = Cloth::new(&mesh);
    let wave = |p: &DVec3| *p + DVec3::Z * 0.002 * (p.x / (3.0 * spacing)).sin();
    let x: Vec<DVec3> = mesh.positions.iter().map(wave).collect();
    let sines = |scale: f64, slope: f64, phase: f64| -> Vec<DVec3> {
        let value = |k: usize| scale * (slope * k as f64 + phase).sin();
        (0..x.len()).map(|i| DVec3::from_array([0, 1, 2].map(|axis| value(3 * i + axis)))).collect()
    };
    let accelerations = Accelerations {
        constant: DVec3::Y * 9.81,
        dynamic: (0..frames).map(|k| sines(3.0, 0.9, k as f64)).collect(),
        entries_per_frame: 1,
        wind: None,
    };
    let settings = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: 5e-3,
        damping: 0.9,
        tolerance: 1e-7,
        newton_limit: 50,
    };
    c.bench_function("rollout 26x26, 40 sub-steps, forward+adjoint", |b| {
        b.iter(|| {
            let initial = State { x: x.clone(), v: sines(0.05, 1.7, 0.0) };
            let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-4]);
            let inputs =
                RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
            let motion = rollout(&cloth, &settings, 4, frames + 1, &inputs).unwrap();
            let mut grad = motion.frames.clone();
            grad[0].fill(DVec3::ZERO);
            rollout_vjp(&cloth, &settings, &inputs, &motion, &grad)
        });
    });
}

/// 200 sub-steps of a sheet that is dropped on a ball, falls over it and comes to lie in folds; and of one that falls
/// past it.
fn bench_contact(c: &mut Criterion) {
    let n = 26;
    let mut mesh = grid(n, n, DVec2::splat(0.5), 0.0);
    mesh.positions.iter_mut().for_each(|x| *x = DVec3::new(x.x, 0.0, x.y));
    let ball =
        Body { shape: Shape::Sphere { centre: DVec3::new(0.02, 0.16, 0.01), radius: 0.12 }, friction: 0.2 };
    let settings = ContactSettings { bodies: vec![ball], ..ContactSettings::default() };
    let free = Cloth::new(&mesh);
    let cloths =
        [("without contact", free.clone()), ("contact", free.with_contact(&mesh, &settings).unwrap())];
    let mut accelerations = Accelerations::zeros(51, 1, n * n);
    accelerations.constant = DVec3::Y * 9.81;
    let step = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: 5e-3,
        damping: 1.0,
        tolerance: 1e-6,
        newton_limit: 200,
    };
    for (name, cloth) in cloths {
        let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-4, 1e-4]);
        let initial = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; n * n] };
        let inputs =
            RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
        c.bench_function(&format!("drop on a ball 26x26, 200 sub-steps, {name}"), |b| {
            b.iter(|| play(&cloth, &step, 4, 51, &inputs).unwrap());
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = bench, bench_rollout, bench_contact
}
criterion_main!(benches);
