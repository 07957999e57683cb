//! The accelerations of a motion by their causes.

use glam::DVec3;

use super::Found;
use super::guide::Guided;
use tessuto_core::mesh::Positions;
use tessuto_sim::air::Air;
use tessuto_sim::{Cloth, State};

/// What acts on every vertex beside the cloth's own springs, per mass, mean of each frame interval [m/s²], shape
/// [N − 1, V].
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
    /// What none of these explains, where the sheet gives way.
    pub residual: Vec<Positions>,
    /// What else leads the sheet exactly to where it was found: mostly across what it resists, and of the found
    /// positions' errors. No cause of anything.
    pub correction: Vec<Positions>,
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
        let mut is_held = vec![false; guided.frames[0].len()];
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
            correction: vec![vec![DVec3::ZERO; is_held.len()]; guided.pulls.len() / substeps],
        }
    }

    /// Calls all but `residual`, shape [N − 1, V] [m/s²], of what is left a correction.
    pub(super) fn leave(&mut self, residual: Vec<Positions>) {
        let all = std::mem::replace(&mut self.residual, residual);
        let less =
            |(all, left): (&Positions, &Positions)| all.iter().zip(left).map(|(a, l)| *a - *l).collect();
        self.correction = all.iter().zip(&self.residual).map(less).collect();
    }
}

/// Strength of every vertex's tie [1/s²]: `hold` of the held ones, none of the others.
pub(super) fn held_ties(cloth: &Cloth, found: &Found, hold: f64) -> Vec<f64> {
    let mut ties = vec![0.0; cloth.vertex_count()];
    found.held.iter().for_each(|v| ties[*v] = hold);
    ties
}
