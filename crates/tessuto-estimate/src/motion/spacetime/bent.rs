//! How the sheet of a clip bends: its shape at rest, and how far it departs from that.
//!
//! The template is the shape of one frame, no more at rest than the others: a flag's waves travel, and a sheet
//! that the first frame finds in folds may hang flat in the next. So of every bending pair the mean over all
//! frames, the template among them, is treated as its angle at rest. The spread about it is the clip's own too.
//! Cauchy's kernel of tail 1 has the shape of Cauchy's distribution, half the negative logarithm of it, and the
//! median of its sizes is its scale. Of true motions the scale is 0 for paper and 0.02 to 0.1 rad for cloth,
//! whatever the simulator.
//!
//! How a sheet was found to bend is no evidence where its print was not found, as that of plain cloth never is:
//! only frames whose print is not lost count (`noise`).

use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use super::{Positions, Problem};
use crate::motion::terms::signed_bend::SignedBend;
use tessuto_core::math::median::median;

/// Bounds of the spread, relative to the setting's.
const BOUNDS: [f64; 2] = [0.25, 10.0];

/// How a sheet bends, relative to template and settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Bent {
    /// Angle of every pair at rest, less the template's, of nominal arms `[rad]`; empty: as the template.
    rest: Vec<f64>,
    /// Factor on the spread.
    spread: f64,
}

impl Default for Bent {
    fn default() -> Self {
        Self { rest: Vec::new(), spread: 1.0 }
    }
}

impl Bent {
    /// Changes what `prior` expects.
    pub fn apply(&self, prior: &mut SignedBend) {
        prior.bend_rest(&self.rest);
        prior.loosen(self.spread);
    }
}

impl Problem<'_> {
    /// How the sheet bends in frames whose print is found, the template the first of them; as the settings say if
    /// there are no others.
    pub(super) fn bent(&self, frames: &[&Positions]) -> Bent {
        let prior = &self.priors.signed_bend;
        let angles: Vec<Vec<f64>> = parallel::over(frames, |x| prior.angles(x));
        // About the template: the mean of few frames is near each of them.
        let sizes = angles.iter().skip(1).flatten().map(|angle| angle.abs()).collect();
        let Some(size) = median(sizes) else { return Bent::default() };
        let mean = |k: usize| angles.iter().map(|of_frame| of_frame[k]).sum::<f64>() / angles.len() as f64;
        let rest = (0..self.cloth.bends.len()).map(mean).collect();
        Bent { rest, spread: (size / self.settings.signed_bend).clamp(BOUNDS[0], BOUNDS[1]) }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use crate::motion::terms::Term;
    use tessuto_sim::Cloth;

    #[test]
    fn waves_that_travel_leave_a_flat_shape_at_rest() {
        let mut scene = scene();
        let wave = |k: usize| -> Positions {
            let phase = std::f64::consts::TAU * k as f64 / 8.0;
            let of = |p: &DVec3| DVec3::new(p.x, p.y, 1.0 + 8e-3 * (60.0 * (p.x + p.y) + phase).sin());
            scene.template.positions.iter().map(of).collect()
        };
        let frames: Vec<Positions> = (0..8).map(wave).collect();
        scene.template.positions.clone_from(&frames[0]);
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let bent = problem.bent(&frames.iter().collect::<Vec<_>>());
        let mut prior = problem.priors.signed_bend.clone();
        bent.apply(&mut prior);
        let flat: Positions = frames[0].iter().map(|p| DVec3::new(p.x, p.y, 1.0)).collect();
        let most = |prior: &SignedBend| prior.angles(&flat).into_iter().fold(0.0, |m: f64, a| m.max(a.abs()));
        println!(
            "flat is off by {:.1e}, was {:.1e} rad; spread {:.2}",
            most(&prior),
            most(&problem.priors.signed_bend),
            bent.spread
        );
        assert!(most(&prior) < 0.01 * most(&problem.priors.signed_bend));
        assert!(bent.spread > 1.5, "waves of {} times the spread that is usual", bent.spread);
        assert!(frames.iter().all(|x| prior.value(x) < problem.priors.signed_bend.value(&frames[4])));
    }

    #[test]
    fn a_sheet_that_stays_as_it_is_keeps_its_shape_closely() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let template = &scene.template.positions;
        let bent = problem.bent(&[template; 3]);
        assert!(bent.rest.iter().all(|angle| angle.abs() < 1e-12) && bent.spread == BOUNDS[0]);
        let one = problem.bent(&[template]);
        assert!(one.rest.is_empty() && one.spread == 1.0, "the template alone tells nothing");
    }
}
