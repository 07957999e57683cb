//! The planar heavy elastica: a strip that is clamped level at one end and bends under its own weight.
//!
//! With the arc length u from the free end as a fraction of the length L, the angle ψ between the strip and the
//! vertical, and Γ = ρ g L³/D,
//!
//!   ψ″ = Γ u sin ψ,   ψ′(0) = 0,   ψ(1) = π/2.
//!
//! All cantilevers of the same Γ have the same shape. Drop over reach of the end by Γ is the master curve of Romero,
//! Ly, Rasheed, Charrondière, Lazarus, Neukirch, Bertails-Descoubes 2021, "Physical validation of simulators in
//! computer graphics", §4.

use std::f64::consts::{FRAC_PI_2, LN_2};

use glam::DVec2;

/// Steps of the integration along the strip.
const STEPS: usize = 2000;

/// The strip at rest: points [reach, drop] from the clamp to the free end as fractions of its length.
pub fn shape(gamma: f64) -> Vec<DVec2> {
    // ln ψ(0): of a long strip ψ(0) is smaller than any rounding.
    let (mut low, mut high) = (-2.0 * gamma.sqrt() - 60.0 * LN_2, FRAC_PI_2.ln());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if clamp_angle(gamma, middle.exp(), |_| {}) > FRAC_PI_2 { high = middle } else { low = middle }
    }
    let mut points = vec![DVec2::ZERO];
    let mut last = low.exp();
    clamp_angle(gamma, low.exp(), |psi| {
        let middle = 0.5 * (last + psi);
        points.push(points[points.len() - 1] + DVec2::new(middle.sin(), middle.cos()) / STEPS as f64);
        last = psi;
    });
    let clamp = points[points.len() - 1];
    points.iter().rev().map(|p| clamp - *p).collect()
}

/// ψ(1) of ψ(0) = `free`; hears of every ψ on the way. Runge-Kutta of fourth order.
fn clamp_angle(gamma: f64, free: f64, mut hear: impl FnMut(f64)) -> f64 {
    let h = 1.0 / STEPS as f64;
    let bend = |u: f64, psi: f64| gamma * u * psi.sin();
    let (mut psi, mut rate) = (free, 0.0);
    for k in 0..STEPS {
        let u = k as f64 * h;
        let a = (rate, bend(u, psi));
        let b = (rate + 0.5 * h * a.1, bend(u + 0.5 * h, psi + 0.5 * h * a.0));
        let c = (rate + 0.5 * h * b.1, bend(u + 0.5 * h, psi + 0.5 * h * b.0));
        let d = (rate + h * c.1, bend(u + h, psi + h * c.0));
        psi += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
        rate += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        hear(psi);
        if psi > FRAC_PI_2 + 1.0 {
            return psi;
        }
    }
    psi
}

/// How far the end hangs below the clamp over how far it reaches out: the master curve.
pub fn drop_over_reach(gamma: f64) -> f64 {
    let points = shape(gamma);
    let end = points[points.len() - 1];
    end.y / end.x
}

/// Γ of the strip that hangs as far: the inverse of [`drop_over_reach`], between 1e-6 and 1e4.
pub fn gamma_of(drop_over_reach_of_strip: f64) -> f64 {
    let (mut low, mut high) = (1e-6f64.ln(), 1e4f64.ln());
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if drop_over_reach(middle.exp()) > drop_over_reach_of_strip { high = middle } else { low = middle }
    }
    (0.5 * (low + high)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_that_of_romero_and_others() {
        // An eighth of Γ where it hardly bends; the other numbers are read from the published curve's data.
        let published =
            [(0.01, 0.00125), (1.0, 0.1247), (5.0, 0.5862), (10.0, 1.0673), (50.0, 3.7044), (9840.0, 68.465)];
        for (gamma, ratio) in published {
            let own = drop_over_reach(gamma);
            println!("Γ {gamma}: {own:.5}, published {ratio}");
            assert!(
                (own / ratio - 1.0).abs() < if gamma < 100.0 { 2e-3 } else { 1e-2 },
                "{gamma}: {own} {ratio}"
            );
        }
        assert!((gamma_of(drop_over_reach(7.0)) / 7.0 - 1.0).abs() < 1e-6);
    }
}
