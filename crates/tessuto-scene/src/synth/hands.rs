//! Two hands that hold the sheet near its upper corners, and carry, turn and shake it.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use super::settings::{Mover, Settings};
use super::sheet::{self, Tilt};
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Mesh;

/// Fastest that a hand moves [m/s].
const TOP_SPEED: f64 = 1.0;
/// Half the width of what a hand holds, along the border `[m]`.
const GRIP: f64 = 0.03;
/// A grip is up to this far from its corner, along the border `[m]`.
const FROM_CORNER: f64 = 0.12;
/// Largest ways of the hands together, along x, y and z `[m]`.
const WAYS: DVec3 = DVec3::new(0.09, 0.05, 0.12);
/// Largest turns of the line between the hands, about y and about z, and of each hand about any axis `[rad]`.
const TURNS: [f64; 3] = [0.6, 0.4, 0.35];
/// Largest amplitude of the shaking `[m]`.
const SHAKE: f64 = 0.012;
/// The hands come into motion within this time `[s]`.
const RISE: f64 = 0.4;

/// A smooth random function of time: a slow wave, and a faster, smaller one.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    /// Frequency [1/s] and phase of both.
    parts: [(f64, f64); 2],
}

impl Wave {
    fn random(largest: f64, rng: &mut Rng) -> Self {
        let amplitude = largest * (0.3 + 0.7 * rng.uniform());
        let mut part = |low: f64, high: f64| (low + (high - low) * rng.uniform(), rng.uniform());
        Self { amplitude, parts: [part(0.5, 1.1), part(1.2, 2.0)] }
    }

    fn at(&self, time: f64) -> f64 {
        let [slow, fast] = self.parts.map(|(frequency, phase)| (TAU * (frequency * time + phase)).sin());
        self.amplitude * (0.75 * slow + 0.25 * fast)
    }
}

/// What one hand holds.
#[derive(Debug, Clone)]
struct Grip {
    /// Middle, before the hands move `[m]`.
    centre: DVec3,
    /// Vertices, and where they are from the middle `[m]`.
    vertices: Vec<(usize, DVec3)>,
    turn: [Wave; 3],
}

/// Both hands. They live in axes whose y points down to the ground; [`Hands::tilt`] leads to the camera's.
#[derive(Debug, Clone)]
pub struct Hands {
    grips: [Grip; 2],
    ways: [Wave; 3],
    turns: [Wave; 2],
    /// How far the hands come together `[m]`.
    together: Wave,
    shake: DVec3,
    /// Frequency of the shaking and of its coming and going [1/s].
    shaking: [f64; 2],
    /// Factor on all motion that keeps to the top speed.
    calm: f64,
    /// From the axes of the ground to the camera's.
    pub tilt: Tilt,
}

impl Hands {
    /// Hands on the flat sheet `mesh`.
    pub fn new(mesh: &Mesh, settings: &Settings) -> Self {
        let mut rng = Rng::new(settings.seed, 3);
        let tilt = Tilt::random(Mover::Hands, &mut rng);
        let grips = [-1.0, 1.0].map(|side| Grip::random(mesh, side, settings.grid, &mut rng));
        let ways = [WAYS.x, WAYS.y, WAYS.z].map(|largest| Wave::random(largest, &mut rng));
        let turns = [TURNS[0], TURNS[1]].map(|largest| Wave::random(largest, &mut rng));
        let mut hands = Self {
            grips,
            ways,
            turns,
            together: Wave::random(0.03, &mut rng),
            shake: rng.vector().normalize_or(DVec3::Z) * (SHAKE * rng.uniform()),
            shaking: [3.0 + 2.0 * rng.uniform(), 0.4 + 0.4 * rng.uniform()],
            calm: 1.0,
            tilt,
        };
        let speed = |k: usize| {
            let at = |time: f64| [0, 1].map(|g| hands.centre(g, time));
            let (a, b) = (at(k as f64 * 2e-3), at((k + 1) as f64 * 2e-3));
            f64::max(a[0].distance(b[0]), a[1].distance(b[1])) / 2e-3
        };
        let fastest = (0..5000).map(speed).fold(0.0, f64::max);
        hands.calm = (TOP_SPEED * (0.4 + 0.6 * rng.uniform()) / fastest).min(1.0);
        hands
    }

    /// Held vertices and where they are `[m]`, `time` `[s]` after the first frame.
    pub fn pins(&self, time: f64) -> Vec<(usize, DVec3)> {
        let rise = self.rise(time);
        let pins = self.grips.iter().enumerate().flat_map(|(g, grip)| {
            let centre = self.centre(g, time);
            let turn = DVec3::from_array(grip.turn.map(|wave| rise * wave.at(time)));
            let rotation = self.rotation(time) * DQuat::from_scaled_axis(turn);
            grip.vertices.iter().map(move |(v, offset)| (*v, centre + rotation * *offset))
        });
        pins.collect()
    }

    fn rise(&self, time: f64) -> f64 {
        let s = (time / RISE).clamp(0.0, 1.0);
        self.calm * s * s * (3.0 - 2.0 * s)
    }

    /// Rotation of the line between the hands.
    fn rotation(&self, time: f64) -> DQuat {
        let [yaw, roll] = self.turns.map(|wave| self.rise(time) * wave.at(time));
        DQuat::from_rotation_z(roll) * DQuat::from_rotation_y(yaw)
    }

    /// Middle of grip `g` `[m]`.
    fn centre(&self, g: usize, time: f64) -> DVec3 {
        let middle = 0.5 * (self.grips[0].centre + self.grips[1].centre);
        let rise = self.rise(time);
        let [frequency, coming] = self.shaking;
        let shake = self.shake * ((TAU * frequency * time).sin() * (TAU * coming * time).sin().max(0.0));
        let way = DVec3::from_array(self.ways.map(|wave| wave.at(time))) + shake;
        let arm = self.grips[g].centre - middle;
        // The hands only come together: apart, they would tear the sheet.
        let closer = rise * (self.together.amplitude + self.together.at(time));
        middle + rise * way + self.rotation(time) * (arm - arm.normalize() * closer)
    }
}

impl Grip {
    /// Near the upper corner on the left (`side` −1) or the right (1): on the upper border or down the side.
    fn random(mesh: &Mesh, side: f64, [columns, rows]: [usize; 2], rng: &mut Rng) -> Self {
        let along = FROM_CORNER * rng.signed();
        let corner = DVec2::new(0.5 * side * sheet::SIZE.x, -0.5 * sheet::SIZE.y);
        let wanted = corner + DVec2::new(-side * along.max(0.0), (-along).max(0.0));
        let border = |i: &usize| {
            let (column, row) = (i % columns, i / columns);
            // Its own half only: two hands never hold the same vertex.
            let own = (column as f64 - 0.5 * (columns - 1) as f64) * side > 0.0;
            own && (row == 0 || column == 0 || column + 1 == columns)
        };
        let off = |i: usize| mesh.positions[i].truncate().distance(wanted);
        let border: Vec<usize> = (0..columns * rows).filter(border).collect();
        let nearest = border.iter().copied().min_by(|a, b| off(*a).total_cmp(&off(*b)));
        let nearest = nearest.expect("a sheet of three columns has a vertex on either side of the middle");
        let flat = mesh.positions[nearest];
        let held = border.iter().filter(|i| mesh.positions[**i].distance(flat) <= GRIP);
        Self {
            centre: DVec3::new(flat.x * (1.0 - sheet::SLACK), flat.y, flat.z),
            vertices: held.map(|i| (*i, mesh.positions[*i] - flat)).collect(),
            turn: [0, 1, 2].map(|_| Wave::random(TURNS[2], rng)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::lattice::{MeshKind, lattice};

    #[test]
    fn hands_start_at_rest_keep_to_their_speed_and_never_pull_apart() {
        for (seed, grid) in
            [(0, [21, 21]), (1, [3, 3]), (2, [4, 9]), (3, [17, 5]), (4, [52, 12]), (5, [9, 9])]
        {
            let settings = Settings { seed, grid, mesh: MeshKind::Irregular, ..Settings::default() };
            let mesh = lattice(settings.mesh, grid, sheet::SIZE, sheet::depth(Mover::Hands), seed);
            let hands = Hands::new(&mesh, &settings);
            let rest = hands.pins(0.0);
            for ((v, p), (_, later)) in rest.iter().zip(hands.pins(1e-3)) {
                let flat = mesh.positions[*v];
                assert!(p.y == flat.y && p.x.abs() <= flat.x.abs() + 1e-12 && p.z == flat.z, "{p} {flat}");
                assert!(p.distance(later) < 1e-5, "seed {seed}: it jumps at the beginning");
            }
            let distance = |time: f64| hands.centre(0, time).distance(hands.centre(1, time));
            let (mut fastest, mut turned) = (0.0f64, 0.0f64);
            for k in 0..3000 {
                let time = k as f64 * 1e-3;
                for g in [0, 1] {
                    let step = hands.centre(g, time + 1e-3).distance(hands.centre(g, time));
                    fastest = fastest.max(step / 1e-3);
                }
                assert!(distance(time) <= distance(0.0) + 1e-12);
                turned = turned.max(hands.rotation(time).angle_between(DQuat::IDENTITY));
            }
            assert!((0.15..=1.01 * TOP_SPEED).contains(&fastest), "seed {seed}: {fastest} m/s");
            assert!((0.05..1.0).contains(&turned), "seed {seed}: {turned} rad");
        }
    }
}
