//! What moves the cloth along found positions.

use super::constraint::{judge, partner};
use super::forces::{Causes, Spread};
use super::search::{Attempt, Fit};
use super::task::{COARSE, FINE, Sheet, Task};
use super::{
    Cause, CauseSettings, Constraint, Constraints, DOUBTED, Explained, Explanation, Found, cut_cloth, follow,
    grips, is_unlikely,
};
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::{Dynamics, Parameters};
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_core::scene::Known;

/// Iterations for everything that may hold the cloth.
const TRIED: usize = 1;
/// Iterations in fine steps, at most, after those in coarse ones.
const FINISHING: usize = 3;
/// Parts of the search, for who waits: for hands, for causes in coarse steps, for positions given these, for
/// causes in fine steps, and leading the cloth along the motion.
const HANDS: usize = grips::PASSES;
const ROUGH: usize = 2;
const POSITIONS: usize = 2;
const FINELY: usize = 2;
const REPLAY: usize = 2;
/// All of them.
pub const PARTS: usize = HANDS + ROUGH + POSITIONS + FINELY + REPLAY;

/// Causes that are found roughly: positions may be found anew given what these make, and they finely given those.
pub struct Begun<'a> {
    sheet: Sheet<'a>,
    /// What was known before, and who holds the cloth.
    known: Found,
    /// What makes the motion; `None` where the clip does not constrain it.
    rough: Option<Attempt>,
    /// What others would be that hold the cloth, and how likely, over what was found.
    others: Vec<(f64, Causes)>,
}

/// Begins to find what moves a sheet, the cloth of its template, along `found`, shape [N, V], `fps` frames per
/// second, with standard deviations `deviations`, shape [N, V] `[m]`; what is known of it beforehand is not
/// searched. Every frame is seen as the sheet's views say, shape `[N]`. `advance` hears how many of [`PARTS`] are
/// done.
pub fn begin<'a>(
    sheet: (&'a Mesh, &Known, &'a [Viewpoint]),
    found: &[Positions],
    deviations: Option<&[Vec<f64>]>,
    (fps, dynamics): (f64, &'a Dynamics),
    settings: &'a CauseSettings,
    advance: &mut dyn FnMut(usize),
) -> Begun<'a> {
    let sheet = Sheet::new(sheet, found, deviations, (fps, dynamics), settings);
    let coarse = sheet.task(found, &COARSE);
    let known = Found {
        causes: coarse.prior.mean.clone(),
        spread: sheet.spread,
        prior: sheet.spread,
        knots: coarse.knots,
        held: sheet.guess.held.clone(),
        rest_lengths: sheet.rest_lengths.clone(),
        misfit: 0.0,
        constraints: Constraints::default(),
    };
    let mut begun = Begun { sheet, known, rough: None, others: Vec::new() };
    if found.len() >= 3 {
        begun.rough = begun.search(found, advance);
    }
    begun
}

impl Begun<'_> {
    /// Who holds the cloth and what moves it, in coarse steps; `None` where the clip does not constrain it, or the
    /// cloth cannot be simulated.
    fn search(&mut self, found: &[Positions], advance: &mut dyn FnMut(usize)) -> Option<Attempt> {
        let (coarse, guess) = (self.sheet.task(found, &COARSE), &self.sheet.guess);
        let settings = self.sheet.settings;
        let mut start = (self.known.causes.clone(), Vec::new());
        if !guess.still && guess.told {
            let fit = |held: &[usize], near: Option<&Attempt>| {
                let (start, iterations) = match near {
                    None => ((&coarse.prior.mean, &[][..]), settings.iterations),
                    Some(near) => ((&near.causes, &near.steps[..]), settings.iterations.min(TRIED)),
                };
                coarse.search(held, start, |search| search.attempt(iterations))
            };
            let (best, tried) =
                grips::find(self.sheet.template, &guess.held, coarse.data.price(), fit, advance)?;
            let likelihood = |hold: &grips::Hold| (best.value - hold.value).exp();
            self.others = tried.iter().map(|hold| (likelihood(hold), hold.attempt.causes.clone())).collect();
            (self.known.held, start) = (best.held, (best.attempt.causes, best.attempt.steps));
        }
        advance(HANDS);
        let iterations = if guess.told { settings.iterations } else { 0 };
        let mut rough =
            coarse.search(&self.known.held, (&start.0, &start.1), |search| search.attempt(iterations))?;
        if guess.told {
            (self.known.held, rough) =
                pins(&coarse, &guess.wider, (self.known.held.clone(), rough), iterations);
        }
        advance(HANDS + ROUGH);
        self.known.misfit = rough.misfit.sqrt();
        (guess.told && self.known.misfit <= DOUBTED).then_some(rough)
    }

    /// The motion, shape [N, V], that the causes found so far make along `found`, shape [N, V] `[m]`; `None` where
    /// the clip does not constrain them, or the simulation loses the cloth.
    pub fn motion(&self, found: &[Positions]) -> Option<Vec<Positions>> {
        let Sheet { template, deviations, dynamics, settings, .. } = &self.sheet;
        let by = self.sheet.with(&self.known, self.rough.as_ref()?.causes.clone());
        let cut = cut_cloth(template, &by.rest_lengths);
        let guided = follow::roughly(&cut, dynamics, &by, (found, deviations), settings);
        (!follow::astray(&guided, found)).then_some(guided.frames)
    }

    /// The causes of the motion `found`, shape [N, V] `[m]`, that differs little from the one at the beginning.
    /// Where the clip does not constrain them, or the cloth cannot be simulated, the prior stays.
    pub fn finish(&self, found: &[Positions]) -> Found {
        let told = self.rough.as_ref().and_then(|rough| self.search_finely(rough, found));
        let out = told.unwrap_or_else(|| self.known.clone());
        self.sheet.with(&out, out.causes.clone())
    }

    fn search_finely(&self, rough: &Attempt, found: &[Positions]) -> Option<Found> {
        let sheet = &self.sheet;
        let (mut fine, coarse) = (sheet.task(found, &FINE), sheet.task(found, &COARSE));
        let whole = fine.substeps.is_multiple_of(coarse.substeps);
        let near = match whole {
            true => between(&fine.targets[0], &rough.steps, fine.substeps / coarse.substeps),
            false => Vec::new(),
        };
        // Where the model is off by more than the positions are, its errors are what data are uncertain by.
        let doubt = rough.misfit.max(1.0);
        fine.data.together *= doubt;
        let iterations = sheet.settings.iterations.min(FINISHING);
        let fit = fine.search(&self.known.held, (&rough.causes, &near), |search| search.run(iterations))?;
        let mut out = Found { misfit: fit.misfit.sqrt(), ..self.known.clone() };
        if out.misfit <= DOUBTED {
            // With other held vertices the sheet has other stiffnesses, and would make another motion.
            let others: Vec<(f64, Causes)> =
                self.others.iter().map(|(weight, other)| (weight.powf(1.0 / doubt), other.clone())).collect();
            out.spread = wider(&fit, &others);
            out.causes = fit.causes.clone();
            out.constraints = constraints(&fit, &out);
        }
        Some(out)
    }

    /// The causes as [`Self::finish`] finds them, and the forces that replay the motion `found`. `advance` hears
    /// how many of [`PARTS`] are done.
    pub fn explain(&self, found: &[Positions], advance: &mut dyn FnMut(usize)) -> Explanation {
        let Sheet { template, deviations, dynamics, settings, fps, .. } = &self.sheet;
        advance(HANDS + ROUGH + POSITIONS);
        let causes = self.finish(found);
        advance(PARTS - REPLAY);
        let cut = cut_cloth(template, &causes.rest_lengths);
        let (guided, parts, led) = follow::follow(&cut, dynamics, &causes, (found, deviations), settings);
        advance(PARTS);
        let parameters = Parameters::of_springs(causes.causes.log_stiffness(), guided.accelerations);
        // Compressed cloth may buckle another way than it was found, whatever the forces.
        let off = follow::beside(&guided.frames, found, deviations).filter(|_| guided.failure.is_none());
        let frames = if off.is_some() { found.to_vec() } else { guided.frames };
        let mut explained = Explained::new((&cut, template), causes, parts, (&frames, led), *fps);
        explained.sizes.replay = off.unwrap_or(0.0);
        Explanation { parameters, explained, frames, failure: guided.failure }
    }
}

/// What moves the cloth of a `sheet` along `found`: [`begin`], and [`Begun::finish`] of the same motion.
pub fn find(
    sheet: (&Mesh, &Known, &[Viewpoint]),
    found: &[Positions],
    deviations: Option<&[Vec<f64>]>,
    clock: (f64, &Dynamics),
    settings: &CauseSettings,
) -> Found {
    begin(sheet, found, deviations, clock, settings, &mut |_| ()).finish(found)
}

/// What holds the cloth of `task`, `held` or one of `wider`, and what moves it: more is held where `rough` does
/// not explain the motion and more gains more than it costs.
fn pins(
    task: &Task,
    wider: &[Vec<usize>],
    (mut held, mut rough): (Vec<usize>, Attempt),
    iterations: usize,
) -> (Vec<usize>, Attempt) {
    for more in wider {
        let price = task.data.price() * (more.len() - held.len()) as f64;
        if rough.misfit <= DOUBTED * DOUBTED || price >= rough.value {
            break;
        }
        let fit = |start: &Causes, near: &[Positions], iterations: usize| {
            task.search(more, (start, near), |search| search.attempt(iterations))
        };
        // What a pin that was not held makes of causes is no start.
        let tried = fit(&task.prior.mean, &rough.steps, iterations.min(TRIED));
        let gains = tried.filter(|tried| tried.value + price < rough.value);
        if let Some(found) = gains.and_then(|tried| fit(&tried.causes, &tried.steps, iterations)) {
            (held, rough) = (more.clone(), found);
        }
    }
    (held, rough)
}

/// Positions after every step, from those after steps `ratio` times as long that start from `first`.
fn between(first: &Positions, steps: &[Positions], ratio: usize) -> Vec<Positions> {
    let all: Vec<Positions> = std::iter::once(first).chain(steps).cloned().collect();
    interpolated(&all, ratio).split_off(1)
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

/// What the clip says of every number of `found`, whose causes are those of `fit`.
fn constraints(fit: &Fit, found: &Found) -> Constraints {
    let (sd, before) = (&found.spread, &found.prior);
    let of = |k: usize| {
        let cause = Cause::POSITIVE[k];
        let sds = match cause {
            Cause::Drag => [sd.ln_drag, before.ln_drag],
            Cause::Friction => [sd.ln_friction, before.ln_friction],
            _ => [sd.ln_stiffness[k], before.ln_stiffness[k]],
        };
        judge(&fit.profiles[k], sds, partner(&fit.matrix, cause, sds[1]))
    };
    let down = match Found::by_deviations(&found.causes, sd, before).down {
        // Gravity has no bounds; a direction that stands for something else is not traded off but wrong.
        Constraint::Unconstrained if !is_unlikely(&found.causes, before) => {
            let with = partner(&fit.matrix, Cause::Gravity, before.down);
            with.map_or(Constraint::Unconstrained, |with| Constraint::TradedOff { with })
        }
        word => word,
    };
    Constraints { stiffness: [of(0), of(1), of(2)], down, drag: of(3), friction: of(4) }
}

#[cfg(test)]
mod tests {
    use super::super::drive::Drive;
    use super::super::forces::Knots;
    use super::super::held::held_vertices;
    use super::super::task::{HOLD, KNOWN_TILT, ways};
    use super::*;
    use crate::motion::parameters::StiffnessRange;
    use glam::{DVec2, DVec3};
    use tessuto_core::camera::Camera;
    use tessuto_core::mesh::grid;
    use tessuto_sim::{Cloth, Integrator, StepSettings};

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
            model: tessuto_sim::Model::Springs,
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
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 1, height: 1 };
        let views = vec![Viewpoint::from(camera); 41];
        let corners = held_vertices(&mesh, (&[mesh.positions.clone()], &views), DVec3::Y).held;
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
        let known = Known::default();
        let sheet = (&mesh, &known, &views[..]);
        let found = find(sheet, &frames, Some(&deviations), (50.0, &dynamics), &settings);
        let sheet = Sheet::new(sheet, &frames, Some(&deviations), (50.0, &dynamics), &settings);
        let task = sheet.task(&frames, &COARSE);
        let by_one = task.search(&[0], (&task.prior.mean, &[]), |search| search.attempt(3)).unwrap();
        let misfit = by_one.misfit.sqrt();
        let (held, by_both) = pins(&task, std::slice::from_ref(&corners), (vec![0], by_one), 3);
        println!("held by one corner: misfit {misfit:.2}, by both: {:.2}", by_both.misfit.sqrt());
        assert!(misfit > DOUBTED && by_both.misfit.sqrt() < DOUBTED);
        assert_eq!(held, corners);
        let (held, _) = pins(&task, &[vec![0, 1, 6]], (held, by_both), 3);
        assert_eq!(held, corners, "what explains the motion stays");
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

        // The clip gives values of bend and shear; of stretch, which is not visible here, it gives none.
        println!("{:?}", found.constraints);
        let [stretch, bend, shear] = found.constraints.stiffness;
        assert_eq!([bend, shear, found.constraints.down], [Constraint::Constrained; 3]);
        let right = match stretch {
            Constraint::AtLeast { factor } => off(0) * factor <= 1.0,
            Constraint::TradedOff { .. } | Constraint::Unconstrained => true,
            Constraint::Constrained | Constraint::AtMost { .. } => false,
        };
        assert!(right, "{stretch:?}, {:.2} of the truth", off(0));

        // What is known is taken: gravity a little off, and held vertices that would not be guessed.
        let down = (truth.down + DVec3::new(0.02, 0.0, -0.01)).normalize();
        let known = Known { down: Some(down), held: Some(vec![0, 3, 6]), ..Known::default() };
        let brief = CauseSettings { iterations: 2, ..settings };
        let found = find((&mesh, &known, &views), &frames, Some(&deviations), (50.0, &dynamics), &brief);
        assert_eq!(found.held, [0, 3, 6]);
        assert!(found.prior.down <= KNOWN_TILT && found.causes.down.angle_between(down) < 3.0 * KNOWN_TILT);

        // Held by its lower corners no causes make it move like that, and nothing is reported as informed.
        let known = Known { held: Some(vec![42, 48]), ..Known::default() };
        let found = find((&mesh, &known, &views), &frames, Some(&deviations), (50.0, &dynamics), &brief);
        println!("held wrongly: misfit {:.2}", found.misfit);
        assert!(found.misfit > DOUBTED && found.spread == found.prior);
        assert_eq!(found.constraints, Constraints::default());
        let mut kept = found.causes.ln_stiffness.iter().zip([200f64, 1e-3, 1e-4]);
        assert!(kept.all(|(ln, start)| (ln - start.ln()).abs() < 1e-12));
        assert!(found.doubt().unwrap().to_string().contains("standard deviations off"));
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
        let fit = Fit { causes: a, spread, misfit: 1.0, profiles: Default::default(), matrix: Vec::new() };
        // As likely as what was found: half of the squares count.
        let out = wider(&fit, &[(1.0, b.clone())]);
        assert!((out.ln_stiffness[1] - 0.17f64.sqrt()).abs() < 1e-12);
        assert!((out.ln_drag - 0.97f64.sqrt()).abs() < 1e-12);
        let same = Spread { ln_stiffness: [0.5, out.ln_stiffness[1], 0.1], ln_drag: out.ln_drag, ..spread };
        assert_eq!(out, same);
    }
}
