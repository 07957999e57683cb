//! Internal friction: bending and shearing cloth costs work that does not come back.
//!
//! Every angle θ resists its change with the moment −c θ̇. In an implicit step of length H in which θ comes from
//! θ̄, this is a spring of stiffness c/H with the rest angle θ̄, and together with the elastic one of stiffness k
//! and rest angle θ₀
//!
//!   ½ k (θ − θ₀)² + ½ c/H (θ − θ̄)² = ½ (k + c/H) (θ − θ*)² + const,   θ* = (k θ₀ + c/H θ̄)/(k + c/H).

use glam::DVec3;
use rayon::prelude::*;

use super::angle;
use super::cloth::{AngleSpring, Cloth, arms};
use super::stiffness::Stiffness;

/// Angles of one parallel task.
const TASK: usize = 1000;

impl Cloth {
    /// θ of all bending, then all shearing pairs at `x` `[rad]`.
    pub fn angles_at(&self, x: &[DVec3]) -> Vec<f64> {
        let of = |h: &AngleSpring| {
            let [u, w] = arms(x, h.vertices);
            angle::angle(u, w)
        };
        self.bends.iter().chain(&self.shears).map(of).collect()
    }

    /// Derivatives of [`angles_at`](Self::angles_at) by the two arms [rad/m].
    pub fn angle_gradients_at(&self, x: &[DVec3]) -> Vec<[DVec3; 2]> {
        let of = |h: &AngleSpring| {
            let [u, w] = arms(x, h.vertices);
            // Of a spring with moment 1.
            angle::gradient(u, w, 1.0, angle::angle(u, w) - 1.0)
        };
        let all: Vec<&AngleSpring> = self.bends.iter().chain(&self.shears).collect();
        all.into_par_iter().with_min_len(TASK).map(of).collect()
    }

    /// Changes of the angles with `gradients` when vertices move by `field`.
    pub fn angle_changes(&self, gradients: &[[DVec3; 2]], field: &[DVec3]) -> Vec<f64> {
        let of = |(h, [gu, gw]): (&AngleSpring, &[DVec3; 2])| {
            let [u, w] = arms(field, h.vertices);
            gu.dot(u) + gw.dot(w)
        };
        self.bends.iter().chain(&self.shears).zip(gradients).map(of).collect()
    }

    /// Adds `scale`·Σ moment ∂θ/∂x to `out`, a moment for every angle.
    pub fn add_moments(&self, gradients: &[[DVec3; 2]], moments: &[f64], scale: f64, out: &mut [DVec3]) {
        for ((h, g), m) in self.bends.iter().chain(&self.shears).zip(gradients).zip(moments) {
            h.scatter(g.map(|g| g * (m * scale)), out);
        }
    }

    /// Makes `self` a copy of `elastic` whose angles resist, with `rate` = c/H [J/rad²], leaving `from` too.
    /// Returns the stiffnesses of both together.
    pub fn rub(&mut self, elastic: &Self, stiffness: &Stiffness, rate: f64, from: &[f64]) -> Stiffness {
        let mut total = stiffness.clone();
        let (bend_from, shear_from) = from.split_at(elastic.bends.len());
        let mix = |springs: &mut [AngleSpring], own: &[AngleSpring], k: &mut [f64], from: &[f64]| {
            for (((spring, own), k), from) in springs.iter_mut().zip(own).zip(k).zip(from) {
                let sum = *k + rate;
                spring.rest_angle = (own.rest_angle * *k + from * rate) / sum.max(f64::MIN_POSITIVE);
                *k = sum;
            }
        };
        mix(&mut self.bends, &elastic.bends, &mut total.bend, bend_from);
        mix(&mut self.shears, &elastic.shears, &mut total.shear, shear_from);
        total
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn friction_is_the_moment_against_the_change_of_angles() {
        let mesh = grid(4, 5, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(3, 0);
        let shake = |rng: &mut Rng, size: f64| -> Vec<DVec3> {
            mesh.positions.iter().map(|p| *p + rng.vector() * size).collect()
        };
        let (before, after) = (shake(&mut rng, 5e-3), shake(&mut rng, 5e-3));
        let (from, to) = (cloth.angles_at(&before), cloth.angles_at(&after));
        let k = Stiffness::uniform(&cloth, [100.0, 2e-3, 5e-4]);
        let rate = 0.03;
        let mut rubbed = cloth.clone();
        let total = rubbed.rub(&cloth, &k, rate, &from);
        let mut own = vec![DVec3::ZERO; 20];
        rubbed.add_gradient(&total, &after, 1.0, &mut own);
        let mut apart = vec![DVec3::ZERO; 20];
        cloth.add_gradient(&k, &after, 1.0, &mut apart);
        let gradients = cloth.angle_gradients_at(&after);
        let moments: Vec<f64> = to.iter().zip(&from).map(|(a, b)| a - b).collect();
        let elastic = apart.clone();
        cloth.add_moments(&gradients, &moments, rate, &mut apart);
        let off = own.iter().zip(&apart).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        let size = apart.iter().zip(&elastic).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(size > 1e-3 && off < 1e-10 * size, "{off} N of {size} N");
    }

    #[test]
    fn changes_of_angles_are_their_differences() {
        let mesh = grid(5, 4, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(5, 0);
        let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p + rng.vector() * 5e-3).collect();
        let field: Vec<DVec3> = x.iter().map(|_| rng.vector()).collect();
        let changes = cloth.angle_changes(&cloth.angle_gradients_at(&x), &field);
        let moved =
            |s: f64| cloth.angles_at(&x.iter().zip(&field).map(|(x, f)| *x + *f * s).collect::<Vec<_>>());
        let (plus, minus) = (moved(1e-7), moved(-1e-7));
        let mut worst = 0.0f64;
        for (change, (a, b)) in changes.iter().zip(plus.iter().zip(&minus)) {
            let difference = (a - b) / 2e-7;
            worst = worst.max((change - difference).abs() / (1.0 + difference.abs()));
        }
        println!("worst {worst:.1e}");
        assert!(changes.iter().any(|c| c.abs() > 1.0) && worst < 1e-5, "{worst}");
    }
}
