//! Prior on bending whatever its direction: Σ ½ ((θ − θ0)/σ)² over the cloth's bending pairs, with the angle θ of
//! `sim::angle` and θ0 that of the template.

use glam::DVec3;

use super::{FrameSystem, Term};
use crate::sim::angle;
use crate::sim::cloth::{Cloth, arms};

/// See the module.
#[derive(Clone)]
pub struct Bend<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Spread σ of the angle `[rad]`.
    pub sigma: f64,
}

impl Term for Bend<'_> {
    fn name(&self) -> &'static str {
        "bend"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let of = |spring: &crate::sim::cloth::AngleSpring| {
            let [u, w] = arms(x, spring.vertices);
            angle::value(u, w, self.sigma.powi(-2), spring.rest_angle)
        };
        self.cloth.bends.iter().map(of).sum()
    }

    /// The matrix is that of Gauss and Newton.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let stiffness = self.sigma.powi(-2);
        for spring in &self.cloth.bends {
            let [u, w] = arms(x, spring.vertices);
            spring.scatter(angle::gradient(u, w, stiffness, spring.rest_angle), &mut system.gradient);
            let h = angle::hessian_gauss_newton(u, w, stiffness, spring.rest_angle);
            spring.scatter_hessian(&h, &self.cloth.pattern, &mut system.matrix);
        }
        self.value(x)
    }
}
