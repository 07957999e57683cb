//! The objective along one number, where the others follow.
//!
//! At a factor on the number the others take the step that the Gauss-Newton matrix foretells, and then one more of
//! its steps, by the residuals there and the derivatives at the optimum. The lower objective of both counts. Beyond a
//! factor that is excluded no other one is tried.
//!
//! Strains of found positions are mostly noise, and lengths are known to [`LENGTH_SPREAD`] only: a stretch stiffness
//! is no farther from the found one than the strains that it makes are, in these spreads, root mean square. So a
//! sheet that does not stretch visibly has a lower bound at most.

use tessuto_core::parallel;

use super::constraint::{Cause, EXCLUDED, FACTORS, Profile, deviations};
use super::drive::{Drive, Trajectory};
use super::forces::Causes;
use super::objective::{Data, LENGTH_SPREAD, Prior, System};
use tessuto_core::math::root::Root;
use tessuto_core::mesh::Positions;
use tessuto_sim::cloth::Edge;

/// The optimum, and what it is the optimum of.
pub struct Optimum<'a> {
    pub drive: &'a Drive<'a>,
    pub data: &'a Data<'a>,
    pub prior: &'a Prior,
    pub causes: &'a Causes,
    /// The motion there, with derivatives.
    pub trajectory: &'a Trajectory,
    /// The system there.
    pub system: &'a System,
}

impl Optimum<'_> {
    /// Of the numbers of [`Cause::POSITIVE`], without values at which the cloth cannot be simulated.
    pub fn profiles(&self) -> [Profile; 5] {
        let unknowns = self.system.gradient.len();
        let root = Root::of(&self.system.matrix.concat(), unknowns);
        let side = |(k, sign): (usize, f64)| -> Profile {
            let place = Cause::POSITIVE[k].places(unknowns).start;
            let unit: Vec<f64> = (0..unknowns).map(|q| f64::from(u8::from(q == place))).collect();
            let column = root.solve(&unit);
            let here = self.value(place, self.causes, &self.trajectory.frames);
            let mut out = Vec::new();
            for ln in FACTORS.map(|factor| sign * factor.ln()) {
                let step: Vec<f64> = column.iter().map(|c| c / column[place] * ln).collect();
                let Some(value) = self.lowest(place, &step) else { break };
                out.push((ln, value));
                // Farther away it is not better.
                if deviations(here, value) >= EXCLUDED {
                    break;
                }
            }
            out
        };
        let tried: Vec<(usize, f64)> = (0..5).flat_map(|k| [(k, -1.0), (k, 1.0)]).collect();
        let sides: Vec<Profile> = parallel::over(&tried, |of| side(*of));
        std::array::from_fn(|k| {
            let place = Cause::POSITIVE[k].places(unknowns).start;
            let here = self.value(place, self.causes, &self.trajectory.frames);
            let mut out: Profile = sides[2 * k].iter().rev().copied().collect();
            out.push((0.0, here));
            out.extend(&sides[2 * k + 1]);
            out
        })
    }

    /// The lowest objective that was found with the unknown at `place` as after `step`.
    fn lowest(&self, place: usize, step: &[f64]) -> Option<f64> {
        let causes = self.causes.moved(step);
        let trajectory = self.drive.run(&causes, false, &self.trajectory.steps).ok()?;
        let value = self.value(place, &causes, &trajectory.frames);
        let further = self.further(place, &causes, trajectory);
        Some(further.map_or(value, |further| value.min(further)))
    }

    /// After one more step of all unknowns except the one at `place`.
    fn further(
        &self,
        place: usize,
        causes: &Causes,
        Trajectory { frames, steps, .. }: Trajectory,
    ) -> Option<f64> {
        let unknowns = self.system.gradient.len();
        let mut system = System::zeros(unknowns);
        self.data.add_gradient(&frames, &self.trajectory.tangents, &mut system.gradient);
        self.prior.value(causes, Some(&mut system));
        let rest: Vec<usize> = (0..unknowns).filter(|p| *p != place).collect();
        let matrix: Vec<f64> =
            rest.iter().flat_map(|p| rest.iter().map(|q| self.system.matrix[*p][*q])).collect();
        let gradient: Vec<f64> = rest.iter().map(|p| system.gradient[*p]).collect();
        let mut step = vec![0.0; unknowns];
        rest.iter().zip(Root::of(&matrix, rest.len()).solve(&gradient)).for_each(|(p, s)| step[*p] = -s);
        let causes = causes.moved(&step);
        let trajectory = self.drive.run(&causes, false, &steps).ok()?;
        Some(self.value(place, &causes, &trajectory.frames))
    }

    /// The objective without the prior of the unknown at `place`; of stretch no more than strains explain.
    fn value(&self, place: usize, causes: &Causes, frames: &[Positions]) -> f64 {
        let whole = |causes: &Causes, frames: &[Positions]| {
            self.data.value(frames) + self.prior.value(causes, None) - self.prior.own(causes, place)
        };
        let value = whole(causes, frames);
        if place != 0 {
            return value;
        }
        let here = &self.trajectory.frames;
        let visible = self.strain_between(frames, here) / LENGTH_SPREAD;
        value.min(whole(self.causes, here) + 0.5 * visible * visible)
    }

    /// Root mean square over edges and frames of the difference in tensile strain.
    fn strain_between(&self, a: &[Positions], b: &[Positions]) -> f64 {
        let edges = &self.drive.cloth.edges;
        let strain = |x: &Positions, edge: &Edge| (edge.along(x).length() / edge.rest_length - 1.0).max(0.0);
        let square = |(a, b): (&Positions, &Positions)| -> f64 {
            edges.iter().map(|edge| (strain(a, edge) - strain(b, edge)).powi(2)).sum()
        };
        let sum: f64 = a.iter().zip(b).map(square).sum();
        (sum / (a.len() * edges.len()).max(1) as f64).sqrt()
    }
}
