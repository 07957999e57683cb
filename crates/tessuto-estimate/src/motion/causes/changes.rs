//! The motion of a clip, but otherwise: under other stiffnesses, air or hold, and after its end.

use glam::DVec3;
use tessuto_core::parallel;

use super::Found;
use super::follow::lead_along;
use super::guide::{Guide, Guided, guide_from};
use super::parts::{air, held_ties};
use super::task::HOLD;
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use tessuto_core::mesh::Positions;
use tessuto_sim::{Cloth, State};

/// How a motion shall go otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Otherwise {
    /// Factors on stretch, bend and shear stiffness and on the drag.
    pub scale: [f64; 4],
    /// Frames after the clip. `air` and `hold` then change at its end, otherwise at its start.
    pub further: usize,
    /// Factor on the wind; 0 is still air. After the clip the last wind holds.
    pub air: f64,
    /// What becomes of held vertices.
    pub hold: Hold,
    /// Factor on gravity.
    pub gravity: f64,
    /// Factor on what no cause explains.
    pub residual: f64,
    /// Whether that goes on after the clip as in its last frame; otherwise it ends with the clip, or goes on as in
    /// its mean where the clip does not constrain the causes and held vertices are not let go.
    pub carry: bool,
}

/// What becomes of held vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// They follow their paths; after the clip they stay.
    Found,
    /// They stay where they are.
    Still,
    /// They are let go.
    Release,
}

impl Otherwise {
    /// What is otherwise in the clip.
    fn of_clip(&self) -> Self {
        match self.further {
            0 => *self,
            _ => Self { further: 0, air: 1.0, hold: Hold::Found, carry: false, ..*self },
        }
    }
}

impl Default for Otherwise {
    fn default() -> Self {
        Self {
            scale: [1.0; 4],
            further: 0,
            air: 1.0,
            hold: Hold::Found,
            gravity: 1.0,
            residual: 1.0,
            carry: false,
        }
    }
}

/// Strength of the lead that shows what a motion's causes leave unexplained [1/s²].
const SOFT: f64 = 6000.0;

/// What moved a cloth along the motion of a clip, ready for other motions.
pub struct Changes<'a> {
    cloth: &'a Cloth,
    /// The same cloth in other motions, which may touch what it did not in the clip.
    touching: &'a Cloth,
    dynamics: &'a Dynamics,
    found: &'a Found,
    /// Where the clip's motion is after every step, from its first frame on.
    paths: Vec<Positions>,
    /// What no cause explains in every step.
    residual: Vec<Positions>,
    /// Velocities at the end of the clip [m/s].
    velocities: Positions,
}

impl<'a> Changes<'a> {
    /// From the motion `frames`, shape [N, V], of `cloth`.
    pub fn new(cloth: &'a Cloth, dynamics: &'a Dynamics, found: &'a Found, frames: &[Positions]) -> Self {
        let paths = interpolated(frames, dynamics.substeps);
        // The pull of a soft lead: a strong one holds the found positions' noise too, which says nothing of
        // another motion.
        let softly = lead_along(cloth, dynamics, found, &paths, SOFT, false);
        let velocities = softly.velocities().clone();
        // Held vertices follow their paths.
        let mut residual = softly.pulls;
        residual.iter_mut().for_each(|pulls| found.held.iter().for_each(|v| pulls[*v] = DVec3::ZERO));
        Self { cloth, touching: cloth, dynamics, found, paths, residual, velocities }
    }

    /// In other motions the cloth is this one, with what it touches there.
    pub fn touching(self, touching: &'a Cloth) -> Self {
        Self { touching, ..self }
    }

    /// The motion of the cloth, but `otherwise`.
    pub fn simulate(&self, otherwise: &Otherwise) -> Guided {
        self.after(otherwise, self.clip(otherwise))
    }

    /// The same, simulated from the first frame on even where nothing of the clip is otherwise.
    pub fn simulate_anew(&self, otherwise: &Otherwise) -> Guided {
        self.after(otherwise, self.clip_led(&otherwise.of_clip()))
    }

    /// [`Self::simulate`] of each of `changes`.
    pub fn simulate_all(&self, changes: &[Otherwise]) -> Vec<Guided> {
        // What goes alike up to the clip's end needs the clip once.
        let mut groups: Vec<(Otherwise, Vec<usize>)> = Vec::new();
        for (k, change) in changes.iter().enumerate() {
            let clip = change.of_clip();
            match groups.iter_mut().find(|(of, _)| *of == clip) {
                Some((_, group)) => group.push(k),
                None => groups.push((clip, vec![k])),
            }
        }
        let group = |(clip, group): &(Otherwise, Vec<usize>)| {
            let clip = self.clip(clip);
            let of = |k: &usize| {
                let own = clip.copy().unwrap_or_else(|| self.clip(&changes[*k]));
                (*k, self.after(&changes[*k], own))
            };
            parallel::over(group, of)
        };
        let mut out: Vec<(usize, Guided)> = parallel::over(&groups, group).into_iter().flatten().collect();
        out.sort_by_key(|(k, _)| *k);
        out.into_iter().map(|(_, guided)| guided).collect()
    }

    /// The clip alone.
    fn clip(&self, otherwise: &Otherwise) -> Guided {
        let otherwise = &otherwise.of_clip();
        if *otherwise == Otherwise::default() {
            // Nothing is: found positions are nearer the truth than any simulation, the velocities of a simulation
            // than their differences.
            let frames = self.paths.iter().step_by(self.dynamics.substeps).cloned().collect();
            let end = State { x: self.paths[self.paths.len() - 1].clone(), v: self.velocities.clone() };
            return Guided::after(frames, end, self.found.causes.gravity(), self.dynamics.substeps);
        }
        self.clip_led(otherwise)
    }

    /// The clip alone, simulated.
    fn clip_led(&self, otherwise: &Otherwise) -> Guided {
        let targets: Vec<&Positions> = match otherwise.hold {
            Hold::Still => vec![&self.paths[0]; self.paths.len()],
            _ => self.paths.iter().collect(),
        };
        self.led(otherwise, &targets, &self.residual, 0, None)
    }

    /// What follows the clip.
    fn after(&self, otherwise: &Otherwise, clip: Guided) -> Guided {
        if otherwise.further == 0 {
            return clip;
        }
        let (steps, substeps) = (otherwise.further * self.dynamics.substeps, self.dynamics.substeps);
        let end = self.paths.last().expect("a frame");
        // What is assumed for want of better does not hold the sheet as it was held; the mean of what is missing does.
        let goes_on = match otherwise.carry {
            true => &self.residual[self.residual.len().saturating_sub(substeps)..],
            false if self.found.doubt().is_some() && otherwise.hold != Hold::Release => &self.residual[..],
            false => &[],
        };
        let mean = |i: usize| goes_on.iter().map(|step| step[i]).sum::<DVec3>() / goes_on.len() as f64;
        let lead = match goes_on.is_empty() {
            true => Vec::new(),
            false => vec![(0..end.len()).map(mean).collect(); steps],
        };
        self.led(otherwise, &vec![end; steps + 1], &lead, self.residual.len(), Some(clip))
    }

    /// Under what is `otherwise` from the step `from` on, held vertices at `targets`.
    fn led(
        &self,
        otherwise: &Otherwise,
        targets: &[&Positions],
        residual: &[Positions],
        from: usize,
        before: Option<Guided>,
    ) -> Guided {
        let (dynamics, found) = (self.dynamics, self.found);
        let h = dynamics.step.step;
        let [stretch, bend, shear, drag_scale] = otherwise.scale;
        let k = found.causes.stiffness();
        // After the clip the last wind holds.
        let last_time = self.residual.len() as f64 * h;
        let outer = |step: usize, state: &State| {
            let time = ((from + step + 1) as f64 * h).min(last_time);
            air(self.cloth, found, [drag_scale, otherwise.air], time, state, h)
        };
        let scaled = |rest: &Positions| rest.iter().map(|r| *r * otherwise.residual).collect();
        let guide = Guide {
            cloth: self.touching,
            dynamics,
            stiffness: [k[0] * stretch, k[1] * bend, k[2] * shear],
            ties: &match otherwise.hold {
                Hold::Release => vec![0.0; self.cloth.vertex_count()],
                _ => held_ties(self.cloth, found, HOLD),
            },
            lead: 0.0,
            targets,
            constant: found.causes.gravity() * otherwise.gravity,
            friction: found.causes.friction(),
            exact: false,
            known: &residual.iter().map(scaled).collect::<Vec<_>>(),
            outer: &outer,
        };
        guide_from(&guide, before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::causes::{Causes, Constraints, Knots, Spread};
    use crate::motion::parameters::StiffnessRange;
    use glam::DVec2;
    use tessuto_core::mesh::grid;
    use tessuto_sim::{Integrator, Model, StepSettings};

    #[test]
    fn what_was_missing_goes_on_after_the_clip_where_no_causes_are_told() {
        // A sheet that stays where it is, though nothing holds it.
        let mesh = grid(4, 4, DVec2::splat(0.3), 1.0);
        let cloth = Cloth::flat(&mesh, 0.05);
        let frames = vec![mesh.positions.clone(); 9];
        let step = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 5e-3,
            damping: 1.0,
            tolerance: 1e-7,
            newton_limit: 50,
        };
        let range = StiffnessRange { start: 0.0, low: -9.0, high: 9.0 };
        let dynamics = Dynamics { step, substeps: 4, model: Model::Springs, stiffness: vec![range; 3] };
        let prior = Spread { ln_stiffness: [1.0; 3], down: 0.3, ln_drag: 0.5, ln_friction: 1.0 };
        let knots = Knots { count: 2, end: 0.16 };
        let untold = Found {
            causes: Causes {
                ln_stiffness: [200f64.ln(), 1e-3f64.ln(), 1e-4f64.ln()],
                down: DVec3::Y,
                ln_drag: 0.0,
                ln_friction: 1e-6f64.ln(),
                ln_length: [0.0; 2],
                wind: vec![DVec3::ZERO; 2],
            },
            spread: prior,
            prior,
            knots,
            held: Vec::new(),
            rest_lengths: cloth.edges.iter().map(|edge| edge.rest_length).collect(),
            misfit: 0.0,
            constraints: Constraints::default(),
        };
        let told = Found { spread: Spread { down: 0.01, ..prior }, ..untold.clone() };
        let falls = |found: &Found, hold: Hold| {
            let changes = Changes::new(&cloth, &dynamics, found, &frames);
            let out = changes.simulate(&Otherwise { further: 8, hold, ..Otherwise::default() }).frames;
            assert_eq!((out.len(), &out[..9]), (17, &frames[..]), "an unchanged clip is the motion itself");
            (out[16][0] - frames[0][0]).y
        };
        let [stays, released] = [Hold::Found, Hold::Release].map(|hold| falls(&untold, hold));
        let ends = falls(&told, Hold::Found);
        println!("falls by {stays:.4}, {released:.4}, {ends:.4} m");
        assert!(ends > 0.05 && (released / ends - 1.0).abs() < 1e-9 && stays.abs() < 0.1 * ends);
    }
}
