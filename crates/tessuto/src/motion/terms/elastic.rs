//! Prior on the angles of the cloth's springs: Σ ½ ((θ − θ0)/σ)² over its bending and shearing pairs,
//! [`crate::sim::Cloth::energy`] with stiffnesses 1/σ² and none of the edges, whose lengths [`super::strain`] keeps.

use glam::DVec3;

use super::{FrameSystem, Term};
use crate::sim::{Cloth, HessianKind, Stiffness};

/// See the module.
pub struct Elastic<'a> {
    cloth: &'a Cloth,
    stiffness: Stiffness,
}

impl<'a> Elastic<'a> {
    /// With the spreads σ of the bending and the shearing angle `[rad]`.
    pub fn new(cloth: &'a Cloth, bend: f64, shear: f64) -> Self {
        Self { cloth, stiffness: Stiffness::uniform(cloth, [0.0, bend.powi(-2), shear.powi(-2)]) }
    }
}

impl Term for Elastic<'_> {
    fn name(&self) -> &'static str {
        "elastic"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.cloth.energy(&self.stiffness, x).total()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let FrameSystem { gradient, matrix, scratch } = system;
        self.cloth.add_gradient(&self.stiffness, x, 1.0, gradient);
        self.cloth.add_hessian(&self.stiffness, x, HessianKind::GaussNewton, 1.0, matrix, scratch);
        self.value(x)
    }
}
