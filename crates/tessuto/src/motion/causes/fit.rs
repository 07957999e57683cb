//! What moves the cloth along found positions.

use glam::DVec3;

use super::drive::Drive;
use super::forces::{Causes, Knots, Spread};
use super::grips;
use super::held::{Guess, held_vertices};
use super::lengths::rest_lengths;
use super::objective::{Data, Prior};
use super::search::{Attempt, Fit, Search};
use super::{CauseSettings, DOUBTED, Found, cut_cloth};
use crate::mesh::{Mesh, Positions};
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use crate::scene::Known;
use crate::sim::cloth::Edge;
use crate::sim::{Cloth, panel};

/// Strength of the ties of held vertices [1/s²].
const HOLD: f64 = 1e9;
/// Drag coefficient at the start: that of a plate across the wind.
const DRAG: f64 = 1.2;
/// Spread of its logarithm: a sheet that hardly moves says nothing of it, but plates have from half to twice as much.
const DRAG_SPREAD: f64 = 0.5;
/// Internal friction at the start [J·s/rad²] and the spread of its logarithm: without these it stands for gravity, and for the hold, of a
/// sheet that hangs from more than was found.
const FRICTION: f64 = 1e-5;
const FRICTION_SPREAD: f64 = 1.0;
/// Spread of gravity's direction about +y `[rad]`.
const TILT: f64 = 0.35;
/// The same about a direction that is known `[rad]`: of what a level or a phone's sensor tells.
const KNOWN_TILT: f64 = 0.01;
/// Iterations at every place that hands are tried at.
const TRIED: usize = 1;
/// Iterations in fine steps, at most, after those in coarse ones.
const FINISHING: usize = 3;
/// Parts of the search, for who waits: for hands, in coarse steps, in fine ones.
const HANDS: usize = grips::PASSES;
const ROUGH: usize = 2;
/// All of them.
pub const PARTS: usize = HANDS + ROUGH + 2;

/// How finely the cloth is simulated.
struct Grain {
    /// Longest step `[s]`; the simulation is of second order.
    step: f64,
    /// How far a step's solution may be off `[m]`.
    tolerance: f64,
}

const FINE: Grain = Grain { step: 0.01, tolerance: 1e-5 };
/// First, and while hands are looked for: a frame of most videos.
const COARSE: Grain = Grain { step: 0.034, tolerance: 3e-5 };

/// What is searched, but for who holds the cloth.
struct Task<'a> {
    cloth: &'a Cloth,
    ways: &'a [[f64; 2]],
    data: Data<'a>,
    prior: Prior,
    /// Of ln stiffnesses.
    bounds: [[f64; 2]; 3],
    tie: f64,
    targets: Vec<Positions>,
    h: f64,
    substeps: usize,
    tolerance: f64,
    knots: Knots,
}

impl Task<'_> {
    fn drive(&self, held: &[usize]) -> Drive<'_> {
        let mut ties = vec![self.tie; self.cloth.masses.len()];
        held.iter().for_each(|v| ties[*v] = HOLD);
        Drive {
            cloth: self.cloth,
            h: self.h,
            tolerance: self.tolerance,
            substeps: self.substeps,
            targets: &self.targets,
            ties,
            ways: self.ways,
            knots: self.knots,
        }
    }

    /// What `end` makes of the search for causes where `held` vertices are held, starting from `start`
    /// near the steps of a similar run; `None` where the cloth cannot be simulated so.
    fn search<T>(
        &self,
        held: &[usize],
        (start, near): (&Causes, &[Positions]),
        end: impl FnOnce(Search) -> T,
    ) -> Option<T> {
        let drive = self.drive(held);
        Some(end(Search::new(&drive, &self.data, &self.prior, start.clone(), near, self.bounds).ok()?))
    }
}

/// What moves the cloth of `template` along `found`, shape [N, V], `fps` frames per second, with standard deviations
/// `deviations`, shape [N, V] `[m]`; what is `known` beforehand is not searched. `advance` hears how many of [`PARTS`] are done.
pub fn find(
    (template, known): (&Mesh, &Known),
    found: &[Positions],
    deviations: &[Vec<f64>],
    (fps, dynamics): (f64, &Dynamics),
    settings: &CauseSettings,
    advance: &mut dyn FnMut(usize),
) -> Found {
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
        wind: Vec::new(),
    };
    let s = settings.spread;
    let spread = Spread {
        ln_stiffness: [0.5 * s, s, s],
        down: if known.down.is_some() { KNOWN_TILT } else { TILT },
        ln_drag: DRAG_SPREAD,
        ln_friction: FRICTION_SPREAD,
    };
    let cloth = cut_cloth(template, &rest_lengths);
    let ways = ways(template, &cloth);
    let task = |grain: Grain| {
        let window = (settings.window / cloth.masses.len()).clamp(8, 1 << 20).min(found.len());
        let end = ((window - 1) as f64 / fps).max(1e-6);
        let knots = Knots { count: ((end / settings.wind_interval).round() as usize + 1).max(2), end };
        let substeps = (1.0 / (fps * grain.step) - 1e-9).ceil().clamp(1.0, 64.0) as usize;
        Task {
            cloth: &cloth,
            ways: &ways,
            data: Data::new(&found[..window], deviations, fps),
            prior: Prior {
                mean: Causes { wind: vec![DVec3::ZERO; knots.count], ..mean.clone() },
                spread,
                wind: [0.1 * settings.wind, settings.wind, 0.5 * settings.wind],
            },
            bounds: dynamics.springs().map(|range| [ln(range.low), ln(range.high)]),
            tie: settings.tie,
            targets: interpolated(&found[..window], substeps),
            h: 1.0 / (fps * substeps as f64),
            substeps,
            tolerance: grain.tolerance,
            knots,
        }
    };
    let mut fine = task(FINE);
    let mut out = Found {
        causes: fine.prior.mean.clone(),
        spread,
        prior: spread,
        knots: fine.knots,
        held: guess.held.clone(),
        rest_lengths,
        misfit: 0.0,
    };
    let coarse = task(COARSE);
    if found.len() >= 3 {
        search((template, &guess), &coarse, &mut fine, &mut out, settings, advance);
    }
    // As they are written: a replay starts from the same bits.
    let lengths = std::mem::take(&mut out.causes.ln_length);
    for (length, [u, v]) in out.rest_lengths.iter_mut().zip(&ways) {
        *length = f64::from((*length * (u * lengths[0] + v * lengths[1]).exp()) as f32);
    }
    out
}

/// Searches what moves the cloth, and puts it into `out` if the clip tells it: otherwise, or where the cloth cannot be simulated, what was
/// known before stays.
fn search(
    (template, guess): (&Mesh, &Guess),
    coarse: &Task,
    fine: &mut Task,
    out: &mut Found,
    settings: &CauseSettings,
    advance: &mut dyn FnMut(usize),
) -> Option<()> {
    let mut start = (out.causes.clone(), Vec::new());
    let mut others = Vec::new();
    if !guess.still && guess.told {
        let fit = |held: &[usize], near: Option<&Attempt>| {
            let (start, iterations) = match near {
                None => ((&coarse.prior.mean, &[][..]), settings.iterations),
                Some(near) => ((&near.causes, &near.steps[..]), settings.iterations.min(TRIED)),
            };
            coarse.search(held, start, |search| search.attempt(iterations))
        };
        let (best, tried) = grips::find(template, &guess.held, coarse.data.price(), fit, advance)?;
        others =
            tried.into_iter().map(|hold| ((best.value - hold.value).exp(), hold.attempt.causes)).collect();
        (out.held, start) = (best.held, (best.attempt.causes, best.attempt.steps));
    }
    advance(HANDS);
    let iterations = if guess.told { settings.iterations } else { 0 };
    let rough = coarse.search(&out.held, (&start.0, &start.1), |search| search.attempt(iterations))?;
    advance(HANDS + ROUGH);
    out.misfit = rough.misfit.sqrt();
    if !guess.told || out.misfit > DOUBTED {
        return None;
    }
    let whole = fine.substeps.is_multiple_of(coarse.substeps);
    let near = match whole {
        true => between(&fine.targets[0], &rough.steps, fine.substeps / coarse.substeps),
        false => Vec::new(),
    };
    // Where the model is off by more than the positions are, its errors are what data are uncertain by.
    let doubt = rough.misfit.max(1.0);
    fine.data.together *= doubt;
    let iterations = settings.iterations.min(FINISHING);
    let fit = fine.search(&out.held, (&rough.causes, &near), |search| search.run(iterations))?;
    out.misfit = fit.misfit.sqrt();
    if out.misfit <= DOUBTED {
        // With other held vertices the sheet has other stiffnesses, and would make another motion.
        others.iter_mut().for_each(|(weight, _)| *weight = weight.powf(1.0 / doubt));
        out.spread = wider(&fit, &others);
        out.causes = fit.causes;
    }
    Some(())
}

/// Positions after every step, from those after steps `ratio` times as long that start from `first`.
fn between(first: &Positions, steps: &[Positions], ratio: usize) -> Vec<Positions> {
    let all: Vec<Positions> = std::iter::once(first).chain(steps).cloned().collect();
    interpolated(&all, ratio).split_off(1)
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

/// The deviations of `fit`, and what the causes of `others` differ by, each with its likelihood over that of `fit`.
fn wider(Fit { causes, spread, .. }: &Fit, others: &[(f64, Causes)]) -> Spread {
    let sum = 1.0 + others.iter().map(|(weight, _)| weight).sum::<f64>();
    let wider = |sd: f64, difference: &dyn Fn(&Causes) -> f64| {
        let squares = others.iter().map(|(weight, other)| weight * difference(other).powi(2)).sum::<f64>();
        (sd * sd + squares / sum).sqrt()
    };
    let stiffness = |k: usize| wider(spread.ln_stiffness[k], &|c| c.ln_stiffness[k] - causes.ln_stiffness[k]);
    Spread {
        ln_stiffness: [0, 1, 2].map(stiffness),
        down: wider(spread.down, &|c| c.down.angle_between(causes.down)),
        ln_drag: wider(spread.ln_drag, &|c| c.ln_drag - causes.ln_drag),
        ln_friction: wider(spread.ln_friction, &|c| c.ln_friction - causes.ln_friction),
    }
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
        let drive = Drive {
            cloth: &cloth,
            h: 0.01,
            tolerance: 1e-6,
            substeps: 2,
            targets: &targets,
            ties,
            ways: &ways,
            knots,
        };
        let frames = drive.run(&truth, false, &[]).unwrap().frames;
        let deviations = vec![vec![2e-3; 49]; frames.len()];
        let settings = CauseSettings { fit: true, iterations: 30, ..CauseSettings::default() };
        let found =
            find((&mesh, &Known::default()), &frames, &deviations, (50.0, &dynamics), &settings, &mut |_| ());
        let off = |k: usize| (found.causes.ln_stiffness[k] - truth.ln_stiffness[k]).exp();
        let angle = found.causes.down.angle_between(truth.down).to_degrees();
        assert_eq!(found.doubt(), None);
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
        let found = find((&mesh, &known), &frames, &deviations, (50.0, &dynamics), &brief, &mut |_| ());
        assert_eq!(found.held, [0, 3, 6]);
        assert!(found.prior.down <= KNOWN_TILT && found.causes.down.angle_between(down) < 3.0 * KNOWN_TILT);

        // Held by its lower corners no causes make it move like that, and nothing is told.
        let known = Known { held: Some(vec![42, 48]), ..Known::default() };
        let found = find((&mesh, &known), &frames, &deviations, (50.0, &dynamics), &brief, &mut |_| ());
        println!("held wrongly: misfit {:.2}", found.misfit);
        assert!(found.misfit > DOUBTED && found.spread == found.prior);
        let mut kept = found.causes.ln_stiffness.iter().zip([200f64, 1e-3, 1e-4]);
        assert!(kept.all(|(ln, start)| (ln - start.ln()).abs() < 1e-12));
        assert!(found.doubt().unwrap().to_string().contains("deviations from the motion"));
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
        let fit = Fit { causes: a, spread, misfit: 1.0 };
        // As likely as what was found: half of the squares count.
        let out = wider(&fit, &[(1.0, b.clone())]);
        assert!((out.ln_stiffness[1] - 0.17f64.sqrt()).abs() < 1e-12);
        assert!((out.ln_drag - 0.97f64.sqrt()).abs() < 1e-12);
        let same = Spread { ln_stiffness: [0.5, out.ln_stiffness[1], 0.1], ln_drag: out.ln_drag, ..spread };
        assert_eq!(out, same);
    }
}
