//! One step of a computation, as its caller hears of it.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

/// One finished step of a stage.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
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

/// [`Epoch`] as it is read.
#[derive(Deserialize)]
struct Record {
    stage: String,
    step: usize,
    of: usize,
    active_frames: usize,
    losses: Vec<(String, f64)>,
    parameters: Vec<(String, f64)>,
}

/// Epochs from MessagePack.
pub(super) fn from_bytes(bytes: &[u8]) -> Result<Vec<Epoch>, rmp_serde::decode::Error> {
    let records: Vec<Record> = rmp_serde::from_slice(bytes)?;
    let named = |pairs: Vec<(String, f64)>| pairs.into_iter().map(|(name, v)| (name_of(name), v)).collect();
    let epoch = |r: Record| Epoch {
        stage: name_of(r.stage),
        step: r.step,
        of: r.of,
        active_frames: r.active_frames,
        losses: named(r.losses),
        parameters: named(r.parameters),
    };
    Ok(records.into_iter().map(epoch).collect())
}

/// The name for good: there are a dozen of them, each kept once.
fn name_of(name: String) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    match names.get(name.as_str()) {
        Some(known) => known,
        None => {
            let known: &'static str = name.leak();
            names.insert(known);
            known
        }
    }
}
