//! The estimation.

use serde::{Deserialize, Serialize};

use super::albedo_scale::{AlbedoScale, brightest, expected};
use super::back;
use super::environment_parameters::EnvironmentParameters;
use super::loss::loss;
use super::observations::{Drawn, observe, telling_sides};
use super::patch_weights::PatchWeights;
use super::sharpen::sharpen;
use super::splat::Splat;
use super::surfaces::SurfacePrior;
use super::texels::{MapState, Maps, TexelPrior, Texels};
use super::{AppearanceSettings, MapPrior, Window};
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::srgb;
use tessuto_core::math::rng::mix32;
use tessuto_core::mesh::Motion;
use tessuto_core::scene::{Back, Scene};
#[cfg(feature = "decoder")]
use tessuto_render::decoder::DecoderConfig;
use tessuto_render::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Gradients, Material, Shader, accumulate,
};

/// Steps after which directions are drawn from the present light.
const REDRAW: usize = 10;

/// Rows of the light as the steps look it up, if its finest grid has no more: a table that stays in the caches.
const TABLE_ROWS: usize = 64;

/// What [`fit`] resumes from.
#[derive(Serialize, Deserialize)]
struct State {
    steps: usize,
    maps: MapState,
    lighting: EnvironmentParameters,
    patch_weights: PatchWeights,
    scale: Option<AlbedoScale>,
}

/// What the cloth is made of, and what shines on it.
#[derive(Debug, Clone)]
pub struct Appearance {
    /// Diffuse, roughness and metallic maps, on `window`.
    pub material: Material,
    /// The part of uv space that the maps cover.
    pub window: Window,
    /// The light.
    pub environment: EnvironmentMap,
    /// What is known of the scale of the diffuse map, where it was led to that.
    pub scale: Option<AlbedoScale>,
    /// Every step.
    pub history: Vec<Epoch>,
}

impl Appearance {
    /// The maps on all of uv space.
    pub fn maps(&self) -> Material {
        self.window.spread(&self.material)
    }
}

/// Estimates material and light from the frames of `scene`, moving as `motion`, shape [N, V].
///
/// # Errors
/// [`Error::Input`] if the motion does not fit the scene or is not seen; [`Error::Numerical`]; whatever the session's
/// observer returns.
pub fn fit(
    scene: &Scene,
    motion: &Motion,
    geometry: &Geometry,
    settings: &AppearanceSettings,
    seed: u64,
    session: &mut Session,
) -> Result<Appearance> {
    check(scene, motion)?;
    let seed = mix32(seed as u32 ^ mix32((seed >> 32) as u32));
    let rasterizer = telling_sides(scene);
    let window = Window::of(&scene.template);
    let drawn = Drawn { most: settings.most_pixels, seed, back: false };
    let seen = observe(scene, &rasterizer, geometry, motion, window, drawn)?;
    if seen.points.is_empty() {
        return Err(Error::input(
            scene.folder.display().to_string(),
            "no pixel shows the cloth where the motion puts it",
            Hint::from("look at the scene, and at pictures/ of the result").with(Remedy::Check),
        ));
    }

    // Start: under a uniform light L, an unshadowed diffuse surface has the colour T_D L.
    let size = settings.map_size;
    let mut colours = Splat::new(size);
    for (point, colour) in seen.points.iter().zip(&seen.colours) {
        colours.add(point.uv, colour.map(srgb::decode), 1.0);
    }
    let counts: Vec<f32> = colours.weights().collect();
    let mut planes = colours.planes();
    let start = (1.0 / settings.light_start) as f32;
    planes.iter_mut().for_each(|v| *v = (*v * start).clamp(0.01, 0.88));
    let mut maps = maps(settings, &planes, seed)?;
    let mut lighting = EnvironmentParameters::new(settings.light_coarsest, settings.light_start);

    let mut patch_weights = PatchWeights::new(motion.len(), rasterizer.triangles().len());
    let state: Option<State> = session.restore("appearance")?;
    let first = state.as_ref().map_or(0, |s| s.steps);
    let mut albedo = state.as_ref().and_then(|s| s.scale);
    if let Some(state) = state {
        if !(state.lighting.matches() && state.patch_weights.matches(&patch_weights)) {
            return Err(foreign_state("appearance"));
        }
        maps.restore(&state.maps)?;
        lighting = state.lighting;
        patch_weights = state.patch_weights;
    }
    let mut gradients = Gradients::default();
    let mut light = None;
    let table_rows = settings.light_finest.max(TABLE_ROWS).min(settings.light_rows);
    let mut batch = Vec::with_capacity(settings.batch);
    let mut observed = Vec::with_capacity(settings.batch);
    for step in first..settings.steps {
        let at = step as f64 / settings.steps as f64;
        let rows = rows_at(settings, at);
        if rows != lighting.rows() {
            lighting.refine(rows);
        }
        let span = (settings.colour_from - settings.grey_until).max(1e-9);
        let colour = ((at - settings.grey_until) / span).clamp(0.0, 1.0);
        if step % REDRAW == 0 {
            albedo = rescale(&mut *maps, &mut lighting, &counts, colour).or(albedo);
        }
        if step > 0 && step == settings.steps * 2 / 5 {
            maps.regroup();
        }
        if step % REDRAW == 0 && step >= settings.steps * 2 / 5 {
            maps.find_metals();
        }
        let environment = lighting.environment(table_rows, colour);
        let light = match &mut light {
            Some(light) if step % REDRAW != 0 => light,
            other => other.insert(EnvironmentSampler::new(&environment, settings.uniform_fraction)),
        };
        light.set_radiance(&environment);
        if step % REDRAW == 0 && at >= settings.reweight_from {
            patch_weights.update();
        }
        let material = Material::from_planes(size, size, &maps.maps());

        let step_seed = mix32(seed.wrapping_add(step as u32));
        batch.clear();
        observed.clear();
        // One of each of as many equal parts of the pixels: in the order of frames and rows, neighbours share what
        // is looked up.
        for k in 0..settings.batch as u64 {
            let within = u64::from(mix32(step_seed.wrapping_add(k as u32)));
            let number = u128::from((k << 32) + within) * seen.points.len() as u128;
            let i = ((number / settings.batch as u128) >> 32) as usize;
            batch.push(seen.points[i]);
            observed.push(seen.colours[i]);
        }
        let shader = Shader { geometry, material: &material, light };
        let scale = 1.0 / (3 * settings.batch) as f32;
        let mean = |i: usize, estimates: &[[f32; 3]; 2]| {
            let (value, adjoints) = loss(observed[i], estimates);
            // The more obliquely a surface is seen, the farther the same error of the motion shifts the texture.
            let cosine = batch[i].normal.dot(geometry.to_viewer(&batch[i]));
            let weight = scale * patch_weights.weight(batch[i].patch) * cosine * cosine;
            (value, adjoints.map(|a| a.map(|a| a * weight)))
        };
        accumulate(&shader, &batch, !step_seed, settings.samples_per_pixel, mean, &mut gradients);
        if at >= settings.grey_until {
            batch
                .iter()
                .zip(&gradients.losses)
                .for_each(|(point, error)| patch_weights.note(point.patch, *error));
        }
        if !gradients.loss.is_finite() {
            return Err(Error::numerical(
                format!("appearance, step {}", step + 1),
                "the loss is not finite",
                "try smaller appearance.map_rate and appearance.light_rate",
            ));
        }
        let fall = settings.final_rate.powf((2.0 * at - 1.0).max(0.0));
        maps.step(&gradients.material, settings.map_rate * fall);
        let smoothness = settings.light_smoothness;
        lighting.step(table_rows, &gradients.light, colour, smoothness, settings.light_rate * fall);
        let epoch = Epoch {
            stage: "appearance".into(),
            step: step + 1,
            of: settings.steps,
            active_frames: motion.len(),
            losses: named([("colour", gradients.loss * f64::from(scale))]),
            parameters: named([("light_rows", rows as f64), ("light_colour", colour)]),
        };
        // The directions are drawn anew where the next run would draw them too.
        let saved = ((step + 1) % REDRAW == 0 && session.wants_state()).then(|| State {
            steps: step + 1,
            maps: maps.save(),
            lighting: lighting.clone(),
            patch_weights: patch_weights.clone(),
            scale: albedo,
        });
        session.step(&epoch, &[], saved.as_ref())?;
    }
    let mut material = Material::from_planes(size, size, &maps.maps());
    let colour = if settings.steps == 0 { 0.0 } else { 1.0 };
    let environment = lighting.environment(settings.light_rows, colour);
    if settings.prior == MapPrior::Smooth && settings.steps > 0 && settings.sharpening_passes > 0 {
        let light = &EnvironmentSampler::new(&environment, settings.uniform_fraction);
        let shader = Shader { geometry, material: &material, light };
        let how = (settings.sharpening_passes, settings.samples_per_pixel, seed);
        let diffuse = sharpen(&shader, &seen, &patch_weights, how);
        material.set_planes(&diffuse);
    }
    if matches!(scene.back(), Back::Plain(_)) {
        let drawn = Drawn { most: back::MOST_PIXELS.min(settings.most_pixels), back: true, ..drawn };
        let of_back = observe(scene, &rasterizer, geometry, motion, window, drawn)?;
        let light = &EnvironmentSampler::new(&environment, settings.uniform_fraction);
        let how = (settings.samples_per_pixel, seed);
        material.back = back::albedo((geometry, &material, light), &of_back, how)
            .or_else(|| back::of_front(scene.back(), &material, &seen, rasterizer.triangles().len()));
    }
    let history = session.history_of(&["appearance"]);
    Ok(Appearance { material, window, environment, scale: albedo, history })
}

/// Leads the brightest part of the diffuse map to what is known of fabrics, the light the other way, and says what
/// that is. `counts` says how often each texel was seen; the light is as far from grey as `colour` says.
fn rescale(
    maps: &mut dyn Maps,
    lighting: &mut EnvironmentParameters,
    counts: &[f32],
    colour: f64,
) -> Option<AlbedoScale> {
    let lit = irradiance(&lighting.environment(lighting.rows(), colour));
    let mut scale = None;
    let factors = maps.rescale(&mut |diffuse, metallic| {
        let paint = |(m, count): (&f32, &f32)| if *count > 0.0 { f64::from(1.0 - m) } else { 0.0 };
        let weights: Vec<f64> = metallic.iter().zip(counts).map(paint).collect();
        let found = brightest(diffuse, &weights)?;
        let known = scale.insert(expected([0, 1, 2].map(|c| found[c] * lit[c])));
        Some([0, 1, 2].map(|c| known.brightest[c] / found[c]))
    })?;
    lighting.rescale(factors.map(f64::recip));
    scale
}

/// Irradiance over π of a surface that faces the camera.
fn irradiance(environment: &EnvironmentMap) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for row in 0..environment.height {
        let solid_angle = environment.solid_angle(row);
        for column in 0..environment.width {
            let weight = solid_angle * (-environment.direction(column, row).z).max(0.0);
            let texel = environment.texels[row * environment.width + column];
            (0..3).for_each(|c| sum[c] += weight * f64::from(texel[c]) / std::f64::consts::PI);
        }
    }
    sum
}

/// The maps that start from `diffuse` planes.
fn maps(settings: &AppearanceSettings, diffuse: &[f32], seed: u32) -> Result<Box<dyn Maps>> {
    let size = settings.map_size;
    match settings.prior {
        MapPrior::Smooth => {
            let prior = TexelPrior {
                smoothness: settings.diffuse_smoothness,
                metal_colour: settings.metal_colour_pull,
                surface: SurfacePrior {
                    metallic: settings.metallic_pull,
                    roughness_weight: settings.roughness_pull,
                    roughness: settings.roughness_start,
                },
            };
            let start = [settings.roughness_start, settings.metallic_start];
            Ok(Box::new(Texels::new(size, diffuse, start, prior)))
        }
        #[cfg(feature = "decoder")]
        MapPrior::Decoder if !size.is_multiple_of(DecoderConfig::LIGHT_STEP) => Err(Error::usage(
            format!(
                "appearance.map_size is {size}; the decoder makes maps of multiples of {}",
                DecoderConfig::LIGHT_STEP
            ),
            "set appearance.map_size=256, or appearance.prior=smooth",
        )),
        #[cfg(feature = "decoder")]
        MapPrior::Decoder => {
            let mut planes = diffuse.to_vec();
            planes.resize(4 * size * size, settings.roughness_start as f32);
            planes.resize(5 * size * size, settings.metallic_start as f32);
            Ok(Box::new(super::decoded::Decoded::new(size, &planes, settings.map_rate, u64::from(seed))))
        }
        #[cfg(not(feature = "decoder"))]
        MapPrior::Decoder => {
            let _ = seed;
            Err(Error::left_out("appearance.prior=decoder", "decoder"))
        }
    }
}

/// Rows of the light's grid after the fraction `at` of the steps; the finest has the last two of the equal intervals.
fn rows_at(settings: &AppearanceSettings, at: f64) -> usize {
    let levels = (settings.light_finest as f64 / settings.light_coarsest as f64).log2().ceil() as u32;
    let level = ((at * f64::from(levels + 2)) as u32).min(levels);
    (settings.light_coarsest << level).min(settings.light_finest)
}

fn check(scene: &Scene, motion: &Motion) -> Result<()> {
    let place = || format!("motion for {}", scene.folder.display());
    if motion.len() != scene.frames.len() {
        return Err(Error::input(
            place(),
            format!("{} frames, the scene has {}", motion.len(), scene.frames.len()),
            "give a result of the same frames of this scene",
        ));
    }
    motion.check_vertices(scene.template.positions.len(), &place())?;
    for (n, positions) in motion.iter().enumerate() {
        if let Some(v) = positions.iter().position(|p| p.length() >= 1e4) {
            return Err(Error::input(
                format!("{}, frame {n}", place()),
                format!("vertex {v} is at {}", positions[v]),
                "positions are metres in the camera's frame; reconstruct the motion again",
            ));
        }
    }
    Ok(())
}
