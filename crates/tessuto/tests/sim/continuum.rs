//! The continuum: closed forms, and its derivatives against central differences. The worst direction is printed.

use glam::{DVec2, DVec3};
use tessuto::math::block_matrix::BlockMatrix;
use tessuto::math::gradient_check::{Worst, check};
use tessuto::math::rng::Rng;
use tessuto::math::{dot, flat, vectors};
use tessuto::mesh::grid;
use tessuto::sim::Fabric;
use tessuto::sim::{
    Accelerations, Cloth, HessianKind, Integrator, RolloutInputs, State, StepSettings, Stiffness, rollout,
    rollout_vjp,
};
use tessuto::{Mesh, Positions};

const FABRIC: Fabric = Fabric { warp: 300.0, weft: 120.0, poisson: 0.25, shear: 15.0, bend: 3e-4 };
const FRAMES: usize = 4;
const SUBSTEPS: usize = 3;

fn report(name: &str, worst: Worst, bound: f64) {
    println!("{name}: {worst:?}");
    assert!(worst.relative_error <= bound, "{name}: {worst:?} exceeds {bound}");
}

fn moved(x: &[DVec3], amount: f64, seed: u64) -> Positions {
    let mut rng = Rng::new(seed, 1);
    x.iter().map(|x| *x + rng.vector() * amount).collect()
}

/// Wavy sheets of quads and of triangles whose vertices lie irregularly; every face of the second is wound at random.
fn meshes() -> Vec<Mesh> {
    let mut quads = grid(5, 4, DVec2::new(0.12, 0.09), 1.2);
    let mut rng = Rng::new(3, 0);
    for p in &mut quads.positions {
        p.z += 0.01 * (30.0 * p.x).sin();
        *p += rng.vector() * 0.003;
    }
    let mut triangles = quads.clone();
    triangles.faces.clear();
    for face in &quads.faces {
        for mut corners in [[0, 1, 2], [0, 2, 3]] {
            if rng.signed() > 0.0 {
                corners.swap(1, 2);
            }
            let pick = |from: &[u32]| corners.iter().map(|k| from[*k]).collect();
            triangles
                .faces
                .push(tessuto::mesh::Face { vertices: pick(&face.vertices), uvs: pick(&face.uvs) });
        }
    }
    vec![quads, triangles]
}

/// Different for every element, so that a swapped index shows.
fn stiffness(cloth: &Cloth) -> Stiffness {
    let mut k = FABRIC.stiffness(cloth);
    let mut rng = Rng::new(5, 0);
    k.membrane.iter_mut().flatten().for_each(|c| *c *= 1.0 + 0.3 * rng.signed());
    k.hinge.iter_mut().for_each(|b| *b *= 1.0 + 0.5 * rng.signed());
    k
}

fn hessian(cloth: &Cloth, k: &Stiffness, x: &[DVec3], kind: HessianKind) -> BlockMatrix {
    let mut matrix = BlockMatrix::zeros(&cloth.pattern);
    cloth.add_hessian(k, x, kind, 1.0, &mut matrix);
    matrix
}

#[test]
fn energy_gradient_hessian_and_third_derivative() {
    for mesh in meshes() {
        let cloth = Cloth::continuum(&mesh);
        let parts = cloth.continuum.as_ref().unwrap();
        assert_eq!((parts.membranes.len(), parts.hinges.len()), (24, 29));
        // Bent gently, and folded over and over.
        for amount in [0.003, 0.03] {
            let mut k = stiffness(&cloth);
            // Bending counts as much as stretching does.
            k.hinge.iter_mut().for_each(|b| *b *= 100.0);
            let x = moved(&mesh.positions, amount, 9);
            let gradient = |x: &[DVec3]| {
                let mut g = vec![DVec3::ZERO; x.len()];
                let energy = cloth.add_gradient(&k, x, 1.0, &mut g);
                let plain = cloth.energy(&k, x).total();
                assert!((energy - plain).abs() < 1e-12 * plain, "{energy} {plain}");
                g
            };
            let energy = |x: &[f64]| cloth.energy(&k, &vectors(x)).total();
            let name = |what: &str| format!("{what}, moved by {amount} m");
            report(&name("∂E"), check(flat(&x), flat(&gradient(&x)), 1e-6, 20, 1, energy), 1e-6);

            let zeros = vec![DVec3::ZERO; x.len()];
            let (a, b) = (moved(&zeros, 1.0, 2), moved(&zeros, 1.0, 3));
            let hb = hessian(&cloth, &k, &x, HessianKind::Exact).multiply(&cloth.pattern, &b);
            let along_b = |x: &[f64]| dot(&gradient(&vectors(x)), &b);
            report(&name("∂²E"), check(flat(&x), flat(&hb), 1e-6, 20, 2, along_b), 1e-6);

            let mut third = zeros.clone();
            cloth.add_third(&k, &x, [&a, &b], 1.0, &mut third);
            let a_h_b = |x: &[f64]| {
                let h = hessian(&cloth, &k, &vectors(x), HessianKind::Exact);
                dot(&a, &h.multiply(&cloth.pattern, &b))
            };
            report(&name("∂³E"), check(flat(&x), flat(&third), 1e-6, 20, 3, a_h_b), 1e-5);
        }
    }
}

#[test]
fn the_projected_hessian_bounds_the_exact_one_and_equals_it_at_rest() {
    for mesh in meshes() {
        let cloth = Cloth::continuum(&mesh);
        let mut k = stiffness(&cloth);
        k.hinge.iter_mut().for_each(|b| *b *= 100.0);
        for positive in [HessianKind::Projected, HessianKind::GaussNewton] {
            let exact = hessian(&cloth, &k, &mesh.positions, HessianKind::Exact);
            let (difference, largest) = exact.difference(&hessian(&cloth, &k, &mesh.positions, positive));
            assert!(largest > 1.0 && difference < 1e-9 * largest, "{difference} of {largest}");
        }
        let zeros = vec![DVec3::ZERO; mesh.positions.len()];
        let mut lowest: f64 = 0.0;
        for seed in 0..300 {
            // Compressed, which pushes the sheet out of its plane, and folded.
            let x: Positions = moved(&mesh.positions, [0.0, 0.02][seed as usize % 2], seed + 1000);
            let x: Positions = x.iter().map(|p| *p * DVec3::new(0.8, 0.9, 1.0)).collect();
            let d = moved(&zeros, 1.0, seed);
            let form = |kind| dot(&d, &hessian(&cloth, &k, &x, kind).multiply(&cloth.pattern, &d));
            let [exact, projected, gauss_newton] =
                [HessianKind::Exact, HessianKind::Projected, HessianKind::GaussNewton].map(form);
            lowest = lowest.min(exact);
            assert!(projected >= 0.0 && gauss_newton >= 0.0, "{projected} {gauss_newton}");
            assert!(projected >= exact * (1.0 - 1e-9), "{projected} {exact}");
        }
        // Out of the plane alone the compressed sheet gives way.
        let x: Positions = mesh.positions.iter().map(|p| *p * DVec3::new(0.8, 0.9, 1.0)).collect();
        let d: Positions = moved(&zeros, 1.0, 7).iter().map(|d| DVec3::Z * d.z).collect();
        k.hinge.fill(0.0);
        let form = |kind| dot(&d, &hessian(&cloth, &k, &x, kind).multiply(&cloth.pattern, &d));
        assert!(form(HessianKind::Exact) < 0.0 && form(HessianKind::Projected) >= 0.0, "{lowest}");
    }
}

#[test]
fn a_sheet_under_tension_and_on_a_cylinder_has_the_energy_of_the_formulas() {
    let size = DVec2::new(0.3, 0.2);
    let mesh = grid(31, 21, size, 1.0);
    let cloth = Cloth::continuum(&mesh);
    let k = FABRIC.stiffness(&cloth);
    let area = size.x * size.y;

    // A Green strain along the warp, and the contraction across that costs least.
    let strain = 0.02;
    let across = -FABRIC.poisson * (FABRIC.warp / FABRIC.weft).sqrt() * strain;
    let factor = DVec3::new((1.0f64 + 2.0 * strain).sqrt(), (1.0 + 2.0 * across).sqrt(), 1.0);
    let pulled: Positions = mesh.positions.iter().map(|p| *p * factor).collect();
    let energy = cloth.energy(&k, &pulled).total();
    let expected = 0.5 * FABRIC.warp * strain * strain * area;
    assert!((energy / expected - 1.0).abs() < 1e-9, "{energy} J, expected {expected} J");
    // Any other contraction costs more.
    for change in [-1e-3, 1e-3] {
        let other: Positions = pulled.iter().map(|p| *p * DVec3::new(1.0, 1.0 + change, 1.0)).collect();
        assert!(cloth.energy(&k, &other).total() > energy);
    }

    // In-plane shear by an angle: E₁₂ is half of its tangent.
    let tangent = 0.01;
    let sheared: Positions = mesh.positions.iter().map(|p| *p + DVec3::X * (tangent * p.y)).collect();
    let energy = cloth.energy(&k, &sheared).shear;
    let expected = 0.5 * FABRIC.shear * tangent * tangent * area;
    assert!((energy / expected - 1.0).abs() < 1e-9, "{energy} J, expected {expected} J");

    // Around a cylinder, but for the border, where no hinge is.
    let radius = 0.2;
    let rolled: Positions = mesh
        .positions
        .iter()
        .map(|p| DVec3::new(radius * (p.x / radius).sin(), p.y, 1.0 + radius * (p.x / radius).cos()))
        .collect();
    let energy = cloth.energy(&k, &rolled).bend;
    let expected = 0.5 * FABRIC.bend / (radius * radius) * area * 29.0 / 30.0;
    assert!((energy / expected - 1.0).abs() < 1e-3, "{energy} J, expected {expected} J");
}

#[test]
fn a_sheet_that_moves_and_turns_feels_no_force() {
    let mesh = &meshes()[1];
    let cloth = Cloth::continuum(mesh);
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.1);
    let x: Positions = mesh.positions.iter().map(|p| turn * *p + DVec3::new(3.0, -1.0, 0.2)).collect();
    let mut force = vec![DVec3::ZERO; x.len()];
    cloth.add_gradient(&FABRIC.stiffness(&cloth), &x, 1.0, &mut force);
    let largest = force.iter().map(|f| f.length()).fold(0.0, f64::max);
    assert!(largest < 1e-11, "{largest} N");
}

#[derive(Clone)]
struct Inputs {
    initial: State,
    accelerations: Accelerations,
    fabric: Fabric,
}

struct Problem {
    cloth: Cloth,
    settings: StepSettings,
    weights: Vec<Positions>,
    x: Positions,
}

impl Problem {
    fn new(integrator: Integrator, mesh: &Mesh) -> (Self, Inputs) {
        let settings =
            StepSettings { integrator, step: 5e-3, damping: 0.9, tolerance: 1e-12, newton_limit: 100 };
        let zeros = vec![DVec3::ZERO; mesh.positions.len()];
        let weights = (0..FRAMES as u64).map(|f| moved(&zeros, 1.0, 100 + f)).collect();
        let problem = Self { cloth: Cloth::continuum(mesh), settings, weights, x: mesh.positions.clone() };
        let mut accelerations = Accelerations::zeros(FRAMES, 1, zeros.len());
        accelerations.constant = DVec3::new(0.3, 2.0, -1.0);
        accelerations.wind = Some(DVec3::new(1.0, -0.5, 2.0));
        for (i, d) in accelerations.dynamic.iter_mut().enumerate() {
            *d = moved(&zeros, 5.0, 40 + i as u64);
        }
        let initial = State { x: problem.x.clone(), v: moved(&zeros, 0.1, 30) };
        (problem, Inputs { initial, accelerations, fabric: FABRIC })
    }

    fn with<R>(&self, inputs: &Inputs, work: impl FnOnce(&RolloutInputs) -> R) -> R {
        work(&RolloutInputs {
            initial: &inputs.initial,
            accelerations: &inputs.accelerations,
            stiffness: &inputs.fabric.stiffness(&self.cloth),
        })
    }

    fn displacement(&self, x: &[DVec3]) -> Positions {
        x.iter().zip(&self.x).map(|(x, t)| *x - *t).collect()
    }

    fn loss(&self, inputs: &Inputs) -> f64 {
        let motion =
            self.with(inputs, |i| rollout(&self.cloth, &self.settings, SUBSTEPS, FRAMES, i).unwrap());
        let of = |(x, w): (&Positions, &Positions)| {
            let d = self.displacement(x);
            dot(&d, w) + 30.0 * dot(&d, &d)
        };
        motion.frames.iter().zip(&self.weights).map(of).sum()
    }

    fn gradients(&self, inputs: &Inputs) -> tessuto::sim::RolloutGradients {
        self.with(inputs, |i| {
            let motion = rollout(&self.cloth, &self.settings, SUBSTEPS, FRAMES, i).unwrap();
            let of = |(x, w): (&Positions, &Positions)| {
                self.displacement(x).iter().zip(w).map(|(d, w)| *w + *d * 60.0).collect()
            };
            let grad: Vec<Positions> = motion.frames.iter().zip(&self.weights).map(of).collect();
            rollout_vjp(&self.cloth, &self.settings, i, &motion, &grad)
        })
    }
}

#[test]
fn both_integrators_over_nine_steps() {
    for integrator in [Integrator::LinearizedEuler, Integrator::ImplicitEuler] {
        for mesh in meshes() {
            let (problem, inputs) = Problem::new(integrator, &mesh);
            let g = problem.gradients(&inputs);
            let name = |what: &str| format!("{integrator:?}, {what}");
            let bound = 1e-5;

            let d: Vec<f64> = inputs.accelerations.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
            let gd: Vec<f64> = g.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
            let n = 3 * problem.cloth.vertex_count();
            let worst = check(&d, &gd, 1e-2, 10, 2, |d| {
                let mut moved = inputs.clone();
                moved.accelerations.dynamic = d.chunks_exact(n).map(vectors).collect();
                problem.loss(&moved)
            });
            report(&name("dynamic force"), worst, bound);

            let wind = inputs.accelerations.wind.unwrap();
            let worst = check(&wind.to_array(), &g.wind.to_array(), 1e-3, 5, 6, |w| {
                let mut moved = inputs.clone();
                moved.accelerations.wind = Some(DVec3::from_slice(w));
                problem.loss(&moved)
            });
            report(&name("wind"), worst, bound);

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

            // One property after the other: their effects differ by orders of magnitude.
            let list = |f: Fabric| [f.warp, f.weft, f.poisson, f.shear, f.bend];
            let by = list(inputs.fabric.vjp(&g.stiffness));
            let names = ["warp", "weft", "poisson", "shear", "bend"];
            for (k, name_of) in names.into_iter().enumerate() {
                let start = list(inputs.fabric)[k];
                let worst = check(&[start], &[by[k]], 3e-3 * start, 2, 5, |value| {
                    let mut moved = inputs.clone();
                    let f = &mut moved.fabric;
                    *[&mut f.warp, &mut f.weft, &mut f.poisson, &mut f.shear, &mut f.bend][k] = value[0];
                    problem.loss(&moved)
                });
                report(&name(name_of), worst, bound);
            }
        }
    }
}
