//! Variances of the positions by samples of the posterior that Gauss and Newton's system describes.
//!
//! At its minimum E is about ½ xᵀ H x, and exp(−E) a normal distribution of covariance H⁻¹, H the matrix of the
//! joint system. H⁻¹ is dense and far too large; its diagonal is estimated from samples, by perturbing and solving
//! (Papandreou and Yuille 2010, "Gaussian Sampling by Local Perturbations"): for a right-hand side b of covariance
//! H, H⁻¹ b has the covariance H⁻¹. b is a sum over the parts of H, H = blocks of the frames + κ DᵀD: for each
//! frame a root of its matrix times normal noise ([`FrameFactor::sample`]), and √κ Dᵀ times normal noise.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use super::super::acceleration::second_differences_transposed;
use super::super::joint::JointSystem;
use crate::motion::terms::low_rank::FrameFactor;
use crate::session::{Epoch, Session, foreign_state, named};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Positions;

/// What every number of the diagonal of a frame's matrix is larger by when its root is taken [1/m²], as where the
/// video shows nothing of a frame the matrix has no root; ten times as much each time that this is not enough. The
/// samples are that much larger than H⁻¹ says where H is near singular: that of a vertex that nothing holds but
/// this would be 10 m.
const DIAGONAL: f64 = 0.01;
/// Attempts to take a root before a frame goes without noise.
const ATTEMPTS: usize = 12;

/// As [`super::super::joint`]'s own, but finer: what is largest in a sample, slow and smooth motions, is found last.
const CG_TOLERANCE: f64 = 1e-5;
const CG_LIMIT: usize = 80;

/// What is gone on from.
#[derive(Default, Serialize, Deserialize)]
struct Drawn {
    /// Samples so far.
    count: usize,
    /// Sum of their ‖x‖² `[m²]`, shape [N−1, V].
    squares: Vec<Vec<f64>>,
}

fn normals(rng: &mut Rng, count: usize) -> Positions {
    (0..count).map(|_| DVec3::new(rng.normal(), rng.normal(), rng.normal())).collect()
}

impl JointSystem<'_> {
    /// Mean of ‖x‖² `[m²]` over `count` samples x of covariance H⁻¹: estimates the trace of every vertex's
    /// covariance, with a relative standard error between √(2/(3 count)) and √(2/count). Shape [N−1, V].
    ///
    /// # Errors
    /// [`tessuto_core::Error::Input`] if it is to go on from a state that does not match; what the session's
    /// observer returns.
    pub fn variances(&self, count: usize, seed: u64, session: &mut Session) -> Result<Vec<Vec<f64>>> {
        let (frames, vertices) = (self.systems.len(), self.cloth.vertex_count());
        let start = || Drawn { count: 0, squares: vec![vec![0.0; vertices]; frames] };
        let mut drawn: Drawn = session.restore("deviation")?.unwrap_or_else(start);
        let matches = drawn.squares.len() == frames
            && drawn.squares.iter().flatten().all(|s| s.is_finite() && *s >= 0.0)
            && drawn.squares.iter().all(|s| s.len() == vertices)
            && drawn.count <= count;
        if !matches {
            return Err(foreign_state("deviation"));
        }
        if drawn.count < count && frames > 0 {
            let noise = self.noise(drawn.count..count, count, seed);
            let factors = self.factors();
            for rhs in &noise {
                let sample = self.solve_with(&factors, rhs, CG_TOLERANCE, CG_LIMIT);
                for (squares, x) in drawn.squares.iter_mut().zip(&sample) {
                    squares.iter_mut().zip(x).for_each(|(s, x)| *s += x.length_squared());
                }
                drawn.count += 1;
                let epoch = Epoch {
                    stage: "deviation".into(),
                    step: drawn.count,
                    of: count,
                    active_frames: frames + 1,
                    losses: named([]),
                    parameters: named([]),
                };
                session.step(&epoch, &[], Some(&drawn))?;
            }
        }
        session.finish("deviation", &drawn);
        let mean = |s: &f64| s / count.max(1) as f64;
        Ok(drawn.squares.iter().map(|of_frame| of_frame.iter().map(mean).collect()).collect())
    }

    /// Right-hand sides of covariance H: those numbered `wanted` of `count`. The random numbers of every one and
    /// of every frame are a stream of their own: the threads that draw them do not matter, nor which are wanted.
    fn noise(&self, wanted: std::ops::Range<usize>, count: usize, seed: u64) -> Vec<Vec<Positions>> {
        let (frames, vertices) = (self.systems.len(), self.cloth.vertex_count());
        let stream = |k: usize, part: usize| Rng::new(seed, (k * (frames + 1) + part) as u64);
        let own: Vec<Vec<Positions>> = parallel::map_with(frames, Scratch::default, |scratch, n| {
            let draw = |factor: &FrameFactor, k: usize| {
                let mut rng = stream(k, n + 1);
                let noise = normals(&mut rng, vertices);
                let low_rank = self.systems[n].low_rank.as_ref();
                factor.sample(self.cloth, low_rank, &noise, || rng.normal())
            };
            let mut diagonal = DIAGONAL;
            for _ in 0..ATTEMPTS {
                let factor = FrameFactor::new(self.cloth, &self.systems[n], diagonal, scratch);
                let drawn: Option<Vec<Positions>> = wanted.clone().map(|k| draw(&factor, k)).collect();
                factor.recycle(scratch);
                if let Some(drawn) = drawn {
                    return drawn;
                }
                diagonal *= 10.0;
            }
            vec![vec![DVec3::ZERO; vertices]; wanted.len()]
        });
        let root = self.kappa.sqrt();
        let whole = |(place, k): (usize, usize)| {
            let mut rng = stream(k, 0);
            let differences: Vec<Positions> =
                (0..frames.saturating_sub(1)).map(|_| normals(&mut rng, vertices)).collect();
            let bent = second_differences_transposed(&differences, [frames + 1, vertices]);
            let of_frame = |(bent, own): (&Positions, &Vec<Positions>)| {
                bent.iter().zip(&own[place]).map(|(b, o)| *b * root + *o).collect()
            };
            bent[1..].iter().zip(&own).map(of_frame).collect()
        };
        debug_assert!(wanted.end <= count);
        wanted.enumerate().map(whole).collect()
    }
}
