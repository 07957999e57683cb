//! Settings of the search for all frames' positions.

use serde::{Deserialize, Serialize};

/// Strictness of every term. A term with spread σ contributes ½ (residual/σ)².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpacetimeSettings {
    /// Spread of the strain of an edge.
    pub strain: f64,
    /// Number of spreads beyond which strain and bending are taken for a fold, see [`crate::motion::terms::strain`].
    pub tail: f64,
    /// Spread of the bending angle at a vertex `[rad]`.
    pub bend: f64,
    /// Spread of the signed bending angle at a vertex `[rad]`, see [`crate::motion::terms::signed_bend`].
    pub signed_bend: f64,
    /// Spread of the shearing angle at a vertex `[rad]`.
    pub shear: f64,
    /// Spread of the second difference of a vertex between frames `[m]`.
    pub acceleration: f64,
    /// Colour differences beyond this count less and less.
    pub colour: f64,
    /// Pixels of level 0 whose colours vary together: the colour term is divided by it.
    pub colour_area: f64,
    /// Weight of the comparison with the frames before and after, relative to that with the first frame.
    pub neighbour_weight: f64,
    /// Distances of the outline beyond this count less and less `[px]`.
    pub outline: f64,
    /// Length of outline `[px]` whose errors vary together.
    pub outline_length: f64,
    /// Smoothness of the brightness field, relative to the data.
    pub gain_smoothness: f64,
    /// Coarsest pyramid level.
    pub coarsest: usize,
    /// Finest pyramid level.
    pub finest: usize,
    /// Iterations over all frames at each level.
    pub iterations: usize,
}

impl Default for SpacetimeSettings {
    fn default() -> Self {
        Self {
            strain: 0.005,
            tail: 2.0,
            bend: 0.15,
            signed_bend: 0.03,
            shear: 0.1,
            acceleration: 0.004,
            colour: 0.1,
            colour_area: 0.3,
            neighbour_weight: 0.5,
            outline: 8.0,
            outline_length: 0.028,
            gain_smoothness: 1.0,
            coarsest: 2,
            finest: 1,
            iterations: 15,
        }
    }
}
