//! Accelerations that lead a cloth along found positions.
//!
//! Stiff ties would lead along the noise of these positions too: a millimetre between neighbours is hundreds of m/s² of springs that hardly
//! lengthen. Soft ties leave such noise out, but lag where a cause is missing. So the cloth is led several times, each time under what
//! ties pulled before, in the mean over adjacent frames: what lasts is led without lag, what does not is left out.

use glam::DVec3;

use super::guide::{Guide, Guided, guide};
use super::parts::air;
use super::{CauseSettings, Found, Parts};
use crate::mesh::Positions;
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use crate::sim::{Cloth, State};

/// Strength of the ties of held vertices [1/s²], if that is more than others': they carry what hangs from them.
const HELD: f64 = 4e5;
/// Frames to either side over which pulls are averaged.
const REACH: usize = 2;

/// Accelerations that lead `cloth` along `frames`, shape [N, V], and the parts they are of.
pub fn follow(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    frames: &[Positions],
    settings: &CauseSettings,
) -> (Guided, Parts) {
    let targets = interpolated(frames, dynamics.substeps);
    let targets: Vec<&Positions> = targets.iter().collect();
    let h = dynamics.step.step;
    let mut ties = vec![settings.tracking; cloth.vertex_count()];
    found.held.iter().for_each(|v| ties[*v] = ties[*v].max(HELD));
    let outer = |k: usize, state: &State| air(cloth, found, [1.0; 2], (k + 1) as f64 * h, state, h);
    let once = |lead: &[Positions], exact: bool| {
        guide(&Guide {
            cloth,
            dynamics,
            stiffness: found.causes.stiffness(),
            ties: &ties,
            targets: &targets,
            constant: found.causes.gravity(),
            friction: found.causes.friction(),
            exact,
            lead,
            outer: &outer,
        })
    };
    let mut lead = Vec::new();
    for _ in 1..settings.passes {
        lead = lasting(&once(&lead, false).pulls, REACH * dynamics.substeps);
        lead.iter_mut().for_each(|lead| found.held.iter().for_each(|v| lead[*v] = DVec3::ZERO));
    }
    let guided = once(&lead, true);
    let parts = Parts::of(&guided, found, dynamics.substeps);
    (guided, parts)
}

/// Mean of `fields`, shape [K, V], over `reach` entries to either side, fewer at the ends.
fn lasting(fields: &[Positions], reach: usize) -> Vec<Positions> {
    let count = fields.first().map_or(0, Vec::len);
    let mut sum = vec![DVec3::ZERO; count];
    let (mut from, mut to) = (0, 0);
    let mut out = Vec::with_capacity(fields.len());
    for k in 0..fields.len() {
        while to < (k + reach + 1).min(fields.len()) {
            sum.iter_mut().zip(&fields[to]).for_each(|(s, f)| *s += *f);
            to += 1;
        }
        while from < k.saturating_sub(reach) {
            sum.iter_mut().zip(&fields[from]).for_each(|(s, f)| *s -= *f);
            from += 1;
        }
        out.push(sum.iter().map(|s| *s / (to - from) as f64).collect());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_neighbours_are_those_of_sums() {
        let fields: Vec<Positions> = (0..9)
            .map(|k| (0..2).map(|i| DVec3::new(f64::from(k * k), f64::from(i), 1.0)).collect())
            .collect();
        let means = lasting(&fields, 2);
        for k in 0..9usize {
            let near = &fields[k.saturating_sub(2)..(k + 3).min(9)];
            for i in 0..2 {
                let plain = near.iter().map(|f| f[i]).sum::<DVec3>() / near.len() as f64;
                assert!(means[k][i].distance(plain) < 1e-12, "{k}: {} of {plain}", means[k][i]);
            }
        }
    }
}
