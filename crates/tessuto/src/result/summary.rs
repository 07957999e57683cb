//! summary.json: is the result good? For people, and for scripts that look at many results.
//!
//! ```text
//! name             of the scene's folder
//! version          of the program
//! frames           [first, one past the last]
//! vertices         of the template
//! seconds          wall time of all stages [s]
//! verdict          state of the worst frame (found, doubtful, lost), sentence; counts of the frames by state;
//!                  doubtful, lost: [first, one past the last] of each stretch of such frames; and of each
//!                  quantity mean, worst value and its frame: silhouette (intersection over union), uncovered part of
//!                  the mask (of 1), psnr [dB], correlation (of the pattern, within tiles), |strain| (of 1: mean, 99th
//!                  percentile, largest), creased edges (of 1), area in flipped triangles (of 1), deviation [m]
//! warnings         remarks on input and result
//! ```
//!
//! The verdict needs no truth; its limits are in [`tessuto_estimate::metrics::verdict`], the verdict on every frame is
//! in metrics.json under `verdicts`, its numbers under `agreement`. Only `seconds` differs from run to run.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Folder, read_json, write_json};
use tessuto_core::error::Result;
use tessuto_core::error::Warning;
use tessuto_estimate::metrics::{Verdict, judge};

const NAME: &str = "summary.json";

/// What a result is in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Summary {
    /// Name of the scene's folder.
    pub name: String,
    /// Version of the program.
    pub version: String,
    /// First frame and one past the last.
    pub frames: [usize; 2],
    /// Vertices of the template.
    pub vertices: usize,
    /// Wall time of all stages `[s]`.
    pub seconds: f64,
    /// Absent for motions that were not compared with a video.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// Remarks on input and result.
    pub warnings: Vec<String>,
}

impl Summary {
    /// From the other files of a result.
    ///
    /// # Errors
    /// [`Error::Input`](tessuto_core::Error::Input) naming the file that cannot be used.
    pub fn of(folder: &Folder) -> Result<Self> {
        let log = folder.log()?;
        let agreement = folder.metrics()?.map_or(&[][..], |metrics| &metrics.agreement);
        Ok(Self {
            name: folder.run.name(),
            version: folder.run.version.clone(),
            frames: folder.run.frames,
            vertices: folder.mesh.positions.len(),
            seconds: log.timings.iter().map(|(_, seconds)| seconds).sum(),
            verdict: judge(agreement, &folder.mesh),
            warnings: log.warnings.clone(),
        })
    }

    /// That of the result in `folder`; None if it has none.
    ///
    /// # Errors
    /// [`Error::Input`](tessuto_core::Error::Input).
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(NAME);
        if path.is_file() { read_json(&path).map(Some) } else { Ok(None) }
    }

    /// Writes it into `folder`.
    ///
    /// # Errors
    /// [`Error::Output`](tessuto_core::Error::Output).
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(NAME), self)
    }

    /// What to report of a verdict that does not find all frames, and what to do about lost ones.
    pub fn warning(&self) -> Option<Warning> {
        self.verdict.as_ref().and_then(Verdict::warning)
    }
}
