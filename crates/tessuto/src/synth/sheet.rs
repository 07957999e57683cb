//! The sheet: its size, how far from the camera it is, how it hangs.

use glam::{DVec2, DVec3};

use super::settings::Mover;

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
    }
}
