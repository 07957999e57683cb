//! A frame fitted by itself, from wherever it may be.

use super::{LevelSearch, Positions, Problem};
use crate::math::factor::Scratch;

/// Strength of the pull to where the fit starts, relative to that of a prediction: it is a start only.
pub(super) const PULL: f64 = 1e-2;

impl Problem<'_> {
    /// Searches of the refined levels, coarse to fine, with the priors' tails of a start.
    pub(super) fn settling(&self) -> Vec<LevelSearch<'_, '_>> {
        let mut levels: Vec<LevelSearch> =
            self.refined_levels().into_iter().map(|level| self.at_level(level)).collect();
        levels.iter_mut().for_each(|level| level.loosen([1.0; 2], self.settings.start_tail));
        levels
    }
}

/// Positions of `frame` that are found from `start` at all `levels`, with brightness as it is where the sheet is at `seen`.
pub(super) fn settled(
    levels: &mut [LevelSearch],
    frame: usize,
    start: &Positions,
    seen: &Positions,
    scratch: &mut Scratch,
) -> Positions {
    let mut x = start.clone();
    for level in levels {
        level.fit_anew(&[(frame, seen)]);
        let (next, value) = level.fit_frame(frame, x.clone(), start, PULL, scratch);
        if value.is_finite() {
            x = next;
        }
    }
    x
}
