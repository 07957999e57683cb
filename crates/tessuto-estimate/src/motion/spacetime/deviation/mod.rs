//! How far the found positions may be off: a standard deviation for every vertex in every frame.
//!
//! Gauss and Newton's system, whose minimum the search has found, says how firmly terms and video hold every
//! vertex: g_nv², the trace of a vertex's block of H⁻¹ (`sampling.rs`). Alone it says tenths of a millimetre where
//! the error is several millimetres: E takes the errors of its terms for independent, but a sheet whose folds are
//! finer than the mesh is shortened everywhere, and a search that has slipped sits in a minimum as deep as any. So
//! g is scaled by what can be seen of that, the misfits of each frame (`misfit.rs`):
//!
//!   σ_nv² = (g_nv/ḡ_n) ā_n² + (h ℓ_nv)² + s_nv² + c², a_n = 5.4 f ⁵√(o_n² d_n² b_n q_n), b_n = ḡ_n √χ²_n, h =
//!   0.35, c = 0.1 mm,
//!
//! with ḡ_n² the mean of g_nv² over the frame's vertices and the first factor scaled to a mean of 1: the geometric
//! mean of all that shows where the error is large, each by about what it shows. ā is the mean of a over five
//! frames, weights 1 2 3 2 1: errors last longer than what shows them.
//!
//! - o: distance of the boundary to the mask's outline `[m]`.
//! - d: mean distance `[m]` between the positions that tracking found, those that the final ones started from, and
//!   the final ones: two searches that agree where both are right.
//! - b: the deviations of Gauss and Newton, times the root of strain's and shear's energy per vertex. The usual
//!   posterior scale, where χ² per degree of freedom shows that the residuals are larger or smaller than the
//!   spreads say: paper keeps lengths and angles far better than the spreads ask, crumpled cloth worse, and depth
//!   follows from them. χ² is at least 0.1.
//! - q: what part of the texture's contrast the colours do not follow.
//! - f = (V/200)^0.3 of a sheet of V vertices, 1 from 200 on: what a coarse mesh cannot follow between its
//!   vertices is in all of these, and in no vertex's error.
//! - ℓ: distance along the edges, in the first frame, from a vertex that the sheet itself hides to the nearest one
//!   that is seen `[m]`. Nothing holds what is hidden but the fold that leads there, about which it may turn: h is
//!   an angle `[rad]`.
//! - s: how far the motions that contend with what was found ([`refine`](Problem::refine)) are from it, the lower
//!   median of them; zero where one motion alone is left. Where searches end in minima of which now one is deeper
//!   and now another, none shows how far off it is.
//! - The pattern over the sheet is the root of g's own, half of it in logarithms, as no more of it can be found in
//!   the errors.
//!
//! The factor is such that more than nine of ten true vertices lie within 2 σ. Where form and factor come from,
//! and how far they hold: `docs/experiments/log/deviation.md`. No truth is used here.

mod misfit;
mod sampling;

use glam::DVec3;
use tessuto_core::parallel;

use self::misfit::Misfit;
use super::best_path::Pool;
use super::gain::GAIN_FITS;
use super::joint::JointSystem;
use super::{LevelSearch, Problem};
use crate::motion::terms::FrameSystem;
use crate::session::Session;
use tessuto_core::error::Result;
use tessuto_core::mesh::Positions;

/// Samples of the posterior.
const SAMPLES: usize = 16;
/// Factor of the geometric mean.
const FACTOR: f64 = 5.4;
/// A mesh of this many vertices is fine, and the power of their fraction of it by which coarser ones count.
const FINE: usize = 200;
const COARSE_POWER: f64 = 0.3;
/// Frames to either side over which the size of the deviations is averaged.
const REACH: usize = 2;
/// Least misfit to the priors: a sheet that keeps all lengths and angles may have slipped all the same.
const PRIOR_FLOOR: f64 = 0.1;
/// Least deviation, and what is added to the distance between tracked and final positions `[m]`.
const FLOOR: f64 = 1e-4;
const AGREEMENT_FLOOR: f64 = 5e-5;

/// h, see the module `[rad]`.
const HINGE: f64 = 0.35;

impl Problem<'_> {
    /// Standard deviation `[m]` of every vertex of `frames`, which [`refine`](Self::refine) made of the `pool`:
    /// square root of the trace of its 3×3 covariance. Shape [N, V]; zero in frame 0, which is given.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] if it is to go on from a state that does not match; what the session's
    /// observer returns.
    ///
    /// # Panics
    /// If the best path of the pool has another shape than `frames`.
    pub fn deviations(
        &self,
        frames: &[Positions],
        pool: &Pool,
        seed: u64,
        session: &mut Session,
    ) -> Result<Vec<Vec<f64>>> {
        let (cloth, tracked) = (self.cloth, &pool.best);
        assert!(tracked.len() == frames.len(), "one shape for each frame");
        let mut search = self.at_level(0);
        search.still = self.still_vertices(tracked);
        search.asked = self.asked(frames);
        search.loosen([1.0; 2], 1.0);
        (0..GAIN_FITS).for_each(|_| search.update_references(frames));
        let linearise = |(n, x): (usize, &Positions)| search.terms(n).linearise(cloth, x).1;
        let systems: Vec<FrameSystem> = parallel::later(frames, linearise);
        let joint = JointSystem { cloth, systems: &systems, kappa: self.acceleration_weight(), lambda: 0.0 };
        let variances = joint.variances(SAMPLES, seed, session)?;
        let pooled = averaged(&variances, &self.adjacency);
        let misfits: Vec<Misfit> = parallel::later(frames, |(n, x)| search.misfit(n, x));
        let of_frame = |(n, (variances, misfit)): (usize, (&Vec<f64>, &Misfit))| {
            let (found, tracked) = (&frames[n + 1], &tracked[n + 1]);
            let apart = found.iter().zip(tracked).map(|(a, b)| a.distance(*b)).sum::<f64>();
            fineness(found.len()) * size(mean(variances), misfit, apart / found.len().max(1) as f64)
        };
        let sizes: Vec<f64> = pooled.iter().zip(&misfits).enumerate().map(of_frame).collect();
        let of_frame = |(n, (variances, size)): (usize, (&Vec<f64>, f64))| {
            let behind = self.behind(&search, n + 1);
            let apart = apart_from_others(frames, &pool.motions, n + 1);
            let own = spread(variances, size).into_iter().zip(behind).zip(apart);
            own.map(|((own, behind), apart)| own.hypot(HINGE * behind).hypot(apart)).collect()
        };
        let mut out = vec![vec![0.0; cloth.vertex_count()]];
        out.extend(pooled.iter().zip(lasting(&sizes)).enumerate().map(of_frame));
        Ok(out)
    }

    /// ℓ of every vertex of a `frame` that `search` has seen, see the module.
    fn behind(&self, search: &LevelSearch, frame: usize) -> Vec<f64> {
        let mut seen = vec![false; self.cloth.vertex_count()];
        for look in &search.looks {
            // Points around every vertex, hidden ones and all.
            let mut around = vec![[0_usize; 2]; seen.len()];
            for (point, hidden) in look.samples.points.iter().zip(&look.occlusions[frame].hidden) {
                for v in look.samples.triangles[point.triangle as usize] {
                    around[v as usize][0] += usize::from(*hidden);
                    around[v as usize][1] += 1;
                }
            }
            seen.iter_mut().zip(around).for_each(|(seen, [hidden, all])| *seen |= 2 * hidden <= all);
        }
        distances(&seen, &self.adjacency, &self.scene.template.positions)
    }
}

/// Distance of every vertex along the edges of the mesh at `x` to the nearest one of `from`; zero if there is none.
fn distances(from: &[bool], adjacency: &[Vec<u32>], x: &[DVec3]) -> Vec<f64> {
    if !from.contains(&true) {
        return vec![0.0; x.len()];
    }
    let mut distances: Vec<f64> = from.iter().map(|f| if *f { 0.0 } else { f64::INFINITY }).collect();
    // Few vertices are hidden, and few edges behind others.
    let mut changed = true;
    while changed {
        changed = false;
        for v in 0..x.len() {
            let through = |&w: &u32| distances[w as usize] + x[v].distance(x[w as usize]);
            let nearest = adjacency[v].iter().map(through).fold(distances[v], f64::min);
            changed |= nearest < distances[v];
            distances[v] = nearest;
        }
    }
    distances.iter().map(|d| if d.is_finite() { *d } else { 0.0 }).collect()
}

/// s of every vertex of a frame, see the module.
fn apart_from_others(frames: &[Positions], motions: &[Vec<Positions>], frame: usize) -> Vec<f64> {
    let of_vertex = |v: usize| {
        let mut apart: Vec<f64> = motions.iter().map(|m| m[frame][v].distance(frames[frame][v])).collect();
        apart.sort_unstable_by(f64::total_cmp);
        if apart.len() > 1 { apart[(apart.len() - 1) / 2] } else { 0.0 }
    };
    (0..frames[frame].len()).map(of_vertex).collect()
}

/// f of a sheet of this many `vertices`, see the module.
fn fineness(vertices: usize) -> f64 {
    (vertices.min(FINE) as f64 / FINE as f64).powf(COARSE_POWER)
}

/// a of a frame over f, see the module; `variance` is ḡ², `apart` is d.
fn size(variance: f64, misfit: &Misfit, apart: f64) -> f64 {
    let posterior = (misfit.prior.max(PRIOR_FLOOR) * variance).sqrt();
    let squares = (misfit.outline * (apart + AGREEMENT_FLOOR)).powi(2);
    FACTOR * (squares * posterior * misfit.texture).powf(0.2)
}

/// ā of every frame, see the module; of fewer frames at the ends.
fn lasting(sizes: &[f64]) -> Vec<f64> {
    let over_time = |n: usize| {
        let window = n.saturating_sub(REACH)..(n + REACH + 1).min(sizes.len());
        let weights = window.clone().map(|k| (1 + REACH - k.abs_diff(n)) as f64);
        let sum: f64 = weights.clone().zip(&sizes[window]).map(|(w, size)| w * size).sum();
        sum / weights.sum::<f64>()
    };
    (0..sizes.len()).map(over_time).collect()
}

/// σ of every vertex of a frame, see the module; `variances` are g², `size` is ā.
fn spread(variances: &[f64], size: f64) -> Vec<f64> {
    // Without any variance, all vertices are alike.
    let mean_root = variances.iter().map(|g| g.sqrt()).sum::<f64>() / variances.len().max(1) as f64;
    let pattern = |g: f64| if mean_root > 0.0 { g.sqrt() / mean_root } else { 1.0 };
    variances.iter().map(|g| (pattern(*g) * size * size + FLOOR * FLOOR).sqrt()).collect()
}

fn mean(variances: &[f64]) -> f64 {
    variances.iter().sum::<f64>() / variances.len().max(1) as f64
}

/// Every variance averaged with those of its neighbours in the mesh and then with those of the same vertex in the
/// frames before and after, which smooth sheets and motions share: lowers the sampling noise. Shape [N−1, V].
fn averaged(variances: &[Vec<f64>], adjacency: &[Vec<u32>]) -> Vec<Vec<f64>> {
    let over_mesh = |of_frame: &Vec<f64>| -> Vec<f64> {
        let around = |(own, around): (&f64, &Vec<u32>)| {
            (own + around.iter().map(|&v| of_frame[v as usize]).sum::<f64>()) / (1 + around.len()) as f64
        };
        of_frame.iter().zip(adjacency).map(around).collect()
    };
    let smooth: Vec<Vec<f64>> = variances.iter().map(over_mesh).collect();
    let over_time = |n: usize| {
        let window = &smooth[n.saturating_sub(1)..(n + 2).min(smooth.len())];
        let mean = |v: usize| window.iter().map(|frame| frame[v]).sum::<f64>() / window.len() as f64;
        (0..smooth[n].len()).map(mean).collect()
    };
    (0..smooth.len()).map(over_time).collect()
}

#[cfg(test)]
pub(super) mod tests;
