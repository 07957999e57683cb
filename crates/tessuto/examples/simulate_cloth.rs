//! A cloth held by two corners falls, swings and comes to rest; its edges keep their lengths.
//!
//! `cargo run --release --example simulate_cloth`

use glam::{DVec2, DVec3};
use tessuto::math::factor::Scratch;
use tessuto::mesh::grid;
use tessuto::sim::step::step;
use tessuto::sim::{Cloth, Integrator, State, StepSettings, Stiffness};

fn main() -> tessuto::Result<()> {
    // 40 cm × 40 cm of fabric, lying flat one metre below the camera's height: y points down.
    let mesh = grid(11, 11, DVec2::splat(0.4), 1.0);
    let flat: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::new(p.x, 0.0, 1.0 + p.y)).collect();
    let mut cloth = Cloth::new(&mesh);
    let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-4, 1e-4]);
    // Two corners are so heavy that nothing moves them, and gravity does not act on them.
    let held = [0, 10];
    held.iter().for_each(|&i| cloth.masses[i] = 1e3);
    let gravity: Vec<DVec3> =
        (0..flat.len()).map(|i| if held.contains(&i) { DVec3::ZERO } else { DVec3::Y * 9.81 }).collect();
    let settings = StepSettings {
        integrator: Integrator::ImplicitEuler,
        step: 0.01,
        damping: 0.98,
        tolerance: 1e-8,
        newton_limit: 200,
    };
    let mut state = State { v: vec![DVec3::ZERO; flat.len()], x: flat };
    let mut scratch = Scratch::default();
    for k in 0..300 {
        state = step(&cloth, &settings, &stiffness, state, &gravity, &mut scratch)?.after;
        if k % 50 == 49 {
            let energy = cloth.energy(&stiffness, &state.x).total();
            println!(
                "{:.1} s: lowest point {:.3} m, elastic energy {energy:.2e} J",
                0.01 * (k + 1) as f64,
                lowest(&state)
            );
        }
    }

    let stretched = |e: &tessuto::sim::cloth::Edge| e.along(&state.x).length() / e.rest_length - 1.0;
    let strain = cloth.edges.iter().map(stretched).fold(0.0, f64::max);
    println!("largest strain {:.2} %", 100.0 * strain);
    assert!(strain < 0.03, "the cloth stretched by {strain}");
    // Hanging from two corners, the middle of the lower edge is about as far down as the cloth is long.
    assert!((0.3..0.5).contains(&lowest(&state)), "{}", lowest(&state));
    Ok(())
}

/// Largest y [m].
fn lowest(state: &State) -> f64 {
    state.x.iter().map(|p| p.y).fold(f64::MIN, f64::max)
}
