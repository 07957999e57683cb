//! Methods beside each other on the same scenes: what was measured, what was published, and the results to look at.
//!
//! The results are those of [`run`](crate::run::run), one folder for each scene and method, with a [`Record`] of
//! what they cost; here they are only read.

mod page;
mod published;
mod record;
mod table;

use std::path::{Path, PathBuf};

pub use page::write_page;
pub use published::{PUBLISHED, Printed};
pub use record::Record;
pub use table::{Table, csv, tables, text};

use crate::result::Folder;
use tessuto_core::error::{Error, Result};
use tessuto_estimate::config::{Config, Preset};
use tessuto_estimate::metrics::Metrics;

/// A method: a preset, with changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    /// Its name: that of the result's folder.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// Where its settings start from.
    pub preset: Preset,
    /// Settings that differ, as [`Config::set`] takes them.
    pub changes: &'static [&'static str],
}

/// The methods, each by the name of its preset.
pub const METHODS: [Method; 4] = [
    Method { key: "default", label: "tessuto", preset: Preset::Default, changes: &[] },
    Method { key: "saft", label: "SAFT, this program's", preset: Preset::Saft, changes: &[] },
    Method { key: "phi-sft", label: "after φ-SfT, this program's", preset: Preset::PhiSft, changes: &[] },
    Method { key: "pg-sft", label: "after PG-SfT, this program's", preset: Preset::PgSft, changes: &[] },
];

const FIXED: &str = "rollout.optimise_material=false";
const NO_FORCE: &str = "rollout.weights.force=0";
const NO_ENERGY: &str = "rollout.weights.energy=0";

/// Those of \[SAFT\] Table 7: without optimising the stiffnesses, and without the regularisers besides.
pub const ABLATIONS: [Method; 4] = [
    Method { key: "saft-fixed", label: "saft, stiffnesses fixed", preset: Preset::Saft, changes: &[FIXED] },
    Method {
        key: "saft-fixed-no-force",
        label: "saft, stiffnesses fixed, without R_F",
        preset: Preset::Saft,
        changes: &[FIXED, NO_FORCE],
    },
    Method {
        key: "saft-fixed-no-energy",
        label: "saft, stiffnesses fixed, without R_E",
        preset: Preset::Saft,
        changes: &[FIXED, NO_ENERGY],
    },
    Method {
        key: "saft-fixed-no-regulariser",
        label: "saft, stiffnesses fixed, without R_F and R_E",
        preset: Preset::Saft,
        changes: &[FIXED, NO_FORCE, NO_ENERGY],
    },
];

impl Method {
    /// The one of [`METHODS`] called `name`.
    ///
    /// # Errors
    /// [`Error::Usage`] with their names.
    pub fn named(name: &str) -> Result<Self> {
        METHODS.into_iter().find(|m| m.key == name).ok_or_else(|| {
            let known = METHODS.map(|m| m.key).join(", ");
            Error::usage(format!("method {name}: no such method"), format!("the methods are: {known}"))
        })
    }

    /// Its settings, with the further `changes`.
    ///
    /// # Errors
    /// As [`Config::set`].
    pub fn config(&self, changes: &[String]) -> Result<Config> {
        let mut config = Config::preset(self.preset);
        config.set_all(self.changes.iter().copied().chain(changes.iter().map(String::as_str)))?;
        Ok(config)
    }
}

/// One method on one scene.
#[derive(Debug)]
pub struct Entry {
    /// Name of the scene's folder.
    pub scene: String,
    /// The method.
    pub method: Method,
    /// Where its result is, if there is one.
    pub folder: PathBuf,
    /// What it cost and how it ended; `None` if it never ran.
    pub record: Option<Record>,
}

impl Entry {
    /// The place of `method` on `scene` below `folder`, with the record that is there.
    pub fn at(folder: &Path, scene: &str, method: Method) -> Self {
        let place = folder.join(scene);
        let record = Record::read(&place.join(format!("{}.json", method.key)));
        Self { scene: scene.to_owned(), method, folder: place.join(method.key), record }
    }

    /// Where its record is.
    pub fn record_path(&self) -> PathBuf {
        self.folder.with_file_name(format!("{}.json", self.method.key))
    }

    /// The result, if there is a whole one.
    pub fn result(&self) -> Option<Folder> {
        Folder::open(&self.folder).ok()
    }

    /// Mean errors against the truth, where there is a result and a truth.
    pub fn errors(&self) -> Option<Metrics> {
        self.result()?.metrics().ok().flatten().map(|evaluation| evaluation.mean)
    }
}
