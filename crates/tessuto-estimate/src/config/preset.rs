//! The named sets of settings.

use serde::{Deserialize, Serialize};

use tessuto_core::error::{Error, Result};

/// Named set of settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The published method, in steps small enough for long clips and without the rims of the masks.
    Saft,
    /// All frames at once, then what moved the fabric: stiffness, gravity, air, what holds it.
    Default,
    /// The same shapes alone: forces and stiffnesses replay them, and mean nothing else. Faster.
    Motion,
    /// After φ-SfT: as saft, of a continuum on an irregular mesh.
    #[serde(rename = "phi-sft")]
    PhiSft,
    /// After PG-SfT: as saft, of springs on a regular grid whose steps a small network takes.
    #[serde(rename = "pg-sft")]
    PgSft,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Default, Self::Motion, Self::Saft, Self::PhiSft, Self::PgSft];
    /// Their names.
    pub const NAMES: &[&str] = &["default", "motion", "saft", "phi-sft", "pg-sft"];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Saft => "saft",
            Self::Motion => "motion",
            Self::PhiSft => "phi-sft",
            Self::PgSft => "pg-sft",
        }
    }

    /// The one called `name`; `physics` is an earlier name of the default.
    ///
    /// # Errors
    /// [`Error::Usage`] with their names.
    pub fn named(name: &str) -> Result<Self> {
        let known = || format!("the presets are: {}", Self::NAMES.join(", "));
        let own = if name == "physics" { "default" } else { name };
        let found = Self::ALL.into_iter().find(|preset| preset.name() == own);
        found.ok_or_else(|| Error::usage(format!("preset {name}: no such preset"), known()))
    }
}
