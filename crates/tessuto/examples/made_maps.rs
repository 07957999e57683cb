//! Material maps estimated of made scenes whose maps are known: fabrics of many kinds under several lights, on the true motion
//! of a scene folder, for instance one that `tessuto synth` made.
//!
//! cargo run --release -p tessuto --example made_maps -- SCENE [steps] [map size] [batch]

use std::path::Path;

use glam::DVec3;
use tessuto::appearance::{self, AppearanceSettings};
use tessuto::image::{Image, srgb};
use tessuto::io::scene::{LoadOptions, load};
use tessuto::metrics::similarity::{best_scale, psnr, scaled};
use tessuto::pbr::{
    CHANNELS, EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame,
};
use tessuto::raster::Rasterizer;
use tessuto::session::Session;
use tessuto::video::Frame;
use tessuto::{Error, Result};

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

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |k: usize, default: usize| arguments.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let folder =
        arguments.get(1).ok_or_else(|| Error::usage("no scene folder", "give one with gt/vertices.npy"))?;
    let mut scene = load(Path::new(folder), &LoadOptions::default())?.scene;
    let motion = scene.truth.vertices.clone().ok_or_else(|| {
        Error::input(folder.clone(), "it has no true vertices", "give a scene that has gt/vertices.npy")
    })?;
    let settings = AppearanceSettings {
        steps: number(2, 200),
        map_size: number(3, SIDE),
        batch: number(4, 25_000),
        ..AppearanceSettings::default()
    };
    let geometry = Geometry::new(&scene.template, &motion);
    let rasterizer = Rasterizer::new(&scene.template);
    println!(
        "fabric, light: diffuse as it is, best factor, mean metallic (truth), mean roughness (truth), relit, best factor"
    );
    for (fabric, truth) in fabrics() {
        for (name, environment) in lights() {
            let draw = |material: &Material, environment: &EnvironmentMap, n: usize, samples: usize| {
                let light = &EnvironmentSampler::new(environment, 0.1);
                let cloth = RenderScene { rasterizer: &rasterizer, geometry: &geometry, material, light };
                render_frame(&cloth, &scene.camera, (n, &motion[n]), samples)
            };
            let frames: Vec<Frame> = (0..motion.len())
                .map(|n| {
                    let rgb = draw(&truth, &environment, n, 32);
                    let covered = rgb.data.chunks_exact(3).map(|p| f32::from(p.iter().any(|v| *v > 0.0)));
                    let mask =
                        Image { width: rgb.width, height: rgb.height, channels: 1, data: covered.collect() };
                    Frame { rgb, mask }
                })
                .collect();
            scene.frames = frames.into();
            let session = &mut Session::silent();
            let found = appearance::fit(&scene, &motion, &geometry, &settings, 0, session)?;
            let found_maps = found.maps();
            let (mut a, mut b, mut sums) = (Vec::new(), Vec::new(), [0.0f64; 4]);
            for row in 0..SIDE {
                for column in 0..SIDE {
                    let uv = [(column as f32 + 0.5) / SIDE as f32, 1.0 - (row as f32 + 0.5) / SIDE as f32];
                    let (x, y) = (found_maps.sample(uv), truth.sample(uv));
                    (0..3).for_each(|c| a.push(srgb::encode(x[c])));
                    (0..3).for_each(|c| b.push(srgb::encode(y[c])));
                    let values = [x[4], y[4], x[3], y[3]];
                    sums.iter_mut().zip(values).for_each(|(s, v)| *s += f64::from(v) / (SIDE * SIDE) as f64);
                }
            }
            let (mut c, mut d) = (Vec::new(), Vec::new());
            for n in [0, motion.len() / 2, motion.len() - 1] {
                let studio = appearance::studio();
                let [x, y] = [&found_maps, &truth].map(|m| draw(m, &studio, n, 32));
                for (x, y) in x.data.chunks_exact(3).zip(y.data.chunks_exact(3)).filter(|(_, y)| y[0] > 0.0) {
                    c.extend_from_slice(x);
                    d.extend_from_slice(y);
                }
            }
            let best = |a: &[f32], b: &[f32]| psnr(&scaled(a, best_scale(a, b)), b);
            println!(
                "{fabric}, {name}: {:.1} {:.1} dB, {:.3} ({:.3}), {:.2} ({:.2}), {:.1} {:.1} dB, {:?}",
                psnr(&a, &b),
                best(&a, &b),
                sums[0],
                sums[1],
                sums[2],
                sums[3],
                psnr(&c, &d),
                best(&c, &d),
                found.scale,
            );
        }
    }
    Ok(())
}
