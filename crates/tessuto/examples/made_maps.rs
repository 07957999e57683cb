//! Material maps estimated of made scenes whose maps are known: fabrics of many kinds under several lights, on the
//! true motion of a scene folder, for instance one that `tessuto synth` made.
//!
//! cargo run --release -p tessuto --example made_maps -- SCENE [steps] [map size] [batch]

use std::path::Path;

use glam::DVec3;
use tessuto::appearance::{self, AlbedoScale, AppearanceSettings};
use tessuto::io::scene::{LoadOptions, load};
use tessuto::pbr::{
    CHANNELS, EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame,
};
use tessuto::raster::Rasterizer;
use tessuto::session::Session;
use tessuto::{Error, Frame, Image, Result};

const SIDE: usize = 256;

/// Base colour, roughness and metallic of one ink.
type Ink = ([f32; 3], f32, f32);

/// A ground with dots and stripes of two more inks.
fn fabric([ground, dots, stripes]: [Ink; 3]) -> Material {
    let mut planes = vec![0.0; CHANNELS * SIDE * SIDE];
    for row in 0..SIDE {
        for column in 0..SIDE {
            let (x, y) = ((column % 64) as f32 - 32.0, (row % 64) as f32 - 32.0);
            let dot = x * x + y * y < 18.0 * 18.0;
            let stripe = (column + 2 * row) % 128 < 24;
            let ([r, g, b], roughness, metallic) = if dot {
                dots
            } else if stripe {
                stripes
            } else {
                ground
            };
            let texel = [r, g, b, roughness, metallic];
            (0..CHANNELS).for_each(|c| planes[(c * SIDE + row) * SIDE + column] = texel[c]);
        }
    }
    Material::from_planes(SIDE, SIDE, &planes)
}

fn fabrics() -> Vec<(&'static str, Material)> {
    let paint = |r, g, b| ([r, g, b], 0.8, 0.0);
    vec![
        ("white print", fabric([paint(0.72, 0.7, 0.66), paint(0.1, 0.25, 0.5), paint(0.6, 0.15, 0.1)])),
        ("dark print", fabric([paint(0.04, 0.04, 0.05), paint(0.12, 0.03, 0.03), paint(0.08, 0.1, 0.06)])),
        ("red all over", fabric([paint(0.45, 0.05, 0.05), paint(0.25, 0.03, 0.04), paint(0.5, 0.15, 0.05)])),
        ("grey print", fabric([paint(0.3, 0.3, 0.3), paint(0.1, 0.1, 0.1), paint(0.2, 0.22, 0.2)])),
        (
            "gold brocade",
            fabric([paint(0.5, 0.1, 0.12), ([0.75, 0.58, 0.3], 0.35, 0.9), paint(0.65, 0.6, 0.55)]),
        ),
        (
            "satin",
            fabric([([0.15, 0.3, 0.5], 0.35, 0.0), paint(0.65, 0.65, 0.6), ([0.5, 0.5, 0.2], 0.35, 0.0)]),
        ),
    ]
}

/// A dim room with lamps of cosine width and colour.
fn light(room: [f32; 3], lamps: &[(DVec3, f64, [f32; 3])]) -> EnvironmentMap {
    let mut light = EnvironmentMap::uniform(128, 64, room);
    for row in 0..light.height {
        for column in 0..light.width {
            let direction = light.direction(column, row);
            for (_, _, radiance) in lamps.iter().filter(|(at, cos, _)| at.normalize().dot(direction) > *cos) {
                light.texels[row * light.width + column] = *radiance;
            }
        }
    }
    light
}

fn lights() -> Vec<(&'static str, EnvironmentMap)> {
    let (left, right, up) =
        (DVec3::new(-0.8, -0.5, -0.7), DVec3::new(0.7, -0.2, -0.6), DVec3::new(0.0, -1.0, -0.3));
    vec![
        ("warm lamp", light([0.2, 0.15, 0.1], &[(left, 0.95, [18.0, 12.0, 6.0])])),
        ("sky", light([0.2, 0.2, 0.2], &[(up, 0.3, [1.2, 1.6, 2.4])])),
        ("two windows", light([0.25; 3], &[(left, 0.9, [5.0, 5.0, 5.2]), (right, 0.93, [4.0, 3.8, 3.4])])),
    ]
}

/// sRGB of a linear value.
fn encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// PSNR [dB] of linear colours, as they are and after the best factor per channel, both seen in sRGB.
fn psnrs(found: &[[f32; 3]], truth: &[[f32; 3]]) -> [f64; 2] {
    let sum = |c: usize, f: fn(f64, f64) -> f64| -> f64 {
        found.iter().zip(truth).map(|(a, b)| f(f64::from(a[c]), f64::from(b[c]))).sum()
    };
    let best = [0, 1, 2].map(|c| (sum(c, |a, b| a * b) / sum(c, |a, _| a * a).max(1e-12)) as f32);
    [[1.0; 3], best].map(|factor| {
        let error = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
            (0..3).map(|c| f64::from(encode((factor[c] * a[c]).min(1.0)) - encode(b[c])).powi(2)).sum()
        };
        let mean = found.iter().zip(truth).map(error).sum::<f64>() / (3 * truth.len()) as f64;
        -10.0 * mean.max(1e-12).log10()
    })
}

/// Mean colour of the brightest twentieth of the texels that are not metal.
fn brightest(material: &Material) -> f64 {
    let paint = material.texels.iter().filter(|t| t[4] < 0.5);
    let mut sums: Vec<f32> = paint.map(|t| (t[0] + t[1] + t[2]) / 3.0).collect();
    sums.sort_unstable_by(|a, b| b.total_cmp(a));
    let count = (sums.len() / 20).max(1);
    f64::from(sums[..count].iter().sum::<f32>()) / count as f64
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |k: usize, default: usize| arguments.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let folder =
        arguments.get(1).ok_or_else(|| Error::usage("no scene folder", "give one with gt/vertices.npy"))?;
    let mut scene = load(Path::new(folder), &LoadOptions::default())?.scene;
    let motion = scene.truth.vertices.clone().ok_or_else(|| {
        Error::input(folder.clone(), "it has no true vertices", "give a scene that has gt/vertices.npy")
    })?;
    let mut settings = AppearanceSettings::default();
    settings.steps = number(2, 200);
    settings.map_size = number(3, SIDE);
    settings.batch = number(4, 25_000);
    let geometry = Geometry::new(&scene.template, &motion);
    let rasterizer = Rasterizer::new(&scene.template);
    println!(
        "| fabric, light | diffuse as estimated · best factor | mean metallic (truth) | mean roughness (truth) | \
         relit as estimated · best factor | brightest part (truth), stated ±, off by |"
    );
    for (fabric, truth) in fabrics() {
        for (name, environment) in lights() {
            let draw = |material: &Material, environment: &EnvironmentMap, n: usize| {
                let light = &EnvironmentSampler::new(environment, 0.1);
                let cloth = RenderScene { rasterizer: &rasterizer, geometry: &geometry, material, light };
                render_frame(&cloth, scene.camera, (n, &motion[n]), 32)
            };
            let frame = |n: usize| {
                let rgb = draw(&truth, &environment, n);
                let covered = rgb.data.chunks_exact(3).map(|p| f32::from(p.iter().any(|v| *v > 0.0)));
                let mask =
                    Image { width: rgb.width, height: rgb.height, channels: 1, data: covered.collect() };
                Frame { rgb, mask }
            };
            let frames: Vec<Frame> = (0..motion.len()).map(frame).collect();
            scene.frames = frames.into();
            let session = &mut Session::silent();
            let found = appearance::fit(&scene, &motion, &geometry, &settings, 0, session)?;
            let maps = found.maps();
            report(&format!("{fabric}, {name}"), [&maps, &truth], found.scale.as_ref(), &|material| {
                let pictures = [0, motion.len() / 2, motion.len() - 1];
                pictures.map(|n| draw(material, &appearance::studio(), n).data).concat()
            });
        }
    }
    Ok(())
}

/// Prints one line about the `maps` found and the true ones; `relit` gives pictures under another light.
fn report(
    name: &str,
    [maps, truth]: [&Material; 2],
    scale: Option<&AlbedoScale>,
    relit: &dyn Fn(&Material) -> Vec<f32>,
) {
    let samples = |material: &Material| -> Vec<[f32; CHANNELS]> {
        let at = |k: usize| (k as f32 + 0.5) / SIDE as f32;
        (0..SIDE * SIDE).map(|i| material.sample([at(i % SIDE), 1.0 - at(i / SIDE)])).collect()
    };
    let sampled = [maps, truth].map(samples);
    let colours = sampled.each_ref().map(|s| s.iter().map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>());
    let [diffuse, diffuse_best] = psnrs(&colours[0], &colours[1]);
    let mean = |k: usize, c: usize| sampled[k].iter().map(|t| t[c]).sum::<f32>() / (SIDE * SIDE) as f32;
    let decode = |v: f32| if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    let pictures = [maps, truth].map(|material| {
        relit(material).chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(decode)).collect::<Vec<[f32; 3]>>()
    });
    let lit: Vec<usize> = (0..pictures[1].len()).filter(|i| pictures[1][*i] != [0.0; 3]).collect();
    let [a, b] = pictures.each_ref().map(|p| lit.iter().map(|i| p[*i]).collect::<Vec<_>>());
    let [relit, relit_best] = psnrs(&a, &b);
    let told = scale.map_or_else(String::new, |scale| {
        let expected = brightest(truth);
        let found = scale.brightest.iter().sum::<f64>() / 3.0;
        let off = (found / expected).ln() / scale.log_deviation;
        format!("{found:.2} ({expected:.2}), ±{:.0} %, {off:+.1} deviations", 100.0 * scale.log_deviation)
    });
    println!(
        "| {name} | {diffuse:.1} · {diffuse_best:.1} dB | {:.3} ({:.3}) | {:.2} ({:.2}) | {relit:.1} · \
         {relit_best:.1} dB | {told} |",
        mean(0, 4),
        mean(1, 4),
        mean(0, 3),
        mean(1, 3),
    );
}
