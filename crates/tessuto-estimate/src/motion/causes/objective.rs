//! How well a motion agrees with the found positions, and causes with what is known before; Gauss-Newton systems
//! of both.

use glam::DVec3;

use super::drive::Trajectory;
use super::forces::{Causes, FIRST, LENGTHS, Spread};
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::Positions;

/// Residuals beyond this many standard deviations count little.
const TAIL: f64 = 3.0;
/// Deviation across the view ray, as a fraction of that along it, which is nearly the whole.
const ACROSS: f64 = 0.2;
/// Least deviations along and across the view ray `[m]`: of the mesh as a model of the cloth.
const LEAST: [f64; 2] = [1e-3, 5e-4];
/// Spread of the logarithm of the panel's lengths: what the template's are off by as a whole.
pub(super) const LENGTH_SPREAD: f64 = 3e-3;
/// Time within which found positions err together `[s]`, and independent errors of the whole sheet at one time.
const MEMORY: f64 = 0.1;
const INDEPENDENT: f64 = 10.0;

/// Gradient and matrix.
pub struct System {
    pub gradient: Vec<f64>,
    pub matrix: Vec<Vec<f64>>,
}

impl System {
    pub fn zeros(unknowns: usize) -> Self {
        Self { gradient: vec![0.0; unknowns], matrix: vec![vec![0.0; unknowns]; unknowns] }
    }
}

/// The found positions as data.
pub struct Data<'a> {
    pub found: &'a [Positions],
    /// Standard deviation of every vertex, shape [N, V] `[m]`.
    pub deviations: &'a [Vec<f64>],
    /// How every frame is seen, shape `[N]`.
    pub views: &'a [Viewpoint],
    /// ν: numbers that err together.
    pub together: f64,
}

/// A vertex's residual and the weights of its parts along and across the ray [1/m²].
struct Residual {
    e: DVec3,
    ray: DVec3,
    along: f64,
    across: f64,
}

impl Residual {
    fn weighted(&self, v: DVec3) -> DVec3 {
        let part = v.dot(self.ray);
        v * self.across + self.ray * (part * (self.along - self.across))
    }
}

impl<'a> Data<'a> {
    /// Positions of a video of `fps` frames per second.
    pub fn new(found: &'a [Positions], deviations: &'a [Vec<f64>], views: &'a [Viewpoint], fps: f64) -> Self {
        let numbers = (3 * found[0].len() * (found.len() - 1)) as f64;
        let periods = ((found.len() - 1) as f64 / fps / MEMORY).max(1.0);
        Self { found, deviations, views, together: (numbers / (INDEPENDENT * periods)).max(1.0) }
    }

    /// The robust sum, where `each` gets frame, vertex and residual, weighted.
    fn sum(&self, frames: &[Positions], mut each: impl FnMut(usize, usize, &Residual)) -> f64 {
        let mut sum = 0.0;
        for n in 1..frames.len() {
            for (i, (x, found)) in frames[n].iter().zip(&self.found[n]).enumerate() {
                let sigma = self.deviations[n][i];
                let weight = |sigma: f64, least: f64| 1.0 / sigma.max(least).powi(2);
                let (along, across) = (weight(sigma, LEAST[0]), weight(ACROSS * sigma, LEAST[1]));
                let ray = self.views[n].direction(*found);
                let mut residual = Residual { e: *x - *found, ray, along, across };
                let relative = residual.e.dot(residual.weighted(residual.e)) / (TAIL * TAIL);
                sum += 0.5 * TAIL * TAIL * relative.ln_1p();
                let scale = 1.0 / ((1.0 + relative) * self.together);
                residual.along *= scale;
                residual.across *= scale;
                each(n, i, &residual);
            }
        }
        sum / self.together
    }

    pub fn value(&self, frames: &[Positions]) -> f64 {
        self.sum(frames, |_, _, _| ())
    }

    /// Mean square of the independent residuals: 1 where a model is as good as the positions are said to be.
    pub fn misfit(&self, frames: &[Positions]) -> f64 {
        let independent = (3 * frames[0].len() * (frames.len() - 1)) as f64 / self.together;
        2.0 * self.value(frames) / independent
    }

    /// What the path of a vertex that is held saves in the mean, by half an independent error a period.
    pub fn price(&self) -> f64 {
        let independent = (3 * self.found[0].len() * (self.found.len() - 1)) as f64 / self.together;
        0.5 * independent / INDEPENDENT
    }

    /// Adds the gradient at `frames`, shape [N, V], by derivatives of shape [N, unknowns, V].
    pub fn add_gradient(&self, frames: &[Positions], tangents: &[Vec<Positions>], gradient: &mut [f64]) {
        self.sum(frames, |n, i, residual| {
            let pull = residual.weighted(residual.e);
            gradient.iter_mut().zip(&tangents[n]).for_each(|(g, tangent)| *g += tangent[i].dot(pull));
        });
    }

    /// Adds gradient and Gauss-Newton matrix.
    pub fn add_system(&self, trajectory: &Trajectory, system: &mut System) {
        let unknowns = system.gradient.len();
        let mut rows = vec![DVec3::ZERO; unknowns];
        self.sum(&trajectory.frames, |n, i, residual| {
            let pull = residual.weighted(residual.e);
            rows.iter_mut().zip(&trajectory.tangents[n]).for_each(|(row, tangent)| *row = tangent[i]);
            for p in 0..unknowns {
                system.gradient[p] += rows[p].dot(pull);
                let weighted = residual.weighted(rows[p]);
                for q in 0..=p {
                    system.matrix[p][q] += weighted.dot(rows[q]);
                }
            }
        });
        for p in 0..unknowns {
            for q in 0..p {
                system.matrix[q][p] = system.matrix[p][q];
            }
        }
    }
}

/// What is known of causes before.
pub struct Prior {
    pub mean: Causes,
    pub spread: Spread,
    /// Spread of the wind in the first frame, later, and of its change from value to value [m/s].
    pub wind: [f64; 3],
}

impl Prior {
    /// The part of [`Self::value`] that is of one stiffness, the drag or the internal friction, by its place among
    /// the unknowns.
    pub fn own(&self, causes: &Causes, place: usize) -> f64 {
        let (off, spread) = match place {
            5 => (causes.ln_drag - self.mean.ln_drag, self.spread.ln_drag),
            6 => (causes.ln_friction - self.mean.ln_friction, self.spread.ln_friction),
            k => (causes.ln_stiffness[k] - self.mean.ln_stiffness[k], self.spread.ln_stiffness[k]),
        };
        0.5 * (off / spread).powi(2)
    }

    /// ½ Σ (r/spread)²; adds gradient and matrix to `system`.
    pub fn value(&self, causes: &Causes, mut system: Option<&mut System>) -> f64 {
        let mut sum = 0.0;
        let mut add = |terms: &[(usize, f64)], r: f64, spread: f64| {
            sum += 0.5 * (r / spread).powi(2);
            if let Some(system) = &mut system {
                let precision = 1.0 / (spread * spread);
                for (i, a) in terms {
                    system.gradient[*i] += a * r * precision;
                    terms.iter().for_each(|(j, b)| system.matrix[*i][*j] += a * b * precision);
                }
            }
        };
        for k in 0..3 {
            let off = causes.ln_stiffness[k] - self.mean.ln_stiffness[k];
            add(&[(k, 1.0)], off, self.spread.ln_stiffness[k]);
        }
        for (k, axis) in causes.across().iter().enumerate() {
            let angle = self.spread.down * std::f64::consts::FRAC_1_SQRT_2;
            // Turning towards the axis takes the mean away from it.
            add(&[(3 + k, -causes.down.dot(self.mean.down))], axis.dot(self.mean.down), angle);
        }
        add(&[(5, 1.0)], causes.ln_drag - self.mean.ln_drag, self.spread.ln_drag);
        add(&[(6, 1.0)], causes.ln_friction - self.mean.ln_friction, self.spread.ln_friction);
        (0..2).for_each(|k| add(&[(LENGTHS + k, 1.0)], causes.ln_length[k], LENGTH_SPREAD));
        let [first, later, change] = self.wind;
        for (n, w) in causes.wind.iter().enumerate() {
            for k in 0..3 {
                let at = FIRST + 3 * n + k;
                add(&[(at, 1.0)], w[k], if n == 0 { first } else { later });
                if n > 0 {
                    add(&[(at, 1.0), (at - 3, -1.0)], w[k] - causes.wind[n - 1][k], change);
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::{Camera, Pose};
    use tessuto_core::math::rng::Rng;

    #[test]
    fn gradients_are_differences_of_values() {
        let mut rng = Rng::new(6, 0);
        let mean = Causes {
            ln_stiffness: [5.0, -7.0, -9.0],
            down: DVec3::new(0.1, 0.9, -0.3).normalize(),
            ln_drag: 0.1,
            ln_friction: -8.0,
            ln_length: [0.0; 2],
            wind: vec![DVec3::ZERO; 3],
        };
        let spread = Spread { ln_stiffness: [0.5, 2.0, 1.5], down: 0.4, ln_drag: 0.7, ln_friction: 1.3 };
        let prior = Prior { mean: mean.clone(), spread, wind: [0.1, 1.0, 0.5] };
        let unknowns = mean.unknowns();
        let causes = mean.moved(&(0..unknowns).map(|_| 0.3 * rng.signed()).collect::<Vec<_>>());
        // Positions that depend on the unknowns linearly.
        let shape = |rng: &mut Rng| -> Positions { (0..4).map(|_| rng.vector() * 0.01 + DVec3::Z).collect() };
        let found: Vec<Positions> = (0..3).map(|_| shape(&mut rng)).collect();
        let deviations = vec![vec![4e-3, 1e-4, 9e-3, 2e-2]; 3];
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 1, height: 1 };
        let view = |pose| Viewpoint { camera, camera_from_world: pose };
        let views = [None, Some(Pose::random(&mut rng)), None].map(view);
        let data = Data::new(&found, &deviations, &views, 10.0);
        let frames: Vec<Positions> = (0..3).map(|_| shape(&mut rng)).collect();
        let tangents: Vec<Vec<Positions>> = (0..3)
            .map(|_| (0..unknowns).map(|_| (0..4).map(|_| rng.vector() * 0.01).collect()).collect())
            .collect();
        let at = |step: &[f64]| -> f64 {
            let moved: Vec<Positions> = (0..3)
                .map(|n| {
                    (0..4)
                        .map(|i| {
                            frames[n][i]
                                + step.iter().zip(&tangents[n]).map(|(s, t)| t[i] * *s).sum::<DVec3>()
                        })
                        .collect()
                })
                .collect();
            data.value(&moved) + prior.value(&causes.moved(step), None)
        };
        let mut system = System::zeros(unknowns);
        data.add_system(
            &Trajectory { frames: frames.clone(), tangents: tangents.clone(), steps: Vec::new() },
            &mut system,
        );
        let mut alone = vec![0.0; unknowns];
        data.add_gradient(&frames, &tangents, &mut alone);
        assert!(alone.iter().any(|g| g.abs() > 1e-2) && alone == system.gradient);
        prior.value(&causes, Some(&mut system));
        for place in [0, 1, 2, 5, 6] {
            let mut there = causes.clone();
            match place {
                5 => there.ln_drag = mean.ln_drag,
                6 => there.ln_friction = mean.ln_friction,
                k => there.ln_stiffness[k] = mean.ln_stiffness[k],
            }
            let own = prior.value(&causes, None) - prior.value(&there, None);
            assert!(own > 0.0 && (prior.own(&causes, place) - own).abs() < 1e-9, "{place}");
        }
        for _ in 0..3 {
            let direction: Vec<f64> = (0..unknowns).map(|_| rng.signed()).collect();
            let step = |s: f64| at(&direction.iter().map(|d| d * s).collect::<Vec<_>>());
            let difference = (step(1e-5) - step(-1e-5)) / 2e-5;
            let slope: f64 = system.gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
            assert!(
                slope.abs() > 1e-2 && (slope - difference).abs() < 1e-5 * slope.abs(),
                "{slope} {difference}"
            );
        }
    }
}
