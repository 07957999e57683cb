//! Layers that were found to pass through each other are put apart.
//!
//! The search knows no contact: where the sheet hides itself, what is behind may come out in front. In a run of
//! such frames the sheet is led on from the frame before, by springs to where it was found that are as firm as that is
//! certain, as a cloth whose layers touch: what the video shows stays, what is hidden gives way. A run is taken only
//! if it stays within what is known of the motion that was found: a sheet that was found on the wrong side of itself
//! cannot be led there, and stays as it is.

use glam::DVec3;
use rayon::prelude::*;

use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::{Mesh, Positions};

use super::ContactSettings;
use super::crossings::crossed_vertices;
use crate::{Cloth, Integrator, State, StepSettings, Stiffness, TiedCloth};

/// Stretch [N/m], bend and shear [J/rad²] of the cloth that is led: soft beside what leads it.
const STIFFNESS: [f64; 3] = [20.0, 1e-5, 1e-5];
/// A spring of this stiffness [N/m] leads a vertex whose deviation is [`CERTAIN`]; of others it goes by the square.
const FIRM: f64 = 100.0;
/// Deviation of what is certain `[m]`: no vertex counts as more so.
const CERTAIN: f64 = 1e-3;
/// Steps from frame to frame.
const STEPS: usize = 4;
/// A run is taken if it is within so many deviations of what was found, root mean square over every frame's vertices.
const WITHIN: f64 = 1.0;

/// The part of all vertices that belong to edges and triangles which pass through each other, in every frame of
/// `motion`, shape [N, V].
pub fn crossed(triangles: &[[u32; 3]], motion: &[Positions]) -> Vec<f64> {
    motion.par_iter().map(|x| crossed_vertices(triangles, x).len() as f64 / x.len().max(1) as f64).collect()
}

/// `frames`, shape [N, V], with their layers put apart where that stays within the `deviations` `[m]`, same shape.
/// Frames without crossings stay as they are, to the last bit.
pub fn put_apart(
    template: &Mesh,
    mut frames: Vec<Positions>,
    deviations: &[Vec<f64>],
    fps: f64,
) -> Vec<Positions> {
    let triangles = template.triangles();
    let crosses: Vec<bool> = crossed(&triangles, &frames).iter().map(|part| *part > 0.0).collect();
    let mut n = 1;
    while n < frames.len() {
        if !crosses[n] || crosses[n - 1] {
            n += 1;
            continue;
        }
        let end = (n..frames.len()).find(|k| !crosses[*k]).unwrap_or(frames.len());
        // What goes on after the run must be reached again.
        let last = (end + 1).min(frames.len());
        if let Ok(led) = lead(template, &frames[n - 1..last], &deviations[n - 1..last], fps) {
            let all = led.iter().zip(&frames[n..last]).zip(&deviations[n..last]);
            if all.clone().all(|((led, found), deviations)| off(led, found, deviations) < WITHIN) {
                let count = end - n;
                led.into_iter().take(count).zip(&mut frames[n..end]).for_each(|(led, x)| *x = led);
            }
        }
        n = end + 1;
    }
    frames
}

/// The cloth led from the first of `frames` through the others: its shapes there.
fn lead(template: &Mesh, frames: &[Positions], deviations: &[Vec<f64>], fps: f64) -> Result<Vec<Positions>> {
    let cloth = Cloth::new(template).with_contact(template, &ContactSettings::default())?;
    let stiffness = Stiffness::uniform(&cloth, STIFFNESS);
    let settings = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: 1.0 / (fps * STEPS as f64),
        // It follows, and does not swing on.
        damping: 0.0,
        tolerance: 1e-5,
        newton_limit: 50,
    };
    let mut scratch = Scratch::default();
    let still = vec![DVec3::ZERO; frames[0].len()];
    let mut state = State { x: frames[0].clone(), v: still };
    let mut led = Vec::new();
    for (pair, deviations) in frames.windows(2).zip(&deviations[1..]) {
        let ties: Vec<f64> = deviations.iter().map(|d| FIRM * (CERTAIN / d.max(CERTAIN)).powi(2)).collect();
        let tied = TiedCloth::new(&cloth, &ties, &settings);
        for k in 1..=STEPS {
            let part = k as f64 / STEPS as f64;
            let targets: Positions = pair[0].iter().zip(&pair[1]).map(|(a, b)| a.lerp(*b, part)).collect();
            state = tied.step(&stiffness, state, &targets, |_| DVec3::ZERO, &mut scratch)?.after;
        }
        led.push(state.x.clone());
    }
    Ok(led)
}

/// How many deviations two shapes are apart, root mean square.
fn off(a: &[DVec3], b: &[DVec3], deviations: &[f64]) -> f64 {
    let of = |((a, b), d): ((&DVec3, &DVec3), &f64)| a.distance_squared(*b) / d.max(CERTAIN).powi(2);
    let sum: f64 = a.iter().zip(b).zip(deviations).map(of).sum();
    (sum / a.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::mesh::grid;

    /// A sheet whose right part folds over to the left by `part` of half a turn.
    fn folding(mesh: &Mesh, part: f64) -> Positions {
        const R: f64 = 0.012;
        let of = |p: &DVec3| {
            let angle = ((p.x - 0.02) / R).clamp(0.0, part * std::f64::consts::PI);
            let beyond = (p.x - 0.02 - angle * R).max(0.0);
            let along = p.x.min(0.02) + R * angle.sin() + beyond * angle.cos();
            let lift = R * (1.0 - angle.cos()) + beyond * angle.sin();
            DVec3::new(along, p.y, p.z - lift)
        };
        mesh.positions.iter().map(of).collect()
    }

    #[test]
    fn a_hidden_layer_gives_way_and_what_does_not_cross_is_kept() {
        let mesh = grid(13, 9, DVec2::new(0.18, 0.12), 1.0);
        let triangles = mesh.triangles();
        let truth: Vec<Positions> = (0..=20).map(|n| folding(&mesh, f64::from(n) / 20.0)).collect();
        assert!(crossed(&triangles, &truth).iter().all(|part| *part == 0.0), "the truth does not cross");
        // The layer behind is found in front of the other one, for some frames.
        let hidden = |x: &DVec3| x.x > -0.02 && x.x < 0.01 && x.y.abs() < 0.04;
        let (mut frames, mut deviations) = (truth.clone(), vec![vec![1e-3; 117]; 21]);
        for n in 15..19 {
            for (v, p) in mesh.positions.iter().enumerate() {
                if hidden(p) {
                    frames[n][v].z -= 0.05;
                    deviations[n][v] = 0.05;
                }
            }
        }
        let before = crossed(&triangles, &frames);
        let apart = put_apart(&mesh, frames.clone(), &deviations, 30.0);
        let after = crossed(&triangles, &apart);
        let error = |frames: &[Positions]| {
            let all = frames.iter().zip(&truth).flat_map(|(a, b)| a.iter().zip(b));
            1e3 * all.map(|(a, b)| a.distance(*b)).sum::<f64>() / (21.0 * 117.0)
        };
        println!(
            "crossed {before:.2?}, then {after:.2?}; {:.2} mm, then {:.2}",
            error(&frames),
            error(&apart)
        );
        assert!(before[15..19].iter().all(|part| *part > 0.05) && after.iter().all(|part| *part == 0.0));
        assert!(error(&apart) < 0.8 * error(&frames));
        assert!((0..15).chain(19..21).all(|n| apart[n] == frames[n]), "the same bits where nothing crosses");
        // What is certain does not give way: the frames stay as they were found.
        let certain = vec![vec![1e-4; 117]; 21];
        assert!(put_apart(&mesh, frames.clone(), &certain, 30.0) == frames);
    }
}
