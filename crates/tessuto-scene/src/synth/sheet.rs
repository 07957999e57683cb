//! The sheet: its size, how far from the camera it is, how it hangs.

use glam::{DQuat, DVec2, DVec3};

use super::settings::Mover;
use tessuto_core::math::rng::Rng;

/// Width and height `[m]`.
pub const SIZE: DVec2 = DVec2::new(0.5, 0.5);
/// Acceleration of gravity, downwards [m/s²].
pub const GRAVITY: DVec3 = DVec3::new(0.0, 9.81, 0.0);
/// What holds it is this much closer together than it is wide, so that it falls in folds.
pub const SLACK: f64 = 0.06;

/// Distance from the camera `[m]`; what moves about needs room in the image.
pub fn depth(mover: Mover) -> f64 {
    match mover {
        Mover::Wind => 1.0,
        Mover::Hands => 1.3,
        Mover::Paper => 1.15,
        Mover::Table => 1.25,
    }
}

/// Largest angles by which the camera looks up or down, and is rolled `[rad]`.
const TILT: [f64; 2] = [0.4, 0.1];

/// Rotation from axes whose y points down to the ground to those of the camera.
#[derive(Debug, Clone, Copy)]
pub struct Tilt {
    rotation: DQuat,
    /// What it turns about `[m]`.
    centre: DVec3,
}

impl Tilt {
    /// The camera looks ahead.
    pub const NONE: Self = Self { rotation: DQuat::IDENTITY, centre: DVec3::ZERO };

    /// The camera is tilted about the sheet.
    pub fn random(mover: Mover, rng: &mut Rng) -> Self {
        let roll = DQuat::from_rotation_z(TILT[1] * rng.signed());
        Self {
            rotation: roll * DQuat::from_rotation_x(TILT[0] * rng.signed()),
            centre: DVec3::Z * depth(mover),
        }
    }

    /// A point in the camera's axes `[m]`.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.centre + self.rotation * (p - self.centre)
    }

    /// A direction in the camera's axes.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.rotation * d
    }
}
