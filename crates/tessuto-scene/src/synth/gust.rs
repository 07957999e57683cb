//! The motion of simulated cloth: it hangs from the corners and the middle of its upper edge, or from two hands,
//! until it is at rest; then a gust comes, and the hands move.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::breeze::{Breeze, DRAG, FRICTION};
use super::hands::Hands;
use super::lattice::{MeshKind, lattice};
use super::settings::{Mover, Settings};
use super::sheet::{self, GRAVITY, SIZE, SLACK, Tilt};
use super::trajectory::{Clock, STEP, Trajectory};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_sim::air::Air;
use tessuto_sim::{Cloth, Integrator, State, StepSettings, Stiffness, TiedCloth};

/// Stiffness of the springs that hold the pinned vertices [N/m].
const PIN: f64 = 1e4;
/// Cloth of more columns or rows starts from a coarser one: from the wave it would take minutes to settle.
const FINE: usize = 48;
/// Steps until all swinging has ended, with a damping of a quarter per step; fine cloth is nearly at rest already.
const SETTLING: usize = 120;
const SETTLING_FINE: usize = 30;

/// Longest time step of a simulation whose causes are truth `[s]`: what a step of 5 ms damps shall not be found as
/// friction.
const SHORT: f64 = 1.25e-3;

/// What shall be different from the clip.
#[derive(Debug, Clone, Copy)]
pub struct Otherwise {
    /// Factor on the bend stiffness.
    pub bend: f64,
    /// Frames after the clip, in still air and with hands that stay.
    pub calm: usize,
}

impl Otherwise {
    /// Nothing.
    pub const NOTHING: Self = Self { bend: 1.0, calm: 0 };
}

/// The cloth and its motion: in the wind alone, or also carried by hands.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] from the simulation.
pub fn simulate(settings: &Settings) -> Result<Trajectory> {
    swing(settings, Otherwise::NOTHING)
}

/// [`simulate`], or otherwise.
///
/// # Errors
/// The same.
pub fn swing(settings: &Settings, otherwise: Otherwise) -> Result<Trajectory> {
    let mesh = lattice(settings.mesh, settings.grid, SIZE, sheet::depth(settings.mover), settings.seed);
    let mut hanging = Hanging::new(&mesh, settings);
    let x = hanging.settled(&mesh, settings)?;
    hanging.stiffness.bend.iter_mut().for_each(|k| *k *= otherwise.bend);
    let longest = if settings.air { SHORT } else { STEP };
    let clock = Clock::new(settings.frames + otherwise.calm, settings.fps, settings.between(), longest);
    let end = if otherwise.calm > 0 { (settings.frames - 1) as f64 / settings.fps } else { f64::INFINITY };
    let gust = Gust::new(settings.wind, settings.seed);
    let breeze = Breeze::new(settings.wind, settings.seed);
    let uvs = mesh.uvs.clone();
    let mut next = State { v: vec![DVec3::ZERO; x.len()], x };
    let shapes = (0..=clock.steps).map(|k| {
        if k > 0 {
            let (h, time) = (clock.step, (k - 1) as f64 * clock.step);
            hanging.carry((time + h).min(end));
            let before = std::mem::replace(&mut next, State { x: Vec::new(), v: Vec::new() });
            next = if settings.air {
                let wind = if time < end { breeze.velocity(time + h) } else { DVec3::ZERO };
                hanging.blow(before, h, wind)?
            } else {
                let acceleration = |i: usize| GRAVITY + gust.acceleration(uvs[i], time);
                hanging.step(before, h, 0.98f64.powf(h / STEP), acceleration)?
            };
        }
        Ok(next.x.iter().map(|p| hanging.tilt.point(*p)).collect())
    });
    Trajectory::collect(mesh, clock, settings.between() > 0.0, shapes)
}

/// A cloth with some vertices tied to fixed points.
pub struct Hanging {
    cloth: Cloth,
    stiffness: Stiffness,
    /// Vertex and the point that holds it.
    pins: Vec<(usize, DVec3)>,
    /// What carries the pins, if they move.
    hands: Option<Hands>,
    /// From the axes of the ground, in which all this is, to the camera's.
    pub tilt: Tilt,
    scratch: Scratch,
}

impl Hanging {
    /// The sheet `mesh`, not yet settled.
    pub fn new(mesh: &Mesh, settings: &Settings) -> Self {
        let cloth = Cloth::new(mesh);
        let columns = settings.grid[0];
        let hands = (settings.mover == Mover::Hands).then(|| Hands::new(mesh, settings));
        let fixed = [0, columns / 2, columns - 1].map(|i| {
            let p = mesh.positions[i];
            (i, DVec3::new(p.x * (1.0 - SLACK), p.y, p.z))
        });
        let tilt = match &hands {
            Some(hands) => hands.tilt,
            None if settings.air => Tilt::random(settings.mover, &mut Rng::new(settings.seed, 3)),
            None => Tilt::NONE,
        };
        Self {
            tilt,
            stiffness: Stiffness::uniform(&cloth, [settings.stretch, settings.bend, settings.shear]),
            pins: hands.as_ref().map_or(fixed.to_vec(), |hands| hands.pins(0.0)),
            hands,
            scratch: Scratch::default(),
            cloth,
        }
    }

    /// Moves the pins to where they are at `time` `[s]`.
    fn carry(&mut self, time: f64) {
        if let Some(hands) = &self.hands {
            self.pins = hands.pins(time);
        }
    }

    /// Vertices that are held, in ascending order.
    pub fn held(&self) -> Vec<usize> {
        let mut held: Vec<usize> = self.pins.iter().map(|(v, _)| *v).collect();
        held.sort_unstable();
        held
    }

    /// At rest under gravity, in folds that start from a slight wave; fine cloth from where a coarser one came to rest.
    fn settled(&mut self, mesh: &Mesh, settings: &Settings) -> Result<Positions> {
        let [columns, rows] = settings.grid;
        let (start, steps): (Positions, usize) = if columns.max(rows) > FINE {
            let halved = [columns, rows].map(|n| n.div_ceil(2).max(3));
            let coarse = Settings { grid: halved, mesh: MeshKind::Quads, ..settings.clone() };
            let grid = lattice(coarse.mesh, halved, SIZE, sheet::depth(settings.mover), settings.seed);
            let x = Hanging::new(&grid, &coarse).settled(&grid, &coarse)?;
            (mesh.uvs.iter().map(|uv| between(&x, halved, *uv)).collect(), SETTLING_FINE)
        } else {
            let wave = |(p, uv): (&DVec3, &DVec2)| {
                let fold = 0.02 * (TAU * 2.0 * uv.x).sin() + 0.01 * (TAU * (uv.x + 0.4 * uv.y)).cos();
                DVec3::new(p.x * (1.0 - SLACK), p.y, p.z + fold)
            };
            (mesh.positions.iter().zip(&mesh.uvs).map(wave).collect(), SETTLING)
        };
        let mut state = State { v: vec![DVec3::ZERO; start.len()], x: start };
        for _ in 0..steps {
            state = self.step(state, 2.0 * STEP, 0.75, |_| GRAVITY)?;
        }
        Ok(state.x)
    }

    /// One step of length `h` `[s]`.
    fn step(
        &mut self,
        state: State,
        h: f64,
        damping: f64,
        acceleration: impl Fn(usize) -> DVec3,
    ) -> Result<State> {
        let (tied, targets) = self.tied(&state.x, h, damping);
        Ok(tied.step(&self.stiffness, state, &targets, acceleration, &mut self.scratch)?.after)
    }

    /// One step of length `h` `[s]` in air of velocity `wind` [m/s], with internal friction.
    fn blow(&mut self, state: State, h: f64, wind: DVec3) -> Result<State> {
        let (mut tied, targets) = self.tied(&state.x, h, 1.0);
        let total = tied.rub(&self.cloth, &self.stiffness, FRICTION / h, &self.cloth.angles_at(&state.x));
        let (x, v) = (state.x.clone(), state.v.clone());
        let air = Air::new(&self.cloth, DRAG, wind, &x, &v, h);
        let acceleration = |i: usize| GRAVITY + air.acceleration(i);
        Ok(tied.step(&total, state, &targets, acceleration, &mut self.scratch)?.after)
    }

    /// The cloth at `x` with its pins, and where these pull.
    fn tied(&self, x: &[DVec3], h: f64, damping: f64) -> (TiedCloth, Positions) {
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: h,
            damping,
            tolerance: 1e-7,
            newton_limit: 200,
        };
        let (mut ties, mut targets) = (vec![0.0; x.len()], x.to_vec());
        for &(i, p) in &self.pins {
            (ties[i], targets[i]) = (PIN, p);
        }
        (TiedCloth::new(&self.cloth, &ties, &settings), targets)
    }
}

/// The point at `uv` of a regular grid of `columns`×`rows` points, linear between them.
fn between(x: &[DVec3], [columns, rows]: [usize; 2], uv: DVec2) -> DVec3 {
    let at = |s: f64, n: usize| {
        let p = s.clamp(0.0, 1.0) * (n - 1) as f64;
        let low = (p as usize).min(n - 2);
        (low, p - low as f64)
    };
    let ((c, s), (r, t)) = (at(uv.x, columns), at(1.0 - uv.y, rows));
    let along = |row: usize| x[row * columns + c].lerp(x[row * columns + c + 1], s);
    along(r).lerp(along(r + 1), t)
}

/// Wind that rises smoothly and carries waves across the cloth.
struct Gust {
    strength: f64,
    /// Phases and tilts of the waves, each in [−1, 1).
    random: [f64; 6],
}

impl Gust {
    fn new(strength: f64, seed: u64) -> Self {
        let mut rng = Rng::new(seed, 1);
        Self { strength, random: std::array::from_fn(|_| rng.signed()) }
    }

    /// Acceleration [m/s²] of the cloth at `uv`, `time` `[s]` after the gust's start.
    fn acceleration(&self, uv: DVec2, time: f64) -> DVec3 {
        let [r0, r1, r2, r3, r4, r5] = self.random;
        let rise = (time / 0.12).min(1.0);
        let envelope = rise * rise * (3.0 - 2.0 * rise);
        let wave = |across: f64, up: f64, frequency: f64, phase: f64| {
            (TAU * (across * uv.x + up * uv.y - frequency * time) + TAU * phase).sin()
        };
        let z = -0.45 * (TAU * 1.3 * time + 0.3 * r0).cos()
            + 0.4 * wave(1.0 + 0.2 * r1, 0.3 * r2, 2.0, 0.1 * r3)
            + 0.2 * wave(0.4 * r4, 1.2, 3.1, r5);
        let x = 0.25 * wave(0.5, 0.2 * r2, 1.7, r4);
        DVec3::new(x, 0.0, z) * (self.strength * envelope)
    }
}
