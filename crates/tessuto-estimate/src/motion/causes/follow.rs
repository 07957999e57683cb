//! Accelerations that lead a cloth along found positions.
//!
//! Found positions are off by a millimetre in directions in which springs hardly give, and to hold a cloth there
//! takes hundreds of m/s², which are no cause of the motion. So what no cause explains has two parts. The residual
//! leads a cloth whose held vertices follow their paths by what its springs would not take up: where the sheet
//! gives way. The motion that it makes is not the one that was found, but beside it wherever the sheet is stiff.
//! The correction is all else that ties to the found positions take: with it the forces lead where the motion was
//! found, and without it to what the causes and the residual make.

use glam::DVec3;

use super::guide::{Guide, Guided, guide};
use super::parts::{air, held_ties};
use super::{CauseSettings, Found, Parts};
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use tessuto_core::mesh::Positions;
use tessuto_sim::{Cloth, State};

/// Strength of the ties of held vertices [1/s²]: the whole weight that hangs from two corners takes them 0.1 mm
/// from their paths.
const HELD: f64 = 1e8;

/// Strength of the ties of all vertices [1/s²]: that of a spring of 1000 N/m on a vertex of 0.03 g. A thousand
/// m/s² take them 0.03 mm from their places.
const FIRM: f64 = 4e7;
/// A cloth is lost that is this fraction of its size, the diagonal of the box around it, from where it should be,
/// root mean square.
const ASTRAY: f64 = 0.02;

/// Mean deviation of positions that pull as [`CauseSettings::tracking`] says `[m]`.
const USUAL: f64 = 5e-3;
/// Least one that counts `[m]`: of the mesh as a model of the cloth.
const LEAST: f64 = 5e-4;

/// Accelerations that lead `cloth` along `frames`, shape [N, V], known up to `deviations`, shape [N, V] `[m]`, the
/// parts they are of, and the motion without the correction, shape [N, V]. A cloth that so gentle a lead loses, or
/// whose simulation fails, leaves all to the residual: what holds it there says little of causes, but its shape is
/// sound; its motion without the correction is then the one with it.
pub fn follow(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    (frames, deviations): (&[Positions], &[Vec<f64>]),
    settings: &CauseSettings,
) -> (Guided, Parts, Vec<Positions>) {
    let paths = interpolated(frames, dynamics.substeps);
    let mut ties = held_ties(cloth, found, HELD);
    ties.iter_mut().for_each(|tie| *tie = tie.max(FIRM));
    let (tied, led) = rayon::join(
        || tied_along(cloth, dynamics, found, &paths, (&ties, 0.0), true),
        || lead_along(cloth, dynamics, found, &paths, strength(deviations, settings), false),
    );
    let mut parts = Parts::of(&tied, found, dynamics.substeps);
    if astray(&led, frames) {
        let same = tied.frames.clone();
        return (tied, parts, same);
    }
    parts.leave(Parts::of(&led, found, dynamics.substeps).residual);
    (tied, parts, led.frames)
}

/// The motion of [`follow`], without the accelerations that make it.
pub(super) fn roughly(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    (frames, deviations): (&[Positions], &[Vec<f64>]),
    settings: &CauseSettings,
) -> Guided {
    let lead = strength(deviations, settings);
    lead_along(cloth, dynamics, found, &interpolated(frames, dynamics.substeps), lead, false)
}

/// Strength of the lead along positions known up to `deviations` [1/s²]: the more sure a position is, the more its
/// weight against what no cause explains.
fn strength(deviations: &[Vec<f64>], settings: &CauseSettings) -> f64 {
    // The first frame is the template's.
    let [sum, count] = deviations[1..]
        .iter()
        .fold([0.0; 2], |[sum, count], of| [sum + of.iter().sum::<f64>(), count + of.len() as f64]);
    let sure = USUAL / (sum / count.max(1.0)).max(LEAST);
    settings.tracking * sure * sure
}

/// Whether the cloth is lost on its way along `frames`, shape [N, V] `[m]`.
pub(super) fn astray(guided: &Guided, frames: &[Positions]) -> bool {
    let [low, high] = [DVec3::min as fn(DVec3, DVec3) -> DVec3, DVec3::max]
        .map(|of| frames[0].iter().copied().reduce(of).unwrap_or_default());
    let limit = (ASTRAY * low.distance(high)).powi(2) * frames[0].len() as f64;
    let squares = |(a, b): (&Positions, &Positions)| -> f64 {
        a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum()
    };
    guided.failure.is_some() || guided.frames.iter().zip(frames).any(|pair| squares(pair) > limit)
}

/// Largest distance of a `made` motion from the `found` one, both [N, V] `[m]`, if any vertex is farther from it
/// than its deviation, shape [N, V] `[m]`: it is another motion then than the one that was found, as far as that
/// is known.
pub(super) fn beside(made: &[Positions], found: &[Positions], deviations: &[Vec<f64>]) -> Option<f64> {
    let pairs = made.iter().flatten().zip(found.iter().flatten()).zip(deviations.iter().flatten());
    let (mut largest, mut known) = (0.0, true);
    for ((made, found), deviation) in pairs {
        let off = made.distance(*found);
        largest = f64::max(largest, off);
        known &= off <= *deviation;
    }
    (!known).then_some(largest)
}

/// Leads `cloth`, moved by what was `found`, along `paths`, one shape per step, by a lead of strength `lead`
/// [1/s²]; as [`Guide::exact`] says.
pub(super) fn lead_along(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    paths: &[Positions],
    lead: f64,
    exact: bool,
) -> Guided {
    tied_along(cloth, dynamics, found, paths, (&held_ties(cloth, found, HELD), lead), exact)
}

/// [`lead_along`] with `ties` of every vertex [1/s²] beside the lead.
fn tied_along(
    cloth: &Cloth,
    dynamics: &Dynamics,
    found: &Found,
    paths: &[Positions],
    (ties, lead): (&[f64], f64),
    exact: bool,
) -> Guided {
    let h = dynamics.step.step;
    let outer = |k: usize, state: &State| air(cloth, found, [1.0; 2], (k + 1) as f64 * h, state, h);
    guide(&Guide {
        cloth,
        dynamics,
        stiffness: found.causes.stiffness(),
        ties,
        lead,
        targets: &paths.iter().collect::<Vec<_>>(),
        constant: found.causes.gravity(),
        friction: found.causes.friction(),
        exact,
        known: &[],
        outer: &outer,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::causes::{Causes, Constraints, Knots, Spread};
    use crate::motion::parameters::StiffnessRange;
    use glam::DVec2;
    use tessuto_core::mesh::{Mesh, grid};
    use tessuto_sim::{Integrator, Model, StepSettings};

    /// A sheet in folds that hangs from two corners.
    fn hanging() -> (Mesh, Cloth, Dynamics, Found) {
        let mut mesh = grid(7, 7, DVec2::splat(0.4), 1.0);
        mesh.positions.iter_mut().for_each(|p| p.z = 0.02 * (25.0 * p.x).sin());
        let cloth = Cloth::flat(&mesh, 0.05);
        let step = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: 2.5e-3,
            damping: 1.0,
            tolerance: 1e-7,
            newton_limit: 50,
        };
        let range = StiffnessRange { start: 0.0, low: -9.0, high: 9.0 };
        let dynamics = Dynamics { step, substeps: 8, model: Model::Springs, stiffness: vec![range; 3] };
        let spread = Spread { ln_stiffness: [0.5; 3], down: 0.1, ln_drag: 0.5, ln_friction: 1.0 };
        let found = Found {
            causes: Causes {
                ln_stiffness: [400f64.ln(), 1e-4f64.ln(), 3e-4f64.ln()],
                down: DVec3::new(0.1, 0.97, 0.2).normalize(),
                ln_drag: 0.2,
                ln_friction: 1e-5f64.ln(),
                ln_length: [0.0; 2],
                wind: vec![DVec3::ZERO, DVec3::Z],
            },
            spread,
            prior: spread,
            knots: Knots { count: 2, end: 0.4 },
            held: vec![0, 6],
            rest_lengths: cloth.edges.iter().map(|e| e.rest_length).collect(),
            misfit: 1.0,
            constraints: Constraints::default(),
        };
        (mesh, cloth, dynamics, found)
    }

    #[test]
    fn what_causes_make_leaves_little_and_so_does_a_stretch_that_springs_resist() {
        let (mesh, cloth, dynamics, found) = hanging();
        let step = dynamics.step;
        let h = step.step;
        let resting = vec![&mesh.positions; 161];
        let outer = |k: usize, state: &State| air(&cloth, &found, [1.0; 2], (k + 1) as f64 * h, state, h);
        let truth = guide(&Guide {
            cloth: &cloth,
            dynamics: &dynamics,
            stiffness: found.causes.stiffness(),
            ties: &held_ties(&cloth, &found, 1e9),
            lead: 0.0,
            targets: &resting,
            constant: found.causes.gravity(),
            friction: found.causes.friction(),
            exact: false,
            known: &[],
            outer: &outer,
        });
        assert!(truth.failure.is_none());
        let size = |fields: &[Positions]| {
            let all: Vec<f64> = fields.iter().flatten().map(|a| a.length_squared()).collect();
            (all.iter().sum::<f64>() / all.len() as f64).sqrt()
        };
        let second = |x: &[Positions]| -> Positions {
            (0..49).map(|i| (x[2][i] - x[1][i] * 2.0 + x[0][i]) * 2500.0).collect()
        };
        let motion = size(&truth.frames.windows(3).map(second).collect::<Vec<_>>());
        let deviations = vec![vec![4e-3; 49]; 21];
        let settings = CauseSettings::default();
        let lead = |frames: &[Positions]| {
            let (guided, parts, led) = follow(&cloth, &dynamics, &found, (frames, &deviations), &settings);
            assert!(guided.failure.is_none());
            let off =
                |frame: &dyn Fn(usize) -> Vec<f64>| (0..frames.len()).flat_map(frame).fold(0.0, f64::max);
            let apart = |a: &Positions, b: &Positions| a.iter().zip(b).map(|(a, b)| a.distance(*b)).collect();
            let told = off(&|n| apart(&guided.frames[n], &frames[n]));
            let beside = off(&|n| apart(&led[n], &frames[n]));
            assert!(told < 1e-4, "the forces lead where the motion was found: {told} m");
            let held = off(&|n| [0, 6].map(|v: usize| led[n][v].distance(frames[n][v])).to_vec());
            (size(&parts.residual), size(&parts.correction), beside, held)
        };
        let (left, corrected, off, held) = lead(&truth.frames);
        println!(
            "motion {motion:.2} m/s²; left {left:.4}, corrected {corrected:.4} m/s², off {:.3}, held {:.4} mm",
            1e3 * off,
            1e3 * held
        );
        // Between frames the places to reach are interpolated, and the sheet falls from rest: that much is not of
        // its causes.
        assert!(motion > 2.0 && left < 0.25 * motion && off < 1e-3 && held < 2e-4);

        // 2 mm too long below the held border in all frames but the first, as no spring would be.
        let mut long = truth.frames.clone();
        let top = mesh.positions[0].y;
        for x in &mut long[1..] {
            x.iter_mut().for_each(|x| x.y = top + (x.y - top) * 1.005);
        }
        let (stretched, corrected, off, _) = lead(&long);
        println!(
            "left {stretched:.4}, corrected {corrected:.1} m/s² of positions that are stretched; off {off:.4} m"
        );
        assert!(stretched < motion && corrected > 10.0 * stretched, "what is stiff is corrected");
        assert!(off > 1e-4, "without the correction springs shorten the sheet again");
    }

    #[test]
    fn a_motion_farther_from_what_was_found_than_that_is_known_is_another_one() {
        let found = vec![vec![DVec3::ZERO; 3]; 4];
        let mut deviations = vec![vec![1e-3; 3]; 4];
        deviations[0] = vec![0.0; 3];
        let off = |by: f64| {
            let mut made = found.clone();
            made[2][1].z = by;
            beside(&made, &found, &deviations)
        };
        assert_eq!([off(0.0), off(0.9e-3), off(1.1e-3)], [None, None, Some(1.1e-3)]);
    }

    #[test]
    fn a_cloth_that_the_lead_loses_is_tied_to_its_places() {
        let (mesh, cloth, dynamics, found) = hanging();
        // Nothing holds it, and it stays where it is.
        let found = Found { held: Vec::new(), ..found };
        let frames = vec![mesh.positions.clone(); 11];
        let deviations = vec![vec![4e-3; 49]; 11];
        let weak = CauseSettings { tracking: 1e-3, ..CauseSettings::default() };
        let lead = strength(&deviations, &weak);
        let paths = interpolated(&frames, dynamics.substeps);
        let fallen = lead_along(&cloth, &dynamics, &found, &paths, lead, true);
        let off = |guided: &Guided| {
            let off = guided.frames[10].iter().zip(&frames[10]).map(|(a, b)| a.distance(*b));
            off.fold(0.0, f64::max)
        };
        let (guided, parts, same) = follow(&cloth, &dynamics, &found, (&frames, &deviations), &weak);
        println!("led: off by {:.3} m, tied: by {:.6} m", off(&fallen), off(&guided));
        assert!(same == guided.frames && parts.correction.iter().flatten().all(|a| *a == DVec3::ZERO));
        assert!(off(&fallen) > 0.1 && astray(&fallen, &frames));
        assert!(guided.failure.is_none() && off(&guided) < 1e-4 && !astray(&guided, &frames));
        let pull = parts.residual[5].iter().map(|r| r.y).sum::<f64>() / 49.0;
        assert!(pull < -5.0, "what bears its weight is not explained: {pull} m/s²");
    }
}
