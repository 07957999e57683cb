//! One step of a computation, as reported to its observer.

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

/// Most different names in a history, and the longest of them [bytes]; there are a dozen short ones.
const MAX_NAMES: usize = 200;
const MAX_NAME: usize = 64;

/// Epochs from MessagePack.
pub(super) fn from_bytes(bytes: &[u8]) -> Result<Vec<Epoch>, String> {
    let records: Vec<Record> = rmp_serde::from_slice(bytes).map_err(|e| e.to_string())?;
    // Names are kept for good, so a file must not bring any number of them.
    let names_in = |r: &'_ Record| {
        let pairs = r.losses.iter().chain(&r.parameters).map(|(name, _)| name.clone());
        pairs.chain([r.stage.clone()]).collect::<Vec<_>>()
    };
    let names: BTreeSet<String> = records.iter().flat_map(names_in).collect();
    if names.len() > MAX_NAMES || names.iter().any(|name| name.len() > MAX_NAME) {
        return Err(format!("{} names of losses and parameters, or one that is too long", names.len()));
    }
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
