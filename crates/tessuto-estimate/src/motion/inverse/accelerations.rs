//! Accelerations of a known motion: the cloth is simulated with every vertex tied to its target by a
//! spring, and the springs' pull is the external force.
//!
//! Each sub-step minimises Φ(x) + ½ κ ‖x − x*‖² with the incremental potential Φ of
//! [`tessuto_sim::implicit_euler`] under C alone; at the minimum the tie acts as the acceleration
//! D = κ (x* − x)/m. The sub-step is then taken again under C + D without the tie, and the next one starts
//! from where that leads: compressed cloth may buckle another way than the tied one, and the loop closed over
//! the real state keeps such differences from growing. Targets between frames lie on Catmull-Rom curves.

use glam::DVec3;

use super::super::parameters::Dynamics;
use tessuto_core::error::Error;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;
use tessuto_core::settings::settings;
use tessuto_sim::step::step;
use tessuto_sim::{Accelerations, Cloth, State, Stiffness, TiedCloth};

settings! {
    /// Settings of the tied simulation.
    pub struct InverseSettings {
        /// Stiffness κ of the springs that tie each vertex to its observed place.
        tracking_stiffness: f64 = 1000.0, number(1e-6..=1e9, "N/m");
    }
}

/// `frames`, shape [N, V], with `substeps` − 1 shapes between each two of them, on Catmull-Rom curves.
pub fn interpolated(frames: &[Positions], substeps: usize) -> Vec<Positions> {
    let last = frames.len() - 1;
    let mut out = vec![frames[0].clone()];
    for n in 0..last {
        let (a, b) = (&frames[n.saturating_sub(1)], &frames[n]);
        let (c, d) = (&frames[n + 1], &frames[(n + 2).min(last)]);
        for k in 1..=substeps {
            let t = k as f64 / substeps as f64;
            let point = |i: usize| {
                let (from, to) = ((c[i] - a[i]) * 0.5, (d[i] - b[i]) * 0.5);
                let (t2, t3) = (t * t, t * t * t);
                b[i] * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + from * (t3 - 2.0 * t2 + t)
                    + c[i] * (3.0 * t2 - 2.0 * t3)
                    + to * (t3 - t2)
            };
            out.push(if k == substeps { c.clone() } else { (0..b.len()).map(point).collect() });
        }
    }
    out
}

/// Accelerations, one entry of D per sub-step, that lead the cloth along `frames`, shape [N, V]. C is the mean
/// acceleration that the centre of mass needs; D is exact in 32-bit numbers. Where the simulation fails, D is zero
/// from that sub-step on and the failure is returned too.
pub fn accelerations_of_motion(
    cloth: &Cloth,
    dynamics: &Dynamics,
    stiffness: [f64; 3],
    frames: &[Positions],
    settings: &InverseSettings,
) -> (Accelerations, Option<Error>) {
    let (h, damping) = (dynamics.step.step, dynamics.step.damping);
    let kappa = settings.tracking_stiffness;
    let targets = interpolated(frames, dynamics.substeps);
    let tied = TiedCloth::new(cloth, &vec![kappa; cloth.vertex_count()], &dynamics.step);
    let stiffness = Stiffness::uniform(cloth, stiffness);
    let constant = mean_acceleration(cloth, &targets, h, damping);
    let mut accelerations = Accelerations::zeros(frames.len(), dynamics.substeps, cloth.vertex_count());
    accelerations.constant = constant;
    let mut scratch = Scratch::default();
    let mut state = State { x: targets[0].clone(), v: vec![DVec3::ZERO; cloth.vertex_count()] };
    for (target, dynamic) in targets[1..].iter().zip(&mut accelerations.dynamic) {
        let tape = match tied.step(&stiffness, state, target, |_| constant, &mut scratch) {
            Ok(tape) => tape,
            Err(failure) => return (accelerations, Some(failure)),
        };
        for (i, d) in dynamic.iter_mut().enumerate() {
            let pull = (target[i] - tape.after.x[i]) * (kappa / cloth.masses[i]);
            *d = pull.as_vec3().as_dvec3();
        }
        let total: Positions = dynamic.iter().map(|d| constant + *d).collect();
        state = match step(cloth, &dynamics.step, &stiffness, tape.before, &total, &mut scratch) {
            Ok(tape) => tape.into_after(&mut scratch),
            Err(failure) => {
                dynamic.fill(DVec3::ZERO);
                return (accelerations, Some(failure));
            }
        };
    }
    (accelerations, None)
}

/// Mass-weighted mean of (x_{k+1} − x_k − h δ v_k)/h²; internal forces do not enter it.
fn mean_acceleration(cloth: &Cloth, targets: &[Positions], h: f64, damping: f64) -> DVec3 {
    let mass: f64 = cloth.masses.iter().sum();
    let mut sum = DVec3::ZERO;
    for k in 0..targets.len() - 1 {
        let before = &targets[k.saturating_sub(1)];
        for (i, m) in cloth.masses.iter().enumerate() {
            let v = targets[k][i] - before[i];
            sum += (targets[k + 1][i] - targets[k][i] - v * damping) * (m / mass / (h * h));
        }
    }
    sum / (targets.len() - 1).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let targets: Vec<Positions> = (0..8).map(swing).collect();
        let (accelerations, failure) =
            accelerations_of_motion(&cloth, &dynamics, k, &targets, &InverseSettings::default());
        assert!(failure.is_none());
        assert!(accelerations.constant.length() > 1e-3);
        let initial = State { x: targets[0].clone(), v: vec![DVec3::ZERO; 25] };
        let stiffness = Stiffness::uniform(&cloth, k);
        let inputs =
            RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
        let motion = rollout(&cloth, &settings, 4, 8, &inputs).unwrap();
        for (x, target) in motion.frames.iter().zip(&targets) {
            let worst = x.iter().zip(target).map(|(x, t)| x.distance(*t)).fold(0.0, f64::max);
            assert!(worst < 5e-4, "{worst} m");
        }
    }
}
