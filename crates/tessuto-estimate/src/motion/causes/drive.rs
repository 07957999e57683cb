//! The motion that causes make, and its derivatives by them.
//!
//! BDF2, whose damping of slow motion is of third order in the step: with x̄ = (4 xₙ − xₙ₋₁)/3, v̄ likewise and
//! H = 2h/3,
//!
//!   x' = argmin ½ ‖x − x̄ − H v̄ − H² a‖²_M/H² + ½ ‖x − target‖²_{M κ} + E(x) + ½ c/H ‖θ(x) − θ̄‖²,
//!   v' = (x' − x̄)/H,
//!
//! an implicit Euler step from (x̄, v̄) with other masses and, for internal friction, other springs
//! ([`tessuto_sim::Cloth::rub`]). Its derivatives follow from the implicit function theorem.

use glam::DVec3;
use rayon::prelude::*;

use super::forces::{Causes, FIRST, GRAVITY, Knots, LENGTHS};
use tessuto_core::error::Result;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;
use tessuto_sim::air::Air;
use tessuto_sim::implicit_euler::{hessian, step_near};
use tessuto_sim::step::in_pool;
use tessuto_sim::stretch;
use tessuto_sim::{Cloth, HessianKind, Integrator, State, StepSettings, Stiffness};

/// Unknowns whose derivatives are solved for at a time: a solve is bound by reading the factor.
const TOGETHER: usize = 8;
/// Newton's method ends after this many iterations.
const NEWTON_LIMIT: usize = 12;

/// A cloth under way.
pub struct Drive<'a> {
    /// The cloth as cut.
    pub cloth: &'a Cloth,
    /// Length h of a step `[s]`.
    pub h: f64,
    /// Newton's method ends when no coordinate moves by more than this `[m]`.
    pub tolerance: f64,
    /// Steps per frame.
    pub substeps: usize,
    /// Where the ties pull at every step, shape [steps + 1, V] `[m]`; it starts from the first, at rest.
    pub targets: &'a [Positions],
    /// Strength κ of every vertex's tie [1/s²].
    pub ties: Vec<f64>,
    /// How much of it runs along u and along v of the panel, for every edge.
    pub ways: &'a [[f64; 2]],
    /// Times of the wind's values.
    pub knots: Knots,
}

/// Positions of every frame [N, V], and their derivatives by every unknown [N, unknowns, V], where these are asked for.
pub struct Trajectory {
    pub frames: Vec<Positions>,
    pub tangents: Vec<Vec<Positions>>,
    /// Positions after every step, where a similar run looks for its own first.
    pub steps: Vec<Positions>,
}

/// Where a step leads, roughly.
struct Places<'a> {
    /// Where the ties pull.
    target: &'a [DVec3],
    /// Where the step of a similar run ended.
    near: Option<&'a [DVec3]>,
}

/// What one step is made of, for its derivatives.
struct Taken<'a> {
    /// The cloth with its lengths.
    cloth: &'a Cloth,
    after: &'a State,
    big: f64,
    time: f64,
    /// Springs of one kind alone.
    only: &'a [Stiffness; 3],
    air: &'a Air<'a>,
    /// θ − θ̄ of every angle, ∂θ/∂x after the step.
    turned: &'a [f64],
    gradients: &'a [[DVec3; 2]],
}

/// Derivatives of a state and its angles by one unknown.
#[derive(Clone)]
struct Tangent {
    state: State,
    angles: Vec<f64>,
}

impl Tangent {
    /// Derivative of the start of a step.
    fn start(now: &Self, before: Option<&Self>) -> Self {
        Self {
            state: combined(&now.state, before.map(|t| &t.state)),
            angles: combined_angles(&now.angles, before.map(|t| &t.angles[..])),
        }
    }
}

/// Start of a step: θ̄, as x̄.
fn combined_angles(now: &[f64], before: Option<&[f64]>) -> Vec<f64> {
    match before {
        None => now.to_vec(),
        Some(before) => now.iter().zip(before).map(|(a, b)| (a * 4.0 - b) / 3.0).collect(),
    }
}

/// Where the last two states lead.
fn ahead(now: &State, before: Option<&State>) -> State {
    let Some(before) = before else { return now.clone() };
    let go = |a: &Positions, b: &Positions| a.iter().zip(b).map(|(a, b)| *a * 2.0 - *b).collect();
    State { x: go(&now.x, &before.x), v: go(&now.v, &before.v) }
}

/// Start of a step: x̄, v̄.
fn combined(now: &State, before: Option<&State>) -> State {
    let Some(before) = before else { return now.clone() };
    let mix = |a: &Positions, b: &Positions| a.iter().zip(b).map(|(a, b)| (*a * 4.0 - *b) / 3.0).collect();
    State { x: mix(&now.x, &before.x), v: mix(&now.v, &before.v) }
}

impl Drive<'_> {
    /// Simulates under `causes`, with derivatives if they are asked for; `near` are the positions of a similar run
    /// after every step.
    ///
    /// # Errors
    /// [`tessuto_core::Error::Numerical`] from a step.
    pub fn run(&self, causes: &Causes, with_tangents: bool, near: &[Positions]) -> Result<Trajectory> {
        in_pool(|| self.run_here(causes, with_tangents, near))
    }

    fn run_here(&self, causes: &Causes, with_tangents: bool, near: &[Positions]) -> Result<Trajectory> {
        let count = self.cloth.vertex_count();
        let k = causes.stiffness();
        let stiffness = Stiffness::uniform(self.cloth, k);
        let only = [0, 1, 2].map(|i| {
            let mut alone = [0.0; 3];
            alone[i] = k[i];
            Stiffness::uniform(self.cloth, alone)
        });
        let still = |x: Positions| State { v: vec![DVec3::ZERO; x.len()], x };
        let mut scratch = Scratch::default();
        let cloth = &self.cut(causes);
        let mut heavy = cloth.clone();
        let (mut now, mut before) = (still(self.targets[0].clone()), None);
        let (mut angles, mut angles_before) = (cloth.angles_at(&now.x), None::<Vec<f64>>);
        let unknowns = if with_tangents { causes.unknowns() } else { 0 };
        let resting = Tangent { state: still(vec![DVec3::ZERO; count]), angles: vec![0.0; angles.len()] };
        let mut tangents = vec![resting.clone(); unknowns];
        let mut tangents_before: Option<Vec<Tangent>> = None;
        let shapes = |tangents: &[Tangent]| tangents.iter().map(|t| t.state.x.clone()).collect();
        let mut out =
            Trajectory { frames: vec![now.x.clone()], tangents: vec![shapes(&tangents)], steps: Vec::new() };
        for n in 0..self.targets.len() - 1 {
            let big = if before.is_some() { 2.0 / 3.0 * self.h } else { self.h };
            let bar = combined(&now, before.as_ref());
            let from = combined_angles(&angles, angles_before.as_deref());
            let total = heavy.rub(cloth, &stiffness, causes.friction() / big, &from);
            let time = (n + 1) as f64 * self.h;
            let ahead_of = ahead(&now, before.as_ref());
            let wind = causes.wind_at(&self.knots, time);
            let air = Air::new(cloth, causes.drag(), wind, &ahead_of.x, &ahead_of.v, self.h);
            let gravity = causes.gravity();
            let outer = |i: usize| gravity + air.acceleration(i);
            let places = Places { target: &self.targets[n + 1], near: near.get(n).map(Vec::as_slice) };
            let after = self.step(outer, &total, &bar, big, &places, &mut heavy, &mut scratch)?;
            out.steps.push(after.x.clone());
            let angles_after = cloth.angles_at(&after.x);
            if with_tangents {
                let matrix = hessian(&heavy, &total, &after.x, big, HessianKind::Exact, &mut scratch);
                let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, &mut scratch);
                scratch.recycle_matrix(matrix);
                let turned: Vec<f64> = angles_after.iter().zip(&from).map(|(a, b)| a - b).collect();
                let gradients = cloth.angle_gradients_at(&after.x);
                let taken = Taken {
                    cloth,
                    after: &after,
                    big,
                    time,
                    only: &only,
                    air: &air,
                    turned: &turned,
                    gradients: &gradients,
                };
                // The wind of later knots has not changed anything yet.
                let awake = unknowns.min(FIRST + 3 * (self.knots.around(time).0 + 2));
                let mut next = vec![resting.clone(); awake];
                next.par_chunks_mut(TOGETHER).enumerate().for_each_init(
                    Scratch::default,
                    |scratch, (c, next)| {
                        let unknowns = TOGETHER * c..TOGETHER * c + next.len();
                        let old = |p: usize| tangents_before.as_ref().map(|t| &t[p]);
                        let starts: Vec<Tangent> =
                            unknowns.clone().map(|p| Tangent::start(&tangents[p], old(p))).collect();
                        let loads: Vec<Positions> = unknowns
                            .zip(&starts)
                            .map(|(p, start)| {
                                let ahead = ahead(&tangents[p].state, old(p).map(|t| &t.state));
                                self.load(causes, &taken, p, &ahead, start)
                            })
                            .collect();
                        let solved = cloth.analysis.solve_many(&cloth.pattern, &factor, &loads, scratch);
                        for ((next, start), x) in next.iter_mut().zip(starts).zip(solved) {
                            *next = taken.tangent(&start, x);
                        }
                    },
                );
                next.extend_from_slice(&tangents[awake..]);
                scratch.recycle(factor);
                tangents_before = Some(std::mem::replace(&mut tangents, next));
            }
            before = Some(std::mem::replace(&mut now, after));
            angles_before = Some(std::mem::replace(&mut angles, angles_after));
            if (n + 1).is_multiple_of(self.substeps) {
                out.frames.push(now.x.clone());
                out.tangents.push(shapes(&tangents));
            }
        }
        Ok(out)
    }

    /// The cloth with its lengths.
    fn cut(&self, causes: &Causes) -> Cloth {
        let mut cloth = self.cloth.clone();
        for (edge, [u, v]) in cloth.edges.iter_mut().zip(self.ways) {
            edge.rest_length *= (u * causes.ln_length[0] + v * causes.ln_length[1]).exp();
        }
        cloth
    }

    /// One step from `bar` under the accelerations `outer`; `heavy` gets the masses with ties.
    #[expect(clippy::too_many_arguments, reason = "what a step depends on")]
    fn step(
        &self,
        outer: impl Fn(usize) -> DVec3,
        stiffness: &Stiffness,
        bar: &State,
        big: f64,
        places: &Places,
        heavy: &mut Cloth,
        scratch: &mut Scratch,
    ) -> Result<State> {
        let sq = big * big;
        let factors = self.ties.iter().map(|tie| 1.0 + sq * tie);
        heavy
            .masses
            .iter_mut()
            .zip(&self.cloth.masses)
            .zip(factors.clone())
            .for_each(|((h, m), f)| *h = m * f);
        let acceleration: Positions = factors
            .enumerate()
            .map(|(i, factor)| {
                let drift = bar.v[i] * big;
                let pull = (places.target[i] - bar.x[i]) * (sq * self.ties[i]);
                ((drift + outer(i) * sq + pull) / factor - drift) / sq
            })
            .collect();
        let settings = StepSettings {
            integrator: Integrator::ImplicitEuler,
            step: big,
            damping: 1.0,
            tolerance: self.tolerance,
            newton_limit: NEWTON_LIMIT,
        };
        let tape = step_near(heavy, &settings, stiffness, bar.clone(), &acceleration, places.near, scratch)?;
        Ok(tape.into_after(scratch))
    }

    /// What the derivative of a step's positions by unknown `p` is solved from, given those of the state ahead and
    /// of the start.
    fn load(&self, causes: &Causes, taken: &Taken, p: usize, ahead: &State, start: &Tangent) -> Positions {
        let (cloth, big) = (taken.cloth, taken.big);
        let [a, b] = causes.across();
        let gravity = match p {
            3 => a * GRAVITY,
            4 => b * GRAVITY,
            _ => DVec3::ZERO,
        };
        let mut wind = DVec3::ZERO;
        if p >= FIRST {
            let (knot, weight) = self.knots.around(taken.time);
            let own = match (p - FIRST) / 3 {
                k if k == knot => 1.0 - weight,
                k if k == knot + 1 => weight,
                _ => 0.0,
            };
            wind = DVec3::AXES[(p - FIRST) % 3] * own;
        }
        let air = taken.air.changes(&ahead.x, &ahead.v, wind, f64::from(u8::from(p == 5)));
        let mut rhs: Positions = (0..cloth.vertex_count())
            .map(|i| {
                let inertia = (start.state.x[i] + start.state.v[i] * big) / (big * big);
                (inertia + gravity + air[i]) * cloth.masses[i]
            })
            .collect();
        if let Some(only) = taken.only.get(p) {
            cloth.add_gradient(only, &taken.after.x, -1.0, &mut rhs);
        }
        if let Some(way) = p.checked_sub(LENGTHS).filter(|way| *way < 2) {
            for ((edge, ways), k) in cloth.edges.iter().zip(self.ways).zip(&taken.only[0].stretch) {
                let k = edge.stiffness(*k, &taken.after.x) * edge.rest_length * ways[way];
                edge.scatter(stretch::gradient_by_rest_length(edge.along(&taken.after.x), -k), &mut rhs);
            }
        }
        let rate = causes.friction() / big;
        cloth.add_moments(taken.gradients, &start.angles, rate, &mut rhs);
        if p == 6 {
            cloth.add_moments(taken.gradients, taken.turned, -rate, &mut rhs);
        }
        rhs
    }
}

impl Taken<'_> {
    /// Derivative of the step, given that of its positions and of the start.
    fn tangent(&self, start: &Tangent, x: Positions) -> Tangent {
        let v = x.iter().zip(&start.state.x).map(|(a, b)| (*a - *b) / self.big).collect();
        let angles = self.cloth.angle_changes(self.gradients, &x);
        Tangent { state: State { x, v }, angles }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn tangents_are_differences_of_trajectories() {
        let mut mesh = grid(6, 5, DVec2::new(0.2, 0.16), 1.0);
        let cloth = Cloth::flat(&mesh, 1.0);
        let mut rng = Rng::new(4, 0);
        mesh.positions
            .iter_mut()
            .for_each(|p| *p += DVec3::Z * (0.02 * (30.0 * p.x + 9.0 * p.y).sin()) + rng.vector() * 1e-4);
        let targets: Vec<Positions> = (0..9)
            .map(|n| {
                mesh.positions.iter().map(|p| *p + DVec3::new(2e-3, -1e-3, 3e-3) * f64::from(n)).collect()
            })
            .collect();
        let mut ties = vec![40.0; 30];
        ties[0] = 1e6;
        ties[5] = 1e6;
        let knots = Knots { count: 3, end: 0.08 };
        let ways: Vec<[f64; 2]> = cloth.edges.iter().map(|_| [rng.uniform(), rng.uniform()]).collect();
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
        let causes = Causes {
            ln_stiffness: [100f64.ln(), 2e-3f64.ln(), 5e-4f64.ln()],
            down: DVec3::new(0.1, 1.0, -0.2).normalize(),
            ln_drag: 0.3,
            ln_friction: 4e-4f64.ln(),
            ln_length: [1e-3, -2e-3],
            wind: (0..3).map(|_| rng.vector()).collect(),
        };
        let run = drive.run(&causes, true, &[]).unwrap();
        for _ in 0..3 {
            let direction: Vec<f64> = (0..causes.unknowns()).map(|_| rng.signed()).collect();
            let at = |s: f64| {
                drive
                    .run(&causes.moved(&direction.iter().map(|d| d * s).collect::<Vec<_>>()), false, &[])
                    .unwrap()
            };
            let (plus, minus) = (at(1e-4), at(-1e-4));
            for n in 1..run.frames.len() {
                let (mut off, mut size) = (0.0f64, 0.0f64);
                for i in 0..30 {
                    let tangent: DVec3 = run.tangents[n].iter().zip(&direction).map(|(t, d)| t[i] * *d).sum();
                    let difference = (plus.frames[n][i] - minus.frames[n][i]) / 2e-4;
                    off = off.max(tangent.distance(difference));
                    size = size.max(difference.length());
                }
                assert!(size > 1e-5 && off < 2e-3 * size, "frame {n}: {off} of {size}");
            }
        }
    }
}
