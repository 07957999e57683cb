//! What a result says of its fabric, whatever the mesh.

use super::Folder;
use tessuto_sim::per_width::PerWidth;

/// Stiffnesses per width, and how sure they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The stiffnesses.
    pub per_width: PerWidth,
    /// Standard deviations of the logarithms of membrane, bending and shear stiffness.
    pub sd_of_ln: [f64; 3],
    /// Whether the video constrains them.
    pub informed: [bool; 3],
}

impl Folder {
    /// Stiffnesses per width; `None` of results without causes, and where the texture coordinates are no flat
    /// panel to scale.
    pub fn measured(&self) -> Option<Measured> {
        let (found, per_width) = (self.found.as_ref()?, self.per_width?);
        let sd_of_ln = found.spread.ln_stiffness;
        let informed = [0, 1, 2].map(|k| found.is_informed(sd_of_ln[k], found.prior.ln_stiffness[k]));
        Some(Measured { per_width, sd_of_ln, informed })
    }
}
