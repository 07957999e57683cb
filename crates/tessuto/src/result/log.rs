//! log.json: how a result came about, beyond its configuration.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{read_json, write_json};
use tessuto_core::error::Result;

/// Commands, times and warnings.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// Command lines that repeat the result, in this order.
    pub commands: Vec<String>,
    /// Remarks on input and result.
    pub warnings: Vec<String>,
    /// Stage and its wall time `[s]`.
    pub timings: Vec<(String, f64)>,
}

impl Log {
    /// That of the result in `folder`.
    ///
    /// # Errors
    /// [`Error::Input`](tessuto_core::Error::Input).
    pub fn read(folder: &Path) -> Result<Self> {
        read_json(&folder.join("log.json"))
    }

    /// Writes it into `folder`.
    ///
    /// # Errors
    /// [`Error::Output`](tessuto_core::Error::Output).
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join("log.json"), self)
    }

    /// Sets the time `[s]` of `stage`.
    pub fn set_time(&mut self, stage: &str, seconds: f64) {
        match self.timings.iter_mut().find(|(name, _)| name == stage) {
            Some(entry) => entry.1 = seconds,
            None => self.timings.push((stage.to_owned(), seconds)),
        }
    }

    /// Adds `command`, in place of an earlier one of the same subcommand.
    pub fn set_command(&mut self, command: &str) {
        let subcommand = |c: &str| c.split_whitespace().nth(1).map(str::to_owned);
        self.commands.retain(|c| subcommand(c) != subcommand(command));
        self.commands.push(command.to_owned());
    }
}
