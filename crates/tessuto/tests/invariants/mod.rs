//! What must hold for any input: laws of mechanics and geometry over random states, and clear answers to numbers that
//! are none. The random states come from fixed seeds, so that a failure repeats.

mod energies;
mod faults;
mod metrics;
mod mutations;
mod rasteriser;
mod readers;
mod seeds;

use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseResult, TestRng, TestRunner};
use tessuto::math::rng::Rng;
use tessuto::mesh::{Mesh, grid};

/// Tries `law` on `cases` values of `strategy`, always the same ones; a failing value is shrunk and shown.
fn holds<S: Strategy>(cases: u32, strategy: S, law: impl Fn(S::Value) -> TestCaseResult) {
    let config = Config { cases, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    if let Err(failure) = runner.run(&strategy, law) {
        panic!("{failure}");
    }
}

/// A cloth of 5×4 vertices and its vertices moved by up to `crumple` [m]; they are 5 cm apart.
fn crumpled(seed: u64, crumple: f64) -> (Mesh, Vec<DVec3>) {
    let mut rng = Rng::new(seed, 0);
    let mesh = grid(5, 4, DVec2::new(0.2, 0.15), 1.0);
    let positions = mesh.positions.iter().map(|p| *p + rng.vector() * crumple).collect();
    (mesh, positions)
}

/// Any rotation and a translation of up to 2 m along each axis.
fn rigid_motion() -> impl Strategy<Value = (DQuat, DVec3)> {
    let axis_angle = (-3.2..3.2f64, -3.2..3.2f64, -3.2..3.2f64);
    let shift = (-2.0..2.0f64, -2.0..2.0f64, -2.0..2.0f64);
    (axis_angle, shift)
        .prop_map(|(r, t)| (DQuat::from_scaled_axis(DVec3::new(r.0, r.1, r.2)), DVec3::new(t.0, t.1, t.2)))
}

/// A seed and how far vertices are moved [m]: from hardly at all to folded over and over.
fn crumple() -> impl Strategy<Value = (u64, f64)> {
    (any::<u64>(), -4.0..-0.7f64).prop_map(|(seed, exponent)| (seed, 10f64.powf(exponent)))
}
