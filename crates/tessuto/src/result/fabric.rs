//! What a result says of its fabric, whatever the mesh.

use super::Folder;
use tessuto_estimate::motion::causes::Constraint;
use tessuto_sim::per_width::PerWidth;

/// Stiffnesses per width, and how sure they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The stiffnesses.
    pub per_width: PerWidth,
    /// Standard deviations of the logarithms of membrane, bending and shear stiffness.
    pub sd_of_ln: [f64; 3],
    /// What the video says of them.
    pub constraints: [Constraint; 3],
}

impl Measured {
    /// Whether the video constrains membrane, bending and shear stiffness.
    pub fn informed(&self) -> [bool; 3] {
        self.constraints.map(|constraint| constraint.is_constrained())
    }
}

impl Folder {
    /// Stiffnesses per width; `None` of results without causes, and where the texture coordinates are no flat
    /// panel to scale.
    pub fn measured(&self) -> Option<Measured> {
        let (found, per_width) = (self.found.as_ref()?, self.per_width?);
        let (sd_of_ln, constraints) = (found.spread.ln_stiffness, found.constraints.stiffness);
        Some(Measured { per_width, sd_of_ln, constraints })
    }
}
