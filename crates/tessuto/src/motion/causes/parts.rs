//! The accelerations of a motion by their causes.

use glam::DVec3;

use super::Found;
use crate::mesh::Positions;
use crate::motion::inverse::accelerations::{Guide, Guided, guide, guide_from, interpolated};
use crate::motion::parameters::Dynamics;
use crate::sim::Cloth;

/// What acts on every vertex beside the cloth's own springs, per mass, mean of each frame interval [m/s²], shape [N − 1, V].
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Gravity, everywhere the same.
    pub gravity: DVec3,
    /// Wind and drag.
    pub air: Vec<Positions>,
    /// On held vertices, by what holds them.
    pub hold: Vec<Positions>,
    /// What none of these explains.
    pub residual: Vec<Positions>,
}

/// Accelerations that lead `cloth` along `frames`, shape [N, V], with springs of strength `tracking` [1/s²] and the parts they are of.
pub fn follow(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    frames: &[Positions],
    tracking: f64,
) -> (Guided, Parts) {
    let targets = interpolated(frames, dynamics.substeps);
    let (h, drag) = (dynamics.step.step, found.causes.drag());
    let air = |k: usize, v: DVec3| {
        found.causes.wind_at(&found.knots, (k + 1) as f64 * h) - v * (drag / (1.0 + drag * h))
    };
    let ties = vec![tracking; cloth.vertex_count()];
    let outer = |k: usize, _: usize, v: DVec3| air(k, v);
    let guided = guide(&Guide {
        cloth,
        dynamics,
        stiffness: found.causes.stiffness(),
        ties: &ties,
        targets: &targets,
        constant: found.causes.gravity(),
        outer: &outer,
    });
    let parts = Parts::of(&guided, found, dynamics.substeps);
    (guided, parts)
}

impl Parts {
    /// The parts of what `guided` recorded, `substeps` steps per frame.
    fn of(guided: &Guided, found: &Found, substeps: usize) -> Self {
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
            hold: mean(&guided.pulls, &|i| is_held[i]),
            residual: mean(&guided.pulls, &|i| !is_held[i]),
        }
    }
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
        Self { scale: [1.0; 4], further: 0, air: 1.0, hold: Hold::Found, gravity: 1.0 }
    }
}

/// Strength of the ties of held vertices [1/s²].
const HOLD: f64 = 1e6;
/// Strength of the ties that tell what a motion's causes leave unexplained [1/s²].
const SOFT: f64 = 5000.0;

/// The motion of `cloth` under what moved it along `frames`, shape [N, V], but `otherwise`.
pub fn changed(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    frames: &[Positions],
    otherwise: &Otherwise,
) -> Guided {
    let residual = residuals(cloth, dynamics, found, frames);
    let (substeps, h) = (dynamics.substeps, dynamics.step.step);
    let clip = (frames.len() - 1) * substeps;
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
    let drag = found.causes.drag() * drag_scale;
    let last_time = clip as f64 * h;
    let outer = |step: usize, i: usize, v: DVec3| {
        let factor = if step >= from { otherwise.air } else { 1.0 };
        let wind = found.causes.wind_at(&found.knots, ((step + 1) as f64 * h).min(last_time));
        let rest = residual.get(step).map_or(DVec3::ZERO, |of_step| of_step[i]);
        // As in the middle of the step: however strong, drag only slows.
        wind * (factor * drag_scale) - v * (drag / (1.0 + drag * h)) + rest
    };
    let mut ties = vec![0.0; cloth.vertex_count()];
    found.held.iter().for_each(|v| ties[*v] = HOLD);
    let stiffness = [k[0] * stretch, k[1] * bend, k[2] * shear];
    let constant = found.causes.gravity() * otherwise.gravity;
    let run = |targets: &[Positions],
               ties: &[f64],
               outer: &dyn Fn(usize, usize, DVec3) -> DVec3,
               start: Option<Guided>| {
        guide_from(&Guide { cloth, dynamics, stiffness, ties, targets, constant, outer }, start)
    };
    if otherwise.hold != Hold::Release {
        return run(&targets, &ties, &outer, None);
    }
    let held = run(&targets[..=from], &ties, &outer, None);
    let loose = vec![0.0; cloth.vertex_count()];
    run(&targets[from..], &loose, &|step, i, v| outer(step + from, i, v), Some(held))
}

/// What gravity, air and springs do not explain of the motion `frames`, of every step; zero at held vertices, which follow their paths.
///
/// The pull of soft ties: those of stiff ones hold the found positions' noise too, which says nothing of another motion.
fn residuals(cloth: &Cloth, dynamics: &Dynamics, found: &Found, frames: &[Positions]) -> Vec<Positions> {
    let (h, drag) = (dynamics.step.step, found.causes.drag());
    let targets = interpolated(frames, dynamics.substeps);
    let mut ties = vec![SOFT; cloth.vertex_count()];
    found.held.iter().for_each(|v| ties[*v] = HOLD);
    let outer = |step: usize, _: usize, v: DVec3| {
        found.causes.wind_at(&found.knots, (step + 1) as f64 * h) - v * (drag / (1.0 + drag * h))
    };
    let stiffness = found.causes.stiffness();
    let constant = found.causes.gravity();
    let guided =
        guide(&Guide { cloth, dynamics, stiffness, ties: &ties, targets: &targets, constant, outer: &outer });
    let mut out = guided.pulls;
    out.iter_mut().for_each(|pulls| found.held.iter().for_each(|v| pulls[*v] = DVec3::ZERO));
    out
}
