//! Simulation of a whole clip and its adjoint.

use glam::DVec3;

use super::cloth::Cloth;
use super::state::{State, StepGradients, StepSettings, StepTape};
use super::step::{step, step_vjp};
use super::stiffness::Stiffness;
use super::wind::{add_wind, add_wind_vjp};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;

/// Factors are kept for the adjoint while they fit into this many bytes; beyond, they are made again.
const FACTOR_MEMORY: usize = 700 << 20;

/// What acts from outside: accelerations [m/s²] f/m = `constant` + `dynamic`, and wind.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Accelerations {
    /// C, the same in space and time.
    pub constant: DVec3,
    /// D, shape [(N − 1)·entries_per_frame, V].
    pub dynamic: Vec<Positions>,
    /// Entries of D for each frame interval, each held for (sub-steps per frame)/parts sub-steps.
    pub entries_per_frame: usize,
    /// Velocity of the air [m/s], the same in space and time; `None` is no air at all, not even still one.
    #[serde(default)]
    pub wind: Option<DVec3>,
}

/// Everything that determines the motion.
#[derive(Debug, Clone)]
pub struct RolloutInputs<'a> {
    /// State at frame 0.
    pub initial: &'a State,
    /// External accelerations.
    pub accelerations: &'a Accelerations,
    /// Stiffnesses.
    pub stiffness: &'a Stiffness,
}

/// ∂L/∂[`RolloutInputs`] and the rest lengths.
#[derive(Debug, Clone)]
pub struct RolloutGradients {
    /// By C.
    pub constant: DVec3,
    /// By D, same shape.
    pub dynamic: Vec<Positions>,
    /// By the wind; zero without.
    pub wind: DVec3,
    /// By every element's stiffness.
    pub stiffness: Stiffness,
    /// By the initial state.
    pub initial: State,
    /// By the rest lengths of the edges.
    pub rest_lengths: Vec<f64>,
    /// By every coefficient of friction: [`super::contact::Contact::frictions`]; empty without contact.
    pub friction: Vec<f64>,
}

/// The record of a rollout over `frames.len()` frames.
#[derive(Debug)]
pub struct Rollout {
    /// Positions at every frame, shape `[N]`.
    pub frames: Vec<Positions>,
    tapes: Vec<StepTape>,
    substeps: usize,
}

/// Simulates `frame_count` frames of `substeps` sub-steps each.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] from the integrator, with the frame.
pub fn rollout(
    cloth: &Cloth,
    settings: &StepSettings,
    substeps: usize,
    frame_count: usize,
    inputs: &RolloutInputs,
) -> Result<Rollout> {
    let kept = FACTOR_MEMORY / (8 * cloth.analysis.factor_len().max(1));
    let mut tapes = Vec::with_capacity((frame_count - 1) * substeps);
    let frames = play_with(cloth, settings, substeps, frame_count, inputs, |mut tape, scratch| {
        if tapes.len() >= kept {
            tape.forget_factor(scratch);
        }
        let after = tape.after.clone();
        tapes.push(tape);
        after
    })?;
    Ok(Rollout { frames, tapes, substeps })
}

/// The frames of [`rollout`], shape [N, V], without the memory that its adjoint takes.
///
/// # Errors
/// As [`rollout`].
pub fn play(
    cloth: &Cloth,
    settings: &StepSettings,
    substeps: usize,
    frame_count: usize,
    inputs: &RolloutInputs,
) -> Result<Vec<Positions>> {
    play_with(cloth, settings, substeps, frame_count, inputs, StepTape::into_after)
}

/// `record` takes every step and gives the state after it back.
fn play_with(
    cloth: &Cloth,
    settings: &StepSettings,
    substeps: usize,
    frame_count: usize,
    inputs: &RolloutInputs,
    mut record: impl FnMut(StepTape, &mut Scratch) -> State,
) -> Result<Vec<Positions>> {
    let mut scratch = Scratch::default();
    let mut frames = vec![inputs.initial.x.clone()];
    let mut state = inputs.initial.clone();
    let mut acceleration = vec![DVec3::ZERO; cloth.vertex_count()];
    for k in 0..(frame_count - 1) * substeps {
        let dynamic = &inputs.accelerations.dynamic[k * inputs.accelerations.entries_per_frame / substeps];
        acceleration.iter_mut().zip(dynamic).for_each(|(a, d)| *a = inputs.accelerations.constant + *d);
        if let Some(wind) = inputs.accelerations.wind {
            add_wind(cloth, &state, wind, &mut acceleration);
        }
        let tape = step(cloth, settings, inputs.stiffness, state, &acceleration, &mut scratch)
            .map_err(|e| at_frame(e, k / substeps + 1))?;
        state = record(tape, &mut scratch);
        if (k + 1) % substeps == 0 {
            frames.push(state.x.clone());
        }
    }
    Ok(frames)
}

/// Adjoint of [`rollout`] for ∂L/∂(shape at every frame), shape [N, V].
pub fn rollout_vjp(
    cloth: &Cloth,
    settings: &StepSettings,
    inputs: &RolloutInputs,
    rollout: &Rollout,
    grad_frames: &[Positions],
) -> RolloutGradients {
    let mut scratch = Scratch::default();
    let substeps = rollout.substeps;
    let zeros = vec![DVec3::ZERO; cloth.vertex_count()];
    let mut dynamic = vec![zeros; inputs.accelerations.dynamic.len()];
    let (mut constant, mut by_wind) = (DVec3::ZERO, DVec3::ZERO);
    let mut gradients = StepGradients::zeros(cloth);
    let add = |x: &mut Positions, g: &Positions| x.iter_mut().zip(g).for_each(|(x, g)| *x += *g);
    for (k, tape) in rollout.tapes.iter().enumerate().rev() {
        if (k + 1) % substeps == 0 {
            add(&mut gradients.x, &grad_frames[(k + 1) / substeps]);
        }
        step_vjp(cloth, settings, inputs.stiffness, tape, &mut gradients, &mut scratch);
        add(&mut dynamic[k * inputs.accelerations.entries_per_frame / substeps], &gradients.acceleration);
        constant += gradients.acceleration.iter().copied().sum::<DVec3>();
        if let Some(wind) = inputs.accelerations.wind {
            let StepGradients { x, v, acceleration, .. } = &mut gradients;
            by_wind += add_wind_vjp(cloth, &tape.before, wind, acceleration, [x, v]);
        }
    }
    add(&mut gradients.x, &grad_frames[0]);
    RolloutGradients {
        constant,
        dynamic,
        wind: by_wind,
        stiffness: gradients.stiffness,
        initial: State { x: gradients.x, v: gradients.v },
        rest_lengths: gradients.rest_lengths,
        friction: gradients.friction,
    }
}

impl Accelerations {
    /// No force at all, over `frame_count` frames with `entries_per_frame` entries of D each.
    pub fn zeros(frame_count: usize, entries_per_frame: usize, vertex_count: usize) -> Self {
        let dynamic =
            vec![vec![DVec3::ZERO; vertex_count]; frame_count.saturating_sub(1) * entries_per_frame];
        Self { constant: DVec3::ZERO, dynamic, entries_per_frame, wind: None }
    }

    /// Rounds the dynamic part to single precision, as files keep it, so that what they make is made again to the
    /// last bit.
    pub fn round(&mut self) {
        self.dynamic.iter_mut().flatten().for_each(|a| *a = a.as_vec3().as_dvec3());
    }

    /// Whether they are for as many frames, parts and vertices as `other`.
    pub fn matches(&self, other: &Self) -> bool {
        let sizes = |f: &Self| f.dynamic.iter().map(Vec::len).collect::<Vec<_>>();
        self.entries_per_frame == other.entries_per_frame
            && self.wind.is_some() == other.wind.is_some()
            && sizes(self) == sizes(other)
    }
}

fn at_frame(error: tessuto_core::Error, frame: usize) -> tessuto_core::Error {
    match error {
        tessuto_core::Error::Numerical { place, problem, hint } => {
            tessuto_core::Error::numerical(format!("frame {frame}, {place}"), problem, hint)
        }
        other => other,
    }
}
