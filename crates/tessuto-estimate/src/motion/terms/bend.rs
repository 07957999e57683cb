//! Prior on bending whatever its direction: Σ ½ ((θ − θ0)/(λ σ))² over the cloth's bending pairs, with the angle θ of
//! `sim::angle`, θ0 that of the template and λ, the length of the pair's arms over a 24th of the sheet's size.
//!
//! What has a spread is the curvature, whatever the mesh: over longer arms the same curvature is a larger angle.
//! So spreads are given for arms of a 24th of the sheet and grow in proportion to λ. With one spread for all a
//! coarse mesh that bends is found flat, and as it is shorter in the image then, too far away.

use glam::DVec3;

use super::{FrameSystem, Term};
use tessuto_core::mesh::Mesh;
use tessuto_sim::angle;
use tessuto_sim::cloth::{AngleSpring, Cloth, arms};

/// Number of arms along a sheet whose spreads are as they are given.
pub const NOMINAL_ARMS: f64 = 24.0;

/// See the module.
#[derive(Clone)]
pub struct Bend<'a> {
    cloth: &'a Cloth,
    /// 1/(λ σ)² of every pair `[1/rad²]`.
    stiffness: Vec<f64>,
}

impl<'a> Bend<'a> {
    /// At rest in the shape of `template`, with the spread σ of nominal arms `[rad]`.
    pub fn new(cloth: &'a Cloth, template: &Mesh, sigma: f64) -> Self {
        let of = |length: f64| (length * sigma).powi(-2);
        Self { cloth, stiffness: arm_lengths(cloth, template).into_iter().map(of).collect() }
    }

    fn pairs(&self) -> impl Iterator<Item = (&AngleSpring, f64)> {
        self.cloth.bends.iter().zip(self.stiffness.iter().copied())
    }
}

/// Mean length λ of the two arms of every bending pair, in nominal arms.
pub fn arm_lengths(cloth: &Cloth, template: &Mesh) -> Vec<f64> {
    let nominal = template.area().sqrt() / NOMINAL_ARMS;
    let of = |spring: &AngleSpring| {
        let [a, o, c] = spring.vertices.map(|v| template.positions[v as usize]);
        0.5 * (a.distance(o) + o.distance(c)) / nominal
    };
    cloth.bends.iter().map(of).collect()
}

impl Term for Bend<'_> {
    fn name(&self) -> &'static str {
        "bend"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let of = |(spring, stiffness): (&AngleSpring, f64)| {
            let [u, w] = arms(x, spring.vertices);
            angle::value(u, w, stiffness, spring.rest_angle)
        };
        self.pairs().map(of).sum()
    }

    /// The matrix is that of Gauss and Newton.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        for (spring, stiffness) in self.pairs() {
            let [u, w] = arms(x, spring.vertices);
            spring.scatter(angle::gradient(u, w, stiffness, spring.rest_angle), &mut system.gradient);
            let h = angle::hessian_gauss_newton(u, w, stiffness, spring.rest_angle);
            spring.scatter_hessian(&h, &self.cloth.pattern, &mut system.matrix.whole());
        }
        self.value(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::mesh::grid;

    #[test]
    fn arms_of_a_24th_of_the_sheet_are_nominal() {
        for (vertices, expected) in [(25, 1.0), (13, 2.0)] {
            let mesh = grid(vertices, vertices, DVec2::splat(0.3), 1.0);
            let cloth = Cloth::new(&mesh);
            let lengths = arm_lengths(&cloth, &mesh);
            assert!(lengths.iter().all(|length| (length - expected).abs() < 1e-9));
            let bend = Bend::new(&cloth, &mesh, 0.15);
            assert!(bend.stiffness.iter().all(|k| (k * (expected * 0.15).powi(2) - 1.0).abs() < 1e-9));
        }
    }
}
