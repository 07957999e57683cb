//! Mechanics of the cloth: what a rigid motion, a translation and a time step may and may not change.

use glam::DVec3;
use proptest::prelude::*;
use tessuto::math::block_matrix::BlockMatrix;
use tessuto::math::factor::Scratch;
use tessuto::math::{dot, rng::Rng};
use tessuto::sim::step::step;
use tessuto::sim::{Cloth, HessianKind, Integrator, State, StepSettings, Stiffness};

use super::{crumple, crumpled, holds, rigid_motion};

const STIFFNESS: [f64; 3] = [200.0, 1e-3, 5e-4];

fn gradient(cloth: &Cloth, stiffness: &Stiffness, x: &[DVec3]) -> Vec<DVec3> {
    let mut out = vec![DVec3::ZERO; x.len()];
    cloth.add_gradient(stiffness, x, 1.0, &mut out);
    out
}

fn hessian(cloth: &Cloth, stiffness: &Stiffness, x: &[DVec3], curvature: HessianKind) -> BlockMatrix {
    let mut matrix = BlockMatrix::zeros(&cloth.pattern);
    cloth.add_hessian(stiffness, x, curvature, 1.0, &mut matrix);
    matrix
}

fn field(rng: &mut Rng, count: usize) -> Vec<DVec3> {
    (0..count).map(|_| rng.vector()).collect()
}

fn largest(field: &[DVec3]) -> f64 {
    field.iter().fold(0.0, |m: f64, v| m.max(v.abs().max_element()))
}

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings { integrator, step: 0.004, damping: 1.0, tolerance: 1e-10, newton_limit: 60 }
}

#[test]
fn rigid_motions_change_no_energy_and_turn_the_forces() {
    holds(100, (crumple(), rigid_motion()), |((seed, size), (turn, shift))| {
        let (mesh, x) = crumpled(seed, size);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, STIFFNESS);
        let moved: Vec<DVec3> = x.iter().map(|p| turn * *p + shift).collect();
        let (before, after) = (cloth.energy(&stiffness, &x), cloth.energy(&stiffness, &moved));
        prop_assert!(before.total() > 0.0);
        // Differences of positions of up to 6 m are exact to 1e-15 m; a strain of 1e-4 m loses eleven digits less.
        for (a, b) in
            [(before.stretch, after.stretch), (before.bend, after.bend), (before.shear, after.shear)]
        {
            prop_assert!((a - b).abs() <= 1e-9 * a.abs() + 1e-18, "{a} {b}");
        }
        let forces = gradient(&cloth, &stiffness, &x);
        let turned = gradient(&cloth, &stiffness, &moved);
        for (f, g) in forces.iter().zip(&turned) {
            prop_assert!((turn * *f - *g).length() <= 1e-9 * largest(&forces), "{f} {g}");
        }
        Ok(())
    });
}

#[test]
fn internal_forces_and_their_torques_vanish() {
    holds(100, crumple(), |(seed, size)| {
        let (mesh, x) = crumpled(seed, size);
        let cloth = Cloth::new(&mesh);
        let forces = gradient(&cloth, &Stiffness::uniform(&cloth, STIFFNESS), &x);
        let scale = forces.iter().map(|f| f.length()).sum::<f64>();
        prop_assert!(scale > 0.0);
        let sum: DVec3 = forces.iter().sum();
        let torque: DVec3 = x.iter().zip(&forces).map(|(x, f)| x.cross(*f)).sum();
        prop_assert!(sum.length() <= 1e-12 * scale, "force {sum} of {scale}");
        prop_assert!(torque.length() <= 1e-12 * scale, "torque {torque} of {scale}");
        Ok(())
    });
}

#[test]
fn second_derivatives_are_symmetric_and_ignore_translations() {
    holds(60, crumple(), |(seed, size)| {
        let (mesh, x) = crumpled(seed, size);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, STIFFNESS);
        let mut rng = Rng::new(seed, 1);
        let (a, b) = (field(&mut rng, x.len()), field(&mut rng, x.len()));
        // The derivative of the forces along a direction, not the stored matrix, which holds one triangle only.
        let h = 1e-7;
        let slope = |direction: &[DVec3]| {
            let at = |h: f64| x.iter().zip(direction).map(|(x, d)| *x + *d * h).collect::<Vec<DVec3>>();
            let (up, down) = (gradient(&cloth, &stiffness, &at(h)), gradient(&cloth, &stiffness, &at(-h)));
            up.iter().zip(&down).map(|(u, d)| (*u - *d) / (2.0 * h)).collect::<Vec<DVec3>>()
        };
        let (ab, ba) = (dot(&a, &slope(&b)), dot(&b, &slope(&a)));
        let exact = hessian(&cloth, &stiffness, &x, HessianKind::Exact);
        let product = exact.multiply(&cloth.pattern, &b);
        let scale = largest(&product) * x.len() as f64;
        prop_assert!(scale > 0.0);
        prop_assert!((ab - ba).abs() <= 1e-4 * scale, "{ab} {ba}");
        prop_assert!((ab - dot(&a, &product)).abs() <= 1e-4 * scale, "{ab} {}", dot(&a, &product));
        // A translation strains nothing; the projected part is never negative and bounds the exact one.
        let shift = vec![rng.vector(); x.len()];
        prop_assert!(largest(&exact.multiply(&cloth.pattern, &shift)) <= 1e-10 * scale);
        let projected = hessian(&cloth, &stiffness, &x, HessianKind::Projected);
        let bound = dot(&b, &projected.multiply(&cloth.pattern, &b));
        prop_assert!(bound >= 0.0 && bound >= dot(&b, &product) - 1e-12 * scale);
        Ok(())
    });
}

#[test]
fn an_implicit_step_from_rest_makes_no_energy_and_no_momentum() {
    holds(60, crumple(), |(seed, size)| {
        let (mesh, x) = crumpled(seed, size);
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, STIFFNESS);
        let elastic = cloth.energy(&stiffness, &x).total();
        let none = vec![DVec3::ZERO; x.len()];
        let before = State { x, v: none.clone() };
        let settings = settings(Integrator::ImplicitEuler);
        let tape =
            step(&cloth, &settings, &stiffness, before, &none, &mut Scratch::default()).expect("a step");
        // The step minimises E(x') + ½ |x' − x|²_M/h², whose value at the start is E(x), and the second term is the
        // kinetic energy after it.
        let after = &tape.after;
        let kinetic: f64 = cloth.masses.iter().zip(&after.v).map(|(m, v)| 0.5 * m * v.length_squared()).sum();
        let total = cloth.energy(&stiffness, &after.x).total() + kinetic;
        prop_assert!(kinetic > 0.0);
        prop_assert!(total <= elastic * (1.0 + 1e-12), "{elastic} J became {total} J");
        let momentum: DVec3 = cloth.masses.iter().zip(&after.v).map(|(m, v)| *v * *m).sum();
        let scale: f64 = cloth.masses.iter().zip(&after.v).map(|(m, v)| m * v.length()).sum();
        prop_assert!(momentum.length() <= 1e-6 * scale, "momentum {momentum} of {scale}");
        Ok(())
    });
}

#[test]
fn steps_keep_the_momentum_of_a_moving_cloth() {
    holds(40, (crumple(), any::<bool>()), |((seed, size), implicit)| {
        let (mesh, x) = crumpled(seed, size.min(1e-3));
        let cloth = Cloth::new(&mesh);
        let stiffness = Stiffness::uniform(&cloth, STIFFNESS);
        let integrator = if implicit { Integrator::ImplicitEuler } else { Integrator::LinearizedEuler };
        let mut rng = Rng::new(seed, 2);
        let drift = rng.vector();
        let v: Vec<DVec3> = x.iter().map(|_| drift + rng.vector() * 0.1).collect();
        let momentum = |v: &[DVec3]| cloth.masses.iter().zip(v).map(|(m, v)| *v * *m).sum::<DVec3>();
        let expected = momentum(&v);
        let none = vec![DVec3::ZERO; x.len()];
        let before = State { x, v };
        let tape = step(&cloth, &settings(integrator), &stiffness, before, &none, &mut Scratch::default())
            .expect("a step");
        let found = momentum(&tape.after.v);
        prop_assert!((found - expected).length() <= 1e-8 * expected.length(), "{expected} became {found}");
        Ok(())
    });
}
