//! Cloths to learn from: made at random, and moved on by the network that learns.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

use crate::{Cloth, State, Stiffness};
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Positions, grid};

/// Rows and columns of the cloths.
const SIZES: [[usize; 2]; 3] = [[25, 25], [20, 31], [32, 24]];
/// Steps after which a cloth is made anew, at most.
const LIFE: f64 = 200.0;
/// Steps for which forces are held.
const HELD: usize = 4;
/// Waves of a random field.
const WAVES: usize = 3;

/// A cloth in motion.
pub struct Subject {
    rng: Rng,
    /// The cloth.
    pub cloth: Cloth,
    /// Its stiffness.
    pub stiffness: Stiffness,
    /// Length of its steps `[s]`.
    pub h: f64,
    /// Factor on the velocity before each.
    pub damping: f64,
    /// Its state.
    pub state: State,
    /// What acts on it [m/s²].
    forces: Positions,
    /// Vertices that are drawn to places.
    held: Vec<(usize, DVec3)>,
    /// Places of the vertices in the cloth, from −½ to ½.
    places: Vec<DVec2>,
    steps_left: usize,
}

impl Subject {
    /// A random one, of the size number `size`.
    pub fn new(mut rng: Rng, size: usize) -> Self {
        let [rows, columns] = SIZES[size % SIZES.len()];
        let spacing = 0.01 * 4f64.powf(rng.uniform());
        let aspect = 1.25f64.powf(rng.signed());
        let cells = DVec2::new((columns - 1) as f64, (rows - 1) as f64);
        let lengths = cells * spacing * DVec2::new(aspect.sqrt(), 1.0 / aspect.sqrt());
        let mut mesh = grid(columns, rows, lengths, 0.0);
        let places: Vec<DVec2> = mesh.positions.iter().map(|p| p.truncate() / lengths).collect();
        let side = lengths.max_element();
        if rng.uniform() < 0.5 {
            let depth = wave(&mut rng, &places, 4.0);
            let height = 0.1 * side * rng.uniform();
            mesh.positions.iter_mut().zip(&depth).for_each(|(p, d)| p.z += height * d.x);
        }
        let log = |rng: &mut Rng, low: f64, high: f64| 10f64.powf(low + (high - low) * rng.uniform());
        let k = [log(&mut rng, 1.0, 3.0), log(&mut rng, -5.0, -2.0), log(&mut rng, -4.0, -2.0)];
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, k);

        // Turned, bent, and a little out of shape.
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(rng.vector() * 0.7));
        let (bent, fine) = (wave(&mut rng, &places, 6.0), wave(&mut rng, &places, 12.0));
        let bend = 0.12 * side * rng.uniform();
        let ripple = 0.02 * side * rng.uniform() * rng.uniform();
        let noise = spacing * log(&mut rng, -5.0, -1.7);
        let shape = |k: usize, noise: DVec3| {
            let flat = mesh.positions[k];
            let off = DVec3::new(0.03 * bent[k].y, 0.03 * bent[k].z, bent[k].x) * bend
                + DVec3::Z * fine[k].x * ripple;
            turn * (flat + off) + noise
        };
        let x: Positions = (0..places.len()).map(|k| shape(k, rng.vector() * noise)).collect();
        let speed = log(&mut rng, -2.0, 0.0);
        let moving = wave(&mut rng, &places, 4.0);
        let trembling = speed * log(&mut rng, -3.0, -1.0);
        let v: Positions = moving.iter().map(|m| *m * speed + rng.vector() * trembling).collect();
        let held: Vec<usize> = match (rng.uniform() * 4.0) as usize {
            0 => vec![0, columns - 1],
            1 => (0..columns).collect(),
            2 => (0..rows).map(|r| r * columns).collect(),
            _ => Vec::new(),
        };
        let held = held.into_iter().map(|k| (k, x[k])).collect();
        let h = 5e-3 * (0.6 + 0.4 * rng.uniform());
        let damping = if rng.uniform() < 0.8 { 0.9 } else { 0.9 + 0.1 * rng.uniform() };
        let steps_left = (LIFE * rng.uniform()) as usize + 1;
        let forces = vec![DVec3::ZERO; x.len()];
        Self { rng, cloth, stiffness, h, damping, state: State { x, v }, forces, held, places, steps_left }
    }

    /// What acts on it in the next step [m/s²], shape `[V]`.
    pub fn accelerations(&mut self) -> Positions {
        if self.steps_left.is_multiple_of(HELD) {
            let rng = &mut self.rng;
            let gravity = rng.vector() * 12.0;
            let smooth = wave(rng, &self.places, 5.0);
            let (size, noise) = (30.0 * rng.uniform().powi(2), 8.0 * rng.uniform().powi(2));
            self.forces = smooth.iter().map(|s| gravity + *s * size + rng.vector() * noise).collect();
        }
        let mut out = self.forces.clone();
        for (k, place) in &self.held {
            let pull = (*place - self.state.x[*k]) * 2500.0 - self.state.v[*k] * 100.0;
            out[*k] += pull.clamp_length_max(200.0);
        }
        out
    }

    /// Takes over the shape after a step; a worn-out or broken cloth is made anew.
    pub fn advance(&mut self, x: Positions) {
        let intact = |e: &crate::cloth::Edge| {
            let length = e.along(&x).length();
            length.is_finite() && (0.5..1.6).contains(&(length / e.rest_length))
        };
        self.steps_left -= 1;
        if self.steps_left == 0 || !self.cloth.edges.iter().all(intact) {
            let size = SIZES.iter().position(|s| s[0] * s[1] == x.len()).expect("one of them");
            let mut rng = self.rng.clone();
            let seed = u64::from(rng.next_u32());
            *self = Self::new(Rng::new(seed, 1), size);
            return;
        }
        self.state.v =
            x.iter().zip(&self.state.x).map(|(after, before)| (*after - *before) / self.h).collect();
        self.state.x = x;
    }
}

/// Smooth random vectors of about unit size, of up to `most` half waves across the cloth.
fn wave(rng: &mut Rng, places: &[DVec2], most: f64) -> Positions {
    let waves: Vec<_> = (0..WAVES)
        .map(|_| {
            let direction = DVec2::new(rng.signed(), rng.signed()) * (0.5 * most);
            (direction, rng.uniform() * TAU, rng.vector())
        })
        .collect();
    let at = |p: &DVec2| waves.iter().map(|(d, phase, v)| *v * (d.dot(*p) * TAU + phase).sin()).sum();
    places.iter().map(at).collect()
}
