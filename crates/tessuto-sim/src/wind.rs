//! Wind: air that moves past a triangle pushes it along its normal.
//!
//! With the area vector N = ½ p × r of the triangle's sides p and r, and the velocity u = w − v of the wind seen
//! from its middle, the force is ρ |u·N| (u·N)/‖N‖² N: the pressure ρ (u·n)² on its area, from the side where the
//! wind comes from. Along the surface air hardly holds it. The force is taken from the state before a step.
//! Source: Narain, Samii, O'Brien 2012, "Adaptive Anisotropic Remeshing for Cloth Simulation" (its program ARCSim,
//! the simulator of φ-SfT), without friction; the derivatives are ours.

use glam::DVec3;

use super::cloth::Cloth;
use super::state::State;
use tessuto_core::mesh::Positions;

/// Density of air [kg/m³].
const DENSITY: f64 = 1.2;
/// Square of an area `[m²]` that is added to squared areas, so that no direction is lost.
const SQ_AREA_FLOOR: f64 = 1e-24;

/// The triangle's sides p, r, its area vector and the wind's velocity relative to it.
fn of_triangle(state: &State, wind: DVec3, triangle: [u32; 3]) -> [DVec3; 4] {
    let [a, b, c] = triangle.map(|v| state.x[v as usize]);
    let (p, r) = (b - a, c - a);
    let mean = triangle.iter().map(|v| state.v[*v as usize]).sum::<DVec3>() / 3.0;
    [p, r, 0.5 * p.cross(r), wind - mean]
}

/// Adds to `out` the accelerations [m/s²], shape `[V]`, by a wind of velocity `wind` [m/s]. A third of a
/// triangle's force acts on each corner.
pub(super) fn add_wind(cloth: &Cloth, state: &State, wind: DVec3, out: &mut [DVec3]) {
    for t in &cloth.triangles {
        let [_, _, n, u] = of_triangle(state, wind, *t);
        let across = u.dot(n);
        let third = n * (DENSITY / 3.0 * across.abs() * across / (n.length_squared() + SQ_AREA_FLOOR));
        t.iter().for_each(|v| out[*v as usize] += third / cloth.masses[*v as usize]);
    }
}

/// Given `grad` = ∂L/∂ the accelerations, adds ∂L/∂ the state to `grad_x` and `grad_v`, and returns ∂L/∂ the wind.
pub(super) fn add_wind_vjp(
    cloth: &Cloth,
    state: &State,
    wind: DVec3,
    grad: &[DVec3],
    [grad_x, grad_v]: [&mut Positions; 2],
) -> DVec3 {
    let mut by_wind = DVec3::ZERO;
    for t in &cloth.triangles {
        let [p, r, n, u] = of_triangle(state, wind, *t);
        let by_force =
            t.iter().map(|v| grad[*v as usize] / cloth.masses[*v as usize]).sum::<DVec3>() * (DENSITY / 3.0);
        let (across, square) = (u.dot(n), n.length_squared() + SQ_AREA_FLOOR);
        let (strength, along) = (across.abs() * across / square, by_force.dot(n));
        let by_across = along * 2.0 * across.abs() / square;
        let by_n = by_force * strength + u * by_across - n * (2.0 * along * strength / square);
        let by_u = n * by_across;
        by_wind += by_u;
        t.iter().for_each(|v| grad_v[*v as usize] -= by_u / 3.0);
        let (by_p, by_r) = (0.5 * r.cross(by_n), 0.5 * by_n.cross(p));
        let [a, b, c] = t.map(|v| v as usize);
        grad_x[a] -= by_p + by_r;
        grad_x[b] += by_p;
        grad_x[c] += by_r;
    }
    by_wind
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::math::{dot, flat, vectors};
    use tessuto_core::mesh::grid;

    #[test]
    fn a_flat_sheet_feels_the_pressure_on_its_area() {
        let mesh = grid(4, 4, DVec2::splat(0.3), 1.0);
        let cloth = Cloth::new(&mesh);
        let state = State { x: mesh.positions.clone(), v: vec![DVec3::new(3.0, 1.0, 0.5); 16] };
        let mut acceleration = vec![DVec3::ZERO; 16];
        add_wind(&cloth, &state, DVec3::new(0.0, 0.0, -1.5), &mut acceleration);
        // 1.2 · 2² N/m² on 0.1 kg/m², from behind.
        assert!(acceleration.iter().all(|a| a.distance(DVec3::Z * -48.0) < 1e-9), "{acceleration:?}");
    }

    #[test]
    fn derivatives_are_differences() {
        let mesh = grid(5, 4, DVec2::splat(0.3), 1.0);
        let cloth = Cloth::new(&mesh);
        let mut rng = Rng::new(9, 0);
        let mut field = |size: f64| -> Positions { (0..20).map(|_| rng.vector() * size).collect() };
        let x: Positions = mesh.positions.iter().zip(field(0.02)).map(|(p, d)| *p + d).collect();
        let state = State { x, v: field(2.0) };
        let (wind, grad) = (DVec3::new(0.5, -0.3, 1.0), field(1.0));
        let value = |state: &State, wind: DVec3| {
            let mut out = vec![DVec3::ZERO; 20];
            add_wind(&cloth, state, wind, &mut out);
            dot(&out, &grad)
        };
        let zeros = || vec![DVec3::ZERO; 20];
        let (mut by_x, mut by_v) = (zeros(), zeros());
        let by_wind = add_wind_vjp(&cloth, &state, wind, &grad, [&mut by_x, &mut by_v]);
        let report = |name: &str, worst: tessuto_core::math::gradient_check::Worst| {
            println!("{name}: {worst:?}");
            assert!(worst.relative_error < 1e-6 && worst.analytic.abs() > 1e-3, "{name}: {worst:?}");
        };
        let of_x = |x: &[f64]| value(&State { x: vectors(x), v: state.v.clone() }, wind);
        report("x", check(flat(&state.x), flat(&by_x), 1e-6, 10, 1, of_x));
        let of_v = |v: &[f64]| value(&State { x: state.x.clone(), v: vectors(v) }, wind);
        report("v", check(flat(&state.v), flat(&by_v), 1e-6, 10, 2, of_v));
        let of_wind = |w: &[f64]| value(&state, DVec3::from_slice(w));
        report("wind", check(&wind.to_array(), &by_wind.to_array(), 1e-6, 10, 3, of_wind));
    }
}
