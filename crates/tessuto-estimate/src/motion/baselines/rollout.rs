//! Motion by simulation: forces and stiffnesses are optimised until the simulated, rendered cloth looks
//! like the video. Every epoch is one rollout, one adjoint and one step of every group of parameters.
//!
//! Source: \[SAFT\] §1.3-1.4, §2.2-2.3 and Table 1.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::compared::Compared;
use super::guard::DivergenceGuard;
use super::losses::{LossWeights, Losses, force_across_rays, force_changes, view_rays};
use crate::motion::image_loss::{LOSS_FLOOR, image_loss};
use crate::motion::parameters::{Dynamics, Parameters};
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::math::{finite, flat, vectors};
use tessuto_core::mesh::Positions;
use tessuto_core::optim::{Adam, GradientClip};
use tessuto_core::scene::Scene;
use tessuto_core::settings::settings;
use tessuto_core::video::Frame;
use tessuto_render::raster::{Gradients, Rasterizer, Rendering, Texture};
use tessuto_sim::{
    Accelerations, Cloth, Rollout, RolloutGradients, RolloutInputs, State, Stiffness, rollout, rollout_vjp,
};

settings! {
    /// Settings of the rollout fit.
    pub struct RolloutSettings {
        /// Frames of the first epochs.
        first_frames: usize = 2, number(2.0..=1e6, "");
        /// Epochs between two frames that join.
        epochs_per_frame: usize = 5, number(1.0..=1e6, "");
        /// Epochs beyond those of the frames that join.
        last_epochs: usize = 20, number(0.0..=1e6, "");
        /// Weights of the losses.
        weights: LossWeights = LossWeights::default(), group::<LossWeights>();
        /// Take the view rays of weights.force from the first frame in all frames, as the published program does.
        frozen_rays: bool = true, flag();
        /// Leave the pixels beside the fabric unblended, as the published program does; half of the gradient of
        /// the silhouettes.
        one_sided_silhouettes: bool = true, flag();
        /// Pixels nearer to the outline of the mask than this part of the fabric's size are not compared: hems and
        /// folds finer than the mesh open there. 0 compares all, as the published program does, and is for fabric
        /// without a print.
        outline_margin: f64 = 0.0, number(0.0..=0.1, "");
        /// Optimise the stiffnesses; otherwise they keep their start.
        optimise_material: bool = true, flag();
        /// Learning rate of the log10 stiffnesses.
        stiffness_rate: f64 = 0.02, number(0.0..=10.0, "");
        /// Learning rate of the constant acceleration C.
        constant_rate: f64 = 0.1, number(0.0..=100.0, "m/s²");
        /// Simulate air, whose velocity is searched from rest: the wind.
        wind: bool = false, flag();
        /// Learning rate of the wind.
        wind_rate: f64 = 0.05, number(0.0..=100.0, "m/s");
        /// Learning rate of the dynamic accelerations D.
        dynamic_rate: f64 = 0.2, number(0.0..=1e9, "m/s²");
        /// Frames that the rates are for: with more of them all rates fall in proportion, for a force moves all
        /// frames after it.
        rated_frames: usize = 1_000_000, number(1.0..=1e6, "");
        /// Fixed limit of the norm of every group's gradient.
        clip_limit: f64 = 1000.0, number(1e-9..=1e12, "");
        /// Quantile of the recent gradient norms that limits the next one.
        clip_quantile: f64 = 0.75, number(0.0..=1.0, "");
        /// How many gradient norms are recent.
        clip_history: usize = 11, number(1.0..=1e6, "");
        /// One entry of D for every sub-step instead of every frame; see weights.force_smoothness.
        force_per_substep: bool = false, flag();
        /// Failed epochs since the last sound one after which the fit stops with the best state.
        patience: usize = 10, number(0.0..=1e6, "");
    }
}

impl RolloutSettings {
    /// Number of epochs for a video of `frames` frames.
    fn epoch_count(&self, frames: usize) -> usize {
        frames.saturating_sub(self.first_frames) * self.epochs_per_frame + self.last_epochs
    }

    /// Factor on the rates of an epoch that looks at `active` frames.
    fn rate(&self, active: usize) -> f64 {
        (self.rated_frames as f64 / active as f64).min(1.0)
    }

    /// How many of `frames` frames epoch number `epoch`, counted from 0, looks at.
    fn active_frames(&self, frames: usize, epoch: usize) -> usize {
        (self.first_frames + epoch.div_ceil(self.epochs_per_frame)).min(frames)
    }
}

/// What the fit looks at.
pub struct RolloutFit<'a> {
    /// The video.
    pub scene: &'a Scene,
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Renderer of the template.
    pub rasterizer: &'a Rasterizer,
    /// The cloth's texture.
    pub texture: &'a Texture,
    /// The pixels that are looked at.
    pub compared: Compared,
    /// The dynamics.
    pub dynamics: Dynamics,
    /// Settings.
    pub settings: &'a RolloutSettings,
}

/// Loss of an epoch with its gradients.
#[derive(Debug)]
pub struct LossAndGradients {
    /// Unweighted losses.
    pub losses: Losses,
    /// Weighted sum.
    pub total: f64,
    /// Weighted losses of each frame, without the regulariser of the forces.
    pub by_frame: Vec<f64>,
    /// ∂total/∂log10 stiffness.
    pub log_stiffness: Vec<f64>,
    /// ∂total/∂C.
    pub constant: DVec3,
    /// ∂total/∂D.
    pub dynamic: Vec<Positions>,
    /// ∂total/∂ the wind.
    pub wind: DVec3,
    /// The motion they belong to, shape [active frames, V].
    pub motion: Vec<Positions>,
}

/// One group of parameters: its clipping and its Adam state.
#[derive(Clone, Serialize, Deserialize)]
struct Group {
    clip: GradientClip,
    adam: Adam,
}

impl Group {
    fn new(settings: &RolloutSettings, len: usize, rate: f64) -> Self {
        let clip = GradientClip::new(settings.clip_limit, settings.clip_quantile, settings.clip_history);
        Self { clip, adam: Adam::new(len, rate) }
    }

    fn step(&mut self, parameters: &mut [f64], gradient: &mut [f64], rate: f64) {
        self.clip.clip(gradient);
        self.adam.step(parameters, gradient, rate);
    }
}

/// What an epoch changes.
#[derive(Clone, Serialize, Deserialize)]
struct FitState {
    parameters: Parameters,
    stiffness: Vec<Group>,
    constant: Group,
    wind: Group,
    dynamic: Group,
}

/// What [`RolloutFit::run`] goes on from.
#[derive(Serialize, Deserialize)]
struct Run {
    /// Epochs done.
    epochs: usize,
    state: FitState,
    guard: DivergenceGuard<FitState>,
}

impl FitState {
    fn new(fit: &RolloutFit, parameters: Parameters) -> Self {
        let s = fit.settings;
        let dynamic_len = 3 * fit.cloth.vertex_count() * parameters.accelerations.dynamic.len();
        Self {
            parameters,
            stiffness: fit.dynamics.stiffness.iter().map(|_| Group::new(s, 1, s.stiffness_rate)).collect(),
            constant: Group::new(s, 3, s.constant_rate),
            wind: Group::new(s, 3, s.wind_rate),
            dynamic: Group::new(s, dynamic_len, s.dynamic_rate),
        }
    }

    /// Whether this is a state of `fit`, and not of other frames, vertices or forces.
    fn fits(&self, fit: &RolloutFit) -> bool {
        let accelerations = &self.parameters.accelerations;
        let len = 3 * fit.cloth.vertex_count() * accelerations.dynamic.len();
        accelerations.matches(&fit.start().accelerations)
            && self.parameters.model == fit.dynamics.model
            && [self.stiffness.len(), self.parameters.log_stiffness.len()]
                == [fit.dynamics.stiffness.len(); 2]
            && self.stiffness.iter().all(|group| group.adam.matches(1))
            && self.constant.adam.matches(3)
            && self.wind.adam.matches(3)
            && self.dynamic.adam.matches(len)
    }
}

impl Run {
    fn fits(&self, fit: &RolloutFit) -> bool {
        let active = fit.active_frames(self.epochs.saturating_sub(1));
        self.state.fits(fit) && self.guard.fits(active, |state| state.fits(fit))
    }
}

impl RolloutFit<'_> {
    /// Start of Table 1: prior stiffnesses, C = 1 m/s² downwards, D = 0.
    pub fn start(&self) -> Parameters {
        let parts = if self.settings.force_per_substep { self.dynamics.substeps } else { 1 };
        let mut accelerations =
            Accelerations::zeros(self.scene.frames.len(), parts, self.cloth.vertex_count());
        accelerations.constant = DVec3::Y;
        accelerations.wind = self.settings.wind.then_some(DVec3::ZERO);
        let log_stiffness = self.dynamics.stiffness.iter().map(|k| k.start).collect();
        Parameters { model: self.dynamics.model, log_stiffness, accelerations }
    }

    /// Number of epochs of the whole fit.
    pub fn epoch_count(&self) -> usize {
        self.settings.epoch_count(self.scene.frames.len())
    }

    fn active_frames(&self, epoch: usize) -> usize {
        self.settings.active_frames(self.scene.frames.len(), epoch)
    }

    /// Runs all epochs from `parameters`; returns the last parameters. If the fit diverges for good it ends early,
    /// with the last sound parameters and the failure.
    ///
    /// # Errors
    /// [`Error::Input`] if it is to go on from a state that does not fit; what the session's observer returns.
    pub fn run(&self, parameters: Parameters, session: &mut Session) -> Result<(Parameters, Option<Error>)> {
        let start =
            || Run { epochs: 0, state: FitState::new(self, parameters), guard: DivergenceGuard::new() };
        let mut run: Run = session.restore("rollout")?.unwrap_or_else(start);
        if !run.fits(self) {
            return Err(foreign_state("rollout"));
        }
        // One epoch more judges the last step.
        while run.epochs <= self.epoch_count() {
            let Run { epochs, state, guard } = &mut run;
            let epoch = *epochs;
            *epochs += 1;
            let active = self.active_frames(epoch);
            if epoch < self.epoch_count() {
                subtract_mean(&mut state.parameters.accelerations.dynamic);
            }
            let evaluated = self.loss_and_gradients(&state.parameters, active).and_then(|gradients| {
                let verdict = guard.judge(state, &gradients.by_frame);
                verdict.map_err(|problem| Error::numerical("loss", problem, "")).map(|()| gradients)
            });
            let gradients = match evaluated {
                Ok(gradients) => gradients,
                Err(failure) => {
                    let sound = guard.back();
                    let known = sound.is_some();
                    *state = sound.unwrap_or_else(|| state.clone());
                    if !known || guard.failures > self.settings.patience {
                        return Ok((run.state.parameters, Some(divergence(epoch, &failure))));
                    }
                    continue;
                }
            };
            if epoch < self.epoch_count() {
                let before = recorded(&state.parameters);
                let rate = guard.rate * self.settings.rate(active);
                self.descend(state, &gradients, rate);
                let record = self.epoch_record(epoch, active, &gradients, before, rate);
                session.step(&record, &gradients.motion, Some(&run))?;
            }
        }
        session.finish("rollout", &run);
        Ok((run.state.parameters, None))
    }

    /// One step of every group against `gradients`.
    fn descend(&self, state: &mut FitState, gradients: &LossAndGradients, rate: f64) {
        // Dividing by the loss makes the step free of its scale.
        let scale = 1.0 / (gradients.total + LOSS_FLOOR);
        let parameters = &mut state.parameters;
        if self.settings.optimise_material {
            for (k, group) in state.stiffness.iter_mut().enumerate() {
                let range = self.dynamics.stiffness[k];
                let value = std::slice::from_mut(&mut parameters.log_stiffness[k]);
                group.step(value, &mut [gradients.log_stiffness[k] * scale], rate);
                value[0] = value[0].clamp(range.low, range.high);
            }
        }
        let mut constant = parameters.accelerations.constant.to_array();
        state.constant.step(&mut constant, &mut (gradients.constant * scale).to_array(), rate);
        parameters.accelerations.constant = DVec3::from_array(constant);
        if let Some(wind) = &mut parameters.accelerations.wind {
            let mut velocity = wind.to_array();
            state.wind.step(&mut velocity, &mut (gradients.wind * scale).to_array(), rate);
            *wind = DVec3::from_array(velocity);
        }
        let numbers =
            |shapes: &[Positions]| -> Vec<f64> { shapes.iter().flat_map(|s| flat(s)).copied().collect() };
        let mut dynamic = numbers(&parameters.accelerations.dynamic);
        let mut gradient = numbers(&gradients.dynamic);
        gradient.iter_mut().for_each(|g| *g *= scale);
        state.dynamic.step(&mut dynamic, &mut gradient, rate);
        parameters.accelerations.dynamic =
            dynamic.chunks_exact(3 * self.cloth.vertex_count()).map(vectors).collect();
    }

    fn epoch_record(
        &self,
        epoch: usize,
        active: usize,
        gradients: &LossAndGradients,
        mut parameters: Vec<(&'static str, f64)>,
        rate: f64,
    ) -> Epoch {
        let l = &gradients.losses;
        parameters.push(("rate", rate));
        Epoch {
            stage: "rollout".into(),
            step: epoch + 1,
            of: self.epoch_count(),
            active_frames: active,
            losses: named([
                ("total", gradients.total),
                ("colour", l.colour),
                ("silhouette", l.silhouette),
                ("energy", l.energy),
                ("force", l.force),
            ]),
            parameters: named(parameters),
        }
    }

    /// Simulates `frame_count` frames with `parameters`.
    ///
    /// # Errors
    /// [`Error::Numerical`] from the simulation.
    pub fn simulate(&self, parameters: &Parameters, frame_count: usize) -> Result<Rollout> {
        let initial = at_rest(&self.scene.template.positions);
        let stiffness = parameters.stiffness_of(self.cloth);
        let inputs = RolloutInputs {
            initial: &initial,
            accelerations: &parameters.accelerations,
            stiffness: &stiffness,
        };
        rollout(self.cloth, &self.dynamics.step, self.dynamics.substeps, frame_count, &inputs)
    }

    /// The losses over the first `active` frames and their gradients.
    ///
    /// # Errors
    /// [`Error::Numerical`] from the simulation; those of reading the frames.
    pub fn loss_and_gradients(&self, parameters: &Parameters, active: usize) -> Result<LossAndGradients> {
        let s = self.settings;
        let motion = self.simulate(parameters, active)?;
        let stiffness = parameters.stiffness_of(self.cloth);
        let share = 1.0 / active as f64;
        let frames = self.scene.frames.map(0..active, FrameScratch::default, |scratch, n| {
            let frame = self.scene.frames.frame(n)?;
            Ok(self.frame_loss(scratch, &motion.frames[n], (n, &frame), &stiffness, share))
        })?;
        let mut losses = Losses::default();
        for f in &frames {
            losses.colour += f.colour * share;
            losses.silhouette += f.silhouette * share;
            losses.energy += f.energy * share;
        }
        let by_frame = frames
            .iter()
            .map(|f| {
                let losses = Losses {
                    colour: f.colour,
                    silhouette: f.silhouette,
                    energy: f.energy,
                    ..Losses::default()
                };
                losses.total(&s.weights)
            })
            .collect();
        let grad_frames: Vec<Positions> = frames.into_iter().map(|f| f.gradient).collect();

        let initial = at_rest(&self.scene.template.positions);
        let inputs = RolloutInputs {
            initial: &initial,
            accelerations: &parameters.accelerations,
            stiffness: &stiffness,
        };
        let RolloutGradients { mut constant, mut dynamic, wind, stiffness: by_stiffness, .. } =
            rollout_vjp(self.cloth, &self.dynamics.step, &inputs, &motion, &grad_frames);

        let entries = (active - 1) * parameters.accelerations.entries_per_frame;
        let rays: Vec<Positions> = match s.frozen_rays {
            true => vec![view_rays(&self.scene.viewpoint(0), &motion.frames[0])],
            false => {
                let rays = |(n, x): (usize, &Positions)| view_rays(&self.scene.viewpoint(n), x);
                motion.frames[..active - 1].iter().enumerate().map(rays).collect()
            }
        };
        let of_entry: Vec<&Positions> = (0..entries)
            .map(|k| &rays[(k / parameters.accelerations.entries_per_frame).min(rays.len() - 1)])
            .collect();
        let f = &parameters.accelerations;
        losses.force = force_across_rays(f, entries, &of_entry, s.weights.force, &mut constant, &mut dynamic);
        losses.force_smoothness = force_changes(f, entries, s.weights.force_smoothness, &mut dynamic);
        let total = losses.total(&s.weights);
        let log_stiffness = parameters.model.grad_log10(&by_stiffness, &parameters.stiffness());
        if !finite(&log_stiffness) || !constant.is_finite() || !wind.is_finite() {
            return Err(Error::numerical("adjoint", "a gradient is not finite", "lower the learning rates"));
        }
        let motion = motion.frames;
        Ok(LossAndGradients { losses, total, by_frame, log_stiffness, constant, dynamic, wind, motion })
    }

    fn frame_loss(
        &self,
        scratch: &mut FrameScratch,
        x: &Positions,
        (n, frame): (usize, &Frame),
        stiffness: &Stiffness,
        share: f64,
    ) -> FrameLoss {
        let (view, weights) = (&self.scene.viewpoint(n), &self.settings.weights);
        let of_image = [weights.colour, weights.silhouette];
        let mut gradients = Gradients::new(self.rasterizer);
        self.rasterizer.render(view, x, self.texture, &mut scratch.rendering);
        let compared = self.compared.frame(n);
        let [colour, silhouette] =
            image_loss(&scratch.rendering.rgba, frame, compared, of_image, share, &mut scratch.grad_rgba);
        self.rasterizer.render_vjp(
            view,
            x,
            self.texture,
            &scratch.rendering,
            &scratch.grad_rgba,
            None,
            &mut gradients,
        );
        let mut gradient = gradients.positions;
        self.cloth.add_gradient(stiffness, x, weights.energy * share, &mut gradient);
        FrameLoss { colour, silhouette, energy: self.cloth.energy(stiffness, x).total(), gradient }
    }
}

/// Buffers of one thread.
#[derive(Default)]
struct FrameScratch {
    rendering: Rendering,
    grad_rgba: Vec<[f32; 4]>,
}

struct FrameLoss {
    colour: f64,
    silhouette: f64,
    energy: f64,
    gradient: Positions,
}

/// The numbers of `parameters` that every epoch records, by name.
fn recorded(parameters: &Parameters) -> Vec<(&'static str, f64)> {
    let Accelerations { constant: c, wind, .. } = &parameters.accelerations;
    let mut rows: Vec<_> = parameters.properties().map(|(p, value)| (p.key, value)).collect();
    rows.extend([("constant_x", c.x), ("constant_y", c.y), ("constant_z", c.z)]);
    rows.extend(wind.iter().flat_map(|w| [("wind_x", w.x), ("wind_y", w.y), ("wind_z", w.z)]));
    rows
}

/// Takes the mean over all entries and vertices off `dynamic`. What all have in common is for C to find; entries
/// of frames that are not looked at yet take part, so that these do not start from no force when they join.
fn subtract_mean(dynamic: &mut [Positions]) {
    let count = dynamic.iter().map(Vec::len).sum::<usize>().max(1);
    let mean = dynamic.iter().flatten().copied().sum::<DVec3>() / count as f64;
    dynamic.iter_mut().flatten().for_each(|d| *d -= mean);
}

fn at_rest(x: &[DVec3]) -> State {
    State { x: x.to_vec(), v: vec![DVec3::ZERO; x.len()] }
}

fn divergence(epoch: usize, cause: &Error) -> Error {
    let problem = match cause {
        Error::Numerical { place, problem, .. } => format!("{place}: {problem}"),
        other => other.to_string(),
    };
    Error::numerical(
        format!("rollout fit, epoch {}", epoch + 1),
        problem,
        Hint::from("the best state so far was kept; try lower learning rates, or another integrator")
            .with(Remedy::Set("dynamics.integrator=implicit_euler")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_schedule() {
        let settings = RolloutSettings::default();
        assert_eq!(settings.epoch_count(50), 260);
        let active: Vec<usize> = (0..260).map(|e| settings.active_frames(50, e)).collect();
        assert_eq!(active[..7], [2, 3, 3, 3, 3, 3, 4]);
        assert_eq!(active.iter().filter(|&&a| a == 50).count(), 24);
    }

    #[test]
    fn rates_fall_as_frames_join() {
        let settings = RolloutSettings { rated_frames: 16, ..RolloutSettings::default() };
        assert_eq!([2, 16, 32, 64].map(|active| settings.rate(active)), [1.0, 1.0, 0.5, 0.25]);
    }

    #[test]
    fn the_mean_of_all_entries_goes() {
        let mut dynamic = vec![vec![DVec3::X * 4.0; 2], vec![DVec3::ZERO; 2]];
        subtract_mean(&mut dynamic);
        assert_eq!(dynamic, [[DVec3::X * 2.0; 2], [DVec3::X * -2.0; 2]]);
    }
}
