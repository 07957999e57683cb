//! The accelerations of a motion by their causes.

use glam::DVec3;

use super::Found;
use super::guide::{Guide, Guided, guide, guide_from};
use crate::mesh::Positions;
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use crate::sim::air::Air;
use crate::sim::{Cloth, State};

/// What acts on every vertex beside the cloth's own springs, per mass, mean of each frame interval [m/s²], shape [N − 1, V].
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Gravity, everywhere the same.
    pub gravity: DVec3,
    /// Wind and drag.
    pub air: Vec<Positions>,
    /// Internal friction, which is no outer cause but no spring either.
    pub friction: Vec<Positions>,
    /// On held vertices, by what holds them.
    pub hold: Vec<Positions>,
    /// What none of these explains.
    pub residual: Vec<Positions>,
}

/// Accelerations by the air at `time` `[s]` in a step of length `h` `[s]`, with factors on drag and wind.
pub(super) fn air(
    cloth: &Cloth,
    found: &Found,
    [drag, wind]: [f64; 2],
    time: f64,
    state: &State,
    h: f64,
) -> Positions {
    let wind = found.causes.wind_at(&found.knots, time) * wind;
    let air = Air::new(cloth, found.causes.drag() * drag, wind, &state.x, &state.v, h);
    (0..state.x.len()).map(|i| air.acceleration(i)).collect()
}

impl Parts {
    /// The parts of what `guided` recorded, `substeps` steps per frame.
    pub(super) fn of(guided: &Guided, found: &Found, substeps: usize) -> Self {
        let mut is_held = vec![false; guided.pulls.first().map_or(0, Vec::len)];
        found.held.iter().for_each(|v| is_held[*v] = true);
        let mean = |field: &[Positions], keep: &dyn Fn(usize) -> bool| -> Vec<Positions> {
            let of = |steps: &[Positions]| {
                let at = |i: usize| match keep(i) {
                    true => steps.iter().map(|s| s[i]).sum::<DVec3>() / steps.len() as f64,
                    false => DVec3::ZERO,
                };
                (0..is_held.len()).map(at).collect()
            };
            field.chunks(substeps).map(of).collect()
        };
        Self {
            gravity: found.causes.gravity(),
            air: mean(&guided.outer, &|_| true),
            friction: mean(&guided.friction, &|_| true),
            hold: mean(&guided.pulls, &|i| is_held[i]),
            residual: mean(&guided.pulls, &|i| !is_held[i]),
        }
    }
}

/// Strength of every vertex's tie [1/s²]: `loose`, and what holds the held ones.
fn held_ties(cloth: &Cloth, found: &Found, loose: f64) -> Vec<f64> {
    let mut ties = vec![loose; cloth.vertex_count()];
    found.held.iter().for_each(|v| ties[*v] = HOLD);
    ties
}

/// How a motion shall go otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Otherwise {
    /// Factors on stretch, bend and shear stiffness and on the drag.
    pub scale: [f64; 4],
    /// Frames after the clip. `air` and `hold` then change at its end, otherwise at its start.
    pub further: usize,
    /// Factor on the wind; 0 is still air. After the clip the last wind holds.
    pub air: f64,
    /// What becomes of held vertices.
    pub hold: Hold,
    /// Factor on gravity.
    pub gravity: f64,
    /// Factor on what no cause explains.
    pub residual: f64,
    /// Whether that goes on after the clip as in its last frame; otherwise it ends with the clip.
    pub carry: bool,
}

/// What becomes of held vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// They follow their paths; after the clip they stay.
    Found,
    /// They stay where they are.
    Still,
    /// They are let go.
    Release,
}

impl Default for Otherwise {
    fn default() -> Self {
        Self {
            scale: [1.0; 4],
            further: 0,
            air: 1.0,
            hold: Hold::Found,
            gravity: 1.0,
            residual: 1.0,
            carry: false,
        }
    }
}

/// Strength of the ties of held vertices [1/s²].
const HOLD: f64 = 1e9;
/// Strength of the ties that tell what a motion's causes leave unexplained [1/s²].
const SOFT: f64 = 2000.0;
/// Longest step of a changed motion `[s]`: it need not go the way that was recorded.
const LONGEST_STEP: f64 = 5e-3;

/// `dynamics` in steps as long as changed motions may take.
fn coarser(dynamics: &Dynamics) -> Dynamics {
    let mut out = dynamics.clone();
    let interval = dynamics.step.step * dynamics.substeps as f64;
    out.substeps = (interval / LONGEST_STEP - 1e-9).ceil().clamp(1.0, dynamics.substeps as f64) as usize;
    out.step.step = interval / out.substeps as f64;
    out.step.damping = dynamics.step.damping.powf(out.step.step / dynamics.step.step);
    out
}

/// The motion of `cloth` under what moved it along `frames`, shape [N, V], but `otherwise`.
pub fn changed(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    frames: &[Positions],
    otherwise: &Otherwise,
) -> Guided {
    let dynamics = &coarser(dynamics);
    let mut residual = residuals(cloth, dynamics, found, frames);
    let (substeps, h) = (dynamics.substeps, dynamics.step.step);
    let clip = (frames.len() - 1) * substeps;
    if otherwise.carry && clip > 0 {
        let last = &residual[clip - substeps..];
        let of = |i: usize| last.iter().map(|step| step[i]).sum::<DVec3>() / substeps as f64;
        let mean: Positions = (0..cloth.vertex_count()).map(of).collect();
        residual.resize(clip + otherwise.further * substeps, mean);
    }
    let from = if otherwise.further > 0 { clip } else { 0 };
    let paths = interpolated(frames, substeps);
    let end = clip + otherwise.further * substeps;
    let last = match otherwise.hold {
        Hold::Still => from,
        _ => clip,
    };
    let targets: Vec<Positions> = (0..=end).map(|k| paths[k.min(last)].clone()).collect();
    let [stretch, bend, shear, drag_scale] = otherwise.scale;
    let k = found.causes.stiffness();
    let last_time = clip as f64 * h;
    let outer = |step: usize, state: &State| {
        let factor = if step >= from { otherwise.air } else { 1.0 };
        let time = ((step + 1) as f64 * h).min(last_time);
        air(cloth, found, [drag_scale, factor], time, state, h)
    };
    residual.iter_mut().flatten().for_each(|rest| *rest *= otherwise.residual);
    let ties = held_ties(cloth, found, 0.0);
    let stiffness = [k[0] * stretch, k[1] * bend, k[2] * shear];
    let constant = found.causes.gravity() * otherwise.gravity;
    let friction = found.causes.friction();
    let exact = false;
    let guide = Guide {
        cloth,
        dynamics,
        stiffness,
        ties: &ties,
        targets: &targets,
        constant,
        friction,
        exact,
        lead: &residual,
        outer: &outer,
    };
    if otherwise.hold != Hold::Release {
        return guide_from(&guide, None);
    }
    let held = guide_from(&Guide { targets: &targets[..=from], ..guide }, None);
    let loose = vec![0.0; cloth.vertex_count()];
    let later = |step: usize, state: &State| outer(step + from, state);
    let lead = residual.get(from..).unwrap_or_default();
    guide_from(&Guide { ties: &loose, targets: &targets[from..], lead, outer: &later, ..guide }, Some(held))
}

/// What gravity, air and springs do not explain of the motion `frames`, of every step; zero at held vertices, which follow their paths.
///
/// The pull of soft ties: those of stiff ones hold the found positions' noise too, which says nothing of another motion.
fn residuals(cloth: &Cloth, dynamics: &Dynamics, found: &Found, frames: &[Positions]) -> Vec<Positions> {
    let h = dynamics.step.step;
    let targets = interpolated(frames, dynamics.substeps);
    let ties = held_ties(cloth, found, SOFT);
    let outer = |k: usize, state: &State| air(cloth, found, [1.0; 2], (k + 1) as f64 * h, state, h);
    let stiffness = found.causes.stiffness();
    let guided = guide(&Guide {
        cloth,
        dynamics,
        stiffness,
        ties: &ties,
        targets: &targets,
        constant: found.causes.gravity(),
        friction: found.causes.friction(),
        exact: false,
        lead: &[],
        outer: &outer,
    });
    let mut out = guided.pulls;
    out.iter_mut().for_each(|pulls| found.held.iter().for_each(|v| pulls[*v] = DVec3::ZERO));
    out
}
