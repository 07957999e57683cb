//! A strip over the edge of a table: the test of bending length by ASTM D1388 and ISO 9073-7.
//!
//! The strip is pushed over the edge until the line from the edge to its end slopes by 41.5°. Half of the overhang is
//! the bending length c, D = ρ g c³.

use glam::{DVec2, DVec3};

use super::GRAVITY;
use super::plate::{Lattice, Plate, clamp};
use super::rest::{Search, at_rest};
use crate::cloth::AREA_DENSITY;
use crate::per_width::bending_length;
use tessuto_core::error::Result;

/// Slope of the line from the edge to the end of the strip in the test `[°]`.
pub const SLOPE: f64 = 41.5;
/// Width of the strip as a fraction of the overhang: it does not matter, as the strip only bends along.
const WIDTH: f64 = 0.2;
/// Cells along the overhang.
const CELLS: usize = 40;
/// Tension per strain of the simulated strip in weights of the overhang: it grows by a two-thousandth.
const TENSION: f64 = 1000.0;

/// A strip at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// Length beyond the edge `[m]`.
    pub overhang: f64,
    /// Its middle line from the edge: out and down `[m]`.
    pub line: Vec<DVec2>,
}

impl Strip {
    /// Slope of the line from the edge to the end `[rad]`.
    pub fn slope(&self) -> f64 {
        let end = self.line[self.line.len() - 1];
        end.y.atan2(end.x)
    }
}

/// The strip of bending stiffness `bending` [N·m] at [`AREA_DENSITY`] that reaches `overhang` `[m]` over the edge, in
/// `cells` along it.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] if the simulation is not finite.
pub fn hang(bending: f64, overhang: f64, cells: usize) -> Result<Strip> {
    const ROWS: usize = 3;
    let h = overhang / cells as f64;
    let columns = cells + 2;
    // The edge is at x = 0, the second column.
    let point = |c: usize, r: usize| DVec2::new((c as f64 - 1.0) * h, overhang * WIDTH * 0.5 * r as f64);
    let lattice = Lattice { columns, rows: ROWS, closed: false };
    let mesh = lattice.mesh(point);
    let tension = TENSION * AREA_DENSITY * GRAVITY * overhang;
    let of_strip = Plate { membrane: [tension; 2], shear: tension, bending: [bending; 2] };
    let (cloth, mut stiffness) = lattice.cloth(&mesh, &of_strip);
    let held: Vec<usize> = (0..columns * ROWS).filter(|v| v % columns < 2).collect();
    clamp(&cloth, &held, &mut stiffness);
    let search = Search { still: 1e-6 * overhang, ..Search::default() };
    let x = at_rest(&cloth, &stiffness, &mesh.positions, &held, DVec3::Z * GRAVITY, &search)?;
    let line = (1..columns).map(|c| x[columns + c]).map(|p| DVec2::new(p.x, p.z)).collect();
    Ok(Strip { overhang, line })
}

/// The strip whose end slopes by [`SLOPE`], of bending stiffness `bending` [N·m] at `density` [kg/m²].
///
/// # Errors
/// As [`hang`].
pub fn overhang(bending: f64, density: f64) -> Result<Strip> {
    // Shapes depend on D/ρ alone.
    let bending = bending * AREA_DENSITY / density;
    let target = SLOPE.to_radians().tan();
    let mut length = 2.0 * bending_length(bending, AREA_DENSITY);
    let mut strip = hang(bending, length, CELLS)?;
    for _ in 0..4 {
        // Drop over reach grows nearly as the cube of the length.
        let off = (strip.slope().tan() / target).ln();
        if off.abs() < 1e-4 {
            break;
        }
        length *= (-off / 2.5).exp();
        strip = hang(bending, length, CELLS)?;
    }
    Ok(strip)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textile::elastica;

    #[test]
    fn the_overhang_is_that_of_the_elastica_and_twice_the_bending_length() {
        for (bending, density) in [(1e-6, 0.1), (4e-5, 0.35)] {
            let strip = overhang(bending, density).unwrap();
            let gamma = elastica::gamma_of(SLOPE.to_radians().tan());
            let expected = (gamma * bending / (density * GRAVITY)).cbrt();
            let halved = strip.overhang / (2.0 * bending_length(bending, density));
            println!("Γ {gamma:.3}: {:.5} m, elastica {expected:.5} m, halved {halved:.4}", strip.overhang);
            assert!((strip.overhang / expected - 1.0).abs() < 0.01, "{} {expected}", strip.overhang);
            assert!((halved - 1.0).abs() < 0.03, "{halved}");
            assert!((strip.slope().to_degrees() - SLOPE).abs() < 0.05, "{}", strip.slope().to_degrees());
        }
    }
}
