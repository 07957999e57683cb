//! The main path: video in, motion, stiffnesses, forces and texture out.

use std::time::Instant;

use crate::config::{Config, Method};
use crate::error::{Error, Result};
use crate::motion::material_fit::fit_material;
use crate::motion::progress::{Epoch, Observer};
use crate::motion::rollout_fit::{Parameters, RolloutFit};
use crate::motion::texture_fit::fit_texture;
use crate::motion::tied_simulation::{forces_of_trajectory, interpolated};
use crate::motion::trajectory;
use crate::raster::{Rasterizer, Texture};
use crate::scene::{Scene, Shape};
use crate::sim::{Cloth, Drive, State, Stiffness, rollout};

/// What a video tells about the fabric.
#[derive(Debug)]
pub struct Reconstruction {
    /// Shape at every frame, shape [N, V]: the rollout of `parameters`.
    pub motion: Vec<Shape>,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// Colours of the surface.
    pub texture: Texture,
    /// Every step of every stage.
    pub history: Vec<Epoch>,
    /// Stage and its wall time [s].
    pub timings: Vec<(String, f64)>,
    /// Set if the optimisation diverged; the result is then the best state before.
    pub failure: Option<Error>,
}

/// Recovers the motion of the fabric in `scene`. `observer` hears of every finished step.
///
/// # Errors
/// [`Error::Numerical`] if not even a first state is finite; whatever `observer` returns.
pub fn reconstruct(scene: &Scene, config: &Config, observer: &mut Observer) -> Result<Reconstruction> {
    config.validate()?;
    let mut history = Vec::new();
    let mut timings = Vec::new();
    let mut observe = |epoch: &Epoch, motion: &[Shape]| {
        history.push(epoch.clone());
        observer(epoch, motion)
    };
    let cloth = Cloth::new(&scene.template);
    let rasterizer = Rasterizer::new(&scene.template);
    let template = &scene.template.positions;

    // What the fabric looks like, from the first frame.
    let mut clock = Instant::now();
    let epochs = config.texture.epochs;
    let frame = &scene.frames[0];
    let texture =
        fit_texture(&rasterizer, &scene.camera, template, frame, &config.texture, |step, colour| {
            let epoch = Epoch {
                stage: "texture",
                step: step + 1,
                of: epochs,
                active_frames: 1,
                losses: vec![("colour", colour)],
                parameters: Vec::new(),
            };
            observe(&epoch, &[])
        })?;
    timings.push(("texture".to_owned(), lap(&mut clock)));

    // How it moves, and what moves it.
    let fit = RolloutFit {
        scene,
        cloth: &cloth,
        rasterizer: &rasterizer,
        texture: &texture,
        dynamics: config.dynamics.at(scene.fps),
        settings: &config.rollout,
    };
    let (parameters, failure) = match config.method {
        Method::Rollout => {
            let fitted = fit.run(fit.start(), &mut observe)?;
            timings.push(("rollout".to_owned(), lap(&mut clock)));
            fitted
        }
        Method::Trajectory => {
            let problem = trajectory::Problem::new(scene, &cloth, config.trajectory.clone());
            let (tracked, lost) = problem.track(&mut observe)?;
            timings.push(("track".to_owned(), lap(&mut clock)));
            let (frames, stuck) = problem.refine(tracked, &mut observe)?;
            timings.push(("refine".to_owned(), lap(&mut clock)));
            let mut parameters = fit.start();
            if config.material.fit {
                let steps = interpolated(&frames, config.dynamics.substeps);
                parameters.log_stiffness =
                    fit_material(&cloth, &fit.dynamics, &steps, config.material.spread);
            }
            let k = parameters.stiffness();
            let (forces, loose) =
                forces_of_trajectory(&scene.template, &fit.dynamics, k, &frames, &config.tie);
            parameters.forces = forces;
            timings.push(("forces and stiffnesses".to_owned(), lap(&mut clock)));
            (parameters, lost.or(stuck).or(loose))
        }
    };

    // The motion is what these parameters make, nothing else.
    let motion = simulate(&cloth, config, scene.fps, template, &parameters)?;
    timings.push(("rollout of the result".to_owned(), lap(&mut clock)));
    Ok(Reconstruction { motion, parameters, texture, history, timings, failure })
}

/// The motion of `cloth` from rest at `template` under `parameters`, one shape per frame.
///
/// # Errors
/// [`Error::Numerical`] from the simulation.
pub fn simulate(
    cloth: &Cloth,
    config: &Config,
    fps: f64,
    template: &Shape,
    parameters: &Parameters,
) -> Result<Vec<Shape>> {
    let dynamics = config.dynamics.at(fps);
    let initial = State { x: template.clone(), v: vec![glam::DVec3::ZERO; template.len()] };
    let stiffness = Stiffness::uniform(cloth, parameters.stiffness());
    let drive = Drive { initial: &initial, forces: &parameters.forces, stiffness: &stiffness };
    let frame_count = parameters.forces.dynamic.len() / parameters.forces.parts + 1;
    Ok(rollout(cloth, &dynamics.step, dynamics.substeps, frame_count, &drive)?.frames)
}

/// Seconds since the last call.
fn lap(clock: &mut Instant) -> f64 {
    let seconds = clock.elapsed().as_secs_f64();
    *clock = Instant::now();
    seconds
}
