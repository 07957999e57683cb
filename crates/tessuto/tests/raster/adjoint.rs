//! The adjoint against central differences of the plain twin.
//!
//! The image is piecewise smooth in the positions: a pixel centre passing from one surface to
//! another one makes it jump, and a blend weight has a kink. Steps are therefore small (the twin
//! computes in f64), and the scenes are fixed, so that none of their steps hits such a place.

use crate::support::raster_scenes::{CAMERA, Scene, noise, plain, ramp};
use glam::{DVec2, DVec3};
use tessuto::Camera;
use tessuto::math::rng::Rng;
use tessuto::raster::{Gradients, Rendering, reference};

/// A loss that is linear in the image: Σ color · rgba + Σ depth · z.
struct Weights {
    rgba: Vec<[f32; 4]>,
    depth: Option<Vec<f32>>,
}

impl Weights {
    /// Random weights, 0 where `used` says no.
    fn new(seed: u64, channels: [f32; 4], depth: bool, used: impl Fn(usize) -> bool) -> Self {
        let mut rng = Rng::new(seed, 9);
        let pixels = CAMERA.width * CAMERA.height;
        let on = |pixel| if used(pixel) { 1.0 } else { 0.0 };
        let rgba = (0..pixels).map(|p| channels.map(|c| on(p) * c * rng.signed() as f32)).collect();
        let depth = depth.then(|| (0..pixels).map(|p| on(p) * rng.signed() as f32).collect());
        Self { rgba, depth }
    }

    fn loss(&self, scene: &Scene, positions: &[DVec3]) -> f64 {
        let twin = reference::render(&scene.rasterizer, CAMERA, positions, &plain(&scene.texture));
        let mut loss = 0.0;
        for (weight, color) in self.rgba.iter().zip(&twin.rgba) {
            loss += weight.iter().zip(color).map(|(w, c)| f64::from(*w) * c).sum::<f64>();
        }
        for (weight, z) in self.depth.iter().flatten().zip(&twin.depth) {
            loss += f64::from(*weight) * z;
        }
        loss
    }

    fn gradients(&self, scene: &Scene) -> Gradients {
        let Scene { rasterizer, positions, texture } = scene;
        let mut out = Rendering::new();
        rasterizer.render(CAMERA, positions, texture, &mut out);
        let mut grads = Gradients::new(rasterizer).with_texture(texture).with_uvs(rasterizer);
        let depth = self.depth.as_deref();
        rasterizer.render_vjp(CAMERA, positions, texture, &out, &self.rgba, depth, &mut grads);
        grads
    }

    /// Worst error, relative to the gradient's length, of `directions` directional derivatives of step
    /// `h` [m].
    fn worst_position_error(&self, scene: &Scene, seed: u64, directions: usize, h: f64) -> f64 {
        let grads = self.gradients(scene).positions;
        let norm = grads.iter().map(|g| g.length_squared()).sum::<f64>().sqrt();
        assert!(norm > 1e-3, "the gradient is zero: {norm}");
        let mut rng = Rng::new(seed, 5);
        let errors = (0..directions).map(|_| {
            let direction: Vec<DVec3> = grads.iter().map(|_| rng.vector()).collect();
            let moved =
                |h: f64| scene.positions.iter().zip(&direction).map(|(x, d)| x + d * h).collect::<Vec<_>>();
            let difference = (self.loss(scene, &moved(h)) - self.loss(scene, &moved(-h))) / (2.0 * h);
            let slope: f64 = grads.iter().zip(&direction).map(|(g, d)| g.dot(*d)).sum();
            (slope - difference).abs() / norm
        });
        errors.fold(0.0, f64::max)
    }
}

/// Pixels that the antialiasing cannot change within a small step: their neighbours all show a
/// triangle of a cloth without folds.
fn interior(scene: &Scene) -> impl Fn(usize) -> bool {
    let mut out = Rendering::new();
    scene.rasterizer.render(CAMERA, &scene.positions, &scene.texture, &mut out);
    move |pixel| {
        let (x, y) = ((pixel % CAMERA.width) as i64, (pixel / CAMERA.width) as i64);
        (-1..=1).all(|dy| {
            (-1..=1).all(|dx| {
                let (x, y) = (x + dx, y + dy);
                let inside = x >= 0 && y >= 0 && x < CAMERA.width as i64 && y < CAMERA.height as i64;
                inside && out.depth(x as usize, y as usize).is_some()
            })
        })
    }
}

#[test]
fn interior_gradient() {
    let mut worst = 0.0f64;
    for seed in 0..3 {
        let scene = Scene::cloth(seed, 0.01, ramp());
        let weights = Weights::new(seed, [1.0, 1.0, 1.0, 0.0], false, interior(&scene));
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
    }
    println!("interior: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn depth_gradient() {
    let mut worst = 0.0f64;
    for seed in 0..3 {
        let scene = Scene::cloth(seed, 0.01, ramp());
        let weights = Weights::new(seed, [0.0; 4], true, interior(&scene));
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
    }
    println!("depth: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn silhouette_gradient() {
    let mut worst = 0.0f64;
    for seed in 0..3 {
        let scene = Scene::cloth(seed, 0.01, ramp());
        let weights = Weights::new(seed, [0.0, 0.0, 0.0, 1.0], false, |_| true);
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
    }
    println!("coverage: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn one_sided_silhouette_gradient() {
    let mut worst = 0.0f64;
    for seed in 0..3 {
        let mut scene = Scene::cloth(seed, 0.01, ramp());
        let weights = Weights::new(seed, [1.0; 4], false, |_| true);
        let both = weights.gradients(&scene);
        scene.rasterizer = scene.rasterizer.one_sided(true);
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
        assert_ne!(both.positions, weights.gradients(&scene).positions);
    }
    println!("one-sided: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn gradient_of_crumpled_cloth_with_folds() {
    let mut worst = 0.0f64;
    for seed in 0..4 {
        let scene = Scene::cloth(seed, [0.03, 0.08][seed as usize % 2], ramp());
        let weights = Weights::new(seed, [1.0; 4], false, |_| true);
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
    }
    println!("crumpled: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn gradients_of_a_cloth_whose_other_side_is_plain() {
    let mut worst = 0.0f64;
    for seed in 0..4 {
        let scene = Scene::cloth(seed, [0.03, 0.08][seed as usize % 2], ramp());
        let weights = Weights::new(seed, [1.0; 4], true, |_| true);
        let printed = weights.gradients(&scene);
        let mut scene = scene.two_sided([0.9, 0.1, 0.3]);
        worst = worst.max(weights.worst_position_error(&scene, seed, 4, 1e-8));
        let grads = weights.gradients(&scene);
        assert!(grads.positions != printed.positions);
        let grads = grads.texture.expect("asked for");
        assert!(grads != printed.texture.expect("asked for"));
        let norm = grads.iter().flatten().map(|g| f64::from(g * g)).sum::<f64>().sqrt();
        let before = weights.loss(&scene, &scene.positions);
        let mut slope = 0.0;
        let direction = noise(seed + 10).texels;
        for ((texel, d), g) in scene.texture.texels.iter_mut().zip(&direction).zip(&grads) {
            for c in 0..3 {
                texel[c] += d[c];
                slope += f64::from(g[c]) * f64::from(d[c]);
            }
        }
        let error = (weights.loss(&scene, &scene.positions) - before - slope).abs() / norm;
        assert!(norm > 1.0 && error < 1e-5, "{norm} {error}");
    }
    println!("two-sided: worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn coverage_does_not_change_along_view_rays() {
    let scene = Scene::cloth(2, 0.01, ramp());
    let weights = Weights::new(2, [0.0, 0.0, 0.0, 1.0], false, |_| true);
    for (g, x) in weights.gradients(&scene).positions.iter().zip(&scene.positions) {
        assert!(g.dot(*x).abs() <= 1e-12 * g.length(), "{g} {x}");
    }
}

#[test]
fn texture_gradient() {
    for (seed, crumple) in [(0, 0.01), (1, 0.08)] {
        let mut scene = Scene::cloth(seed, crumple, noise(seed));
        let weights = Weights::new(seed, [1.0, 1.0, 1.0, 0.0], false, |_| true);
        let grads = weights.gradients(&scene).texture.expect("asked for");
        let norm = grads.iter().flatten().map(|g| f64::from(g * g)).sum::<f64>().sqrt();
        let direction = noise(seed + 10).texels;
        let before = weights.loss(&scene, &scene.positions);
        let mut slope = 0.0;
        for ((texel, d), g) in scene.texture.texels.iter_mut().zip(&direction).zip(&grads) {
            for c in 0..3 {
                texel[c] += d[c];
                slope += f64::from(g[c]) * f64::from(d[c]);
            }
        }
        // The loss is linear in the texels, so that no step is too long.
        let error = (weights.loss(&scene, &scene.positions) - before - slope).abs() / norm;
        println!("texture: relative error {error:.1e}");
        assert!(norm > 1.0 && error < 1e-5, "{norm} {error}");
    }
}

#[test]
fn uv_gradient() {
    for (seed, crumple) in [(0, 0.01), (1, 0.08)] {
        let mut scene = Scene::cloth(seed, crumple, ramp());
        let weights = Weights::new(seed, [1.0, 1.0, 1.0, 0.0], false, |_| true);
        let grads = weights.gradients(&scene).uvs.expect("asked for");
        let norm = grads.iter().map(|g| g.length_squared()).sum::<f64>().sqrt();
        let mut rng = Rng::new(seed, 3);
        let direction: Vec<DVec2> = grads.iter().map(|_| rng.vector().truncate()).collect();
        let slope: f64 = grads.iter().zip(&direction).map(|(g, d)| g.dot(*d)).sum();
        let h = 1e-6;
        let mut loss_at = |step: f64| {
            for (uv, d) in scene.rasterizer.uvs_mut().iter_mut().zip(&direction) {
                *uv += *d * step;
            }
            weights.loss(&scene, &scene.positions)
        };
        let difference = (loss_at(h) - loss_at(-2.0 * h)) / (2.0 * h);
        let error = (slope - difference).abs() / norm;
        println!("uv: relative error {error:.1e}");
        assert!(norm > 1.0 && error < 1e-5, "{norm} {error}");
    }
}

/// Moving one side of a rectangle outwards by 1 px adds as many pixels of area as the side is long.
#[test]
fn moving_edge_gains_area() {
    let camera = Camera { fy: CAMERA.fx, ..CAMERA };
    let (half, f) = (DVec2::new(0.16, 0.13), CAMERA.fx);
    for angle in [0.0, 0.03, 0.3, 0.6, std::f64::consts::FRAC_PI_4, 1.0, 1.5, 2.5] {
        let normal = DVec2::from_angle(angle);
        let mut mean = 0.0;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut rng = Rng::new(4, 0);
        let samples = 64;
        for _ in 0..samples {
            let centre = rng.vector().truncate() / f;
            let scene = Scene::rectangle(angle, half, centre);
            let mut out = Rendering::new();
            scene.rasterizer.render(camera, &scene.positions, &scene.texture, &mut out);
            let grad = vec![[0.0, 0.0, 0.0, 1.0]; out.rgba.len()];
            let mut grads = Gradients::new(&scene.rasterizer);
            let (texture, r) = (&scene.texture, &scene.rasterizer);
            r.render_vjp(camera, &scene.positions, texture, &out, &grad, None, &mut grads);
            // Vertices 1 and 3 are those of the side that was on the right.
            let gain = (grads.positions[1] + grads.positions[3]).truncate().dot(normal) / f;
            (least, most) = (least.min(gain), most.max(gain));
            mean += gain / f64::from(samples);
        }
        let length = 2.0 * half.y * f;
        println!(
            "angle {angle:.2}: mean {:.4} of the length, {:.3}..{:.3}",
            mean / length,
            least / length,
            most / length
        );
        assert!((mean / length - 1.0).abs() < 0.02, "angle {angle}: {mean} {length}");
    }
}
