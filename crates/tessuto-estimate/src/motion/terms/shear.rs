//! Prior on shear: smooth over the sheet except at a few folds.
//!
//! Woven cloth shears easily where a hand pulls it askew, and then the whole sheet does; paper and what hangs
//! straight hardly do. A field of smooth modes over the texture coordinates takes up the sheet's own shear, and
//! only what departs from it is resisted, with heavy tails:
//!
//!   E = min_m Σ_i ½ τ² ln(1 + (r_i/τ)²) + ½ |m|²/σ_m²,  r_i = (θ_i − θ0_i − b_i·m)/σ,
//!
//! over the shearing pairs i, with the angle θ of `sim::angle`, θ0 that of the template and b_i the change of the
//! angle under the shears 1, p, q, p q, where p and q run over [−1, 1] along the texture's axes; a sheet that
//! hands shear has a field of more modes, of which these four say hardly the half. They count at the pair's middle
//! vertex, so that what changes from one cell to the next is resisted as well. m is found with the positions: in
//! the second-order system it is eliminated (a Schur complement, [`LowRank`]).

use std::sync::Arc;

use glam::{DVec2, DVec3};
use tessuto_core::parallel;

use super::low_rank::LowRank;
use super::robust::cauchy;
use super::{FrameSystem, Term};
use tessuto_core::math::root::Root;
use tessuto_core::mesh::{Mesh, Positions, SEAM, vertex_uvs};
use tessuto_sim::angle;
use tessuto_sim::cloth::{AngleSpring, Cloth, arms};

/// Number of modes of a sheet that hardly shears.
pub const FEW: usize = 4;
/// Number of modes along each axis of a sheet that shears as a whole.
const ALONG: usize = 6;
/// Number of all of them.
pub const MANY: usize = ALONG * ALONG;
/// Steps of the search for m, and the change `[rad]` that ends it.
const STEPS: usize = 60;
const SETTLED: f64 = 1e-8;

/// See the module.
#[derive(Clone)]
pub struct Shear<'a> {
    cloth: &'a Cloth,
    /// Modes at every vertex, shape [V, MANY]; zero where the texture has seams: all shear is resisted then.
    modes: Arc<Vec<f64>>,
    /// Change of every pair's angle under a shear of 1.
    responses: Arc<Vec<f64>>,
    /// Spread σ of the departure from the modes `[rad]`.
    pub sigma: f64,
    /// Number τ of spreads beyond which a departure is resisted less and less.
    pub tail: f64,
    /// Spread σ_m of the modes `[rad]`.
    pub smooth: f64,
    /// Number of modes in use.
    pub rank: usize,
}

/// The modes m that explain the angles less those of the template, with the weights of the rest.
struct Fit {
    m: Vec<f64>,
    /// What they leave of the angles.
    rest: Vec<f64>,
    value: f64,
    /// Weight/σ² of every pair.
    weights: Vec<f64>,
    /// Second derivative by m at these weights, its lower half.
    curvature: Vec<f64>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<'a> Shear<'a> {
    /// Of the cloth that is at rest in the shape of `template`; the numbers are σ, τ, σ_m. Few modes are in use.
    pub fn new(cloth: &'a Cloth, template: &Mesh, [sigma, tail, smooth]: [f64; 3]) -> Self {
        let (modes, responses) = match vertex_uvs(template, SEAM) {
            Some(uvs) => {
                let arms = |spring: &AngleSpring| response(spring.vertices.map(|v| uvs[v as usize]));
                (uvs.iter().flat_map(|uv| modes(*uv)).collect(), cloth.shears.iter().map(arms).collect())
            }
            None => (vec![0.0; MANY * template.positions.len()], vec![0.0; cloth.shears.len()]),
        };
        let (modes, responses) = (Arc::new(modes), Arc::new(responses));
        Self { cloth, modes, responses, sigma, tail, smooth, rank: FEW }
    }

    /// Every pair's middle vertex, and its response.
    fn pairs(&self) -> impl Iterator<Item = (usize, f64)> {
        let middle = |spring: &AngleSpring| spring.vertices[1] as usize;
        self.cloth.shears.iter().map(middle).zip(self.responses.iter().copied())
    }

    /// The modes in use at every vertex.
    fn modes_in_use(&self) -> impl Iterator<Item = &[f64]> {
        self.modes.chunks_exact(MANY).map(|b| &b[..self.rank])
    }

    /// The lower half of Σ w b bᵀ + 1/σ_m², and Σ w b d.
    fn normal_equations(&self, weights: &[f64], angles: &[f64]) -> (Vec<f64>, Vec<f64>) {
        // All pairs around a vertex have the same modes.
        let mut sums = vec![[0.0; 2]; self.cloth.vertex_count()];
        for (((v, response), w), d) in self.pairs().zip(weights).zip(angles) {
            let [square, product] = &mut sums[v];
            *square += w * response * response;
            *product += w * response * d;
        }
        let (mut matrix, mut rhs) = (vec![0.0; self.rank * self.rank], vec![0.0; self.rank]);
        (0..self.rank).for_each(|k| matrix[k * (self.rank + 1)] = self.smooth.powi(-2));
        for (b, [square, product]) in self.modes_in_use().zip(&sums) {
            for (j, row) in matrix.chunks_exact_mut(self.rank).enumerate() {
                let scale = square * b[j];
                row[..=j].iter_mut().zip(b).for_each(|(c, b)| *c += scale * b);
            }
            rhs.iter_mut().zip(b).for_each(|(r, b)| *r += product * b);
        }
        (matrix, rhs)
    }

    /// What the modes `m` make of every pair's angle.
    fn explained(&self, m: &[f64]) -> Vec<f64> {
        let shears: Vec<f64> = self.modes_in_use().map(|b| dot(b, m)).collect();
        self.pairs().map(|(v, response)| response * shears[v]).collect()
    }

    /// The best m, by reweighted least squares from the unweighted ones.
    fn fit(&self, x: &[DVec3]) -> Fit {
        let change = |spring: &AngleSpring| {
            let [u, w] = arms(x, spring.vertices);
            angle::angle(u, w) - spring.rest_angle
        };
        let angles: Vec<f64> = self.cloth.shears.iter().map(change).collect();
        let scale = self.sigma.powi(-2);
        let mut fit = Fit {
            weights: vec![scale; angles.len()],
            m: vec![0.0; self.rank],
            rest: angles.clone(),
            value: 0.0,
            curvature: Vec::new(),
        };
        for _ in 0..STEPS {
            let (matrix, rhs) = self.normal_equations(&fit.weights, &angles);
            let m = Root::of(&matrix, self.rank).solve(&rhs);
            let moved = m.iter().zip(&fit.m).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            fit.value = 0.5 * dot(&m, &m) / (self.smooth * self.smooth);
            for ((rest, d), part) in fit.rest.iter_mut().zip(&angles).zip(self.explained(&m)) {
                *rest = d - part;
            }
            for (rest, w) in fit.rest.iter().zip(&mut fit.weights) {
                let (rho, weight) = cauchy(rest / self.sigma, self.tail);
                fit.value += rho;
                *w = weight * scale;
            }
            fit.m = m;
            if moved < SETTLED {
                break;
            }
        }
        fit.curvature = self.normal_equations(&fit.weights, &angles).0;
        fit
    }
}

/// Change of the angle between a − o and c − o under a shear of 1, given the texture coordinates of a, o, c.
fn response([a, o, c]: [DVec2; 3]) -> f64 {
    let (p, q) = (a - o, c - o);
    // A shear γ turns a direction at the angle φ by ½ γ cos 2φ.
    let turn = |v: DVec2| 0.5 * (v.x * v.x - v.y * v.y) / v.length_squared().max(f64::MIN_POSITIVE);
    (turn(p) - turn(q)) * p.perp_dot(q).signum()
}

/// Products of Legendre's polynomials of p and q at the texture coordinates `uv`, those of low degree first.
fn modes(uv: DVec2) -> Vec<f64> {
    let at = uv * 2.0 - 1.0;
    let legendre = |x: f64| {
        let mut out = [1.0; ALONG];
        out[1] = x;
        (1..ALONG - 1).for_each(|n| {
            let k = n as f64;
            out[n + 1] = ((2.0 * k + 1.0) * x * out[n] - k * out[n - 1]) / (k + 1.0);
        });
        out
    };
    let [of_p, of_q] = [at.x, at.y].map(legendre);
    let mut pairs: Vec<[usize; 2]> = (0..MANY).map(|k| [k / ALONG, k % ALONG]).collect();
    pairs.sort_by_key(|[i, j]| (i.max(j) > &1, i + j, *j));
    pairs.iter().map(|[i, j]| of_p[*i] * of_q[*j]).collect()
}

impl Shear<'_> {
    /// Root mean square of the first FEW modes m over `frames` `[rad]`.
    pub fn smooth_shear(&self, frames: &[Positions]) -> f64 {
        let squares: Vec<f64> = parallel::over(frames, |x| self.fit(x).m[..FEW].iter().map(|m| m * m).sum());
        (squares.iter().sum::<f64>() / (FEW * frames.len().max(1)) as f64).sqrt()
    }
}

impl Term for Shear<'_> {
    fn name(&self) -> &'static str {
        "shear"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.fit(x).value
    }

    /// The matrix is that of Gauss and Newton; what m takes off it is the system's part of low rank.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let fit = self.fit(x);
        let mut columns = vec![vec![DVec3::ZERO; x.len()]; self.rank];
        let pairs = self.cloth.shears.iter().zip(self.pairs()).zip(fit.rest.iter().zip(&fit.weights));
        for ((spring, (v, response)), (rest, weight)) in pairs {
            let [u, w] = arms(x, spring.vertices);
            // ∂θ/∂(u, w): the gradient of ½ (θ − θ')² at θ' = θ − 1.
            let slope = angle::gradient(u, w, 1.0, angle::angle(u, w) - 1.0);
            spring.scatter(slope.map(|g| g * (weight * rest)), &mut system.gradient);
            for (b, column) in self.modes[v * MANY..].iter().zip(&mut columns) {
                spring.scatter(slope.map(|g| g * (weight * response * b)), column);
            }
            let h = angle::hessian_gauss_newton(u, w, *weight, spring.rest_angle);
            spring.scatter_hessian(&h, &self.cloth.pattern, &mut system.matrix.whole());
        }
        system.low_rank = Some(LowRank::new(columns, fit.curvature));
        fit.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    fn sheet() -> Mesh {
        grid(8, 7, DVec2::new(0.14, 0.12), 1.0)
    }

    fn sheared(mesh: &Mesh, angle: impl Fn(f64) -> f64) -> Positions {
        let shear = |p: &DVec3| DVec3::new(p.x + p.y * angle(p.y).sin(), p.y * angle(p.y).cos(), p.z);
        mesh.positions.iter().map(shear).collect()
    }

    #[test]
    fn the_shear_of_a_whole_sheet_is_its_modes() {
        let (mesh, cloth) = (sheet(), Cloth::new(&sheet()));
        let term = Shear::new(&cloth, &mesh, [0.01, 1.0, 10.0]);
        let whole = sheared(&mesh, |_| 0.1);
        // Angles are those of `sim::angle`, which keeps them off zero and π: a little less than the shear itself.
        let found = term.fit(&whole).m;
        assert!(
            (found[0].abs() - 0.1).abs() < 2e-3 && dot(&found[1..], &found[1..]).sqrt() < 2e-3,
            "{found:?}"
        );
        assert!((term.smooth_shear(std::slice::from_ref(&whole)) - 0.05).abs() < 1e-3);
        // A strip that shears alone is none of the modes, and a sheet whose texture has seams has none.
        let strip = sheared(&mesh, |y| if y > 0.03 { 0.1 } else { 0.0 });
        assert!(
            term.value(&strip) > 30.0 * term.value(&whole),
            "{} {}",
            term.value(&strip),
            term.value(&whole)
        );
        let without = Shear { responses: Arc::new(vec![0.0; cloth.shears.len()]), ..term.clone() };
        assert!(without.value(&whole) > 30.0 * term.value(&whole));
    }

    /// A sheet of many cells, and the same sheared more and less along its height, as between two hands.
    fn waves() -> (Mesh, Positions) {
        let mesh = grid(16, 21, DVec2::new(0.14, 0.12), 1.0);
        let x = sheared(&mesh, |y| 0.04 * (25.0 * y).sin());
        (mesh, x)
    }

    #[test]
    fn many_modes_explain_a_field_of_shear_that_few_do_not() {
        let (mesh, x) = waves();
        let cloth = Cloth::new(&mesh);
        let few = Shear::new(&cloth, &mesh, [0.01, 1.0, 0.1]);
        let many = Shear { rank: MANY, ..few.clone() };
        let [few, many] = [few, many].map(|term| term.value(&x));
        println!("{few} {many}");
        assert!(few > 5.0 * many && many > 0.0, "{few} {many}");
    }

    #[test]
    fn gradients_are_differences_of_values_with_any_number_of_modes() {
        let (mesh, x) = waves();
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(3, 0);
        let x: Positions = x.iter().map(|p| *p + rng.vector() * 1e-4).collect();
        let mut worst: f64 = 0.0;
        for rank in [FEW, MANY] {
            let term = Shear { rank, ..Shear::new(&cloth, &mesh, [0.01, 5.0, 0.05]) };
            let mut system = FrameSystem::zeros(&cloth);
            term.add_system(&x, &mut system);
            for _ in 0..3 {
                let direction: Positions = x.iter().map(|_| rng.vector()).collect();
                let at = |s: f64| {
                    term.value(&x.iter().zip(&direction).map(|(x, d)| *x + *d * s).collect::<Vec<_>>())
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                let slope = tessuto_core::math::dot(&system.gradient, &direction);
                assert!(slope.abs() > 1.0, "{slope}");
                worst = worst.max((slope - difference).abs() / slope.abs());
            }
        }
        println!("worst relative error {worst:.1e}");
        assert!(worst < 1e-4, "{worst}");
    }
}
