//! What a running reconstruction tells its caller.

use crate::error::Result;
use crate::scene::Shape;

/// One finished step of a stage.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Epoch {
    /// Stage of the reconstruction.
    pub stage: &'static str,
    /// Steps finished in this stage.
    pub step: usize,
    /// Steps this stage will take.
    pub of: usize,
    /// Frames that take part.
    pub active_frames: usize,
    /// Losses by name.
    pub losses: Vec<(&'static str, f64)>,
    /// Parameters by name.
    pub parameters: Vec<(&'static str, f64)>,
}

/// Receives every finished step, and the motion so far of the first frames (empty from stages that do not change
/// it); an error it returns ends the reconstruction with that error.
pub type Observer<'a> = dyn FnMut(&Epoch, &[Shape]) -> Result<()> + 'a;
