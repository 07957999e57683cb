//! Stiffnesses that explain a motion with the least change of force in space and time.
//!
//! For a motion x_0 … x_{N−1} at one implicit step after another the external acceleration that must have acted,
//!
//!   g = (x_{n+1} − x_n − h δ v_n)/h² + M⁻¹ ∂E(x_{n+1}),
//!
//! is linear in the stiffnesses. They are chosen to minimise
//!
//!   ½ N ln Σ ‖g − mean g‖² + ½ Σ ((log10 k − start)/σ)²
//!
//! within their bounds: every shape counts as one observation, and σ is the spread of the prior.

use glam::DVec3;

use super::super::parameters::Dynamics;
use tessuto_core::mesh::Positions;
use tessuto_core::settings::settings;
use tessuto_sim::{Cloth, Stiffness};

settings! {
    /// Settings of the material fit.
    pub struct MaterialSettings {
        /// Fit the stiffnesses; otherwise they keep their start.
        fit: bool = true, flag();
        /// Spread σ of log10 of a stiffness about its start; larger is weaker.
        spread: f64 = 0.5, number(1e-3..=1e3, "");
    }
}

/// log10 of stretch, bend and shear stiffness of `motion`, one shape per step of `dynamics`.
pub fn fit_material(cloth: &Cloth, dynamics: &Dynamics, motion: &[Positions], spread: f64) -> [f64; 3] {
    let gram = gram(cloth, dynamics, motion);
    let frames = (motion.len() - 1) as f64;
    let objective = |log_k: [f64; 3]| {
        let k = log_k.map(|l| 10f64.powf(l));
        let c = [1.0, k[0], k[1], k[2]];
        let sum: f64 = (0..4).map(|i| (0..4).map(|j| c[i] * gram[i][j] * c[j]).sum::<f64>()).sum();
        let prior: f64 = (0..3).map(|i| ((log_k[i] - dynamics.stiffness[i].start) / spread).powi(2)).sum();
        0.5 * frames * sum.max(f64::MIN_POSITIVE).ln() + 0.5 * prior
    };
    let mut log_k = dynamics.springs().map(|range| range.start);
    for _ in 0..50 {
        for i in 0..3 {
            let range = dynamics.stiffness[i];
            let along = |value: f64| {
                let mut moved = log_k;
                moved[i] = value;
                objective(moved)
            };
            log_k[i] = golden_section(along, range.low, range.high);
        }
    }
    log_k
}

/// Products, summed over frames and vertices, of the fields inertia, stretch, bend and shear acceleration per
/// unit of stiffness, each without its mean.
fn gram(cloth: &Cloth, dynamics: &Dynamics, motion: &[Positions]) -> [[f64; 4]; 4] {
    let (h, damping) = (dynamics.step.step, dynamics.step.damping);
    let units = [0, 1, 2].map(|k| {
        let mut unit = [0.0; 3];
        unit[k] = 1.0;
        Stiffness::uniform(cloth, unit)
    });
    let vertex_count = cloth.vertex_count();
    let (mut products, mut sums) = ([[0.0; 4]; 4], [DVec3::ZERO; 4]);
    for n in 0..motion.len() - 1 {
        let before = &motion[n.saturating_sub(1)];
        let (now, after) = (&motion[n], &motion[n + 1]);
        let inertia = |i: usize| (after[i] - now[i] - (now[i] - before[i]) * damping) / (h * h);
        let mut fields = vec![(0..vertex_count).map(inertia).collect::<Positions>()];
        for unit in &units {
            let mut field = vec![DVec3::ZERO; vertex_count];
            cloth.add_gradient(unit, after, 1.0, &mut field);
            field.iter_mut().zip(&cloth.masses).for_each(|(f, m)| *f /= *m);
            fields.push(field);
        }
        for i in 0..4 {
            sums[i] += fields[i].iter().copied().sum::<DVec3>();
            for j in 0..4 {
                products[i][j] += tessuto_core::math::dot(&fields[i], &fields[j]);
            }
        }
    }
    let count = ((motion.len() - 1) * vertex_count) as f64;
    for i in 0..4 {
        for j in 0..4 {
            products[i][j] -= sums[i].dot(sums[j]) / count;
        }
    }
    products
}

/// Minimum of a function of one variable on [low, high], to 1e-4.
fn golden_section(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    while high - low > 1e-4 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if f(a) < f(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::parameters::StiffnessRange;
    use glam::DVec2;
    use tessuto_core::mesh::grid;
    use tessuto_sim::{Accelerations, Integrator, RolloutInputs, State, StepSettings, rollout};

    #[test]
    fn a_free_motion_gives_back_the_stiffnesses_that_made_it() {
        let mesh = grid(7, 6, DVec2::new(0.12, 0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let step = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 0.02,
            damping: 0.9,
            tolerance: 1e-12,
            newton_limit: 200,
        };
        let range = |start, low, high| StiffnessRange { start, low, high };
        let stiffness = [range(2.3, 1.0, 3.0), range(-3.0, -4.0, -2.0), range(-4.0, -5.0, -2.0)];
        let dynamics =
            Dynamics { step, substeps: 1, model: tessuto_sim::Model::Springs, stiffness: stiffness.to_vec() };
        let truth = [60f64, 3e-3, 4e-4];
        // Bent and stretched at the start, then left alone under gravity.
        let x: Positions = mesh
            .positions
            .iter()
            .map(|p| DVec3::new(p.x * 1.02 + 0.1 * p.y, p.y, p.z + 2.0 * p.x * p.x))
            .collect();
        let initial = State { v: vec![DVec3::ZERO; x.len()], x };
        let mut accelerations = Accelerations::zeros(20, 1, cloth.vertex_count());
        accelerations.constant = DVec3::new(0.0, 9.81, 0.0);
        let k = Stiffness::uniform(&cloth, truth);
        let inputs = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &k };
        let motion = rollout(&cloth, &step, 1, 20, &inputs).unwrap().frames;
        let found = fit_material(&cloth, &dynamics, &motion, 0.5).map(|l| 10f64.powf(l));
        println!("{found:?} of {truth:?}");
        for (found, truth) in found.iter().zip(truth) {
            assert!((found / truth - 1.0).abs() < 0.02, "{found} of {truth}");
        }
    }
}
