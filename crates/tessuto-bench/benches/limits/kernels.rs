//! The kernels that are measured, on the sizes of the other benches.

use glam::{DVec2, DVec3};
use tessuto::Camera;
use tessuto::math::block_matrix::BlockMatrix;
use tessuto::math::factor::Scratch;
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, LANES, Material, Shader, accumulate, visible_points,
};
use tessuto::raster::{self, Rasterizer, Rendering, Texture};
use tessuto::sim::state::StepGradients;
use tessuto::sim::step::{step, step_vjp};
use tessuto::sim::{Cloth, HessianKind, Integrator, State, StepSettings, Stiffness};

use crate::machine::Machine;
use crate::shortest;
use crate::work::{self, Springs, Work};

/// Of the numbers that a kernel calculates with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Precision {
    Double,
    Single,
}

/// One row of the table.
pub struct Kernel {
    pub name: &'static str,
    pub flops: f64,
    pub bytes: f64,
    pub is_counted: bool,
    pub precision: Precision,
    pub seconds: f64,
}

/// Side of the sheets in vertices.
const SIDE: usize = 26;

/// All rows; the machine is measured before, between and after them.
pub fn all(machine: &mut Machine) -> Vec<Kernel> {
    machine.measure();
    let mut kernels = Vec::new();
    simulation(&mut kernels);
    machine.measure();
    rasteriser(&mut kernels);
    light(&mut kernels);
    machine.measure();
    kernels
}

fn simulation(kernels: &mut Vec<Kernel>) {
    let mut mesh = grid(SIDE, SIDE, DVec2::splat(0.5), 1.2);
    let cloth = Cloth::new(&mesh);
    let mut rng = Rng::new(1, 0);
    for p in &mut mesh.positions {
        p.z += 0.002 * (p.x / 0.06).sin();
        *p += rng.vector() * 1e-4;
    }
    let mut vectors = |size: f64| -> Vec<DVec3> { (0..SIDE * SIDE).map(|_| rng.vector() * size).collect() };
    let (v, acceleration, grad) = (vectors(0.05), vectors(3.0), vectors(1.0));
    let (x, stiffness) = (&mesh.positions, Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-4]));
    let mut matrix = BlockMatrix::zeros(&cloth.pattern);
    cloth.add_hessian(&stiffness, x, HessianKind::Projected, 1.0, &mut matrix);
    matrix.add_masses(&cloth.pattern, &cloth.masses, 1.0 / (5e-3f64 * 5e-3));
    let (analysis, pattern, scratch) = (&cloth.analysis, &*cloth.pattern, &mut Scratch::default());
    let mut add = |name, work: Work, precision, seconds| {
        let Work { flops, bytes } = work;
        kernels.push(Kernel { name, flops, bytes, is_counted: true, precision, seconds });
    };
    let (double, single) = (Precision::Double, Precision::Single);

    let seconds = shortest(|| {
        let factor = analysis.factorize(pattern, &matrix, scratch);
        scratch.recycle(factor);
    });
    add("factor of a sheet of 26×26, double precision", work::factor(&cloth, 8.0), double, seconds);
    let rounded = |scratch: &mut Scratch| {
        analysis.definite_rounded(pattern, &matrix, scratch).expect("the matrix is definite")
    };
    let seconds = shortest(|| {
        let factor = rounded(scratch);
        scratch.recycle(factor);
    });
    add("factor, single precision", work::factor(&cloth, 4.0), single, seconds);
    let plain = analysis.factorize(pattern, &matrix, scratch);
    let seconds = shortest(|| analysis.solve(pattern, &plain, &grad, scratch));
    add("solve with it, double precision", work::solve(&cloth, 8.0), double, seconds);
    let plain = rounded(scratch);
    let seconds = shortest(|| analysis.solve(pattern, &plain, &grad, scratch));
    add("solve, single precision", work::solve(&cloth, 4.0), single, seconds);

    let springs = Springs::of(&cloth);
    let mut out = grad.clone();
    let seconds = shortest(|| cloth.add_gradient(&stiffness, x, 1.0, &mut out));
    add("springs: energy and gradient", springs.gradient, double, seconds);
    let seconds = shortest(|| cloth.add_hessian(&stiffness, x, HessianKind::Exact, 1.0, &mut matrix));
    add("springs: matrix", springs.hessian, double, seconds);
    let seconds = shortest(|| cloth.add_third(&stiffness, x, [&v, &grad], 1.0, &mut out));
    add("springs: third derivative", springs.third, double, seconds);
    let integrator = Integrator::LinearizedEuler;
    let settings = StepSettings { integrator, step: 5e-3, damping: 0.9, tolerance: 1e-7, newton_limit: 50 };
    let seconds = shortest(|| {
        let before = State { x: x.clone(), v: v.clone() };
        let mut gradients = StepGradients::zeros(&cloth);
        gradients.x.clone_from(&grad);
        let mut tape =
            step(&cloth, &settings, &stiffness, before, &acceleration, scratch).expect("it is finite");
        step_vjp(&cloth, &settings, &stiffness, &tape, &mut gradients, scratch);
        tape.forget_factor(scratch);
        gradients
    });
    add("linearised step of springs with adjoint", springs.step(&cloth), double, seconds);
}

fn rasteriser(kernels: &mut Vec<Kernel>) {
    let camera = Camera { fx: 800.0, fy: 800.0, cx: 399.5, cy: 349.5, width: 800, height: 700 };
    let mut mesh = grid(33, 33, DVec2::new(0.535, 0.535), 1.0);
    let mut rng = Rng::new(1, 0);
    for p in &mut mesh.positions {
        p.z += 0.03 * (9.0 * p.x).sin() * (7.0 * p.y).cos();
        *p += rng.vector() * 0.002;
    }
    let mut texture = Texture::uniform(512, 512, [0.0; 3]);
    for texel in &mut texture.texels {
        *texel = [rng.uniform() as f32, rng.uniform() as f32, rng.uniform() as f32, 1.0];
    }
    let rasterizer = Rasterizer::new(&mesh);
    let mut out = Rendering::new();
    rasterizer.render(camera, &mesh.positions, &texture, &mut out);
    let covered = out.triangle.iter().filter(|&&t| t != Rendering::NO_TRIANGLE).count();
    let pixels = out.rgba.len();
    let grad: Vec<_> = out.rgba.iter().map(|_| [0; 4].map(|_| rng.signed() as f32)).collect();
    let mut add = |name, work: Work, seconds| {
        let (Work { flops, bytes }, precision) = (work, Precision::Single);
        kernels.push(Kernel { name, flops, bytes, is_counted: false, precision, seconds });
    };
    let forward = work::of_pixels(work::FORWARD, pixels, covered);
    let adjoint = forward + work::of_pixels(work::ADJOINT, pixels, covered);
    let textured = adjoint + work::of_pixels(work::TEXTURE_ADJOINT, pixels, covered);
    let seconds = shortest(|| rasterizer.render(camera, &mesh.positions, &texture, &mut out));
    add("rasteriser, 800×700", forward, seconds);
    let plain = raster::Gradients::new(&rasterizer);
    let with_texture = raster::Gradients::new(&rasterizer).with_texture(&texture);
    let rows = [
        ("rasteriser with adjoint", adjoint, plain),
        ("rasteriser with adjoint and texture", textured, with_texture),
    ];
    for (name, work, mut gradients) in rows {
        let seconds = shortest(|| {
            rasterizer.render(camera, &mesh.positions, &texture, &mut out);
            rasterizer.render_vjp(camera, &mesh.positions, &texture, &out, &grad, None, &mut gradients);
        });
        add(name, work, seconds);
    }
    let places: Vec<[f64; 2]> =
        (0..covered).map(|k| [(k % 424) as f64 * 1.2, (k / 424) as f64 * 1.2]).collect();
    let mut colours = vec![glam::Vec4::ZERO; covered];
    let seconds = shortest(|| {
        colours.iter_mut().zip(&places).for_each(|(c, [x, y])| *c = texture.sample(*x, *y));
    });
    add(
        "texture, bilinear, row by row",
        work::of_pixels([Work::default(), work::LOOKUP], 0, covered),
        seconds,
    );
}

fn light(kernels: &mut Vec<Kernel>) {
    let camera = Camera { fx: 512.0, fy: 512.0, cx: 255.5, cy: 255.5, width: 512, height: 512 };
    let mut mesh = grid(33, 33, DVec2::splat(0.9), 1.0);
    let mut rng = Rng::new(1, 0);
    for p in &mut mesh.positions {
        p.z += 0.03 * (14.0 * p.x).sin() * (9.0 * p.y).cos();
        *p += rng.vector() * 0.002;
    }
    let geometry = Geometry::new(&mesh, std::slice::from_ref(&mesh.positions));
    let (rasterizer, mut out) = (Rasterizer::new(&mesh), Rendering::new());
    let seen = visible_points(&rasterizer, camera, &geometry, 0, &mesh.positions, &mut out, |_, pixel| {
        pixel % 256 == 0
    });
    let points: Vec<_> = seen.into_iter().map(|(_, point)| point).collect();
    // Small maps: what clearing their sums takes is not a sample's.
    let planes: Vec<f32> = (0..5 * 64 * 64).map(|_| 0.2 + 0.6 * rng.uniform() as f32).collect();
    let material = Material::from_planes(64, 64, &planes);
    let mut environment = EnvironmentMap::uniform(64, 32, [0.0; 3]);
    for texel in &mut environment.texels {
        *texel = [(); 3].map(|()| 0.2 + rng.uniform() as f32);
    }
    let light = EnvironmentSampler::new(&environment, 0.1);
    let shader = Shader { geometry: &geometry, material: &material, light: &light };
    let mut gradients = tessuto::pbr::Gradients::default();
    let loss = |_: usize, c: &[[f32; 3]; 2]| (c[0][0], [[0.1, 0.2, -0.3]; 2]);
    let samples = 2 * LANES;
    let seconds = shortest(|| accumulate(&shader, &points, 7, samples, loss, &mut gradients));
    // Two estimates of every point.
    let Work { flops, bytes } =
        work::of_pixels([Work::default(), work::SAMPLE], 0, points.len() * 2 * samples);
    let (name, precision) = ("light, samples with derivatives", Precision::Single);
    kernels.push(Kernel { name, flops, bytes, is_counted: false, precision, seconds });
}
