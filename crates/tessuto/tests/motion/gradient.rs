//! The whole loss of the rollout fit, simulation, rendering and regularisers together, against central
//! differences. Rendered colours are 32-bit and silhouettes are antialiased, so the bound is 1e-2.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use tessuto::Rect;
use tessuto::config::{Config, Preset};
use tessuto::math::gradient_check::{Worst, check};
use tessuto::math::rng::Rng;
use tessuto::math::{flat, vectors};
use tessuto::mesh::grid;
use tessuto::motion::baselines::compared::Compared;
use tessuto::motion::baselines::{RolloutFit, RolloutSettings};
use tessuto::motion::parameters::Parameters;
use tessuto::raster::{Rasterizer, Rendering, Texture};
use tessuto::sim::Model;
use tessuto::{Camera, Frame, Image, Scene, Truth};

const SIZE: usize = 96;
const FRAMES: usize = 3;

/// A print without sharp edges.
fn texture() -> Texture {
    let mut texture = Texture::uniform(256, 256, [0.0; 3]);
    for (i, texel) in texture.texels.iter_mut().enumerate() {
        let (u, v) = ((i % 256) as f64 / 256.0, (i / 256) as f64 / 256.0);
        for (c, value) in texel[..3].iter_mut().enumerate() {
            let phase = c as f64 * 1.7;
            *value = (0.5 + 0.2 * (TAU * 2.0 * u + phase).sin() + 0.2 * (TAU * 3.0 * v - phase).cos()) as f32;
        }
    }
    texture
}

/// Frames of the cloth moved a little, so that neither colours nor masks fit.
fn scene(rasterizer: &Rasterizer, template: &tessuto::Mesh, texture: &Texture) -> Scene {
    let size = SIZE as f64;
    let camera = Camera { fx: 300.0, fy: 290.0, cx: size / 2.0, cy: size / 2.1, width: SIZE, height: SIZE };
    let frame = |n: usize| {
        let shift = DVec3::new(0.004 * n as f64, -0.003 * n as f64, 0.01 * n as f64);
        let x: Vec<DVec3> =
            template.positions.iter().map(|p| *p + shift + DVec3::Z * (0.1 * n as f64 * p.x)).collect();
        let mut rendering = Rendering::new();
        rasterizer.render(camera, &x, texture, &mut rendering);
        let channels = |range: std::ops::Range<usize>| Image {
            width: SIZE,
            height: SIZE,
            channels: range.len(),
            data: rendering.rgba.iter().flat_map(|c| c[range.clone()].to_vec()).collect(),
        };
        Frame { rgb: channels(0..3), mask: channels(3..4) }
    };
    Scene {
        name: "gradient".to_owned(),
        folder: ".".into(),
        fps: 50.0,
        camera,
        crop: Rect { x0: 0, y0: 0, x1: SIZE, y1: SIZE },
        poses: None,
        pose_unit: Default::default(),
        depths: None,
        more: Vec::new(),
        full_size: [SIZE, SIZE],
        first_frame: 0,
        template: template.clone(),
        frames: (0..FRAMES).map(frame).collect::<Vec<_>>().into(),
        known: Default::default(),
        truth: Truth::default(),
    }
}

fn report(name: &str, worst: Worst) {
    println!("{name}: {worst:?}");
    assert!(worst.relative_error <= 1e-2, "{name}: {worst:?}");
}

fn check_whole_loss(preset: Preset) {
    let mut template = grid(6, 6, DVec2::splat(0.22), 1.0);
    template.positions.iter_mut().for_each(|p| p.z += 0.02 * (20.0 * p.x).sin());
    let settings = Config::preset(preset).dynamics;
    let cloth = settings.model.cloth(&template);
    let (rasterizer, texture) = (Rasterizer::new(&template), texture());
    let scene = scene(&rasterizer, &template, &texture);
    // The rays are constants to the gradient; only frozen ones are constants to the differences too.
    let mut dynamics = settings.at(scene.fps);
    let mut settings = RolloutSettings::default();
    settings.frozen_rays = true;
    settings.weights.force_smoothness = 1e-5;
    dynamics.step.tolerance = 1e-12;
    settings.wind = preset == Preset::PhiSft;
    // All pixels, or those away from the outlines.
    let margin = if preset == Preset::Saft { 0.05 } else { 0.0 };
    let fit = RolloutFit {
        scene: &scene,
        cloth: &cloth,
        rasterizer: &rasterizer,
        texture: &texture,
        compared: Compared::away_from_outlines(&scene, margin).unwrap(),
        dynamics,
        settings: &settings,
    };
    let mut start = fit.start();
    start.log_stiffness = match start.model {
        Model::Springs => vec![2.0, -2.5, -3.0],
        Model::Continuum => vec![2.0, 2.3, -0.9, 1.5, -4.0],
    };
    start.accelerations.wind = settings.wind.then_some(DVec3::new(0.3, -0.2, -0.8));
    let mut rng = Rng::new(8, 0);
    start.accelerations.dynamic.iter_mut().flatten().for_each(|d| *d = rng.vector() * 4.0);
    let loss = |p: &Parameters| fit.loss_and_gradients(p, FRAMES).unwrap().total;
    let g = fit.loss_and_gradients(&start, FRAMES).unwrap();

    let dynamic: Vec<f64> = start.accelerations.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
    let gradient: Vec<f64> = g.dynamic.iter().flat_map(|d| flat(d).to_vec()).collect();
    let n = 3 * cloth.vertex_count();
    let worst = check(&dynamic, &gradient, 0.3, 12, 1, |d| {
        let mut moved = start.clone();
        moved.accelerations.dynamic = d.chunks_exact(n).map(vectors).collect();
        loss(&moved)
    });
    report(&format!("{preset:?}: dynamic force"), worst);

    let worst = check(&start.accelerations.constant.to_array(), &g.constant.to_array(), 0.03, 6, 2, |c| {
        let mut moved = start.clone();
        moved.accelerations.constant = DVec3::from_slice(c);
        loss(&moved)
    });
    report(&format!("{preset:?}: constant force"), worst);

    if let Some(wind) = start.accelerations.wind {
        let worst = check(&wind.to_array(), &g.wind.to_array(), 0.03, 6, 4, |w| {
            let mut moved = start.clone();
            moved.accelerations.wind = Some(DVec3::from_slice(w));
            loss(&moved)
        });
        report(&format!("{preset:?}: wind"), worst);
    }

    // The energy regulariser holds the stiffnesses constant, so it must not be in the differences.
    let mut energy_free = settings.clone();
    energy_free.weights.energy = 0.0;
    let fit = RolloutFit { settings: &energy_free, ..fit };
    let g = fit.loss_and_gradients(&start, FRAMES).unwrap();
    let worst = check(&start.log_stiffness, &g.log_stiffness, 0.01, 6, 3, |k| {
        let mut moved = start.clone();
        moved.log_stiffness = k.to_vec();
        fit.loss_and_gradients(&moved, FRAMES).unwrap().total
    });
    report(&format!("{preset:?}: log10 stiffness"), worst);
}

#[test]
fn whole_loss_with_the_linearised_integrator() {
    check_whole_loss(Preset::Saft);
}

#[test]
fn whole_loss_with_the_solved_integrator() {
    check_whole_loss(Preset::Default);
}

#[test]
fn whole_loss_of_the_continuum() {
    check_whole_loss(Preset::PhiSft);
}
