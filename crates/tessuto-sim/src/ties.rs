//! Springs of no length that tie vertices to given points, inside an implicit step.
//!
//! A tie of stiffness κ adds ½ κ ‖x − p‖² to the incremental potential Φ of [`super::implicit_euler`]: a second
//! inertia. The step is that of free cloth with the masses and accelerations
//!
//!   M' = M + h² κ,   M' g' = M g + κ (p − x − h δ v).

use glam::DVec3;

use super::cloth::Cloth;
use super::state::{State, StepSettings, StepTape};
use super::step::step;
use super::stiffness::Stiffness;
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;

/// A cloth with tied vertices, ready for steps of one length.
#[derive(Debug)]
pub struct TiedCloth {
    /// With the masses M'.
    cloth: Cloth,
    settings: StepSettings,
    /// h² κ/M' of every vertex: 0 where it is free, near 1 where it is held.
    held: Vec<f64>,
}

impl TiedCloth {
    /// Ties of stiffness κ [N/m], shape `[V]`, to vertices of `cloth`; 0 ties nothing.
    pub fn new(cloth: &Cloth, ties: &[f64], settings: &StepSettings) -> Self {
        let sq_step = settings.step * settings.step;
        let mut cloth = cloth.clone();
        cloth.masses.iter_mut().zip(ties).for_each(|(m, kappa)| *m += sq_step * kappa);
        let held = cloth.masses.iter().zip(ties).map(|(m, kappa)| sq_step * kappa / m).collect();
        Self { cloth, settings: *settings, held }
    }

    /// Lets the angles of this cloth, otherwise like those of `elastic`, resist their change: [`Cloth::rub`].
    pub fn rub(&mut self, elastic: &Cloth, stiffness: &Stiffness, rate: f64, from: &[f64]) -> Stiffness {
        self.cloth.rub(elastic, stiffness, rate, from)
    }

    /// [`step`] under external `acceleration` [m/s²] with the vertices tied to `targets` `[m]`, shape `[V]` each.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Numerical`] if the result is not finite.
    pub fn step(
        &self,
        stiffness: &Stiffness,
        before: State,
        targets: &[DVec3],
        acceleration: impl Fn(usize) -> DVec3,
        scratch: &mut Scratch,
    ) -> Result<StepTape> {
        let (h, damping) = (self.settings.step, self.settings.damping);
        let tied = |i: usize| {
            let drift = before.v[i] * (h * damping);
            let own = drift + acceleration(i) * (h * h);
            // (y' − x − h δ v)/h² of the tied step.
            (own * (1.0 - self.held[i]) + (targets[i] - before.x[i]) * self.held[i] - drift) / (h * h)
        };
        let accelerations: Positions = (0..targets.len()).map(tied).collect();
        let mut tape = step(&self.cloth, &self.settings, stiffness, before, &accelerations, scratch)?;
        tape.forget_factor(scratch);
        Ok(tape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Integrator;
    use glam::DVec2;
    use tessuto_core::mesh::grid;

    #[test]
    fn held_vertices_stay_and_the_rest_hangs_from_them() {
        let mesh = grid(5, 5, DVec2::splat(0.2), 1.0);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-3]);
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 0.01,
            damping: 0.7,
            tolerance: 1e-9,
            newton_limit: 100,
        };
        let kappa = 1e4;
        let ties: Vec<f64> = (0..25).map(|i| if i < 5 { kappa } else { 0.0 }).collect();
        let tied = TiedCloth::new(&cloth, &ties, &settings);
        let mut state = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 25] };
        let mut scratch = Scratch::default();
        for _ in 0..200 {
            let gravity = |_| DVec3::Y * 9.81;
            state = tied.step(&stiffness, state, &mesh.positions, gravity, &mut scratch).unwrap().after;
        }
        // At rest the ties carry the weight of all that is not its own.
        let pull: f64 = (0..5).map(|i| kappa * (state.x[i].y - mesh.positions[i].y)).sum();
        let weight = 9.81 * cloth.masses.iter().sum::<f64>();
        assert!((pull / weight - 1.0).abs() < 1e-3, "{pull} N of {weight} N");
        assert!((0..5).all(|i| state.x[i].distance(mesh.positions[i]) < 1e-4));
    }
}
