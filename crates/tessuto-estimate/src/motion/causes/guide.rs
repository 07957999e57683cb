//! Leads a cloth along given places, under known accelerations: by ties, and by pulls that leave out what its
//! springs would take up ([`Lead`]).
//!
//! Each sub-step minimises Φ(x) + ½ ‖x − x*‖²_{M κ} with the incremental potential Φ of
//! [`tessuto_sim::implicit_euler`] under the known accelerations alone; at the minimum the tie acts as the
//! acceleration κ (x* − x). Where the accelerations alone must lead along the same motion, the sub-step is then
//! taken again under all of them without the tie, and the next one starts from where that leads: compressed cloth
//! may buckle another way than the tied one, and the loop closed over the real state keeps such differences from
//! growing. Internal friction acts as springs in the tied sub-step ([`Cloth::rub`]), as the accelerations that
//! these make in the other.

use glam::DVec3;

use super::lead::Lead;
use crate::motion::parameters::Dynamics;
use tessuto_core::error::Error;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;
use tessuto_sim::step::step;
use tessuto_sim::{Accelerations, Cloth, State, StepSettings, Stiffness, TiedCloth};

/// How far a tied step's solution may be off `[m]`: the pull is what the ties make of it.
const ROUGH: f64 = 1e-6;

/// What leads a cloth.
pub struct Guide<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// How it is simulated.
    pub dynamics: &'a Dynamics,
    /// Stretch [N/m], bend [J/rad²], shear [J/rad²].
    pub stiffness: [f64; 3],
    /// Strength κ of every vertex's tie [1/s²].
    pub ties: &'a [f64],
    /// Strength of the [`Lead`] of all vertices that no tie holds [1/s²]; 0 for none.
    pub lead: f64,
    /// Where ties and lead pull, shape [steps + 1, V] `[m]`.
    pub targets: &'a [&'a Positions],
    /// Acceleration C, the same in space and time [m/s²].
    pub constant: DVec3,
    /// Internal friction c [J·s/rad²].
    pub friction: f64,
    /// Whether the accelerations alone must lead along the same motion; otherwise it is that of the tied cloth.
    pub exact: bool,
    /// Accelerations that are added to the pulls, shape [K, V] [m/s²]; none after the first K steps.
    pub known: &'a [Positions],
    /// Further known accelerations in a step from a state, shape `[V]` [m/s²].
    pub outer: &'a dyn Fn(usize, &State) -> Positions,
}

/// What came of it.
#[derive(Debug)]
pub struct Guided {
    /// C, and all else in D, one entry per sub-step, exact in 32-bit numbers.
    pub accelerations: Accelerations,
    /// The part of D that was known, and the pulls with what was added to them, shape [steps, V] [m/s²].
    pub outer: Vec<Positions>,
    /// See above.
    pub pulls: Vec<Positions>,
    /// The part of D by internal friction, shape [steps, V] [m/s²].
    pub friction: Vec<Positions>,
    /// Shape of every frame, [N, V] `[m]`.
    pub frames: Vec<Positions>,
    /// Where the simulation failed, D is zero from that sub-step on.
    pub failure: Option<Error>,
    end: State,
}

impl Guided {
    /// Nothing but a motion and the state that it ends in, to go on from.
    pub(super) fn after(frames: Vec<Positions>, end: State, constant: DVec3, substeps: usize) -> Self {
        Self {
            accelerations: Accelerations {
                constant,
                dynamic: Vec::new(),
                entries_per_frame: substeps,
                wind: None,
            },
            outer: Vec::new(),
            pulls: Vec::new(),
            friction: Vec::new(),
            frames,
            failure: None,
            end,
        }
    }

    /// Velocities at the end, shape `[V]` [m/s].
    pub(super) fn velocities(&self) -> &Positions {
        &self.end.v
    }

    /// A copy to go on from, unless the simulation failed.
    pub(super) fn copy(&self) -> Option<Self> {
        self.failure.is_none().then(|| Self {
            accelerations: self.accelerations.clone(),
            outer: self.outer.clone(),
            pulls: self.pulls.clone(),
            friction: self.friction.clone(),
            frames: self.frames.clone(),
            failure: None,
            end: self.end.clone(),
        })
    }
}

/// Leads a cloth from rest at the first target.
pub fn guide(guide: &Guide) -> Guided {
    guide_from(guide, None)
}

/// Leads a cloth on from where `before` ended, of which the result contains all; at rest from the first target
/// without it.
pub fn guide_from(guide: &Guide, before: Option<Guided>) -> Guided {
    let (cloth, dynamics) = (guide.cloth, guide.dynamics);
    let (count, steps) = (cloth.vertex_count(), guide.targets.len() - 1);
    let forces: Vec<f64> = guide.ties.iter().zip(&cloth.masses).map(|(tie, m)| tie * m).collect();
    let tied_step = StepSettings { tolerance: dynamics.step.tolerance.max(ROUGH), ..dynamics.step };
    let mut tied = TiedCloth::new(cloth, &forces, &tied_step);
    let stiffness = Stiffness::uniform(cloth, guide.stiffness);
    let (ties, strength, h) = (guide.ties, guide.lead, dynamics.step.step);
    let lead = Lead { cloth, stiffness: &stiffness, ties, strength, h };
    let (mut scratch, mut compliance) = (Scratch::default(), None);
    let start = State { x: guide.targets[0].to_vec(), v: vec![DVec3::ZERO; count] };
    let begin = || Guided::after(vec![start.x.clone()], start, guide.constant, dynamics.substeps);
    let mut out = before.unwrap_or_else(begin);
    for k in 0..steps {
        let zeros = vec![DVec3::ZERO; count];
        let (mut dynamic, mut pulls, mut friction) = (zeros.clone(), zeros.clone(), zeros);
        let outer = (guide.outer)(k, &out.end);
        if out.failure.is_none() {
            let [before, target] = [guide.targets[k], guide.targets[k + 1]];
            // Within a frame the sheet hardly turns, and a factorisation takes as long as ten solves.
            if k.is_multiple_of(dynamics.substeps) {
                compliance.take().into_iter().for_each(|factor| scratch.recycle(factor));
                compliance = lead.compliance(&out.end.x, &mut scratch);
            }
            let mut pull = lead.pull(compliance.as_ref(), &out.end, [before, target], &mut scratch);
            if let Some(known) = guide.known.get(k) {
                pull.iter_mut().zip(known).for_each(|(pull, known)| *pull += *known);
            }
            let known = |i: usize| guide.constant + outer[i] + pull[i];
            let from = cloth.angles_at(&out.end.x);
            let rate = guide.friction / dynamics.step.step;
            let total = tied.rub(cloth, &stiffness, rate, &from);
            let taken = tied.step(&total, out.end.clone(), target, known, &mut scratch).and_then(|tape| {
                let x = &tape.after.x;
                let turned: Vec<f64> = cloth.angles_at(x).iter().zip(&from).map(|(a, b)| a - b).collect();
                cloth.add_moments(&cloth.angle_gradients_at(x), &turned, -rate, &mut friction);
                for i in 0..count {
                    friction[i] /= cloth.masses[i];
                    pulls[i] = (target[i] - x[i]) * guide.ties[i] + pull[i];
                    dynamic[i] = (outer[i] + pulls[i] + friction[i]).as_vec3().as_dvec3();
                }
                if !guide.exact {
                    return Ok(tape);
                }
                let total: Positions = dynamic.iter().map(|d| guide.constant + *d).collect();
                step(cloth, &dynamics.step, &stiffness, tape.before, &total, &mut scratch)
            });
            match taken {
                Ok(tape) => out.end = tape.into_after(&mut scratch),
                Err(failure) => {
                    out.failure = Some(failure);
                    dynamic.fill(DVec3::ZERO);
                    pulls.fill(DVec3::ZERO);
                    friction.fill(DVec3::ZERO);
                }
            }
        }
        out.accelerations.dynamic.push(dynamic);
        out.outer.push(outer);
        out.pulls.push(pulls);
        out.friction.push(friction);
        if (k + 1).is_multiple_of(dynamics.substeps) {
            out.frames.push(out.end.x.clone());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::inverse::accelerations::interpolated;
    use glam::DVec2;
    use tessuto_core::mesh::grid;
    use tessuto_sim::{Integrator, RolloutInputs, StepSettings, rollout};

    #[test]
    fn the_forces_lead_along_the_tied_motion_and_stiff_ties_reach_the_targets() {
        let mesh = grid(5, 5, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 0.005,
            damping: 0.9,
            tolerance: 1e-9,
            newton_limit: 100,
        };
        let range = crate::motion::parameters::StiffnessRange { start: 0.0, low: 0.0, high: 0.0 };
        let dynamics = Dynamics {
            step: settings,
            substeps: 4,
            model: tessuto_sim::Model::Springs,
            stiffness: vec![range; 3],
        };
        let k = [200.0, 1e-3, 1e-4];
        let swing = |n: usize| -> Positions {
            mesh.positions
                .iter()
                .map(|p| *p + DVec3::Z * (0.3 * (p.y + 0.05) * (n as f64 * 0.2).sin()))
                .collect()
        };
        let frames: Vec<Positions> = (0..8).map(swing).collect();
        let targets = interpolated(&frames, 4);
        let drag = |_: usize, state: &State| state.v.iter().map(|v| *v * -2.0).collect();
        let guided = guide(&Guide {
            cloth: &cloth,
            dynamics: &dynamics,
            stiffness: k,
            ties: &[4e7; 25],
            lead: 0.0,
            targets: &targets.iter().collect::<Vec<_>>(),
            constant: DVec3::Y,
            friction: 2e-4,
            exact: true,
            known: &vec![vec![DVec3::new(0.0, 0.3, -0.2); 25]; 5],
            outer: &drag,
        });
        assert!(guided.failure.is_none());
        let initial = State { x: frames[0].clone(), v: vec![DVec3::ZERO; 25] };
        let stiffness = Stiffness::uniform(&cloth, k);
        let inputs =
            RolloutInputs { initial: &initial, accelerations: &guided.accelerations, stiffness: &stiffness };
        let motion = rollout(&cloth, &settings, 4, 8, &inputs).unwrap();
        assert_eq!(motion.frames, guided.frames);
        for (x, target) in motion.frames.iter().zip(&frames) {
            let worst = x.iter().zip(target).map(|(x, t)| x.distance(*t)).fold(0.0, f64::max);
            assert!(worst < 5e-4, "{worst} m");
        }
    }
}
