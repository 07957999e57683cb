//! The motion of paper: a flat sheet, bent without being stretched about an axis that turns, and moved slowly.
//!
//! The sheet is bent to a general cone, whose apex lies in the sheet's plane at the distance D from its middle (D
//! → ∞: a cylinder). A point at the distance r from the apex, in the direction α, goes to
//!
//!   p(r, α) = r c(α),  |c| = |c'| = 1,
//!
//! which keeps all lengths for any curve c on the unit sphere. With σ = α D, q = 1/D and the curvature κ(σ) of the
//! sheet at its middle the frame (c, t, n) along the curve is found from
//!
//!   c' = q t,  t' = −q c + κ n,  n' = −κ t.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::lattice::lattice;
use super::settings::{Mover, Settings};
use super::sheet::{self, SIZE};
use super::trajectory::{Clock, STEP, Trajectory};
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Positions;

/// Largest curvature at the sheet's middle [1/m].
const CURVATURE: f64 = 6.5;
/// Largest 1/D [1/m]; the apex stays off the sheet, whose corners are 0.354 m from its middle.
const APEX: f64 = 0.7;
/// Most that the sheet bends along one edge of its mesh `[rad]`, or else a coarse mesh could not show its shape.
const EDGE_BEND: f64 = 0.6;
/// The sheet starts to bend and to move within this time `[s]`.
const RISE: f64 = 0.25;
/// Steps along σ to each vertex; the frame is of fourth order in them.
const STEPS: usize = 24;
/// Largest tilts in the first frame and during the motion, about x, y and z `[rad]`, and largest ways `[m]`.
const TILT: f64 = 0.2;
const TURNS: [f64; 3] = [0.35, 0.35, 0.25];
const WAYS: [f64; 3] = [0.05, 0.05, 0.08];

/// Amplitude, frequency [1/s] and phase.
#[derive(Debug, Clone, Copy)]
struct Wave(f64, f64, f64);

impl Wave {
    fn at(self, time: f64) -> f64 {
        self.0 * (TAU * (self.1 * time + self.2)).sin()
    }
}

/// A sheet of paper that bends and moves.
#[derive(Debug, Clone)]
pub struct Paper {
    /// Curvature at the middle [1/m].
    curvature: Wave,
    /// Part of the curvature that varies along σ, in [0, 0.4]; its wavelength `[m]`, frequency [1/s] and phase.
    varying: (f64, f64, f64, f64),
    /// Direction of σ in the sheet, at the beginning `[rad]` and turning [rad/s].
    direction: [f64; 2],
    /// 1/D [1/m], above 0.
    apex: f64,
    /// Rotation vector of the first frame.
    tilt: DVec3,
    turns: [Wave; 3],
    ways: [Wave; 3],
}

impl Paper {
    /// The sheet of `seed`.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed, 4);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.uniform();
        let side = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        Self {
            curvature: Wave(side * between(0.5, 1.0) * CURVATURE, between(0.7, 1.3), between(-0.05, 0.1)),
            varying: (between(0.0, 0.4), between(0.4, 0.8), between(-0.5, 0.5), between(0.0, 1.0)),
            direction: [between(0.0, TAU), between(-2.5, 2.5)],
            apex: between(0.01, APEX),
            tilt: DVec3::new(between(-TILT, TILT), between(-TILT, TILT), between(-TILT, TILT)),
            turns: TURNS.map(|a| Wave(a * between(0.3, 1.0), between(0.2, 0.6), between(0.0, 1.0))),
            ways: WAYS.map(|a| Wave(a * between(0.3, 1.0), between(0.2, 0.6), between(0.0, 1.0))),
        }
    }

    /// Bent less if the mesh's longest edge, of `length` `[m]`, asks for it.
    fn limited(mut self, length: f64) -> Self {
        self.curvature.0 *= (EDGE_BEND / (length * largest_curvature())).min(1.0);
        self
    }

    /// Positions `[m]` of the points `flat` `[m]` of the sheet, from its middle, `time` `[s]` after the first frame.
    pub fn shape(&self, flat: &[DVec2], time: f64) -> Positions {
        let s = (time / RISE).clamp(0.0, 1.0);
        let rise = s * s * (3.0 - 2.0 * s);
        let vector = |waves: &[Wave; 3]| DVec3::from_array(waves.map(|wave| rise * wave.at(time)));
        let rotation = DQuat::from_scaled_axis(vector(&self.turns)) * DQuat::from_scaled_axis(self.tilt);
        let middle = DVec3::Z * sheet::depth(Mover::Paper) + vector(&self.ways);
        let along = DVec2::from_angle(self.direction[0] + self.direction[1] * time);
        let bent = |p: &DVec2| middle + rotation * self.bent(*p, along, rise, time);
        flat.iter().map(bent).collect()
    }

    /// The point `p` of the bent sheet, whose middle is in the origin and touches z = 0 there.
    fn bent(&self, p: DVec2, along: DVec2, rise: f64, time: f64) -> DVec3 {
        let across = along.perp();
        let distance = 1.0 / self.apex;
        let from_apex = DVec2::new(p.dot(along), p.dot(across) + distance);
        let sigma = distance * from_apex.x.atan2(from_apex.y);
        let (c, t) = (across.extend(0.0), along.extend(0.0));
        let start = DMat3::from_cols(c, t, c.cross(t));
        let frame = start * DMat3::from_quat(self.turned(sigma, rise, time));
        frame.x_axis * from_apex.length() - c * distance
    }

    /// Rotation of the frame from 0 to `sigma`: Magnus' expansion to fourth order.
    fn turned(&self, sigma: f64, rise: f64, time: f64) -> DQuat {
        let h = sigma / STEPS as f64;
        // Gauss points of a step.
        let gauss = [0.5 - 3f64.sqrt() / 6.0, 0.5 + 3f64.sqrt() / 6.0];
        (0..STEPS).fold(DQuat::IDENTITY, |turned, k| {
            let [a, b] = gauss.map(|g| {
                let curvature = rise * self.curvature_at((k as f64 + g) * h, time);
                DVec3::new(curvature, 0.0, self.apex)
            });
            turned * DQuat::from_scaled_axis(0.5 * h * (a + b) + (3f64.sqrt() / 12.0 * h * h) * a.cross(b))
        })
    }

    /// Curvature κ(σ) [1/m] once the sheet has started to bend; at most [`CURVATURE`].
    fn curvature_at(&self, sigma: f64, time: f64) -> f64 {
        let (part, length, frequency, phase) = self.varying;
        let wave = (TAU * (sigma / length + frequency * time + phase)).sin();
        self.curvature.at(time) * (1.0 - part + part * wave)
    }
}

/// Largest curvature anywhere [1/m]: at the corner nearest to the apex the rulings are closer together.
fn largest_curvature() -> f64 {
    CURVATURE / (1.0 - APEX * 0.5 * SIZE.length())
}

/// The sheet and its motion.
pub fn bend(settings: &Settings) -> Trajectory {
    let mesh = lattice(settings.mesh, settings.grid, SIZE, sheet::depth(Mover::Paper), settings.seed);
    let flat: Vec<DVec2> = mesh.positions.iter().map(|p| p.truncate()).collect();
    let clock = Clock::new(settings.frames, settings.fps, settings.between(), STEP);
    let length = |[a, b]: [u32; 2]| flat[a as usize].distance(flat[b as usize]);
    let longest = mesh.edges().into_iter().map(length).fold(0.0, f64::max);
    let paper = Paper::new(settings.seed).limited(longest);
    let shapes = (0..=clock.steps).map(|k| {
        // Without anything between the frames, only theirs are worth the work.
        let wanted = settings.between() > 0.0 || k % clock.per_frame == 0;
        Ok::<_, std::convert::Infallible>(if wanted {
            paper.shape(&flat, k as f64 * clock.step)
        } else {
            Vec::new()
        })
    });
    match Trajectory::collect(mesh, clock, settings.between() > 0.0, shapes) {
        Ok(trajectory) => trajectory,
        Err(never) => match never {},
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::lattice::MeshKind;
    use tessuto_core::mesh::grid;

    #[test]
    fn it_starts_flat_and_keeps_its_lengths_but_for_the_chords_of_the_bend() {
        let mesh = grid(12, 9, SIZE, 1.0);
        let flat: Vec<DVec2> = mesh.positions.iter().map(|p| p.truncate()).collect();
        let mut most = 0.0f64;
        for seed in 0..20 {
            let paper = Paper::new(seed);
            for k in 0..8 {
                let shape = paper.shape(&flat, 0.15 * k as f64);
                // Quads' edges and diagonals.
                let diagonals = mesh.faces.iter().flat_map(|f| {
                    let v = &f.vertices;
                    [[v[0], v[2]], [v[1], v[3]]]
                });
                for [a, b] in mesh.edges().into_iter().chain(diagonals).map(|e| e.map(|v| v as usize)) {
                    let length = flat[a].distance(flat[b]);
                    let shorter = 1.0 - shape[a].distance(shape[b]) / length;
                    // A chord of an arc of curvature κ is shorter by (κ l)²/24 and higher orders, never longer.
                    let chord = (largest_curvature() * length).powi(2) / 24.0;
                    assert!((-1e-9..=chord).contains(&shorter), "seed {seed}, {k}: {shorter} of {chord}");
                    most = most.max(shorter);
                    assert!(k > 0 || shorter.abs() < 1e-12, "it is not flat: {shorter}");
                }
            }
        }
        assert!(most > 1e-3, "nothing was bent: {most}");
    }

    #[test]
    fn finer_lines_come_nearer_to_the_true_length_by_the_square() {
        // Along any line of the flat sheet the chords' sum is the length to within O(l²): it is isometric in the limit.
        for seed in 0..6 {
            let paper = Paper::new(seed);
            let (a, b) = (DVec2::new(-0.24, -0.2), DVec2::new(0.21, 0.25));
            let missing = |n: usize| {
                let line: Vec<DVec2> = (0..=n).map(|k| a.lerp(b, k as f64 / n as f64)).collect();
                let shape = paper.shape(&line, 0.4);
                a.distance(b) - shape.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>()
            };
            let ratio = missing(20) / missing(80);
            assert!((ratio - 16.0).abs() < 0.5, "seed {seed}: {ratio}");
        }
    }

    #[test]
    fn coarse_meshes_are_bent_less_and_fine_ones_as_much_as_they_are() {
        for seed in 0..8 {
            let shortest = |grid: [usize; 2]| {
                let (mesh, mover) = (MeshKind::Irregular, Mover::Paper);
                let settings = Settings { grid, seed, mesh, mover, fps: 20.0, ..Settings::default() };
                let Trajectory { mesh, frames, .. } = bend(&settings);
                let ratio = |x: &Positions, [a, b]: [u32; 2]| {
                    let length = |x: &Positions| x[a as usize].distance(x[b as usize]);
                    length(x) / length(&frames[0])
                };
                let of = |x: &Positions| mesh.edges().into_iter().map(|e| ratio(x, e)).fold(1.0, f64::min);
                frames.iter().map(of).fold(1.0, f64::min)
            };
            for grid in [[3, 3], [3, 9], [6, 4], [12, 5]] {
                assert!(1.0 - shortest(grid) <= EDGE_BEND * EDGE_BEND / 24.0, "seed {seed}, {grid:?}");
            }
        }
        let unlimited = Paper::new(1);
        assert_eq!(unlimited.clone().limited(0.5 / 20.0).curvature.0, unlimited.curvature.0);
    }
}
