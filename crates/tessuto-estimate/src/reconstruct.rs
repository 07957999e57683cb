//! The main path: video in, motion, stiffnesses, forces and texture out.

use crate::config::{Config, Method};
use crate::motion::baselines;
use crate::motion::causes::{self, Explained};
use crate::motion::inverse::accelerations::{accelerations_of_motion, interpolated};
use crate::motion::inverse::stiffness::fit_material;
use crate::motion::parameters::Parameters;
use crate::motion::spacetime;
use crate::motion::texture::{Window, fit_texture};
use crate::session::{Epoch, Session, foreign_state};
use glam::DVec3;
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Motion, Positions};
use tessuto_core::scene::{Back, PoseUnit, Scene};
use tessuto_render::raster::{Rasterizer, Texture};
use tessuto_sim::contact::apart::{crossed, put_apart};
use tessuto_sim::{Cloth, Integrator, RolloutInputs, State, play, surrogate};

/// What was found about the fabric.
#[derive(Debug)]
pub struct Reconstruction {
    /// Positions at every frame, shape [N, V]: what was found, and the rollout of `parameters`.
    pub motion: Motion,
    /// Standard deviation of every vertex in every frame `[m]`, shape [N, V]: the root of the trace of its
    /// covariance, see [`crate::motion::spacetime`]. `None` from the other method and from a search that failed.
    pub deviations: Option<Vec<Vec<f64>>>,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// What the forces are of, where that was searched (`causes.fit`).
    pub causes: Option<Explained>,
    /// Colours of the surface.
    pub texture: Texture,
    /// What its other side looks like, as was told or found.
    pub back: Back,
    /// Every step of every stage.
    pub history: Vec<Epoch>,
    /// Stage and its wall time `[s]`.
    pub timings: Vec<(String, f64)>,
    /// Set if the optimisation diverged; the result is then the best state before.
    pub failure: Option<Error>,
}

/// Recovers the motion of the fabric in `scene`. Every finished step is reported to `session`, which may hold the
/// state of an interrupted run.
///
/// # Errors
/// [`Error::Input`] for a scene that cannot be computed on; [`Error::Numerical`] if not even a first state is finite;
/// whatever the session's observer returns.
pub fn reconstruct(scene: &Scene, config: &Config, session: &mut Session) -> Result<Reconstruction> {
    config.validate()?;
    config.check_build()?;
    scene.check()?;
    let cloth = config.dynamics.model.cloth(&scene.template);
    if config.dynamics.integrator == Integrator::Surrogate {
        surrogate::lattice(&cloth)?;
    }
    let window = Window::around(&scene.template.uvs, config.texture.size);
    let by_simulation = config.method == Method::Rollout;
    // The published program's renderer, whose losses are weighted for it.
    let one_sided = by_simulation && config.rollout.one_sided_silhouettes;
    let (first, back) = (scene.viewpoint(0), scene.back());
    let mut rasterizer = Rasterizer::of_fabric(&scene.template, &first, back).one_sided(one_sided);
    rasterizer.uvs_mut().iter_mut().for_each(|uv| *uv = window.uv(*uv));
    let template = &scene.template.positions;

    // What the fabric looks like, from the first frame.
    session.begin("texture");
    let side = config.texture.size;
    let fits = |t: &Texture| [t.width, t.height, t.texels.len()] == [side, side, side * side];
    let texture = match session.restore("texture")? {
        Some(texture) if !fits(&texture) => return Err(foreign_state("texture")),
        Some(texture) => texture,
        None => {
            fit_texture(&rasterizer, &first, template, &*scene.frames.frame(0)?, &config.texture, session)?
        }
    };
    session.finish("texture", &texture);

    // How it moves, and what moves it.
    let found = match config.method {
        Method::Rollout => {
            let (parameters, failure) =
                baselines::search(scene, &cloth, &rasterizer, &texture, config, session)?;
            Found { parameters, deviations: None, causes: None, made: None, back, failure }
        }
        Method::Spacetime => by_search(scene, &cloth, config, session)?,
    };
    let Found { mut parameters, deviations, causes, made, back, failure } = found;

    // The motion is what these parameters make; where their simulation fails, what was found.
    session.begin("rollout of the result");
    let cut = causes.as_ref().map(|c| causes::cut_cloth(&scene.template, &c.found.rest_lengths));
    let motion = match made {
        Some(frames) => Motion::new(frames)?,
        None => {
            parameters.accelerations.round();
            simulate(cut.as_ref().unwrap_or(&cloth), config, scene.fps, template, &parameters)?
        }
    };
    let motion = match &deviations {
        Some((found, _)) => not_through_itself(&scene.template, motion, found)?,
        None => motion,
    };
    let deviations = deviations.map(|(found, deviations)| of_motion(deviations, &found, &motion));
    session.end();
    let history = session.history_of(&["texture", "track", "refine", "fuse", "rollout"]);
    let timings = session.timings().to_vec();
    let texture = window.whole(&texture);
    Ok(Reconstruction { motion, deviations, parameters, causes, texture, back, history, timings, failure })
}

/// What either method found.
struct Found {
    parameters: Parameters,
    /// The positions that were found and their deviations, shape [N, V].
    deviations: Option<(Vec<Positions>, Vec<Vec<f64>>)>,
    causes: Option<Explained>,
    /// The motion to report, shape [N, V]; that of the parameters if there is none.
    made: Option<Vec<Positions>>,
    back: Back,
    failure: Option<Error>,
}

/// The default method: the positions of all frames, then what moves the fabric, and the positions again in the
/// light of that.
fn by_search(scene: &Scene, cloth: &Cloth, config: &Config, session: &mut Session) -> Result<Found> {
    let mut search = spacetime::Search::new(scene, cloth, &config.spacetime);
    let spacetime::Found { mut frames, deviations, failure } = search.find(config.seed, session)?;
    let deviations = deviations.map(|deviations| of_unit(scene, deviations));
    if let Some(deviations) = &deviations {
        frames = put_apart(&scene.template, frames, deviations, scene.fps);
    }
    session.begin("forces and stiffnesses");
    let dynamics = config.dynamics.at(scene.fps);
    let (mut causes, mut made) = (None, None);
    let (parameters, loose) = if config.causes.fit {
        let views = scene.viewpoints();
        let sheet = (&scene.template, &scene.known, &views[..]);
        let advance = &mut |done| session.advance(done, causes::PARTS);
        // Roughly what moves it; where it is, given that; what moves it, given where it is.
        let clock = (scene.fps, &dynamics);
        let begun = causes::begin(sheet, &frames, deviations.as_deref(), clock, &config.causes, advance);
        if let Some(made) = begun.motion(&frames) {
            frames = search.along(&frames, &made)?;
            if let Some(deviations) = &deviations {
                frames = put_apart(&scene.template, frames, deviations, scene.fps);
            }
        }
        let found = begun.explain(&frames, advance);
        causes = Some(found.explained);
        // Where no forces lead there, what was found is still the motion.
        made = Some(if found.failure.is_none() { found.frames } else { frames.clone() });
        (found.parameters, found.failure)
    } else {
        let log_stiffness = match config.material.fit {
            true => {
                let steps = interpolated(&frames, dynamics.substeps);
                fit_material(cloth, &dynamics, &steps, config.material.spread)
            }
            false => dynamics.springs().map(|range| range.start),
        };
        let stiffness = log_stiffness.map(|k| 10f64.powf(k));
        let (accelerations, loose) =
            accelerations_of_motion(cloth, &dynamics, stiffness, &frames, &config.inverse);
        (Parameters::of_springs(log_stiffness, accelerations), loose)
    };
    let deviations = deviations.map(|of_found| (frames, of_found));
    Ok(Found { parameters, deviations, causes, made, back: search.back(), failure: failure.or(loose) })
}

/// The simulated `motion`, or what was `found` where the simulation passes through itself more than that: layers a
/// millimetre apart are moved by less.
fn not_through_itself(template: &Mesh, motion: Motion, found: &[Positions]) -> Result<Motion> {
    let triangles = template.triangles();
    let all = |frames: &[Positions]| crossed(&triangles, frames).iter().sum::<f64>();
    if all(&motion) > all(found) { Motion::new(found.to_vec()) } else { Ok(motion) }
}

/// `deviations`, with what the length of a unit of the camera's path leaves open added: where the camera is, and all of
/// the sheet with it.
fn of_unit(scene: &Scene, mut deviations: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    if let (PoseUnit::Found { length, sd }, Some(poses)) = (scene.pose_unit, &scene.poses) {
        for (of_frame, pose) in deviations.iter_mut().zip(poses) {
            let way = pose.in_world(DVec3::ZERO).distance(poses[0].in_world(DVec3::ZERO));
            of_frame.iter_mut().for_each(|d| *d = d.hypot(way * sd / length));
        }
    }
    deviations
}

/// `deviations` of the `found` positions, with what the simulated `motion` is off from these added.
fn of_motion(mut deviations: Vec<Vec<f64>>, found: &[Positions], motion: &Motion) -> Vec<Vec<f64>> {
    for ((deviations, found), x) in deviations.iter_mut().zip(found).zip(motion.iter()) {
        deviations.iter_mut().zip(found.iter().zip(x)).for_each(|(d, (a, b))| *d = d.hypot(a.distance(*b)));
    }
    deviations
}

/// The motion of `cloth` from rest at `template` under `parameters`, one shape per frame.
///
/// # Errors
/// [`Error::Numerical`] from the simulation.
pub fn simulate(
    cloth: &Cloth,
    config: &Config,
    fps: f64,
    template: &Positions,
    parameters: &Parameters,
) -> Result<Motion> {
    let dynamics = config.dynamics.at(fps);
    let initial = State { x: template.clone(), v: vec![glam::DVec3::ZERO; template.len()] };
    let stiffness = parameters.stiffness_of(cloth);
    let inputs =
        RolloutInputs { initial: &initial, accelerations: &parameters.accelerations, stiffness: &stiffness };
    let frame_count = parameters.accelerations.dynamic.len() / parameters.accelerations.entries_per_frame + 1;
    Motion::new(play(cloth, &dynamics.step, dynamics.substeps, frame_count, &inputs)?)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn what_a_unit_leaves_open_is_in_the_deviations() {
        let settings = crate::synth::Settings::default().with(|s| {
            (s.frames, s.size, s.grid, s.orbit) = (3, 32, [4, 4], 20.0);
        });
        let scene = crate::synth::make(&settings).unwrap();
        let of = |pose_unit| of_unit(&Scene { pose_unit, ..scene.clone() }, vec![vec![0.003; 16]; 3]);
        assert_eq!(of(PoseUnit::Metres), vec![vec![0.003; 16]; 3]);
        let found = of(PoseUnit::Found { length: 0.5, sd: 0.05 });
        let way = scene.poses.as_ref().unwrap()[2].in_world(DVec3::ZERO).length();
        assert!(way > 0.1 && found[0] == [0.003; 16]);
        assert!((found[2][5] - 0.003f64.hypot(0.1 * way)).abs() < 1e-12);
    }

    #[test]
    fn a_simulation_that_passes_through_itself_is_not_told() {
        let mesh = tessuto_core::mesh::grid(11, 11, DVec2::splat(0.1), 1.0);
        // The right half turned over to the left; with a slope its rim comes out below.
        let folded = |slope: f64| -> Positions {
            let of = |x: &DVec3| match x.x {
                ..=0.001 => *x,
                out => DVec3::new(-out, x.y + 0.003, x.z - 0.01 + slope * out),
            };
            mesh.positions.iter().map(of).collect()
        };
        let (sound, crossing) = (folded(0.0), folded(0.3));
        let told = |simulated: &Positions, found: &Positions| {
            let motion = Motion::new(vec![simulated.clone()]).unwrap();
            not_through_itself(&mesh, motion, std::slice::from_ref(found)).unwrap()[0].clone()
        };
        assert!(told(&crossing, &sound) == sound && told(&sound, &crossing) == sound);
        assert!(told(&crossing, &crossing) == crossing);
    }
}
