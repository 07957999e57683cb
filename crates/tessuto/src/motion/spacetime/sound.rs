//! Lost frames hold a shape that cloth can have.
//!
//! What was found where a frame is lost may be crumpled or inverted. Such shapes are no estimate of anything: between the frames around
//! them the least strain, bending and acceleration say more. The video has no say in what is put there.

use super::acceleration;
use super::joint::{JointSystem, POLICY};
use super::{Positions, Problem};
use crate::math::minimise::Model;
use crate::metrics::agreement::{AgreementMeter, FrameAgreement};
use crate::metrics::{State, judge_frames};
use crate::motion::terms::{FrameSystem, Term};

/// Gauss-Newton steps between the shapes around lost frames.
const STEPS: usize = 20;
/// Known frames are held by so many times the weight of the acceleration term.
const HELD: f64 = 1e8;

impl Problem<'_> {
    /// `frames` with other shapes in those that are lost and not sound; their `deviations`, shape [N, V], grow by what is
    /// changed. A frame is lost if its verdict says so that knows shape and deviation alone, and not sound if its shape alone makes it
    /// doubtful.
    pub fn sound(&self, frames: Vec<Positions>, deviations: Option<&mut Vec<Vec<f64>>>) -> Vec<Positions> {
        let template = &self.scene.template;
        let meter = AgreementMeter::new(template);
        let shapes: Vec<FrameAgreement> = frames.iter().enumerate().map(|(n, x)| meter.shape(n, x)).collect();
        let mut uncertain = shapes.clone();
        for (shape, deviations) in uncertain.iter_mut().zip(deviations.iter().flat_map(|d| d.iter())) {
            let squares: f64 = deviations.iter().map(|d| d * d).sum();
            shape.deviation = Some((squares / deviations.len().max(1) as f64).sqrt());
        }
        let states = |shapes: &[FrameAgreement]| -> Vec<State> {
            judge_frames(shapes, template).into_iter().map(|verdict| verdict.state).collect()
        };
        let (shapes, whole) = (states(&shapes), states(&uncertain));
        let unsound = |n: &usize| whole[*n] == State::Lost && shapes[*n] > State::Found;
        // The first frame is given.
        let unsound: Vec<usize> = (1..frames.len()).filter(unsound).collect();
        let mut out = frames.clone();
        for stretch in unsound.chunk_by(|a, b| a + 1 == *b) {
            self.bridge(&mut out, stretch[0], stretch[stretch.len() - 1] + 1);
        }
        if let Some(deviations) = deviations {
            for ((deviations, old), new) in deviations.iter_mut().zip(&frames).zip(&out) {
                let moved = deviations.iter_mut().zip(old.iter().zip(new));
                moved.for_each(|(d, (a, b))| *d = d.hypot(a.distance(*b)));
            }
        }
        out
    }

    /// Puts the shapes with the least strain, bending, shear and acceleration into frames `from` to `to` − 1. To the end of the clip the
    /// last one before is held.
    fn bridge(&self, frames: &mut [Positions], from: usize, to: usize) {
        let (head, tail) = frames.split_at_mut(from);
        let before = &head[from - 1];
        let count = to - from;
        let Some(after) = tail.get(count).cloned() else {
            tail.iter_mut().for_each(|x| x.clone_from(before));
            return;
        };
        for (k, x) in tail[..count].iter_mut().enumerate() {
            let t = (k + 1) as f64 / (count + 1) as f64;
            *x = before.iter().zip(&after).map(|(a, b)| a.lerp(*b, t)).collect();
        }
        // With two known frames on either side, where there are so many.
        let window = from.saturating_sub(2)..(to + 2).min(frames.len());
        let known: Vec<bool> = window.clone().map(|n| !(from..to).contains(&n)).collect();
        let mut clip = frames[window.clone()].to_vec();
        POLICY.minimise(&mut Bridge { problem: self, known }, &mut clip, STEPS);
        frames[window].clone_from_slice(&clip);
    }

    fn prior_terms(&self) -> [&dyn Term; 4] {
        let p = &self.priors;
        [&p.strain, &p.signed_bend, &p.bend, &p.shear]
    }

    /// The priors' system of a frame at `x`; of a `known` one, what holds it there.
    fn prior_system(&self, x: &Positions, known: bool) -> FrameSystem {
        let mut system = FrameSystem::zeros(self.cloth);
        if known {
            let held = vec![1.0; x.len()];
            system.matrix.add_masses(&self.cloth.pattern, &held, HELD * self.acceleration_weight());
        } else {
            for term in self.prior_terms() {
                term.add_system(x, &mut system);
            }
        }
        system
    }

    fn prior_value(&self, frames: &[Positions], known: &[bool]) -> f64 {
        let of_frame = |x: &Positions| self.prior_terms().iter().map(|term| term.value(x)).sum::<f64>();
        let own: f64 = frames.iter().zip(known).filter(|(_, known)| !**known).map(|(x, _)| of_frame(x)).sum();
        own + acceleration::value(frames, self.acceleration_weight())
    }
}

/// Frames between known ones, which the priors alone shape.
struct Bridge<'p, 'a> {
    problem: &'p Problem<'a>,
    /// Whether a frame stays as it is, shape `[N]`.
    known: Vec<bool>,
}

impl Model for Bridge<'_, '_> {
    /// Shape [N, V].
    type Point = Vec<Positions>;
    type System = Vec<FrameSystem>;

    fn linearise(&mut self, frames: &Self::Point) -> (f64, Self::System) {
        let system = |n: usize| self.problem.prior_system(&frames[n], self.known[n]);
        (self.problem.prior_value(frames, &self.known), (1..frames.len()).map(system).collect())
    }

    fn step(&mut self, x: &Self::Point, systems: &Self::System, lambda: f64) -> Option<(Self::Point, f64)> {
        let p = self.problem;
        let joint = JointSystem { cloth: p.cloth, systems, kappa: p.acceleration_weight(), lambda };
        let change = joint.solve(&joint.gradient(x));
        let mut next = x.clone();
        for n in (1..x.len()).filter(|n| !self.known[*n]) {
            next[n].iter_mut().zip(&change[n - 1]).for_each(|(x, s)| *x -= *s);
        }
        let value = p.prior_value(&next, &self.known);
        Some((next, value))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use crate::math::rng::Rng;
    use crate::sim::Cloth;

    #[test]
    fn lost_frames_get_sound_shapes_and_the_others_stay() {
        let mut scene = scene();
        let frame = scene.frames.frame(1).unwrap().into_owned();
        scene.frames = vec![frame; 9].into();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let meter = AgreementMeter::new(&scene.template);
        let at = |n: usize| -> Positions {
            // The sheet turns about the view axis as it comes nearer.
            let (turn, by) = (glam::DMat3::from_rotation_z(0.15 * n as f64), DVec3::Z * (-0.01 * n as f64));
            scene.template.positions.iter().map(|x| turn * *x + by).collect()
        };
        let right: Vec<Positions> = (0..9).map(at).collect();
        let mut frames = right.clone();
        let mut rng = Rng::new(2, 0);
        for n in [3, 4, 8] {
            frames[n].iter_mut().for_each(|x| *x += rng.vector() * 0.03);
            assert_eq!(judge_frames(&[meter.shape(n, &frames[n])], &scene.template)[0].state, State::Lost);
        }
        let mut deviations = vec![vec![1e-3; frames[0].len()]; 9];
        let sound = problem.sound(frames.clone(), Some(&mut deviations));
        for n in 0..9 {
            let shape = meter.shape(n, &sound[n]);
            let off = sound[n].iter().zip(&right[n]).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            println!("frame {n}: off by {off} m at most, strain {:.4}", shape.strain_mean);
            assert_eq!(shape.flipped, 0.0);
            let changed = [3, 4, 8].contains(&n);
            assert_eq!(sound[n] != frames[n], changed);
            assert_eq!(deviations[n][7] > 1e-3, changed);
            // Held at the end, moved on between.
            assert!(off < if n == 8 { 0.03 } else { 2e-3 } && shape.strain_mean < 5e-3);
        }
        assert_eq!(sound[8], sound[7]);
    }

    #[test]
    fn a_sound_shape_stays_however_uncertain() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let frames = vec![scene.template.positions.clone(); 4];
        let mut deviations = vec![vec![1.0; frames[0].len()]; 4];
        assert_eq!(problem.sound(frames.clone(), Some(&mut deviations)), frames);
        assert_eq!(problem.sound(frames.clone(), None), frames);
    }
}
