//! A sheet's motion between the frames.

use tessuto_core::mesh::{Mesh, Positions};

/// Longest time between two shapes `[s]`, and longest time step of a simulation.
pub const STEP: f64 = 5e-3;

/// When the shapes of a motion are: as many from each frame to the next, and some after the last one.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// Time from shape to shape `[s]`.
    pub step: f64,
    /// Shapes from one frame to the next.
    pub per_frame: usize,
    /// Steps from the first frame to the end.
    pub steps: usize,
}

impl Clock {
    /// `frames` frames at `fps`, and what follows while the shutter is open for the fraction `exposure` of a frame.
    pub fn new(frames: usize, fps: f64, exposure: f64, longest: f64) -> Self {
        let per_frame = (1.0 / (fps * longest)).ceil().max(1.0) as usize;
        let after = (0.5 * exposure * per_frame as f64).ceil() as usize;
        let step = 1.0 / (fps * per_frame as f64);
        Self { step, per_frame, steps: (frames - 1) * per_frame + after }
    }
}

/// A sheet in motion.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// The sheet; its positions are no part of the motion.
    pub mesh: Mesh,
    /// Shape `[V]` at every frame.
    pub frames: Vec<Positions>,
    /// Shape `[V]` at every step of the clock; empty if nobody asks for shapes between the frames.
    pub steps: Vec<Positions>,
    /// When they are.
    pub clock: Clock,
}

impl Trajectory {
    /// Takes the shapes at the steps of `clock`, one after the other, from `shapes`; keeps those between the frames if
    /// `between` says so.
    ///
    /// # Errors
    /// The first of `shapes`.
    pub fn collect<E>(
        mesh: Mesh,
        clock: Clock,
        between: bool,
        shapes: impl Iterator<Item = Result<Positions, E>>,
    ) -> Result<Self, E> {
        let (mut frames, mut steps) = (Vec::new(), Vec::new());
        for (k, shape) in shapes.enumerate().take(clock.steps + 1) {
            let shape = shape?;
            if k % clock.per_frame == 0 {
                frames.push(shape.clone());
            }
            if between {
                steps.push(shape);
            }
        }
        Ok(Self { mesh, frames, steps, clock })
    }

    /// The shape at `time` `[s]` after the first frame, linear between the steps; still before the first and after
    /// the last.
    pub fn at(&self, time: f64) -> Positions {
        let s = (time / self.clock.step).clamp(0.0, (self.steps.len() - 1) as f64);
        let k = (s as usize).min(self.steps.len().saturating_sub(2));
        let pairs = self.steps[k].iter().zip(&self.steps[(k + 1).min(self.steps.len() - 1)]);
        pairs.map(|(a, b)| a.lerp(*b, s - k as f64)).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use tessuto_core::mesh::grid;

    #[test]
    fn frames_are_steps_and_between_them_it_is_linear() {
        let clock = Clock::new(3, 40.0, 0.5, STEP);
        assert_eq!((clock.per_frame, clock.steps), (5, 12));
        let shapes = (0..100).map(|k| Ok::<_, ()>(vec![DVec3::X * (k * k) as f64; 4]));
        let mesh = grid(2, 2, DVec2::ONE, 1.0);
        let motion = Trajectory::collect(mesh, clock, true, shapes).unwrap();
        let x: Vec<f64> = motion.frames.iter().map(|f| f[0].x).collect();
        assert_eq!(x, [0.0, 25.0, 100.0]);
        for (time, expected) in [(-1.0, 0.0), (0.025, 25.0), (0.0275, 30.5), (0.060, 144.0), (9.0, 144.0)] {
            assert!((motion.at(time)[3].x - expected).abs() < 1e-9, "{time}: {}", motion.at(time)[3].x);
        }
    }
}
