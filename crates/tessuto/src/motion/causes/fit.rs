//! The search: Gauss-Newton with damping.

use glam::DVec3;

use super::drive::{Drive, Trajectory};
use super::forces::{Causes, Knots, Spread};
use super::grips::{self, Tries};
use super::held::{Guess, held_vertices};
use super::lengths::rest_lengths;
use super::objective::{Data, Prior, System};
use super::{CauseSettings, Found, cut_cloth};
use crate::error::Result;
use crate::mesh::{Mesh, Positions};
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use crate::scene::Known;
use crate::sim::cloth::Edge;
use crate::sim::{Cloth, panel};

/// Longest step of the simulation `[s]`; it is of second order.
const LONGEST_STEP: f64 = 0.01;
/// Strength of the ties of held vertices [1/s²].
const HOLD: f64 = 1e9;
/// Drag coefficient at the start: that of a plate across the wind.
const DRAG: f64 = 1.2;
/// Its bounds, and the spread of its logarithm: a sheet that hardly moves says nothing of it, but plates have from half to twice as much.
const DRAGS: [f64; 2] = [0.05, 20.0];
const DRAG_SPREAD: f64 = 0.5;
/// Internal friction at the start [J·s/rad²], its bounds, and the spread of its logarithm: without these it stands for gravity, and for the
/// hold, of a sheet that hangs from more than was found.
const FRICTION: f64 = 1e-5;
const FRICTIONS: [f64; 2] = [1e-8, 3e-4];
const FRICTION_SPREAD: f64 = 1.0;
/// Spread of gravity's direction about +y `[rad]`.
const TILT: f64 = 0.35;
/// The same about a direction that is known `[rad]`: of what a level or a phone's sensor tells.
const KNOWN_TILT: f64 = 0.01;
/// Largest change of an unknown logarithm, and a fifth of it of gravity's direction, in one iteration.
const LARGEST_STEP: f64 = 1.5;
/// The search ends when an iteration gains less than this, or so much of the objective.
const LEAST_GAIN: f64 = 3e-3;
const ATTEMPTS: usize = 3;
/// Damping after a step that failed, at least: with less the next one would be the same.
const LEAST_DAMPING: f64 = 0.1;
/// Where the motion that the causes make is off by more than so many of the positions' deviations, root mean square, something else
/// holds or moves the cloth, and nothing is told.
const DOUBTED: f64 = 1.75;

/// What moves the cloth of `template` along `found`, shape [N, V], `fps` frames per second, with standard deviations
/// `deviations`, shape [N, V] `[m]`; what is `known` beforehand is not searched.
pub fn find(
    (template, known): (&Mesh, &Known),
    found: &[Positions],
    deviations: &[Vec<f64>],
    (fps, dynamics): (f64, &Dynamics),
    settings: &CauseSettings,
) -> Found {
    let vertex_count = template.positions.len();
    let window = (settings.window / vertex_count).clamp(8, 1 << 20).min(found.len());
    let end = ((window - 1) as f64 / fps).max(1e-6);
    let knots = Knots { count: ((end / settings.wind_interval).round() as usize + 1).max(2), end };
    let rest_lengths = rest_lengths(template, found);
    let down = known.down.unwrap_or(DVec3::Y);
    let guess = match &known.held {
        Some(held) => Guess { held: held.clone(), still: true, told: true },
        None => held_vertices(template, found, down),
    };
    let ln = |log10: f64| log10 * std::f64::consts::LN_10;
    let mean = Causes {
        ln_stiffness: dynamics.springs().map(|range| ln(range.start)),
        down,
        ln_drag: DRAG.ln(),
        ln_friction: FRICTION.ln(),
        ln_length: [0.0; 2],
        wind: vec![DVec3::ZERO; knots.count],
    };
    let s = settings.spread;
    let spread = Spread {
        ln_stiffness: [0.5 * s, s, s],
        down: if known.down.is_some() { KNOWN_TILT } else { TILT },
        ln_drag: DRAG_SPREAD,
        ln_friction: FRICTION_SPREAD,
    };
    let prior =
        Prior { mean: mean.clone(), spread, wind: [0.1 * settings.wind, settings.wind, 0.5 * settings.wind] };
    let mut out = Found {
        causes: mean,
        spread,
        prior: spread,
        knots,
        held: guess.held.clone(),
        rest_lengths,
        misfit: 0.0,
    };
    if found.len() < 3 {
        return out;
    }
    let cloth = cut_cloth(template, &out.rest_lengths);
    let substeps = (1.0 / (fps * LONGEST_STEP) - 1e-9).ceil().clamp(1.0, 64.0) as usize;
    let targets = interpolated(&found[..window], substeps);
    let ties = vec![settings.tie; vertex_count];
    let h = 1.0 / (fps * substeps as f64);
    let ways = ways(template, &cloth);
    let mut drive = Drive { cloth: &cloth, h, substeps, targets: &targets, ties, ways: &ways, knots };
    let mut data = Data::new(&found[..window], deviations, fps);
    let bounds = dynamics.springs().map(|range| [ln(range.low), ln(range.high)]);
    let mut last_misfit = 0.0;
    // A simulation that fails at the start leaves what was known before.
    for pass in 0..2 {
        if !guess.still {
            out.held = match pass {
                0 => grips::about(template, &guess.held),
                // With causes that are known better.
                _ => {
                    drive.ties.fill(settings.tie);
                    let found = &found[..window];
                    let tries =
                        Tries { drive: &drive, hold: HOLD, found, causes: &out.causes, interval: 1.0 / fps };
                    tries.best(template, &guess.held)
                }
            };
        }
        out.held.iter().for_each(|v| drive.ties[*v] = HOLD);
        let Ok(search) = Search::new(&drive, &data, &prior, out.causes.clone(), bounds) else { break };
        let (causes, spread, misfit) = search.run(settings.iterations);
        let before = std::mem::replace(&mut out.causes, causes);
        // Where hands hold the cloth is itself a guess: what another guess makes of it tells by how much.
        out.spread = if pass == 1 && !guess.still { wider(spread, &before, &out.causes) } else { spread };
        last_misfit = misfit.sqrt();
        if pass == 0 {
            out.misfit = last_misfit;
        }
        if misfit <= 1.0 {
            break;
        }
        // Where the model is off by more than the positions are, its errors are what data are uncertain by.
        data.together *= misfit.max(1.0);
    }
    // With other held vertices the sheet has other stiffnesses, and would make another motion.
    if !guess.told || last_misfit > DOUBTED {
        out.spread = spread;
    }
    // As they are written: a replay starts from the same bits.
    let found = std::mem::take(&mut out.causes.ln_length);
    for (length, [u, v]) in out.rest_lengths.iter_mut().zip(&ways) {
        *length = f64::from((*length * (u * found[0] + v * found[1]).exp()) as f32);
    }
    out
}

struct Search<'a> {
    drive: &'a Drive<'a>,
    data: &'a Data<'a>,
    prior: &'a Prior,
    causes: Causes,
    trajectory: Trajectory,
    value: f64,
    /// Of ln stiffnesses.
    bounds: [[f64; 2]; 3],
}

impl<'a> Search<'a> {
    fn new(
        drive: &'a Drive<'a>,
        data: &'a Data<'a>,
        prior: &'a Prior,
        causes: Causes,
        bounds: [[f64; 2]; 3],
    ) -> Result<Self> {
        let trajectory = drive.run(&causes, true)?;
        let value = data.value(&trajectory.frames) + prior.value(&causes, None);
        Ok(Self { drive, data, prior, causes, trajectory, value, bounds })
    }

    fn system(&self) -> System {
        let mut system = System::zeros(self.causes.unknowns());
        self.data.add_system(&self.trajectory, &mut system);
        self.prior.value(&self.causes, Some(&mut system));
        system
    }

    /// What was found, its standard deviations, and [`Data::misfit`].
    fn run(mut self, iterations: usize) -> (Causes, Spread, f64) {
        let mut lambda = 1e-3;
        for _ in 0..iterations {
            let before = self.value;
            if !self.step(&mut lambda) || before - self.value < LEAST_GAIN * before.max(1.0) {
                break;
            }
        }
        let spread = spread(&self.system().matrix);
        let misfit = self.data.misfit(&self.trajectory.frames);
        (self.causes, spread, misfit)
    }

    /// A step that lowers the objective, if one is found.
    fn step(&mut self, lambda: &mut f64) -> bool {
        let system = self.system();
        for _ in 0..ATTEMPTS {
            let mut matrix = system.matrix.clone();
            (0..matrix.len()).for_each(|p| matrix[p][p] *= 1.0 + *lambda);
            let mut step = solve(&matrix, &system.gradient);
            let logarithms = [step[0], step[1], step[2], step[5], step[6], 5.0 * step[3], 5.0 * step[4]];
            let largest = logarithms.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            let scale = -f64::min(1.0, LARGEST_STEP / largest.max(f64::MIN_POSITIVE));
            step.iter_mut().for_each(|s| *s *= scale);
            let mut causes = self.causes.moved(&step);
            for (k, [low, high]) in causes.ln_stiffness.iter_mut().zip(self.bounds) {
                *k = k.clamp(low, high);
            }
            causes.ln_drag = causes.ln_drag.clamp(DRAGS[0].ln(), DRAGS[1].ln());
            causes.ln_friction = causes.ln_friction.clamp(FRICTIONS[0].ln(), FRICTIONS[1].ln());
            if let Ok(next) = Self::new(self.drive, self.data, self.prior, causes, self.bounds)
                && next.value < self.value
            {
                *self = next;
                *lambda = (*lambda * 0.1).max(1e-6);
                return true;
            }
            *lambda = (10.0 * *lambda).max(LEAST_DAMPING);
        }
        false
    }
}

/// How much of every edge runs along u and along v of the panel.
fn ways(template: &Mesh, cloth: &Cloth) -> Vec<[f64; 2]> {
    let Some(flat) = panel(template) else { return vec![[0.5; 2]; cloth.edges.len()] };
    let way = |edge: &Edge| {
        let d = edge.along(&flat).normalize_or_zero();
        [d.x * d.x, d.y * d.y]
    };
    cloth.edges.iter().map(way).collect()
}

/// `spread`, and what the causes `a` and `b` differ by.
fn wider(spread: Spread, a: &Causes, b: &Causes) -> Spread {
    Spread {
        ln_stiffness: [0, 1, 2].map(|k| spread.ln_stiffness[k].hypot(a.ln_stiffness[k] - b.ln_stiffness[k])),
        down: spread.down.hypot(a.down.angle_between(b.down)),
        ln_drag: spread.ln_drag.hypot(a.ln_drag - b.ln_drag),
        ln_friction: spread.ln_friction.hypot(a.ln_friction - b.ln_friction),
    }
}

/// Roots of the diagonal of the inverse.
fn spread(matrix: &[Vec<f64>]) -> Spread {
    let variance = |p: usize| {
        let unit: Vec<f64> = (0..matrix.len()).map(|q| f64::from(u8::from(p == q))).collect();
        solve(matrix, &unit)[p]
    };
    let ln_stiffness = [0, 1, 2].map(|p| variance(p).sqrt());
    let down = (variance(3) + variance(4)).sqrt();
    Spread { ln_stiffness, down, ln_drag: variance(5).sqrt(), ln_friction: variance(6).sqrt() }
}

/// Solution of a small positive definite system, by Cholesky's method.
fn solve(matrix: &[Vec<f64>], rhs: &[f64]) -> Vec<f64> {
    let n = rhs.len();
    let mut l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            l[i][j] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / l[j][j] };
        }
    }
    let mut x = rhs.to_vec();
    for i in 0..n {
        x[i] = (x[i] - (0..i).map(|k| l[i][k] * x[k]).sum::<f64>()) / l[i][i];
    }
    for i in (0..n).rev() {
        x[i] = (x[i] - (i + 1..n).map(|k| l[k][i] * x[k]).sum::<f64>()) / l[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid;
    use crate::motion::parameters::StiffnessRange;
    use crate::sim::{Integrator, StepSettings};
    use glam::DVec2;

    #[test]
    fn a_hanging_sheet_that_is_shaken_gives_back_its_causes() {
        let mut mesh = grid(7, 7, DVec2::splat(0.4), 1.0);
        // In folds, from two corners.
        mesh.positions.iter_mut().for_each(|p| {
            let fold = 0.02 * (25.0 * p.x).sin();
            *p = DVec3::new(p.x * 0.93, p.y, p.z + fold);
        });
        let range = |start: f64| StiffnessRange { start: start.log10(), low: -9.0, high: 9.0 };
        let step = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 5e-3,
            damping: 1.0,
            tolerance: 1e-8,
            newton_limit: 20,
        };
        let dynamics = Dynamics {
            step,
            substeps: 4,
            model: crate::sim::Model::Springs,
            stiffness: vec![range(200.0), range(1e-3), range(1e-4)],
        };
        let cloth = Cloth::flat(&mesh, 0.05);
        let truth = Causes {
            ln_stiffness: [200f64.ln(), 6e-3f64.ln(), 6e-4f64.ln()],
            down: DVec3::new(-0.15, 0.95, 0.2).normalize(),
            ln_drag: 1.5f64.ln(),
            ln_friction: 2e-4f64.ln(),
            ln_length: [0.0; 2],
            wind: vec![DVec3::ZERO, DVec3::Z * 0.5, DVec3::X * 0.5],
        };
        let knots = Knots { count: 3, end: 0.4 };
        let shaken = |n: usize| -> Positions {
            let way = DVec3::new(0.02, 0.0, 0.03) * (1.0 - (n as f64 * 0.2).cos());
            mesh.positions.iter().map(|p| *p + way).collect()
        };
        let targets: Vec<Positions> = (0..41).map(shaken).collect();
        let mut ties = vec![0.0; 49];
        let corners = held_vertices(&mesh, &[mesh.positions.clone()], DVec3::Y).held;
        assert_eq!(corners, [0, 6]);
        corners.iter().for_each(|v| ties[*v] = HOLD);
        let ways = ways(&mesh, &cloth);
        let drive =
            Drive { cloth: &cloth, h: 0.01, substeps: 2, targets: &targets, ties, ways: &ways, knots };
        let frames = drive.run(&truth, false).unwrap().frames;
        let deviations = vec![vec![2e-3; 49]; frames.len()];
        let settings = CauseSettings { fit: true, iterations: 30, ..CauseSettings::default() };
        let found = find((&mesh, &Known::default()), &frames, &deviations, (50.0, &dynamics), &settings);
        let off = |k: usize| (found.causes.ln_stiffness[k] - truth.ln_stiffness[k]).exp();
        let angle = found.causes.down.angle_between(truth.down).to_degrees();
        println!("bend {:.2}, shear {:.2}, gravity {angle:.1}°, {:?}", off(1), off(2), found.spread);
        assert!(off(1).ln().abs() < 1.25f64.ln() && off(2).ln().abs() < 1.25f64.ln() && angle < 3.0);
        assert!(
            found
                .spread
                .ln_stiffness
                .iter()
                .zip(found.prior.ln_stiffness)
                .all(|(sd, prior)| *sd < 0.4 * prior)
        );

        // What is known is taken: gravity a little off, and held vertices that would not be guessed.
        let down = (truth.down + DVec3::new(0.02, 0.0, -0.01)).normalize();
        let known = Known { down: Some(down), held: Some(vec![0, 3, 6]) };
        let brief = CauseSettings { iterations: 2, ..settings };
        let found = find((&mesh, &known), &frames, &deviations, (50.0, &dynamics), &brief);
        assert_eq!(found.held, [0, 3, 6]);
        assert!(found.prior.down <= KNOWN_TILT && found.causes.down.angle_between(down) < 3.0 * KNOWN_TILT);

        // Held by its lower corners no causes make it move like that, and nothing is told.
        let known = Known { held: Some(vec![42, 48]), ..Known::default() };
        let found = find((&mesh, &known), &frames, &deviations, (50.0, &dynamics), &brief);
        println!("held wrongly: misfit {:.2}", found.misfit);
        assert!(found.misfit > DOUBTED && found.spread == found.prior);
    }

    #[test]
    fn what_another_hold_makes_of_a_number_adds_to_its_deviation() {
        let a = Causes {
            ln_stiffness: [5.0, -7.0, -9.0],
            down: DVec3::Y,
            ln_drag: 0.0,
            ln_friction: -8.0,
            ln_length: [0.0; 2],
            wind: Vec::new(),
        };
        let b = Causes { ln_stiffness: [5.0, -7.4, -9.0], ln_drag: 1.2, ..a.clone() };
        let spread = Spread { ln_stiffness: [0.5, 0.3, 0.1], down: 0.04, ln_drag: 0.5, ln_friction: 1.0 };
        let out = wider(spread, &a, &b);
        assert!((out.ln_stiffness[1] - 0.5).abs() < 1e-12 && (out.ln_drag - 1.3).abs() < 1e-12);
        let same = Spread { ln_stiffness: [0.5, out.ln_stiffness[1], 0.1], ln_drag: out.ln_drag, ..spread };
        assert_eq!(out, same);
    }
}
