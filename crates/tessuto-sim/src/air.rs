//! Air: on every vertex of area A it acts along the normal n with ½ ρ C_d A |u·n| (u·n), u = w − v of wind and vertex.
//!
//! Along the sheet air hardly holds it. Per mass that is κ |u·n| (u·n) n, κ = ½ ρ C_d/area density. It is taken
//! from the state before a step; lest a long step turns the motion around, it falls behind where κ |u·n| h nears
//! 1:
//!
//!   a = κ s n,   s = (u·n) |u·n|/(1 + q²),   q = κ |u·n| h.

use glam::DVec3;

use super::cloth::{AREA_DENSITY, Cloth};
use tessuto_core::mesh::Positions;

/// Density of air [kg/m³].
const DENSITY: f64 = 1.2;

/// κ of a drag coefficient C_d [1/m].
pub fn kappa(drag: f64) -> f64 {
    0.5 * DENSITY * drag / AREA_DENSITY
}

/// The air about a cloth in one state.
pub struct Air<'a> {
    cloth: &'a Cloth,
    kappa: f64,
    h: f64,
    /// Positions before the step `[m]`.
    x: &'a [DVec3],
    /// Velocity of the air relative to every vertex [m/s].
    relative: Positions,
    /// Normals, and the lengths of what they were made from `[m²]`.
    normals: Positions,
    lengths: Vec<f64>,
}

impl<'a> Air<'a> {
    /// Wind of velocity `wind` [m/s] and drag coefficient `drag` about a cloth at `x` `[m]` with velocities `v`
    /// [m/s], for a step of length `h` `[s]`.
    pub fn new(cloth: &'a Cloth, drag: f64, wind: DVec3, x: &'a [DVec3], v: &[DVec3], h: f64) -> Self {
        let mut normals = vec![DVec3::ZERO; x.len()];
        for t in &cloth.triangles {
            let [a, b, c] = t.map(|i| x[i as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|i| normals[*i as usize] += n);
        }
        let lengths: Vec<f64> = normals.iter().map(|n| n.length().max(f64::MIN_POSITIVE)).collect();
        normals.iter_mut().zip(&lengths).for_each(|(n, l)| *n /= *l);
        let relative = v.iter().map(|v| wind - *v).collect();
        Self { cloth, kappa: kappa(drag), h, x, relative, normals, lengths }
    }

    /// u·n, |u·n| and q of a vertex.
    fn across(&self, i: usize) -> [f64; 3] {
        let across = self.relative[i].dot(self.normals[i]);
        [across, across.abs(), self.kappa * across.abs() * self.h]
    }

    /// Of a vertex [m/s²].
    pub fn acceleration(&self, i: usize) -> DVec3 {
        let [across, size, q] = self.across(i);
        self.normals[i] * (self.kappa * across * size / (1.0 + q * q))
    }

    /// Derivatives of all accelerations along changes of the positions, the velocities, the wind and ln C_d.
    pub fn changes(&self, dx: &[DVec3], dv: &[DVec3], d_wind: DVec3, d_ln_drag: f64) -> Positions {
        let mut turned = vec![DVec3::ZERO; dx.len()];
        for t in &self.cloth.triangles {
            let [a, b, c] = t.map(|i| self.x[i as usize]);
            let [da, db, dc] = t.map(|i| dx[i as usize]);
            let n = (db - da).cross(c - a) + (b - a).cross(dc - da);
            t.iter().for_each(|i| turned[*i as usize] += n);
        }
        let of = |i: usize| {
            let ([across, size, q], n) = (self.across(i), self.normals[i]);
            let dn = (turned[i] - n * n.dot(turned[i])) / self.lengths[i];
            let d_across = (d_wind - dv[i]).dot(n) + self.relative[i].dot(dn);
            let sq = 1.0 + q * q;
            let s = across * size / sq;
            let ds = 2.0 * size / (sq * sq) * d_across + s * (1.0 - q * q) / sq * d_ln_drag;
            (n * ds + dn * s) * self.kappa
        };
        (0..dx.len()).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn a_flat_sheet_feels_the_wind_across_it_alone() {
        let mesh = grid(3, 3, DVec2::splat(0.2), 1.0);
        let cloth = Cloth::new(&mesh);
        let v = vec![DVec3::new(3.0, 1.0, 0.5); 9];
        let air = Air::new(&cloth, 1.5, DVec3::new(0.0, 0.0, 2.5), &mesh.positions, &v, 0.0);
        // ½ · 1.2 · 1.5 · 2² N/m² on 0.1 kg/m².
        for i in 0..9 {
            assert!(air.acceleration(i).distance(DVec3::Z * 36.0) < 1e-9, "{}", air.acceleration(i));
        }
        let strong = Air::new(&cloth, 1.5, DVec3::ZERO, &mesh.positions, &v, 100.0);
        assert!(strong.acceleration(4).length() * 100.0 < 0.5, "no more than half of the velocity in a step");
    }

    #[test]
    fn changes_are_differences() {
        let mesh = grid(4, 5, DVec2::splat(0.2), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(9, 0);
        let mut field = |size: f64| -> Positions { (0..20).map(|_| rng.vector() * size).collect() };
        let x: Positions = mesh.positions.iter().zip(field(0.02)).map(|(p, d)| *p + d).collect();
        let (v, dx, dv) = (field(2.0), field(0.1), field(1.0));
        let (wind, d_wind, d_ln) = (DVec3::new(0.5, -0.3, 1.0), DVec3::new(0.3, 0.8, -0.4), 0.7);
        let changes = Air::new(&cloth, 1.1, wind, &x, &v, 0.03).changes(&dx, &dv, d_wind, d_ln);
        let at = |s: f64| -> Positions {
            let moved: Positions = x.iter().zip(&dx).map(|(x, d)| *x + *d * s).collect();
            let v: Positions = v.iter().zip(&dv).map(|(v, d)| *v + *d * s).collect();
            let air = Air::new(&cloth, 1.1 * (d_ln * s).exp(), wind + d_wind * s, &moved, &v, 0.03);
            (0..20).map(|i| air.acceleration(i)).collect()
        };
        let (plus, minus) = (at(1e-6), at(-1e-6));
        let (mut worst, mut size) = (0.0f64, 0.0f64);
        for i in 0..20 {
            let difference = (plus[i] - minus[i]) / 2e-6;
            worst = worst.max(difference.distance(changes[i]));
            size = size.max(difference.length());
        }
        println!("worst {worst:.1e} of {size:.1e}");
        assert!(size > 1.0 && worst < 1e-6 * size, "{worst} of {size}");
    }
}
