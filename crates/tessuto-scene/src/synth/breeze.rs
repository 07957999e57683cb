//! Moving air: everywhere the same, still at first, then from changing sides.

use std::f64::consts::TAU;

use glam::DVec3;

use tessuto_core::math::rng::Rng;

/// Drag coefficient of the sheet.
pub const DRAG: f64 = 1.1;
/// Internal friction of bending and shearing [J·s/rad²].
pub const FRICTION: f64 = 2e-6;
/// The air comes into motion within this time `[s]`.
const RISE: f64 = 0.25;

/// The wind.
#[derive(Debug, Clone, Copy)]
pub struct Breeze {
    /// Largest velocity, about [m/s].
    strength: f64,
    random: [f64; 6],
}

impl Breeze {
    /// Of velocities up to about `strength` [m/s].
    pub fn new(strength: f64, seed: u64) -> Self {
        let mut rng = Rng::new(seed, 4);
        Self { strength, random: std::array::from_fn(|_| rng.signed()) }
    }

    /// Velocity at `time` `[s]`, in the axes of the ground [m/s].
    pub fn velocity(&self, time: f64) -> DVec3 {
        let [r0, r1, r2, r3, r4, r5] = self.random;
        let s = (time / RISE).clamp(0.0, 1.0);
        let rise = s * s * (3.0 - 2.0 * s);
        let wave = |frequency: f64, phase: f64| (TAU * (frequency * time + phase)).sin();
        let z = 0.5 * r0 + 0.5 * wave(1.0 + 0.4 * r1, 0.5 * r2);
        let x = 0.3 * r3 + 0.3 * wave(0.8 + 0.3 * r4, 0.5 * r5);
        DVec3::new(x, 0.0, z) * (self.strength * rise)
    }
}
