//! What moves the cloth, in few numbers.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Size of gravity [m/s²].
pub const GRAVITY: f64 = 9.81;
/// Unknowns before those of the wind: ln stretch, ln bend, ln shear, gravity's direction (2), ln drag, ln
/// friction, ln lengths (2).
pub(super) const FIRST: usize = 9;
/// The first of the lengths.
pub(super) const LENGTHS: usize = 7;

/// Stiffnesses, gravity and air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Causes {
    /// ln of stretch [N/m], bend [J/rad²], shear [J/rad²].
    pub ln_stiffness: [f64; 3],
    /// Direction of gravity, a unit vector.
    pub down: DVec3,
    /// ln of the drag coefficient C_d of the air, as across a plate.
    pub ln_drag: f64,
    /// ln of the internal friction c [J·s/rad²] of bending and shearing: a moment c θ̇ at every angle.
    pub ln_friction: f64,
    /// ln of the factors on the panel's lengths along u and along v, while they are searched;
    /// [`super::Found::rest_lengths`] has them in it.
    #[serde(skip)]
    pub(super) ln_length: [f64; 2],
    /// Velocity of the wind at the [`Knots`] [m/s].
    pub wind: Vec<DVec3>,
}

/// Standard deviations of [`Causes`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Of ln of stretch, bend, shear stiffness.
    pub ln_stiffness: [f64; 3],
    /// Of gravity's direction, both angles together `[rad]`.
    pub down: f64,
    /// Of ln of the drag.
    pub ln_drag: f64,
    /// Of ln of the internal friction.
    pub ln_friction: f64,
}

/// Times between which the wind is interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Knots {
    /// Number, at least 2.
    pub count: usize,
    /// Time of the last one, that of the first is 0 `[s]`.
    pub end: f64,
}

impl Knots {
    /// The knot before `time` `[s]`, and the weight of the one after it; the last value holds from then on.
    pub fn around(&self, time: f64) -> (usize, f64) {
        let t = (time / self.end).clamp(0.0, 1.0) * (self.count - 1) as f64;
        let k = (t as usize).min(self.count - 2);
        (k, t - k as f64)
    }
}

impl Causes {
    /// Number of unknowns.
    pub(super) fn unknowns(&self) -> usize {
        FIRST + 3 * self.wind.len()
    }

    /// Two directions across gravity, in which it is turned.
    pub(super) fn across(&self) -> [DVec3; 2] {
        self.down.any_orthonormal_pair().into()
    }

    /// After a step of the unknowns.
    pub(super) fn moved(&self, step: &[f64]) -> Self {
        let mut out = self.clone();
        (0..3).for_each(|k| out.ln_stiffness[k] += step[k]);
        let [a, b] = self.across();
        out.down = (self.down + a * step[3] + b * step[4]).normalize();
        out.ln_drag += step[5];
        out.ln_friction += step[6];
        (0..2).for_each(|k| out.ln_length[k] += step[LENGTHS + k]);
        for (w, s) in out.wind.iter_mut().zip(step[FIRST..].chunks_exact(3)) {
            *w += DVec3::from_slice(s);
        }
        out
    }

    /// log10 of stretch [N/m], bend [J/rad²], shear [J/rad²].
    pub fn log_stiffness(&self) -> [f64; 3] {
        self.ln_stiffness.map(|ln| ln / std::f64::consts::LN_10)
    }

    /// Stretch [N/m], bend [J/rad²], shear [J/rad²]: the same bits as of a simulation's parameters, which are log10.
    pub fn stiffness(&self) -> [f64; 3] {
        self.log_stiffness().map(|log| 10f64.powf(log))
    }

    /// Gravity [m/s²].
    pub fn gravity(&self) -> DVec3 {
        self.down * GRAVITY
    }

    /// Drag coefficient C_d.
    pub fn drag(&self) -> f64 {
        self.ln_drag.exp()
    }

    /// Internal friction c [J·s/rad²].
    pub fn friction(&self) -> f64 {
        self.ln_friction.exp()
    }

    /// The wind's velocity at `time` `[s]` [m/s].
    pub fn wind_at(&self, knots: &Knots, time: f64) -> DVec3 {
        let (k, t) = knots.around(time);
        self.wind[k].lerp(self.wind[k + 1], t)
    }
}
