//! Accelerations that lead a cloth along found positions.
//!
//! Found positions are off by a millimetre in directions in which springs hardly give, and to hold a cloth there takes hundreds of m/s²,
//! which are no cause of the motion. So held vertices follow their paths, and the others are led by what the springs would not take up.

use super::guide::{Guide, Guided, guide};
use super::parts::{air, held_ties};
use super::{CauseSettings, Found, Parts};
use crate::mesh::Positions;
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use crate::sim::{Cloth, State};

/// Strength of the ties of held vertices [1/s²]: the whole weight that hangs from two corners takes them 0.1 mm from their paths.
const HELD: f64 = 1e8;

/// Mean deviation of positions that pull as [`CauseSettings::tracking`] says `[m]`.
const USUAL: f64 = 5e-3;
/// Least one that counts `[m]`: of the mesh as a model of the cloth.
const LEAST: f64 = 5e-4;

/// Accelerations that lead `cloth` along `frames`, shape [N, V], known up to `deviations`, shape [N, V] `[m]`, and the parts they are of.
pub fn follow(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    (frames, deviations): (&[Positions], &[Vec<f64>]),
    settings: &CauseSettings,
) -> (Guided, Parts) {
    // The more sure a position is, the more its weight against what no cause explains: the first is the template's.
    let sum: f64 = deviations[1..].iter().flatten().sum();
    let sure = USUAL / (sum / ((frames.len() - 1) * cloth.vertex_count()).max(1) as f64).max(LEAST);
    let targets = interpolated(frames, dynamics.substeps);
    let h = dynamics.step.step;
    let outer = |k: usize, state: &State| air(cloth, found, [1.0; 2], (k + 1) as f64 * h, state, h);
    let guided = guide(&Guide {
        cloth,
        dynamics,
        stiffness: found.causes.stiffness(),
        ties: &held_ties(cloth, found, HELD),
        lead: settings.tracking * sure * sure,
        targets: &targets.iter().collect::<Vec<_>>(),
        constant: found.causes.gravity(),
        friction: found.causes.friction(),
        exact: true,
        known: &[],
        outer: &outer,
    });
    let parts = Parts::of(&guided, found, dynamics.substeps);
    (guided, parts)
}
