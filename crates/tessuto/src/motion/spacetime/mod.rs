//! All frames at once: the shapes that explain the video with the least strain and acceleration.
//!
//! Unknowns are the positions x_n of every vertex in every frame n ≥ 1. The objective is
//!
//!   Σ_n [ data_n(x_n) + E(x_n) ] + ½ Σ_n κ ‖x_{n+1} − 2 x_n + x_{n−1}‖²,
//!
//! with the elastic energy E of the cloth under prior stiffnesses. It is minimised by Gauss-Newton with
//! Levenberg's damping; the linear systems, block-tridiagonal up to the acceleration term, by conjugate
//! gradients preconditioned with the Cholesky factor of every frame.

mod settings;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::observed::Observed;
use super::observed::samples::{EdgePoint, boundary_points, interior_points};
use super::terms::colour::{DataTerm, Local, Points, Reference, fit_gain};
use super::terms::signed_bend::SignedBendPrior;
use super::terms::strain::StrainPrior;
use crate::error::{Error, Result};
use crate::math::block_matrix::BlockMatrix;
use crate::math::dot;
use crate::math::factor::{Factor, Scratch};
use crate::mesh::Positions;
use crate::scene::Scene;
use crate::session::{Epoch, Session, foreign_state, named};
use crate::sim::{Cloth, HessianKind, Stiffness};
pub use settings::SpacetimeSettings;

/// Shapes [N, V], and why they are not better if the search failed.
pub type Fitted = (Vec<Positions>, Option<Error>);

/// What [`Problem::track`] goes on from.
#[derive(Serialize, Deserialize)]
struct Tracked {
    /// Shapes so far.
    frames: Vec<Positions>,
    /// Brightness of the last of them, by resolution.
    gains: Vec<Vec<[f32; 3]>>,
}

/// What [`Problem::refine`] goes on from.
#[derive(Serialize, Deserialize)]
struct Refined {
    frames: Vec<Positions>,
    /// Iterations so far, over all levels.
    steps: usize,
    damping: f64,
    /// Brightness at the present level.
    gains: Vec<Vec<[f32; 3]>>,
}

/// Everything about the clip that stays fixed.
pub struct Problem<'a> {
    scene: &'a Scene,
    cloth: &'a Cloth,
    settings: SpacetimeSettings,
    /// Stiffness of the elastic prior.
    prior: Stiffness,
    strain: StrainPrior,
    curvature: SignedBendPrior,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<Vec<u32>>,
    boundary: Vec<EdgePoint>,
    observed: Observed,
}

/// State of the search at one resolution.
struct Stage<'p, 'a> {
    problem: &'p Problem<'a>,
    level: usize,
    points: Points<'p>,
    reference: Reference,
    /// Brightness, shape [N, V, 3].
    gains: Vec<Vec<[f32; 3]>>,
    /// What the neighbouring frames show at the surface points, shape [N]; empty while not known.
    neighbours: Vec<Reference>,
    /// No change of brightness, shape [V, 3].
    no_gain: Vec<[f32; 3]>,
}

/// Gauss-Newton system of one frame.
struct System {
    value: f64,
    gradient: Positions,
    matrix: BlockMatrix,
}

impl<'a> Problem<'a> {
    /// Looks at every frame.
    ///
    /// # Errors
    /// Those of reading the frames.
    pub fn new(scene: &'a Scene, cloth: &'a Cloth, settings: SpacetimeSettings) -> Result<Self> {
        let prior = Stiffness::uniform(cloth, [0.0, settings.bend.powi(-2), settings.shear.powi(-2)]);
        let template = &scene.template;
        Ok(Self {
            scene,
            cloth,
            prior,
            strain: StrainPrior { sigma: settings.strain, tail: settings.tail },
            curvature: SignedBendPrior::new(
                cloth,
                &template.triangles(),
                &template.positions,
                settings.signed_bend,
                settings.tail,
            ),
            triangles: template.triangles(),
            neighbours: template.neighbours(),
            boundary: boundary_points(template, &template.positions, &scene.camera, 4.0),
            observed: Observed::new(scene, [settings.finest, settings.coarsest])?,
            settings,
        })
    }

    /// Whether shapes and brightnesses have this cloth's vertices.
    fn fit(&self, frames: &[Positions], gains: &[Vec<[f32; 3]>]) -> bool {
        let count = self.cloth.vertex_count();
        frames.iter().all(|x| x.len() == count && x.iter().all(|p| p.is_finite()))
            && gains.iter().all(|g| g.len() == count)
    }

    fn stage(&self, level: usize) -> Stage<'_, 'a> {
        let template = &self.scene.template;
        let camera = &self.observed.levels[0][level].camera;
        let points = interior_points(template, &template.positions, camera, 1.0);
        let points = Points::new(&self.triangles, points, &self.boundary);
        let gains = vec![vec![[1.0; 3]; template.positions.len()]; self.scene.frames.len()];
        let mut stage = Stage {
            problem: self,
            level,
            points,
            reference: Vec::new(),
            neighbours: vec![Vec::new(); gains.len()],
            no_gain: gains[0].clone(),
            gains,
        };
        stage.reference = stage.data(0).observe(&stage.points, None, &template.positions);
        stage
    }

    /// Follows the fabric frame by frame, coarse to fine, each frame starting from its predecessors.
    ///
    /// If a frame's objective is no longer finite, the last good shape is held from there on and the failure is
    /// returned with it.
    ///
    /// # Errors
    /// [`Error::Input`] if it is to go on from a state that does not fit; what the session's observer returns.
    pub fn track(&self, session: &mut Session) -> Result<Fitted> {
        let mut stages: Vec<_> = self.observed.coarse_to_fine().map(|level| self.stage(level)).collect();
        let mut tracked = session.restore("track")?.unwrap_or_else(|| Tracked {
            frames: vec![self.scene.template.positions.clone()],
            gains: stages.iter().map(|stage| stage.gains[0].clone()).collect(),
        });
        let fits = tracked.frames.len() <= self.scene.frames.len()
            && tracked.gains.len() == stages.len()
            && self.fit(&tracked.frames, &tracked.gains);
        if tracked.frames.is_empty() || !fits {
            return Err(foreign_state("track"));
        }
        let mut scratch = Scratch::default();
        for n in tracked.frames.len()..self.scene.frames.len() {
            let frames = &mut tracked.frames;
            let last = &frames[n - 1];
            let predicted: Positions = match n.checked_sub(2) {
                Some(k) => last.iter().zip(&frames[k]).map(|(x, old)| *x + (*x - *old) * 0.9).collect(),
                None => last.clone(),
            };
            let mut x = predicted.clone();
            let mut value = 0.0;
            for (stage, gains) in stages.iter_mut().zip(&mut tracked.gains) {
                stage.gains[n].clone_from(gains);
                stage.neighbours[n] = stage.data(n - 1).observe(&stage.points, None, last);
                (x, value) = match stage.fit_frame(n, x, &predicted, &mut scratch) {
                    Ok(fitted) => fitted,
                    Err(failure) => {
                        let held = frames[n - 1].clone();
                        frames.resize(self.scene.frames.len(), held);
                        return Ok((tracked.frames, Some(failure)));
                    }
                };
                gains.clone_from(&stage.gains[n]);
                stage.neighbours[n] = Vec::new();
            }
            frames.push(x);
            let epoch = Epoch {
                stage: "track".into(),
                step: n,
                of: self.scene.frames.len() - 1,
                active_frames: n + 1,
                losses: named([("total", value)]),
                parameters: Vec::new(),
            };
            session.step(&epoch, &tracked.frames, Some(&tracked))?;
        }
        session.finish("track", &tracked);
        Ok((tracked.frames, None))
    }

    /// Improves all frames together, coarse to fine.
    ///
    /// If the objective is no longer finite, the shapes before that are returned with the failure.
    ///
    /// # Errors
    /// What the session's observer returns.
    pub fn refine(&self, frames: Vec<Positions>, session: &mut Session) -> Result<Fitted> {
        let levels = self.observed.coarse_to_fine().count();
        let start = || Refined { frames, steps: 0, damping: 0.0, gains: Vec::new() };
        let mut refined: Refined = session.restore("refine")?.unwrap_or_else(start);
        let iterations = self.settings.iterations;
        let count = self.scene.frames.len();
        let started = !refined.steps.is_multiple_of(iterations.max(1));
        let gains = refined.gains.len() == count || (!started && refined.gains.is_empty());
        if refined.frames.len() != count || !gains || !self.fit(&refined.frames, &refined.gains) {
            return Err(foreign_state("refine"));
        }
        for (k, level) in self.observed.coarse_to_fine().enumerate() {
            if refined.steps >= (k + 1) * iterations {
                continue;
            }
            let mut stage = self.stage(level);
            let first = refined.steps - k * iterations;
            match first {
                0 => refined.damping = 1e-3,
                _ => stage.gains = std::mem::take(&mut refined.gains),
            }
            for iteration in first..iterations {
                stage.update_gains(&refined.frames);
                stage.update_neighbours(&refined.frames);
                let (next, value, accepted) = stage.joint_step(&refined.frames, refined.damping);
                if !value.is_finite() {
                    let failure = diverged(format!("level {level}, iteration {iteration}"), value);
                    return Ok((refined.frames, Some(failure)));
                }
                refined.steps += 1;
                let epoch = Epoch {
                    stage: "refine".into(),
                    step: refined.steps,
                    of: levels * iterations,
                    active_frames: refined.frames.len(),
                    losses: named(std::iter::once(("total", value)).chain(stage.terms(&refined.frames))),
                    parameters: named([("level", level as f64)]),
                };
                let damping = refined.damping;
                refined.damping = if accepted { f64::max(damping * 0.3, 1e-6) } else { damping * 8.0 };
                if accepted {
                    refined.frames = next;
                }
                refined.gains.clone_from(&stage.gains);
                session.step(&epoch, &refined.frames, Some(&refined))?;
            }
        }
        session.finish("refine", &refined);
        Ok((refined.frames, None))
    }
}

fn diverged(place: String, value: f64) -> Error {
    Error::numerical(
        format!("trajectory, {place}"),
        format!("objective {value}"),
        "check camera and template with `tessuto check`",
    )
}

impl Stage<'_, '_> {
    fn data(&self, frame: usize) -> DataTerm<'_> {
        let p = self.problem;
        let s = &p.settings;
        DataTerm {
            level: &p.observed.levels[frame][self.level],
            scale: (1 << self.level) as f64,
            outline: &p.observed.outlines[frame],
            camera: &p.scene.camera,
            colour_sigma: s.colour,
            outline_sigma: s.outline,
            colour_weight: 1.0 / (s.colour * s.colour * s.colour_area),
            outline_weight: 1.0 / (s.outline * s.outline * s.outline_length),
        }
    }

    /// Data term and elastic energy of one frame with their Gauss-Newton system.
    fn linearise(&self, frame: usize, x: &[DVec3]) -> System {
        let cloth = self.problem.cloth;
        let data = self.data(frame);
        let mut matrix = BlockMatrix::zeros(&cloth.pattern);
        let mut gradient = vec![DVec3::ZERO; x.len()];
        let mut value = self.prior_value(x);
        self.problem.strain.add_system(cloth, x, &mut gradient, &mut matrix);
        self.problem.curvature.add_system(cloth, x, &mut gradient, &mut matrix);
        cloth.add_gradient(&self.problem.prior, x, 1.0, &mut gradient);
        let scratch = &mut Scratch::default();
        cloth.add_hessian(&self.problem.prior, x, HessianKind::GaussNewton, 1.0, &mut matrix, scratch);
        let colour = self.colour(frame, x);
        for ((local, corners), pairs) in colour.iter().zip(&self.problem.triangles).zip(&cloth.triangle_pairs)
        {
            value += local.value;
            for k in 0..3 {
                gradient[corners[k] as usize] += local.gradient[k];
                matrix.add_diagonal(&cloth.pattern, corners[k] as usize, &local.blocks[k]);
                matrix.add_pair(&cloth.pattern, pairs[k], &local.blocks[3 + k]);
            }
        }
        for (local, point) in data.outline(&self.points, x).iter().zip(&self.problem.boundary) {
            value += local.value;
            for k in 0..2 {
                gradient[point.vertices[k] as usize] += local.gradient[k];
                matrix.add_diagonal(&cloth.pattern, point.vertices[k] as usize, &local.blocks[k]);
            }
            let pair = cloth.edge_pair(point.vertices);
            matrix.add_pair(&cloth.pattern, pair, &local.blocks[2]);
        }
        System { value, gradient, matrix }
    }

    /// Colour term of every triangle: against the first frame, and against the neighbouring frames.
    fn colour(&self, frame: usize, x: &[DVec3]) -> Vec<Local<3, 6>> {
        let mut data = self.data(frame);
        let mut colour = data.colour(&self.points, &self.reference, &self.gains[frame], None, x);
        let neighbours = &self.neighbours[frame];
        if !neighbours.is_empty() {
            data.colour_weight *= self.problem.settings.neighbour_weight;
            let other = data.colour(&self.points, neighbours, &self.no_gain, None, x);
            colour.iter_mut().zip(&other).for_each(|(a, b)| a.add(b));
        }
        colour
    }

    /// Mean of what the frames before and after show at their present shapes.
    fn update_neighbours(&mut self, frames: &[Positions]) {
        if self.problem.settings.neighbour_weight == 0.0 {
            return;
        }
        self.neighbours.clear();
        let observed: Vec<Reference> =
            frames.par_iter().enumerate().map(|(n, x)| self.data(n).observe(&self.points, None, x)).collect();
        let mean = |a: &Option<[f32; 3]>, b: &Option<[f32; 3]>| match (a, b) {
            (Some(a), Some(b)) => Some([0, 1, 2].map(|k| 0.5 * (a[k] + b[k]))),
            (a, b) => a.or(*b),
        };
        self.neighbours = (0..frames.len())
            .map(|n| {
                let before = &observed[n.saturating_sub(1)];
                let after = &observed[(n + 1).min(frames.len() - 1)];
                match n + 1 == frames.len() {
                    true => before.clone(),
                    false => before.iter().zip(after).map(|(a, b)| mean(a, b)).collect(),
                }
            })
            .collect();
    }

    fn prior_value(&self, x: &[DVec3]) -> f64 {
        let p = self.problem;
        p.cloth.energy(&p.prior, x).total() + p.strain.value(p.cloth, x) + p.curvature.value(p.cloth, x)
    }

    fn value(&self, frame: usize, x: &[DVec3]) -> f64 {
        let data = self.data(frame);
        let colour = self.colour(frame, x);
        let outline = data.outline(&self.points, x);
        self.prior_value(x)
            + colour.iter().map(|l| l.value).sum::<f64>()
            + outline.iter().map(|l| l.value).sum::<f64>()
    }

    /// The objective by terms, summed over the frames.
    fn terms(&self, frames: &[Positions]) -> Vec<(&'static str, f64)> {
        let p = self.problem;
        let of = |(n, x): (usize, &Positions)| {
            let energy = p.cloth.energy(&p.prior, x);
            let colour: f64 = self.colour(n, x).iter().map(|l| l.value).sum();
            let outline: f64 = self.data(n).outline(&self.points, x).iter().map(|l| l.value).sum();
            let strain = p.strain.value(p.cloth, x);
            [colour, outline, strain, energy.bend, energy.shear, p.curvature.value(p.cloth, x)]
        };
        let per_frame: Vec<[f64; 6]> = frames.par_iter().enumerate().skip(1).map(of).collect();
        let names = ["colour", "outline", "strain", "bend", "shear", "curvature"];
        let sum = |k: usize| per_frame.iter().map(|f| f[k]).sum::<f64>();
        let mut terms: Vec<_> = names.iter().enumerate().map(|(k, name)| (*name, sum(k))).collect();
        terms.push(("acceleration", self.acceleration_value(frames)));
        terms
    }

    fn update_gain(&mut self, frame: usize, x: &[DVec3]) {
        let mut gain = std::mem::take(&mut self.gains[frame]);
        self.fit_gain(frame, x, &mut gain);
        self.gains[frame] = gain;
    }

    fn fit_gain(&self, frame: usize, x: &[DVec3], gain: &mut [[f32; 3]]) {
        let s = &self.problem.settings;
        let observed = self.data(frame).observe(&self.points, None, x);
        fit_gain(
            &self.points,
            &self.problem.neighbours,
            &self.reference,
            &observed,
            s.gain_smoothness,
            s.colour,
            gain,
        );
    }

    fn update_gains(&mut self, frames: &[Positions]) {
        let mut gains = std::mem::take(&mut self.gains);
        gains.par_iter_mut().zip(frames).enumerate().skip(1).for_each(|(n, (gain, x))| {
            self.fit_gain(n, x, gain);
        });
        self.gains = gains;
    }

    /// κ of the acceleration term.
    fn kappa(&self) -> f64 {
        self.problem.settings.acceleration.powi(-2)
    }

    /// Fits one frame with a pull towards its prediction.
    fn fit_frame(
        &mut self,
        frame: usize,
        mut x: Positions,
        predicted: &[DVec3],
        scratch: &mut Scratch,
    ) -> Result<(Positions, f64)> {
        let cloth = self.problem.cloth;
        let kappa = self.kappa();
        let prior = |x: &[DVec3]| -> f64 {
            0.5 * kappa * x.iter().zip(predicted).map(|(x, p)| (*x - *p).length_squared()).sum::<f64>()
        };
        let ones = vec![1.0; x.len()];
        let (mut damping, mut value) = (1e-3, f64::INFINITY);
        for _ in 0..self.problem.settings.iterations.min(8) {
            self.update_gain(frame, &x);
            let system = self.linearise(frame, &x);
            value = system.value + prior(&x);
            if !value.is_finite() {
                return Err(diverged(format!("frame {frame}"), value));
            }
            let gradient: Positions =
                (0..x.len()).map(|i| system.gradient[i] + (x[i] - predicted[i]) * kappa).collect();
            for _ in 0..6 {
                let mut matrix = system.matrix.clone();
                matrix.add_masses(&cloth.pattern, &ones, kappa * (1.0 + damping));
                let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
                let step = cloth.analysis.solve(&cloth.pattern, &factor, &gradient, scratch);
                scratch.recycle(factor);
                let next: Positions = x.iter().zip(&step).map(|(x, s)| *x - *s).collect();
                let next_value = self.value(frame, &next) + prior(&next);
                if next_value <= value {
                    let moved = step.iter().fold(0.0, |m: f64, s| m.max(s.length()));
                    (x, value, damping) = (next, next_value, damping * 0.3);
                    if moved < 2e-5 {
                        return Ok((x, value));
                    }
                    break;
                }
                damping = (damping * 10.0).max(1e-2);
            }
        }
        Ok((x, value))
    }

    /// Sum of squared second differences times ½ κ.
    fn acceleration_value(&self, frames: &[Positions]) -> f64 {
        let sum: f64 = second_differences(frames).iter().map(|a| dot(a, a)).sum();
        0.5 * self.kappa() * sum
    }

    /// One damped Gauss-Newton step on all frames: (new frames, old objective, whether it helps).
    fn joint_step(&self, frames: &[Positions], damping: f64) -> (Vec<Positions>, f64, bool) {
        let cloth = self.problem.cloth;
        let kappa = self.kappa();
        let systems: Vec<System> =
            frames.par_iter().enumerate().skip(1).map(|(n, x)| self.linearise(n, x)).collect();
        let value = systems.iter().map(|s| s.value).sum::<f64>() + self.acceleration_value(frames);
        let bent = second_differences_transposed(&second_differences(frames), frames.len());
        let gradient: Vec<Positions> = systems
            .iter()
            .zip(&bent[1..])
            .map(|(s, b)| s.gradient.iter().zip(b).map(|(g, b)| *g + *b * kappa).collect())
            .collect();
        let ones = vec![1.0; cloth.vertex_count()];
        let factors: Vec<Factor> = systems
            .par_iter()
            .map_init(Scratch::default, |scratch, s| {
                let mut matrix = s.matrix.clone();
                matrix.add_masses(&cloth.pattern, &ones, kappa * (6.0 + damping));
                cloth.analysis.factorize(&cloth.pattern, &matrix, scratch)
            })
            .collect();
        let step = self.conjugate_gradients(&systems, &factors, &gradient, damping);
        let mut next = frames.to_vec();
        for (x, s) in next[1..].iter_mut().zip(&step) {
            x.iter_mut().zip(s).for_each(|(x, s)| *x -= *s);
        }
        let next_value =
            next.par_iter().enumerate().skip(1).map(|(n, x)| self.value(n, x)).collect::<Vec<_>>();
        let next_value = next_value.iter().sum::<f64>() + self.acceleration_value(&next);
        (next, value, next_value <= value)
    }

    /// Solves (H + κ DᵀD + κ·damping) s = gradient over the frames 1…N−1.
    fn conjugate_gradients(
        &self,
        systems: &[System],
        factors: &[Factor],
        gradient: &[Positions],
        damping: f64,
    ) -> Vec<Positions> {
        let cloth = self.problem.cloth;
        let kappa = self.kappa();
        let multiply = |p: &[Positions]| -> Vec<Positions> {
            let mut padded = vec![vec![DVec3::ZERO; cloth.vertex_count()]];
            padded.extend_from_slice(p);
            let bent = second_differences_transposed(&second_differences(&padded), padded.len());
            (0..p.len())
                .into_par_iter()
                .map(|n| {
                    let mut out = systems[n].matrix.multiply(&cloth.pattern, &p[n]);
                    for (i, out) in out.iter_mut().enumerate() {
                        *out += (bent[n + 1][i] + p[n][i] * damping) * kappa;
                    }
                    out
                })
                .collect()
        };
        let precondition = |r: &[Positions]| -> Vec<Positions> {
            r.par_iter()
                .zip(factors)
                .map_init(Scratch::default, |scratch, (r, f)| {
                    cloth.analysis.solve(&cloth.pattern, f, r, scratch)
                })
                .collect()
        };
        let product = |a: &[Positions], b: &[Positions]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f64>();
        let axpy = |y: &mut [Positions], s: f64, x: &[Positions]| {
            for (y, x) in y.iter_mut().zip(x) {
                y.iter_mut().zip(x).for_each(|(y, x)| *y += *x * s);
            }
        };
        let mut x: Vec<Positions> = vec![vec![DVec3::ZERO; cloth.vertex_count()]; gradient.len()];
        let mut r = gradient.to_vec();
        let mut z = precondition(&r);
        let mut p = z.clone();
        let mut rz = product(&r, &z);
        let target = rz * 1e-4;
        for _ in 0..60 {
            if rz <= target {
                break;
            }
            let ap = multiply(&p);
            let alpha = rz / product(&p, &ap);
            axpy(&mut x, alpha, &p);
            axpy(&mut r, -alpha, &ap);
            z = precondition(&r);
            let next = product(&r, &z);
            let beta = next / rz;
            rz = next;
            for (p, z) in p.iter_mut().zip(&z) {
                p.iter_mut().zip(z).for_each(|(p, z)| *p = *z + *p * beta);
            }
        }
        x
    }
}

/// x_{n+1} − 2 x_n + x_{n−1} for n = 1 … N−2, shape [N−2, V].
fn second_differences(frames: &[Positions]) -> Vec<Positions> {
    let of = |w: &[Positions]| (0..w[0].len()).map(|i| w[2][i] - w[1][i] * 2.0 + w[0][i]).collect();
    frames.windows(3).map(of).collect()
}

/// Transpose of [`second_differences`], shape [N, V].
fn second_differences_transposed(differences: &[Positions], frame_count: usize) -> Vec<Positions> {
    let vertex_count = differences.first().map_or(0, Vec::len);
    let mut out = vec![vec![DVec3::ZERO; vertex_count]; frame_count];
    for (n, a) in differences.iter().enumerate() {
        for (i, a) in a.iter().enumerate() {
            out[n][i] += *a;
            out[n + 1][i] -= *a * 2.0;
            out[n + 2][i] += *a;
        }
    }
    out
}
