//! Implicit Euler, solved: the default integrator.
//!
//! x' = argmin Φ(x),  Φ(x) = ½ (x − y)ᵀ M (x − y)/h² + E(x),  y = x + h δ v + h² g;  v' = (x' − x)/h.
//!
//! With [`super::contact`] its energy and friction's are part of E, and no iteration goes farther than nothing is
//! passed through.
//!
//! Newton's method with a line search, its systems solved by conjugate gradients, which an older factor or, where the
//! exact Hessian is not positive definite, that of an upper bound preconditions. Unconditionally stable: every
//! iteration lowers Φ. Crumpled cloth can take very many of them; after the limit the descent so far is taken, an
//! inexact but repeatable step.

use glam::DVec3;

use super::cloth::Cloth;
use super::contact::touch::{Far, Touch};
use super::state::{State, StepGradients, StepSettings, StepTape, check_finite};
use super::stiffness::{HessianKind, Stiffness};
use tessuto_core::error::{Error, Result};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern};
use tessuto_core::math::conjugate_gradients::{End, Measure, conjugate_gradients};
use tessuto_core::math::dot;
use tessuto_core::math::factor::{Factor, Scratch};
use tessuto_core::mesh::Positions;

/// Fraction of the decrease promised by the slope that a step must reach (Armijo).
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// Conjugate gradients end when the residual's square has fallen to at most this fraction.
const CG_TOLERANCE: f64 = 1e-2;
/// Most iterations of conjugate gradients. A new factorisation takes little longer, and serves the next steps as well.
const CG_LIMIT: usize = 5;
/// The same with contact, whose blocks between layers no factor holds.
const CONTACT_LIMIT: usize = 100;
/// The same for the adjoint: ten digits.
const ADJOINT_TOLERANCE: f64 = 1e-20;
/// As many iterations as take about as long as the adjoint's own factor would.
const ADJOINT_LIMIT: usize = 12;
/// Newton's step less than this fraction of the last one: the method converges, and ends where the next one, had
/// it shrunk like this one, would be less than so much of the tolerance. Springs whose stiffness jumps where they
/// are compressed can make it longer.
const SHRINKS: f64 = 0.25;
const SURELY: f64 = 0.03;

/// The factor of an earlier matrix of a step, as a preconditioner.
struct Kept {
    factor: Factor,
    /// Iterations of conjugate gradients that it took for every factor of e by which the residual's square fell;
    /// zero: not known.
    slowness: f64,
}

/// One step; see the module for the formulas and [`super::step::step`] for the arguments.
pub fn step(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
    scratch: &mut Scratch,
) -> Result<StepTape> {
    step_near(cloth, settings, stiffness, before, acceleration, None, scratch)
}

/// [`step`] whose search starts from the positions `near`, shape `[V]`, where their potential is less than that of
/// going straight on.
pub fn step_near(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    before: State,
    acceleration: &[DVec3],
    near: Option<&[DVec3]>,
    scratch: &mut Scratch,
) -> Result<StepTape> {
    let h = settings.step;
    check_finite("implicit Euler step", &before, acceleration)?;
    let inertial: Vec<DVec3> = (0..cloth.vertex_count())
        .map(|i| before.v[i] * (h * settings.damping) + acceleration[i] * (h * h))
        .collect();
    // Displacements d = x' − x keep the precision that positions would lose.
    let mut d: Vec<DVec3> = before.v.iter().map(|v| *v * (h * settings.damping)).collect();
    let touch = cloth.contact.as_ref().map(|contact| Touch::new(contact, &before.x, &d, h)).transpose()?;
    let mut potential = Potential { cloth, stiffness, x: &before.x, inertial: &inertial, h, touch };
    potential.shorten(&mut d);
    let (mut value, mut gradient) = potential.at(&d);
    if let Some(near) = near {
        let mut to: Vec<DVec3> = near.iter().zip(&before.x).map(|(near, x)| *near - *x).collect();
        potential.shorten(&mut to);
        let there = potential.at(&to);
        if there.0 < value {
            (d, (value, gradient)) = (to, there);
        }
    }
    let mut kept: Option<Kept> = None;
    let (mut first_square, mut last) = (None, 0.0);
    // Whether the next step would be less than the tolerance, were it to shrink like the last one. One by the kept
    // factor alone shows.
    let mut nearly = false;
    for _ in 0..settings.newton_limit {
        let chord = kept
            .as_ref()
            .filter(|_| nearly)
            .map(|kept| cloth.analysis.solve(&cloth.pattern, &kept.factor, &gradient, scratch));
        if let Some(chord) = chord.as_ref().filter(|chord| longest(chord) < settings.tolerance) {
            d.iter_mut().zip(chord).for_each(|(d, s)| *d -= *s);
            break;
        }
        let first_square =
            *first_square.get_or_insert_with(|| dot(&gradient, &gradient).max(f64::MIN_POSITIVE));
        // Nearer to the minimum the quadratic model is worth a more exact solution.
        let tolerance = CG_TOLERANCE.min((dot(&gradient, &gradient) / first_square).sqrt());
        let newton = potential.newton_step(&d, (&gradient, chord), tolerance, &mut kept, scratch);
        let length = longest(&newton);
        let slope = -dot(&gradient, &newton);
        if !length.is_finite() || !value.is_finite() {
            return Err(diverged(format!("potential {value} J, Newton step of {length} m")));
        }
        // Shorten the step until the potential falls enough. Near the solution the promised decrease
        // drowns in the potential's round-off; there Newton's step is right and taken whole.
        let blind = slope.abs() < 1e-10 * value.abs();
        let mut scale = potential.free_part(&d, &newton);
        (d, (value, gradient)) = loop {
            let next: Vec<DVec3> = d.iter().zip(&newton).map(|(d, s)| *d - *s * scale).collect();
            let there = potential.at(&next);
            if blind || there.0 <= value + SUFFICIENT_DECREASE * scale * slope || scale < 1e-10 {
                break (next, there);
            }
            scale *= 0.5;
        };
        // A step that was not solved to its end says nothing about the next one.
        let whole = kept.is_some();
        let shrinks = length / last;
        let converges = whole && scale == 1.0 && shrinks < SHRINKS;
        let ahead = length * shrinks / settings.tolerance;
        if (whole && length < settings.tolerance) || (converges && ahead < SURELY) {
            break;
        }
        nearly = converges && ahead < 1.0;
        last = if whole && scale == 1.0 { length } else { 0.0 };
    }
    let v: Vec<DVec3> = d.iter().map(|d| *d / h).collect();
    if let Some(vertex) = v.iter().position(|v| !v.is_finite()) {
        return Err(diverged(format!("velocity {} m/s of vertex {vertex}", v[vertex])));
    }
    let x = before.x.iter().zip(&d).map(|(x, d)| *x + *d).collect();
    let factor = kept.map(|kept| kept.factor);
    Ok(StepTape { before, after: State { x, v }, factor, inertial: None })
}

/// Largest component `[m]`.
fn longest(step: &Positions) -> f64 {
    step.iter().fold(0.0, |m: f64, s| m.max(s.abs().max_element()))
}

fn diverged(problem: String) -> Error {
    Error::numerical("implicit Euler step", problem, "use more sub-steps or smaller forces")
}

/// Φ as a function of the displacement d = x' − x.
struct Potential<'a> {
    cloth: &'a Cloth,
    stiffness: &'a Stiffness,
    x: &'a [DVec3],
    /// y − x.
    inertial: &'a [DVec3],
    h: f64,
    /// The cloth's contact in this step.
    touch: Option<Touch<'a>>,
}

impl Potential<'_> {
    fn moved(&self, d: &[DVec3]) -> Vec<DVec3> {
        self.x.iter().zip(d).map(|(x, d)| *x + *d).collect()
    }

    /// Ends the way `d` before anything is passed through.
    fn shorten(&mut self, d: &mut [DVec3]) {
        if let Some(touch) = &mut self.touch {
            let ends: Positions = self.x.iter().zip(&*d).map(|(x, d)| *x + *d).collect();
            touch.cover(&ends);
            let part = touch.free_part(self.x, d);
            d.iter_mut().for_each(|d| *d *= part);
        }
    }

    /// The part of the way from `d` by −`newton` in which nothing is passed through.
    fn free_part(&mut self, d: &[DVec3], newton: &[DVec3]) -> f64 {
        let from = self.moved(d);
        let Some(touch) = &mut self.touch else { return 1.0 };
        let ends: Positions = from.iter().zip(newton).map(|(x, s)| *x - *s).collect();
        touch.cover(&ends);
        touch.free_part(&from, &newton.iter().map(|s| -*s).collect::<Positions>())
    }

    /// Φ and ∂Φ.
    fn at(&mut self, d: &[DVec3]) -> (f64, Positions) {
        let (masses, sq_h) = (&self.cloth.masses, self.h * self.h);
        let off: Positions = d.iter().zip(self.inertial).map(|(d, y)| *d - *y).collect();
        let kinetic: f64 = masses.iter().zip(&off).map(|(m, off)| m * off.length_squared()).sum();
        let mut gradient: Positions = masses.iter().zip(&off).map(|(m, off)| *off * (m / sq_h)).collect();
        let x = self.moved(d);
        let elastic = self.cloth.add_gradient(self.stiffness, &x, 1.0, &mut gradient);
        let mut value = 0.5 * kinetic / sq_h + elastic;
        if let Some(touch) = &mut self.touch {
            touch.cover(&x);
            value += touch.add_gradient(&x, &mut gradient);
        }
        (value, gradient)
    }

    /// Solves ∂²Φ s = `gradient`, as far as ∂²Φ is positive. `kept` is the factor of an earlier matrix of this
    /// step, if there is one, and `chord` its solution, if that is known; afterwards the one to go on with, or
    /// none where that did not lead to the end.
    ///
    /// The kept factor preconditions conjugate gradients while it is near enough: as long as it promises, by how
    /// fast it was the last time, to keep within the limit of iterations. What they reached leads downwards in any
    /// case. Where the exact matrix H is not definite, a projected one P ≥ H is factorised: alone it would take
    /// short steps, but conjugate gradients with H lengthen them. Factors are rounded, which conjugate gradients
    /// make up for at once.
    fn newton_step(
        &self,
        d: &[DVec3],
        (gradient, chord): (&Positions, Option<Positions>),
        tolerance: f64,
        kept: &mut Option<Kept>,
        scratch: &mut Scratch,
    ) -> Positions {
        let x = self.moved(d);
        let (analysis, pattern) = (&self.cloth.analysis, &self.cloth.pattern);
        let exact = self.system(&x, HessianKind::Exact, scratch);
        let limit = limit(exact.1.as_ref());
        let (mut step, mut definite) = (None, true);
        let digits = -tolerance.ln();
        match kept.take() {
            None => {}
            Some(old) if old.slowness * digits > limit as f64 => scratch.recycle(old.factor),
            Some(old) => {
                let (found, end, iterations) =
                    self.iterate(&exact, &old.factor, (gradient, chord), tolerance, scratch);
                definite = end != End::Indefinite;
                // Without an iteration it is a step by old curvature alone.
                step = (iterations > 0).then_some(found);
                match end {
                    End::Converged => *kept = Some(Kept { slowness: iterations as f64 / digits, ..old }),
                    _ => scratch.recycle(old.factor),
                }
            }
        }
        let step = step.unwrap_or_else(|| {
            let of_exact = definite.then(|| analysis.definite_rounded(pattern, &exact.0, scratch)).flatten();
            let factor = of_exact.unwrap_or_else(|| {
                let (projected, _) = self.system(&x, HessianKind::Projected, scratch);
                let rounded = analysis.definite_rounded(pattern, &projected, scratch);
                let factor = rounded.unwrap_or_else(|| analysis.factorize(pattern, &projected, scratch));
                scratch.recycle_matrix(projected);
                factor
            });
            let (step, end, _) = self.iterate(&exact, &factor, (gradient, None), tolerance, scratch);
            match end {
                End::Limit => scratch.recycle(factor),
                _ => *kept = Some(Kept { factor, slowness: 0.0 }),
            }
            step
        });
        scratch.recycle_matrix(exact.0);
        step
    }

    /// ∂²Φ at `x`: what the pattern holds, and what contact couples beyond it.
    fn system(&self, x: &[DVec3], kind: HessianKind, scratch: &mut Scratch) -> (BlockMatrix, Option<Far>) {
        let mut matrix = hessian(self.cloth, self.stiffness, x, self.h, kind, scratch);
        let is_exact = kind == HessianKind::Exact;
        let add = |touch: &Touch| touch.add_hessian(x, is_exact, (&self.cloth.pattern, &mut matrix));
        let far = self.touch.as_ref().map(add);
        (matrix, far)
    }

    /// Solves `matrix` s = `gradient`, preconditioned with `factor`, whose own solution is the `chord`.
    fn iterate(
        &self,
        (matrix, far): &(BlockMatrix, Option<Far>),
        factor: &Factor,
        (gradient, mut chord): (&Positions, Option<Positions>),
        tolerance: f64,
        scratch: &mut Scratch,
    ) -> (Positions, End, usize) {
        let (analysis, pattern) = (&self.cloth.analysis, &self.cloth.pattern);
        let limit = limit(far.as_ref());
        let multiply = |p: &Positions| product(pattern, (matrix, far.as_ref()), p);
        let precondition =
            |r: &Positions| chord.take().unwrap_or_else(|| analysis.solve(pattern, factor, r, scratch));
        conjugate_gradients(gradient, multiply, precondition, (Measure::Plain, tolerance), limit)
    }
}

/// A matrix times a field, with what contact couples beyond its pattern.
fn product(
    pattern: &BlockPattern,
    (matrix, far): (&BlockMatrix, Option<&Far>),
    field: &Positions,
) -> Positions {
    let mut out = matrix.multiply(pattern, field);
    if let Some(far) = far {
        far.add_product(field, &mut out);
    }
    out
}

/// Most iterations of conjugate gradients for a matrix with these blocks beyond its pattern.
fn limit(far: Option<&Far>) -> usize {
    if far.is_some_and(|far| !far.is_empty()) { CONTACT_LIMIT } else { CG_LIMIT }
}

/// M/h² + ∂²E: ∂²Φ without contact.
pub fn hessian(
    cloth: &Cloth,
    stiffness: &Stiffness,
    x: &[DVec3],
    h: f64,
    kind: HessianKind,
    scratch: &mut Scratch,
) -> BlockMatrix {
    let mut matrix = scratch.zero_matrix(&cloth.pattern);
    cloth.add_hessian(stiffness, x, kind, 1.0, &mut matrix);
    matrix.add_masses(&cloth.pattern, &cloth.masses, 1.0 / (h * h));
    matrix
}

/// Adjoint of [`step`] by the implicit function theorem; see [`super::step::step_vjp`].
///
/// μ = (∂²Φ)⁻¹ (x̄ + v̄/h) at the solution;  ȳ = M μ/h²;  x̄ₙ = ȳ − v̄/h;  v̄ₙ = δ h ȳ;  ḡ = M μ;
/// p̄ = −μᵀ ∂(∂E)/∂p for a parameter p of E.
pub fn step_vjp(
    cloth: &Cloth,
    settings: &StepSettings,
    stiffness: &Stiffness,
    tape: &StepTape,
    gradients: &mut StepGradients,
    scratch: &mut Scratch,
) {
    let h = settings.step;
    let x = &tape.after.x;
    let mut matrix = hessian(cloth, stiffness, x, h, HessianKind::Exact, scratch);
    let touch = cloth.contact.as_ref().map(|contact| {
        let way: Positions = x.iter().zip(&tape.before.x).map(|(after, before)| *after - *before).collect();
        let mut touch = Touch::new(contact, &tape.before.x, &way, h).expect("the step began from there");
        touch.cover(x);
        touch
    });
    let far = touch.as_ref().map(|touch| touch.add_hessian(x, true, (&cloth.pattern, &mut matrix)));
    let rhs: Vec<DVec3> = gradients.x.iter().zip(&gradients.v).map(|(x, v)| *x + *v / h).collect();
    let system = (&matrix, far.as_ref());
    let near = tape.factor.as_ref().and_then(|factor| solve_near(cloth, system, factor, &rhs, scratch));
    let mu = near.unwrap_or_else(|| {
        let factor = cloth.analysis.factorize(&cloth.pattern, &matrix, scratch);
        let mu = match far.as_ref().filter(|far| !far.is_empty()) {
            Some(_) => solve_far(cloth, system, &factor, &rhs, scratch),
            None => cloth.analysis.solve(&cloth.pattern, &factor, &rhs, scratch),
        };
        scratch.recycle(factor);
        mu
    });
    scratch.recycle_matrix(matrix);
    for i in 0..x.len() {
        let m_mu = mu[i] * cloth.masses[i];
        gradients.x[i] = m_mu / (h * h) - gradients.v[i] / h;
        gradients.v[i] = m_mu * (settings.damping / h);
        gradients.acceleration[i] = m_mu;
    }
    if let Some(touch) = &touch {
        touch.add_vjp(x, &mu, gradients);
    }
    cloth.add_gradient_by_stiffness(x, &mu, -1.0, &mut gradients.stiffness);
    for ((edge, &k), out) in cloth.edges.iter().zip(&stiffness.stretch).zip(&mut gradients.rest_lengths) {
        *out -=
            super::stretch::gradient_by_rest_length(edge.along(x), edge.stiffness(k, x)).dot(edge.along(&mu));
    }
}

/// Solves `matrix` x = `rhs` given the `factor` of a matrix near it; `None` where it is not near enough to be worth it.
fn solve_near(
    cloth: &Cloth,
    matrix: (&BlockMatrix, Option<&Far>),
    factor: &Factor,
    rhs: &Positions,
    scratch: &mut Scratch,
) -> Option<Positions> {
    let (analysis, pattern) = (&cloth.analysis, &cloth.pattern);
    let multiply = |p: &Positions| product(pattern, matrix, p);
    let precondition = |r: &Positions| analysis.solve(pattern, factor, r, scratch);
    let end = (Measure::Plain, ADJOINT_TOLERANCE);
    let limit = if limit(matrix.1) == CONTACT_LIMIT { CONTACT_LIMIT } else { ADJOINT_LIMIT };
    let (x, end, _) = conjugate_gradients(rhs, multiply, precondition, end, limit);
    (end == End::Converged).then_some(x)
}

/// The same for a matrix beyond its pattern, whatever it takes: it is positive definite where the step has ended at a
/// minimum. Where Newton's method reached its limit before, the derivatives are as inexact as the step.
fn solve_far(
    cloth: &Cloth,
    matrix: (&BlockMatrix, Option<&Far>),
    factor: &Factor,
    rhs: &Positions,
    scratch: &mut Scratch,
) -> Positions {
    let (analysis, pattern) = (&cloth.analysis, &cloth.pattern);
    let multiply = |p: &Positions| product(pattern, matrix, p);
    let precondition = |r: &Positions| analysis.solve(pattern, factor, r, scratch);
    let end = (Measure::Plain, ADJOINT_TOLERANCE);
    conjugate_gradients(rhs, multiply, precondition, end, 3 * rhs.len()).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Fabric, Integrator};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    const FABRIC: Fabric = Fabric { warp: 300.0, weft: 200.0, poisson: 0.2, shear: 20.0, bend: 1e-5 };

    const SETTINGS: StepSettings = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: 5e-3,
        damping: 0.9,
        tolerance: 1e-10,
        newton_limit: 100,
    };

    #[test]
    fn a_step_that_is_looked_for_nearby_ends_where_the_plain_one_does() {
        let mesh = grid(9, 8, glam::DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let mut rng = Rng::new(7, 0);
        let v: Vec<DVec3> = mesh.positions.iter().map(|_| rng.vector()).collect();
        let before = State { x: mesh.positions.clone(), v };
        let (gravity, scratch) = (vec![DVec3::Y * 9.81; 72], &mut Scratch::default());
        let plain = step(&cloth, &SETTINGS, &stiffness, before.clone(), &gravity, scratch).unwrap().after.x;
        let moved = |size: f64, rng: &mut Rng| -> Vec<DVec3> {
            plain.iter().map(|x| *x + rng.vector() * size).collect()
        };
        // From nearer than going straight on, and from farther, where that is taken.
        for (size, is_taken) in [(1e-5, true), (1e-2, false)] {
            let near = moved(size, &mut rng);
            let found =
                step_near(&cloth, &SETTINGS, &stiffness, before.clone(), &gravity, Some(&near), scratch)
                    .unwrap()
                    .after
                    .x;
            let off = found.iter().zip(&plain).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            println!("from {size} m: {off} m");
            assert!(off < 1e-9 && (found != plain) == is_taken, "{size}: {off}");
        }
    }

    #[test]
    fn a_step_ends_within_a_few_tolerances_of_its_minimum() {
        let mesh = grid(9, 8, glam::DVec2::splat(0.1), 1.0);
        // Edges that hardly resist when shorter: kinks that Newton's steps have to find.
        let kinked = Cloth::flat(&mesh, 0.05);
        let springs = Stiffness::uniform(&kinked, [200.0, 1e-4, 5e-4]);
        let continuum = Cloth::continuum(&mesh);
        let of_fabric = FABRIC.stiffness(&continuum);
        for (name, cloth, stiffness) in [
            ("kinked springs", kinked, springs.clone()),
            ("springs", Cloth::new(&mesh), springs),
            ("continuum", continuum, of_fabric),
        ] {
            let mut rng = Rng::new(11, 0);
            let (gravity, scratch) = (vec![DVec3::Y * 9.81; 72], &mut Scratch::default());
            let mut worst = [0.0f64; 3];
            for _ in 0..300 {
                let x = mesh.positions.iter().map(|p| *p + rng.vector() * 1e-3).collect();
                let v = mesh.positions.iter().map(|_| rng.vector() * 0.3).collect();
                let before = State { x, v };
                let mut at = |tolerance: f64| {
                    let settings = StepSettings { tolerance, ..SETTINGS };
                    step(&cloth, &settings, &stiffness, before.clone(), &gravity, scratch).unwrap().after.x
                };
                let exact = at(1e-12);
                for (worst, tolerance) in worst.iter_mut().zip([1e-5, 1e-6, 1e-7]) {
                    let off =
                        at(tolerance).iter().zip(&exact).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                    *worst = worst.max(off / tolerance);
                }
            }
            println!("{name}: off by at most {worst:.3?} of the tolerances");
            assert!(worst.iter().all(|off| *off < 4.0) && worst[0] > 0.0, "{name}: {worst:?}");
        }
    }

    #[test]
    fn the_adjoint_by_the_kept_factor_is_that_by_its_own() {
        let mesh = grid(12, 11, glam::DVec2::splat(0.2), 1.0);
        for cloth in [Cloth::new(&mesh), Cloth::continuum(&mesh)] {
            let stiffness = match &cloth.continuum {
                None => Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-4]),
                Some(_) => FABRIC.stiffness(&cloth),
            };
            let mut rng = Rng::new(13, 0);
            let x: Positions = mesh.positions.iter().map(|p| *p + rng.vector() * 1e-4).collect();
            let v = x.iter().map(|_| rng.vector() * 0.05).collect();
            let (gravity, scratch) = (vec![DVec3::Y * 9.81; x.len()], &mut Scratch::default());
            let settings = StepSettings { tolerance: 1e-7, ..SETTINGS };
            let mut tape = step(&cloth, &settings, &stiffness, State { x, v }, &gravity, scratch).unwrap();
            let mut start = StepGradients::zeros(&cloth);
            start.x.iter_mut().chain(&mut start.v).for_each(|g| *g = rng.vector());
            let mut adjoint = |tape: &StepTape| {
                let mut gradients = start.clone();
                step_vjp(&cloth, &settings, &stiffness, tape, &mut gradients, scratch);
                gradients
            };
            let by_kept = adjoint(&tape);
            tape.factor.take().expect("a factor that led to the end is kept");
            let by_own = adjoint(&tape);
            let off = |of: fn(&StepGradients) -> &Positions| {
                let (kept, own) = (of(&by_kept), of(&by_own));
                let size = own.iter().map(|g| g.length()).fold(0.0, f64::max);
                kept.iter().zip(own).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) / size
            };
            let worst = off(|g| &g.x).max(off(|g| &g.v)).max(off(|g| &g.acceleration));
            println!("{worst:e} of the largest");
            // Not zero: it was not factorised again.
            assert!(worst > 0.0 && worst < 1e-9, "{worst}");
        }
    }

    #[test]
    fn a_crumpled_cloth_reaches_a_minimum() {
        let mesh = grid(17, 17, glam::DVec2::splat(0.1), 1.0);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let mut rng = Rng::new(2, 0);
        // Compressed by a tenth: hundreds of directions without positive curvature.
        let x: Positions =
            mesh.positions.iter().map(|p| *p * DVec3::new(0.9, 0.95, 1.0) + rng.vector() * 5e-4).collect();
        let before = State { v: vec![DVec3::ZERO; x.len()], x };
        let (h, scratch) = (SETTINGS.step, &mut Scratch::default());
        let gravity = vec![DVec3::Y * 9.81; before.x.len()];
        assert!(
            cloth
                .analysis
                .definite(
                    &cloth.pattern,
                    &hessian(&cloth, &stiffness, &before.x, h, HessianKind::Exact, scratch),
                    scratch
                )
                .is_none()
        );
        let after = step(&cloth, &SETTINGS, &stiffness, before.clone(), &gravity, scratch).unwrap().after;
        // There the forces are in balance and the plain factorisation finds no negative direction.
        let inertial: Vec<DVec3> = gravity.iter().map(|g| *g * (h * h)).collect();
        let (stiffness, inertial) = (&stiffness, &inertial);
        let mut potential = Potential { cloth: &cloth, stiffness, x: &before.x, inertial, h, touch: None };
        let d: Positions = after.x.iter().zip(&before.x).map(|(x, x0)| *x - *x0).collect();
        let mut size = |d: Positions| potential.at(&d).1.iter().fold(0.0, |m: f64, g| m.max(g.length()));
        let (left, start) = (size(d.clone()), size(vec![DVec3::ZERO; d.len()]));
        assert!(left < 1e-8 * start, "{left} N of {start} N");
        let matrix = hessian(&cloth, stiffness, &after.x, h, HessianKind::Exact, scratch);
        assert!(cloth.analysis.definite(&cloth.pattern, &matrix, scratch).is_some());
    }
}
