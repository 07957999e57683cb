//! Forces of a known trajectory: the cloth is simulated with every vertex tied to its target by a soft
//! spring, and the springs' pull is the external force.
//!
//! Each step minimises Φ(x) + ½ κ ‖x − x*‖² with the incremental potential Φ of
//! [`crate::sim::implicit_euler`] under C alone; at the minimum the tie acts as the acceleration
//! D = κ (x* − x)/m. Noise that would take large elastic forces is thereby smoothed out of the motion.

use glam::DVec3;

use super::rollout_fit::Dynamics;
use crate::error::Result;
use crate::math::factor::Scratch;
use crate::mesh::Mesh;
use crate::scene::Shape;
use crate::sim::step::step;
use crate::sim::{Cloth, Forces, State, Stiffness};

/// Settings of the tied simulation.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TieSettings {
    /// Stiffness κ of the ties [N/m].
    pub stiffness: f64,
}

impl Default for TieSettings {
    fn default() -> Self {
        Self { stiffness: 10.0 }
    }
}

/// Forces that lead the cloth along `targets`, shape [N, V], at one step per frame; C is their mean and D is
/// exact in 32-bit numbers.
///
/// # Errors
/// [`crate::Error::Numerical`] from the simulation.
pub fn forces_of_trajectory(
    template: &Mesh,
    dynamics: &Dynamics,
    stiffness: [f64; 3],
    targets: &[Shape],
    settings: &TieSettings,
) -> Result<Forces> {
    assert_eq!(dynamics.substeps, 1, "one step per frame, since the targets are frames");
    let h = dynamics.step.step;
    let kappa = settings.stiffness;
    // The tie is a second inertia: M' = M + h² κ, M' y' = M y + h² κ x*.
    let mut cloth = Cloth::new(template);
    let masses = cloth.masses.clone();
    cloth.masses.iter_mut().for_each(|m| *m += h * h * kappa);
    let stiffness = Stiffness::uniform(&cloth, stiffness);
    let mut scratch = Scratch::default();
    let mut state = State { x: targets[0].clone(), v: vec![DVec3::ZERO; masses.len()] };
    let mut forces = Forces::zeros(targets.len(), 1, masses.len());
    for (target, dynamic) in targets[1..].iter().zip(&mut forces.dynamic) {
        let acceleration: Shape = (0..masses.len())
            .map(|i| {
                let drift = state.v[i] * (h * dynamics.step.damping);
                let share = h * h * kappa / cloth.masses[i];
                (target[i] - state.x[i] - drift) * (share / (h * h))
            })
            .collect();
        let tape = step(&cloth, &dynamics.step, &stiffness, state, &acceleration, &mut scratch)?;
        for (i, d) in dynamic.iter_mut().enumerate() {
            *d = (target[i] - tape.after.x[i]) * (kappa / masses[i]);
        }
        state = tape.after;
    }
    let count = (forces.dynamic.len() * masses.len()).max(1) as f64;
    let constant = forces.dynamic.iter().flatten().copied().sum::<DVec3>() / count;
    forces.constant = constant;
    for d in forces.dynamic.iter_mut().flatten() {
        *d = (*d - constant).as_vec3().as_dvec3();
    }
    Ok(forces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid;
    use crate::sim::{Drive, Integrator, StepSettings, rollout};
    use glam::DVec2;

    #[test]
    fn the_forces_lead_along_the_tied_motion_and_stiff_ties_reach_the_targets() {
        let mesh = grid(5, 5, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 0.02,
            damping: 0.66,
            tolerance: 1e-9,
            newton_limit: 100,
        };
        let range = super::super::rollout_fit::StiffnessRange { start: 0.0, low: 0.0, high: 0.0 };
        let dynamics = Dynamics { step: settings, substeps: 1, stiffness: [range; 3] };
        let k = [200.0, 1e-3, 1e-4];
        let swing = |n: usize| -> Shape {
            mesh.positions
                .iter()
                .map(|p| *p + DVec3::Z * (0.3 * (p.y + 0.05) * (n as f64 * 0.2).sin()))
                .collect()
        };
        let targets: Vec<Shape> = (0..8).map(swing).collect();
        let forces =
            forces_of_trajectory(&mesh, &dynamics, k, &targets, &TieSettings { stiffness: 1e3 }).unwrap();
        assert!(forces.constant.length() > 1e-3);
        let initial = State { x: targets[0].clone(), v: vec![DVec3::ZERO; 25] };
        let stiffness = Stiffness::uniform(&cloth, k);
        let drive = Drive { initial: &initial, forces: &forces, stiffness: &stiffness };
        let motion = rollout(&cloth, &settings, 1, 8, &drive).unwrap();
        for (x, target) in motion.frames.iter().zip(&targets) {
            let worst = x.iter().zip(target).map(|(x, t)| x.distance(*t)).fold(0.0, f64::max);
            assert!(worst < 5e-4, "{worst} m");
        }
    }
}
