//! The shape at rest of a cloth with held vertices, under gravity.

use glam::DVec3;

use crate::state::{Integrator, State, StepSettings};
use crate::stiffness::Stiffness;
use crate::{Cloth, TiedCloth};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;

/// Stiffness of the ties that hold vertices [N/m].
const TIE: f64 = 1e4;

/// How the shape is found.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Steps of 0.02 s in which the cloth swings before it is led to rest: a way out of shapes that are at rest
    /// only as long as nothing disturbs them.
    pub swings: usize,
    /// Steps without inertia at most.
    pub steps: usize,
    /// At rest where no coordinate moves by more in a step `[m]`.
    pub still: f64,
}

impl Default for Search {
    fn default() -> Self {
        Self { swings: 0, steps: 400, still: 1e-7 }
    }
}

/// Positions at rest under `acceleration` [m/s²] with the vertices `held` where they are in `start`, shape `[V]`.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] if a step is not finite.
pub fn at_rest(
    cloth: &Cloth,
    stiffness: &Stiffness,
    start: &[DVec3],
    held: &[usize],
    acceleration: DVec3,
    search: &Search,
) -> Result<Positions> {
    let mut ties = vec![0.0; start.len()];
    held.iter().for_each(|v| ties[*v] = TIE);
    let of_step = |step: f64, damping: f64, newton_limit: usize| {
        let integrator = Integrator::ImplicitEuler;
        let settings =
            StepSettings { integrator, step, damping, tolerance: 0.1 * search.still, newton_limit };
        TiedCloth::new(cloth, &ties, &settings)
    };
    let mut state = State { x: start.to_vec(), v: vec![DVec3::ZERO; start.len()] };
    let mut scratch = Scratch::default();
    let swinging = of_step(0.02, 0.95, 20);
    for _ in 0..search.swings {
        state =
            swinging.step(stiffness, state, start, |_| acceleration, &mut scratch)?.into_after(&mut scratch);
    }
    let mut step = 0.05;
    let mut tied = of_step(step, 0.0, 60);
    for _ in 0..search.steps {
        let before = state.x.clone();
        state = tied.step(stiffness, state, start, |_| acceleration, &mut scratch)?.into_after(&mut scratch);
        let moved = |(a, b): (&DVec3, &DVec3)| (*a - *b).abs().max_element();
        let moved = state.x.iter().zip(&before).map(moved).fold(0.0, f64::max);
        if step >= 0.8 {
            if moved < search.still {
                break;
            }
        } else if moved < 1e-3 {
            step *= 2.0;
            tied = of_step(step, 0.0, 60);
        }
    }
    Ok(state.x)
}
