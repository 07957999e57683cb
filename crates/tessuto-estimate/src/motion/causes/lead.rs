//! What leads a cloth to where it should be, without what its own springs would take up.
//!
//! A spring of strength k to every place to reach, p, would pull with k (p − x) in all directions alike, and
//! against springs that hardly give for good: hundreds of m/s² for a millimetre in which the sheet cannot go. Here
//! such a pull a acts as
//!
//!   κ (M⁻¹ H + κ)⁻¹ a
//!
//! with the Hessian H of the springs, held vertices fixed: nearly whole where a sheet gives way, like bending, and
//! hardly where it is stiff, like stretch. The smaller κ [1/s²], the more is left out; k κ alone says how closely
//! the cloth follows, and for what pull.

use glam::DVec3;

use tessuto_core::math::factor::{Factor, Scratch};
use tessuto_core::mesh::Positions;
use tessuto_sim::stiffness::HessianKind;
use tessuto_sim::{Cloth, State, Stiffness};

/// κ.
const COMPLIANCE: f64 = 1000.0;
/// Damping of the pull, as a fraction of the critical one.
const DAMPING: f64 = 0.5;

/// A cloth that is led.
pub struct Lead<'a> {
    pub cloth: &'a Cloth,
    pub stiffness: &'a Stiffness,
    /// Strength of what holds held vertices, which are not led, 0 for the others, shape `[V]` [1/s²].
    pub ties: &'a [f64],
    /// k [1/s²]; 0 leads nowhere.
    pub strength: f64,
    /// Length of a step `[s]`.
    pub h: f64,
}

impl Lead<'_> {
    /// What the springs take up of a pull, as the sheet is at `x` `[m]`, shape `[V]`; `None` where nothing is led.
    pub fn compliance(&self, x: &[DVec3], scratch: &mut Scratch) -> Option<Factor> {
        let cloth = self.cloth;
        if self.strength == 0.0 {
            return None;
        }
        let mut matrix = scratch.zero_matrix(&cloth.pattern);
        cloth.add_hessian(self.stiffness, x, HessianKind::Projected, 1.0, &mut matrix);
        let masses: Vec<f64> =
            cloth.masses.iter().zip(self.ties).map(|(m, tie)| m * (COMPLIANCE + tie)).collect();
        matrix.add_masses(&cloth.pattern, &masses, 1.0);
        let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
        scratch.recycle_matrix(matrix);
        Some(factor)
    }

    /// The pull in a step from `state`, in which the places to reach go from `from` to `to` `[m]`, shape `[V]`
    /// [m/s²], with the [`Self::compliance`] of a sheet that is nearly there.
    pub fn pull(
        &self,
        compliance: Option<&Factor>,
        state: &State,
        [from, to]: [&[DVec3]; 2],
        scratch: &mut Scratch,
    ) -> Positions {
        let count = state.x.len();
        let Some(compliance) = compliance else { return vec![DVec3::ZERO; count] };
        let (cloth, h) = (self.cloth, self.h);
        // As a spring and a damper pull in an implicit step: stable, however strong.
        let damping = 2.0 * DAMPING * self.strength.sqrt();
        let all = 1.0 + self.strength * h * h + damping * h;
        let plain = |i: usize| {
            let ahead = to[i] - state.x[i] - state.v[i] * h;
            let faster = (to[i] - from[i]) / h - state.v[i];
            (ahead * self.strength + faster * damping) / all
        };
        let led = |i: usize| self.ties[i] == 0.0;
        let force = |i: usize| if led(i) { plain(i) * (COMPLIANCE * cloth.masses[i]) } else { DVec3::ZERO };
        let force: Positions = (0..count).map(force).collect();
        let mut pull = cloth.analysis.solve(&cloth.pattern, compliance, &force, scratch);
        (0..count).filter(|i| !led(*i)).for_each(|i| pull[i] = DVec3::ZERO);
        pull
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::math::dot;
    use tessuto_core::mesh::grid;

    #[test]
    fn the_pull_is_that_of_springs_but_where_the_sheet_is_stiff() {
        let mesh = grid(7, 7, DVec2::splat(0.3), 1.0);
        let cloth = Cloth::new(&mesh);
        let stiffness = &Stiffness::uniform(&cloth, [200.0, 1e-5, 1e-2]);
        let mut ties = vec![0.0; 49];
        ties[..7].fill(1e8);
        let state = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 49] };
        let lead = |strength: f64| Lead { cloth: &cloth, stiffness, ties: &ties, strength, h: 1e-5 };
        let off = 1e-3;
        let scratch = &mut Scratch::default();
        let mut pulled = |way: &dyn Fn(DVec3) -> DVec3| {
            let to: Positions = state.x.iter().map(|x| *x + way(*x) * off).collect();
            let lead = lead(2e4);
            let compliance = lead.compliance(&state.x, scratch);
            let pull = lead.pull(compliance.as_ref(), &state, [&to, &to], scratch);
            assert!(pull[..7].iter().all(|p| *p == DVec3::ZERO), "of held vertices");
            let way: Positions = state.x[7..].iter().map(|x| way(*x)).collect();
            dot(&pull[7..], &way) / dot(&way, &way) / (2e4 * off)
        };
        // From the held border on, out of the plane, along the sheet and aslant.
        let below = |x: DVec3| (x.y - mesh.positions[0].y) / 0.3;
        let swung = pulled(&|x| DVec3::Z * below(x));
        let stretched = pulled(&|x| DVec3::Y * below(x));
        let sheared = pulled(&|x| DVec3::X * below(x));
        println!("swung {swung:.3}, sheared {sheared:.3}, stretched {stretched:.4} of a spring's pull");
        assert!(swung > 0.9 && swung <= 1.0 && sheared < 0.5 * swung && stretched < 0.05);

        let nothing = lead(0.0);
        let compliance = nothing.compliance(&state.x, scratch);
        assert!(compliance.is_none());
        let nothing = nothing.pull(None, &state, [&state.x, &state.x], scratch);
        assert!(nothing.iter().all(|p| *p == DVec3::ZERO));
    }

    #[test]
    fn however_strong_it_ends_where_it_leads() {
        let mesh = grid(3, 3, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let stiffness = &Stiffness::uniform(&cloth, [0.0; 3]);
        let to: Positions = mesh.positions.iter().map(|x| *x + DVec3::new(0.01, 0.02, -0.01)).collect();
        for strength in [1e4, 1e12] {
            let h = 5e-3;
            let lead = Lead { cloth: &cloth, stiffness, ties: &[0.0; 9], strength, h };
            let mut state = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 9] };
            let scratch = &mut Scratch::default();
            for _ in 0..60 {
                let compliance = lead.compliance(&state.x, scratch);
                let pull = lead.pull(compliance.as_ref(), &state, [&to, &to], scratch);
                for i in 0..9 {
                    state.v[i] += pull[i] * h;
                    state.x[i] += state.v[i] * h;
                }
            }
            let worst = state.x.iter().zip(&to).map(|(x, to)| x.distance(*to)).fold(0.0, f64::max);
            println!("{strength}: {worst} m");
            assert!(worst < 1e-5);
        }
    }
}
