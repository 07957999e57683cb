//! A sheet that lies on a table, seen from above: two hands lift one side of it and lay it down again, or over the
//! sheet.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use super::lattice::lattice;
use super::settings::{Mover, Settings};
use super::sheet::{self, SIZE};
use super::trajectory::{Clock, STEP, Trajectory};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_core::scene::Plane;
use tessuto_sim::contact::{Body, ContactSettings, Shape};
use tessuto_sim::{Cloth, Integrator, State, StepSettings, Stiffness, TiedCloth};

/// Stiffness of the springs by which the hands hold [N/m].
const GRIP: f64 = 1e4;
/// What a hand holds is within this of its corner `[m]`.
const HAND: f64 = 0.04;
/// Thickness of the contact `[m]`, and the part of it at which the sheet's own weight is borne.
const THICKNESS: f64 = 1e-3;
const BORNE: f64 = 0.83;
/// Friction on the table and between layers.
const FRICTION: f64 = 0.4;
/// Angle by which the camera looks down, least and most `[rad]`.
const DOWN: [f64; 2] = [0.9, 1.3];
/// Least and most distance of the lifted side from the line that it is turned about, as a part of the sheet.
const REACH: [f64; 2] = [0.4, 0.6];
/// Largest angle by which a side is lifted that is laid down again `[rad]`.
const LIFTED: f64 = 1.4;
/// The hands have done after this part of the clip.
const DONE: f64 = 0.85;
/// The hands come nearer to the line by this part half-way, and keep this above the layer below `[m]`.
const SLACK: f64 = 0.06;
const CLEAR: f64 = 3e-3;

/// Where the table is and how the sheet lies on it, in the camera's frame.
struct Table {
    /// Directions along the sheet's width and height, and across the table to the free side.
    axes: [DVec3; 3],
    /// Below the middle of the sheet `[m]`.
    centre: DVec3,
    /// Distance of the lifted side from the line that it is turned about `[m]`.
    reach: f64,
}

impl Table {
    fn new(settings: &Settings) -> Self {
        let mut rng = Rng::new(settings.seed, 3);
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.uniform();
        let (down, turn) = (between(DOWN), between([0.0, 2.0 * PI]));
        let up = -DVec3::new(0.0, down.cos(), down.sin());
        let about = DQuat::from_axis_angle(up, turn);
        let along = about * DVec3::X;
        let centre = DVec3::Z * sheet::depth(Mover::Table);
        Self { axes: [along, along.cross(up), up], centre, reach: SIZE.x * between(REACH) }
    }

    /// The sheet lying there.
    fn lying(&self, mesh: &Mesh) -> Positions {
        let [along, across, up] = self.axes;
        mesh.positions
            .iter()
            .map(|p| self.centre + along * p.x + across * p.y + up * (BORNE * THICKNESS))
            .collect()
    }

    /// Vertices that the hands hold at the side x < 0, `mesh` being flat.
    fn held(mesh: &Mesh) -> Vec<usize> {
        let corners = [-1.0, 1.0].map(|side| 0.5 * DVec3::new(-SIZE.x, side * SIZE.y, 0.0));
        let near = |v: &usize| {
            let p = DVec3 { z: 0.0, ..mesh.positions[*v] };
            corners.iter().any(|corner| corner.distance(p) < HAND)
        };
        (0..mesh.positions.len()).filter(near).collect()
    }

    /// Where something at `p`, on the lying sheet, has got to when the hands have turned by `angle`.
    fn turned(&self, p: DVec3, angle: f64) -> DVec3 {
        let [along, across, up] = self.axes;
        let line = self.centre + along * (self.reach - 0.5 * SIZE.x);
        let from = p - line;
        let arm = -from.dot(along) * (1.0 - SLACK * angle.sin());
        let height = from.dot(up) + CLEAR * (0.5 * angle).sin();
        line + across * from.dot(across) + along * (-arm * angle.cos()) + up * (arm * angle.sin() + height)
    }
}

/// Angle of the hands at a part `s` of the clip `[rad]`.
fn angle(settings: &Settings, s: f64) -> f64 {
    let s = (s / DONE).min(1.0);
    if settings.fold { PI * s * s * (3.0 - 2.0 * s) } else { LIFTED * (PI * s).sin().powi(2) }
}

/// The plane in which the sheet lies on the table: that of its mesh.
pub fn plane(settings: &Settings) -> Plane {
    let Table { axes: [_, _, up], centre, .. } = Table::new(settings);
    Plane { normal: up, height: up.dot(centre) + BORNE * THICKNESS }
}

/// The sheet and its motion.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] from the simulation.
pub fn simulate(settings: &Settings) -> Result<Trajectory> {
    let table = Table::new(settings);
    let mesh = lattice(settings.mesh, settings.grid, SIZE, 0.0, settings.seed);
    let clock = Clock::new(settings.frames, settings.fps, settings.between(), STEP);
    let [.., normal] = table.axes;
    let height = normal.dot(table.centre);
    let contact = ContactSettings {
        thickness: Some(THICKNESS),
        friction: FRICTION,
        bodies: vec![Body { shape: Shape::Plane { normal, height }, friction: FRICTION }],
        ..ContactSettings::default()
    };
    let cloth = Cloth::new(&mesh).with_contact(&mesh, &contact)?;
    let stiffness = Stiffness::uniform(&cloth, [settings.stretch, settings.bend, settings.shear]);
    let step = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: clock.step,
        damping: 0.97f64.powf(clock.step / STEP),
        tolerance: 1e-5,
        newton_limit: 100,
    };
    let lying = table.lying(&mesh);
    let held = Table::held(&mesh);
    let mut ties = vec![0.0; lying.len()];
    held.iter().for_each(|v| ties[*v] = GRIP);
    let tied = TiedCloth::new(&cloth, &ties, &step);
    let gravity = normal * -sheet::GRAVITY.length();
    let end = (settings.frames - 1) as f64 / settings.fps;
    let mut scratch = Scratch::default();
    let mut state = State { x: lying.clone(), v: vec![DVec3::ZERO; lying.len()] };
    let shapes = (0..=clock.steps).map(|k| {
        if k > 0 {
            let turn = angle(settings, k as f64 * clock.step / end);
            let mut targets = lying.clone();
            held.iter().for_each(|v| targets[*v] = table.turned(lying[*v], turn));
            let before = std::mem::replace(&mut state, State { x: Vec::new(), v: Vec::new() });
            state = tied.step(&stiffness, before, &targets, |_| gravity, &mut scratch)?.after;
        }
        Ok(state.x.clone())
    });
    Trajectory::collect(mesh.clone(), clock, settings.between() > 0.0, shapes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_sim::contact::crossings::crossed_vertices;

    #[test]
    fn a_side_is_laid_over_the_sheet_or_down_again_and_nothing_passes_the_table() {
        for fold in [true, false] {
            let settings = Settings::default().with(|s| {
                (s.mover, s.fold, s.frames, s.fps, s.grid, s.seed) =
                    (Mover::Table, fold, 14, 10.0, [13, 13], 4);
                (s.bend, s.shear) = (1e-4, 1e-4);
            });
            let motion = simulate(&settings).unwrap();
            let plane = plane(&settings);
            let least = motion.frames.iter().flatten().map(|x| plane.above(*x)).fold(f64::INFINITY, f64::min);
            let most = motion.frames.iter().flatten().map(|x| plane.above(*x)).fold(0.0, f64::max);
            let triangles = motion.mesh.triangles();
            let crossed: usize = motion.frames.iter().map(|x| crossed_vertices(&triangles, x).len()).sum();
            let ends = [&motion.frames[0], &motion.frames[13]].map(|x| {
                // Of the side that is lifted and the other one.
                x[0].distance(x[12])
            });
            println!(
                "fold {fold}: {least:.2e} to {most:.3} m above, sides {ends:.3?} m apart, {crossed} crossed"
            );
            assert!(least > -BORNE * THICKNESS && most > 0.1 && crossed == 0);
            assert!(
                (ends[0] - 0.5).abs() < 1e-6 && if fold { ends[1] < 0.3 } else { ends[1] > 0.45 },
                "{ends:?}"
            );
        }
    }
}
