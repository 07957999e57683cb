//! Prior on the angles of the cloth's springs, with heavy tails: over its bending or its shearing pairs,
//!
//!   E = Σ ½ τ² ln(1 + (r/τ)²),  r = (θ − θ0)/σ,
//!
//! with the angle θ of [`crate::sim::angle`] and θ0 that of the template.

use glam::DVec3;

use super::robust::cauchy;
use super::{FrameSystem, Term};
use crate::sim::angle;
use crate::sim::cloth::{AngleSpring, Cloth, arms};

/// See the module.
#[derive(Clone)]
pub struct Angles<'a> {
    /// Name of the term.
    pub name: &'static str,
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Its bending or its shearing pairs.
    pub springs: &'a [AngleSpring],
    /// What is added to θ0 of every pair `[rad]`; empty for nothing.
    pub offset: &'a [f64],
    /// Spread σ of the angle `[rad]`.
    pub sigma: f64,
    /// Number τ of spreads beyond which an angle is resisted less and less.
    pub tail: f64,
}

impl Angles<'_> {
    fn rest(&self, k: usize) -> f64 {
        self.springs[k].rest_angle + self.offset.get(k).copied().unwrap_or(0.0)
    }

    /// Value and weight of one pair with arms `u` and `w`.
    fn of_pair(&self, rest: f64, u: DVec3, w: DVec3) -> (f64, f64) {
        cauchy((angle::angle(u, w) - rest) / self.sigma, self.tail)
    }
}

impl Term for Angles<'_> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let of = |(k, spring): (usize, &AngleSpring)| {
            let [u, w] = arms(x, spring.vertices);
            self.of_pair(self.rest(k), u, w).0
        };
        self.springs.iter().enumerate().map(of).sum()
    }

    /// The matrix is that of Gauss and Newton.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let mut value = 0.0;
        for (k, spring) in self.springs.iter().enumerate() {
            let rest = self.rest(k);
            let [u, w] = arms(x, spring.vertices);
            let (rho, weight) = self.of_pair(rest, u, w);
            value += rho;
            let stiffness = weight / (self.sigma * self.sigma);
            spring.scatter(angle::gradient(u, w, stiffness, rest), &mut system.gradient);
            let h = angle::hessian_gauss_newton(u, w, stiffness, rest);
            spring.scatter_hessian(&h, &self.cloth.pattern, &mut system.matrix);
        }
        value
    }
}
