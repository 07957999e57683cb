//! What a run cost, kept beside its result.

use std::path::Path;

use serde::{Deserialize, Serialize};

use tessuto_core::error::{Error, Result};
use tessuto_estimate::io::{atomic_write, read_bounded};

/// Largest file of a record `[bytes]`.
const LARGEST: u64 = 1 << 20;

/// Of one method on one scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// The command.
    pub command: String,
    /// Wall time `[s]`, that of interrupted attempts included.
    pub seconds: f64,
    /// Largest memory that it held `[bytes]`, where the system reports it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<u64>,
    /// Energy that the processors took during the run, for this and everything else `[J]`, where the machine reports
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy: Option<f64>,
    /// What went wrong; `None` if nothing did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl Record {
    /// The record at `path`; `None` if there is none, or something else.
    pub fn read(path: &Path) -> Option<Self> {
        serde_json::from_slice(&read_bounded(path, LARGEST).ok()?).ok()
    }

    /// Writes it to `path`, over an earlier record only.
    ///
    /// # Errors
    /// [`Error::Input`] if something else is there; [`Error::Output`].
    pub fn write(&self, path: &Path) -> Result<()> {
        if path.exists() && Self::read(path).is_none() {
            let problem = "is no record of a comparison, and is not replaced";
            return Err(Error::input(path.display().to_string(), problem, "choose another output folder"));
        }
        let text = serde_json::to_string_pretty(self).expect("plain data") + "\n";
        atomic_write(path, text.as_bytes())
    }

    /// Adds what an earlier, interrupted attempt of the same command took.
    #[must_use]
    pub fn after(mut self, earlier: Option<&Self>) -> Self {
        let Some(earlier) = earlier.filter(|e| e.failure.is_some() && e.command == self.command) else {
            return self;
        };
        self.seconds += earlier.seconds;
        self.memory = self.memory.max(earlier.memory);
        self.energy = self.energy.zip(earlier.energy).map(|(a, b)| a + b);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_replaces_records_only_and_adds_up_attempts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("saft.json");
        let failed = Record {
            command: "a".into(),
            seconds: 3.0,
            memory: Some(9),
            energy: Some(1.0),
            failure: Some("killed".into()),
        };
        failed.write(&path).unwrap();
        let now = Record { command: "a".into(), seconds: 2.0, memory: Some(5), ..Record::default() };
        let sum = now.clone().after(Record::read(&path).as_ref());
        assert_eq!((sum.seconds, sum.memory, sum.energy), (5.0, Some(9), None));
        // A finished run is not an attempt of the next one, nor is another command's.
        assert_eq!(now.clone().after(Some(&now)).seconds, 2.0);
        assert_eq!(Record { command: "b".into(), ..now.clone() }.after(Some(&failed)).seconds, 2.0);
        now.write(&path).unwrap();
        std::fs::write(&path, "{\"mine\": 1}").unwrap();
        assert_eq!(now.write(&path).unwrap_err().exit_code(), 3);
    }
}
