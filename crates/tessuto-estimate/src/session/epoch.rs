//! One step of a computation, as reported to its observer and as it is stored.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// Name of a stage, a loss or a parameter.
pub type Name = Cow<'static, str>;

/// One finished step of a stage.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Stage of the reconstruction.
    pub stage: Name,
    /// Steps finished in this stage.
    pub step: usize,
    /// Steps this stage will take; as many as `step` where that is not known any more.
    pub of: usize,
    /// Frames that take part.
    pub active_frames: usize,
    /// Losses by name.
    pub losses: Vec<(Name, f64)>,
    /// Parameters by name.
    pub parameters: Vec<(Name, f64)>,
}

/// Values with names, for an [`Epoch`].
pub fn named(values: impl IntoIterator<Item = (&'static str, f64)>) -> Vec<(Name, f64)> {
    values.into_iter().map(|(name, value)| (Name::Borrowed(name), value)).collect()
}
