//! Rendering and its adjoint: 2048 triangles over about 180,000 pixels of an 800×700 image, 512²
//! texture.

#![allow(missing_docs)] // criterion_group! makes a public function

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec2;
use tessuto::Camera;
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::raster::{Gradients, Rasterizer, Rendering, Texture};

fn raster(criterion: &mut Criterion) {
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
    eprintln!(
        "{covered} pixels covered, {} blends, {} threads",
        out.blend_count(),
        rayon::current_num_threads()
    );
    let grad: Vec<_> = out.rgba.iter().map(|_| [0; 4].map(|_| rng.signed() as f32)).collect();

    let mut group = criterion.benchmark_group("raster");
    group.bench_function("forward", |bench| {
        bench.iter(|| rasterizer.render(camera, &mesh.positions, &texture, &mut out));
    });
    let mut grads = Gradients::new(&rasterizer);
    group.bench_function("forward and adjoint", |bench| {
        bench.iter(|| {
            rasterizer.render(camera, &mesh.positions, &texture, &mut out);
            rasterizer.render_vjp(camera, &mesh.positions, &texture, &out, &grad, None, &mut grads);
        });
    });
    let mut grads = Gradients::new(&rasterizer).with_texture(&texture);
    group.bench_function("forward and adjoint with texture", |bench| {
        bench.iter(|| {
            rasterizer.render(camera, &mesh.positions, &texture, &mut out);
            rasterizer.render_vjp(camera, &mesh.positions, &texture, &out, &grad, None, &mut grads);
        });
    });
    group.finish();
}

criterion_group!(benches, raster);
criterion_main!(benches);
