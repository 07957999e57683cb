//! What both elastic models take and return.

use super::membrane::Coefficients;

/// Stiffness of every element; all the same number in a homogeneous cloth.
#[derive(Debug, Clone, PartialEq)]
pub struct Stiffness {
    /// Y of every edge [N/m].
    pub stretch: Vec<f64>,
    /// B of every bending pair [J/rad²].
    pub bend: Vec<f64>,
    /// S of every shearing pair [J/rad²].
    pub shear: Vec<f64>,
    /// Coefficients of every triangle of a continuum [N/m].
    pub membrane: Vec<Coefficients>,
    /// B of every hinge of a continuum `[J]`.
    pub hinge: Vec<f64>,
}

/// Elastic energy by kind `[J]`; that of a continuum likewise.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energy {
    /// Of the edges.
    pub stretch: f64,
    /// Of the bending pairs.
    pub bend: f64,
    /// Of the shearing pairs.
    pub shear: f64,
}

impl Energy {
    /// Sum of the kinds `[J]`.
    pub fn total(&self) -> f64 {
        self.stretch + self.bend + self.shear
    }
}

/// Which second derivatives to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianKind {
    /// As they are; indefinite under compression.
    Exact,
    /// Each element's positive semi-definite upper bound.
    Projected,
    /// Squares of first derivatives of lengths and angles only; positive semi-definite.
    GaussNewton,
}
