//! Shaded camera samples per second, derivatives included: a folded cloth of 2048 triangles that covers most of a
//! 512² image, 512² material, 256×512 light; each sample has one direction from the light and one from the BRDF,
//! and a shadow ray for either.

#![allow(missing_docs)] // criterion_group! makes a public function

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec2;
use tessuto::Camera;
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Gradients, LANES, Material, Shader, accumulate,
    visible_points,
};
use tessuto::raster::{Rasterizer, Rendering};

fn pbr(criterion: &mut Criterion) {
    let camera = Camera { fx: 512.0, fy: 512.0, cx: 255.5, cy: 255.5, width: 512, height: 512 };
    let mut mesh = grid(33, 33, DVec2::splat(0.9), 1.0);
    let mut rng = Rng::new(1, 0);
    for p in &mut mesh.positions {
        p.z += 0.03 * (14.0 * p.x).sin() * (9.0 * p.y).cos();
        *p += rng.vector() * 0.002;
    }
    let geometry = Geometry::new(&mesh, std::slice::from_ref(&mesh.positions));
    let rasterizer = Rasterizer::new(&mesh);
    let seen =
        visible_points(&rasterizer, camera, &geometry, 0, &mesh.positions, &mut Rendering::new(), |_, _| {
            true
        });
    let points: Vec<_> = seen.into_iter().map(|(_, point)| point).collect();
    let planes: Vec<f32> = (0..5 * 512 * 512).map(|_| 0.2 + 0.6 * rng.uniform() as f32).collect();
    let material = Material::from_planes(512, 512, &planes);
    let mut environment = EnvironmentMap::uniform(512, 256, [0.0; 3]);
    for (k, texel) in environment.texels.iter_mut().enumerate() {
        // A bright window in a dim room.
        let window = (40..90).contains(&(k / 512)) && (100..180).contains(&(k % 512));
        let base = if window { 12.0 } else { 0.4 };
        *texel = [(); 3].map(|()| base * (0.5 + rng.uniform() as f32));
    }
    let light = EnvironmentSampler::new(&environment, 0.1);
    let shader = Shader { geometry: &geometry, material: &material, light: &light };
    let mut gradients = Gradients::default();

    let mut group = criterion.benchmark_group("pbr");
    // Two estimates of one bundle each: 16 samples per pixel.
    group.throughput(Throughput::Elements((points.len() * 2 * LANES) as u64));
    group.sample_size(10);
    group.bench_function("camera samples with derivatives", |bench| {
        let loss = |_: usize, c: &[[f32; 3]; 2]| (c[0][0], [[0.1, 0.2, -0.3]; 2]);
        bench.iter(|| accumulate(&shader, &points, 7, LANES, loss, &mut gradients));
    });
    let traced = geometry.clone().without_horizons();
    let shader = Shader { geometry: &traced, ..shader };
    group.bench_function("every ray traced", |bench| {
        let loss = |_: usize, c: &[[f32; 3]; 2]| (c[0][0], [[0.1, 0.2, -0.3]; 2]);
        bench.iter(|| accumulate(&shader, &points, 7, LANES, loss, &mut gradients));
    });
    group.bench_function("geometry of one frame", |bench| {
        bench.iter(|| Geometry::new(&mesh, std::slice::from_ref(&mesh.positions)));
    });
    group.finish();
}

criterion_group!(benches, pbr);
criterion_main!(benches);
