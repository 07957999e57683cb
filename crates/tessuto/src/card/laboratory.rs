//! A strip and a disc of the fabric in the tests of a textile laboratory, simulated.

use super::Answer;
use tessuto_core::error::Result;
use tessuto_sim::textile::cantilever::{Strip, overhang};
use tessuto_sim::textile::drape::{Drape, drape};
use tessuto_sim::textile::plate::Plate;

/// What the tests give.
#[derive(Debug, Clone, PartialEq)]
pub struct Tested {
    /// Strips along warp and weft whose end slopes by 41.5°.
    pub strips: [Strip; 2],
    /// Their overhang at a standard deviation less, at the mean, and at one more `[m]`.
    pub overhangs: [[f64; 3]; 2],
    /// The disc at a standard deviation of the bending stiffness less, at the mean, and at one more.
    pub drapes: [Drape; 3],
}

/// Simulates them.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] if a simulation is not finite.
pub fn simulate(answer: &Answer) -> Result<Tested> {
    let widths = &answer.per_width;
    let (density, sd) = (widths.area_density, answer.parameters[1].sd_of_ln);
    let [warp, weft] = widths.bending;
    let strips = [overhang(warp, density)?, overhang(weft, density)?];
    // Strips of any stiffness have the same shape, and lengths that go with its cube root.
    let overhangs = [0, 1].map(|k| [-1.0, 0.0, 1.0].map(|n| strips[k].overhang * (n * sd / 3.0).exp()));
    let of = |deviations: f64| {
        let bending = widths.bending.map(|d| d * (deviations * sd).exp());
        drape(&Plate { membrane: widths.membrane, shear: widths.shear, bending }, density)
    };
    Ok(Tested { strips, overhangs, drapes: [of(-1.0)?, of(0.0)?, of(1.0)?] })
}
