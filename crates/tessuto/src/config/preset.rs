//! The named sets of settings.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Named set of settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The published method.
    Saft,
    /// All frames at once, then the forces; more accurate and faster.
    Default,
    /// The same, then what moved the fabric: stiffness, gravity, air, what holds it. Being worked on.
    Physics,
    /// After φ-SfT: as saft, of a continuum on an irregular mesh.
    #[serde(rename = "phi-sft")]
    PhiSft,
    /// After PG-SfT: as saft, of springs on a regular grid whose steps a small network takes.
    #[serde(rename = "pg-sft")]
    PgSft,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Default, Self::Saft, Self::Physics, Self::PhiSft, Self::PgSft];
    /// Their names.
    pub const NAMES: &[&str] = &["default", "saft", "physics", "phi-sft", "pg-sft"];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Saft => "saft",
            Self::Physics => "physics",
            Self::PhiSft => "phi-sft",
            Self::PgSft => "pg-sft",
        }
    }

    /// The one called `name`.
    ///
    /// # Errors
    /// [`Error::Usage`] with their names.
    pub fn named(name: &str) -> Result<Self> {
        let known = || format!("the presets are: {}", Self::NAMES.join(", "));
        let found = Self::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| Error::usage(format!("preset {name}: no such preset"), known()))
    }
}
