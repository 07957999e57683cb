//! masks.json: what the masks of a scene were made from, and how far each can be trusted.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::findings::{Fault, Finding, findings};
use super::front::Front;
use super::judge::Judgement;
use crate::io::{atomic_write, read_text};
use tessuto_core::error::{Error, Result};

/// Name of the file.
pub(super) const NAME: &str = "masks.json";
const FORMAT: &str = "masks of tessuto 1";

/// A place that somebody clicked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Click {
    /// Number of the frame.
    pub frame: usize,
    /// Column `[px]`.
    pub x: f64,
    /// Row `[px]`.
    pub y: f64,
    /// Whether fabric is there.
    pub inside: bool,
}

/// What the border is that was given for frame 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Border {
    /// That of the fabric: the mask of frame 0 is what was drawn.
    Drawn,
    /// Near that of the fabric, which is found by colours.
    Found,
}

/// What is known of the masks of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    format: String,
    /// Corners of the fabric in frame 0 `[px]`; none where it was given otherwise.
    pub outline: Option<Vec<[f64; 2]>>,
    /// File of the scene with the mask of frame 0, where one was given.
    #[serde(default)]
    pub first: Option<String>,
    /// What was said of the border that was given; none where nothing was.
    #[serde(default)]
    pub border: Option<Border>,
    /// File of the scene with the place without the fabric, where one was given.
    pub plate: Option<String>,
    /// In the order in which they were made.
    pub clicks: Vec<Click>,
    /// Whether pieces beside the largest were dropped.
    pub largest_piece: bool,
    /// Standard deviation of a channel `[0 … 255 of companded colours]` between frames that should be alike.
    pub noise: f64,
    /// Of every frame.
    pub frames: Vec<Frame>,
    /// What was found, frames with the same fault together; those that may be wrong first.
    #[serde(default)]
    pub findings: Vec<Finding>,
    /// What a user should know.
    pub notes: Vec<String>,
}

/// What is known of one mask.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Its number.
    pub frame: usize,
    /// 0 … 1.
    pub confidence: f64,
    /// Fraction of the image.
    pub area: f64,
    /// Why it looks wrong, where it does.
    pub reason: Option<String>,
}

impl Record {
    /// Nothing yet.
    pub(super) fn new() -> Self {
        Self {
            format: FORMAT.to_owned(),
            outline: None,
            first: None,
            border: None,
            plate: None,
            clicks: Vec::new(),
            largest_piece: false,
            noise: 0.0,
            frames: Vec::new(),
            findings: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Reads the record of the scene in `folder`; `None` where its masks were not made from the clip.
    ///
    /// # Errors
    /// [`Error::Input`] if there is one that cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(NAME);
        if path.symlink_metadata().is_err() {
            return Ok(None);
        }
        let damaged = |problem: String| {
            Error::input(path.display().to_string(), problem, "remove the file, and give the outline again")
        };
        let mut record: Self =
            serde_json::from_str(&read_text(&path)?).map_err(|e| damaged(e.to_string()))?;
        if record.format != FORMAT {
            return Err(damaged(format!("the format is “{}”, not “{FORMAT}”", record.format)));
        }
        if record.findings.is_empty() {
            // Earlier versions wrote those of single frames only.
            let single = |f: &Frame| {
                let text = f.reason.clone()?;
                Some(Finding { first: f.frame, last: f.frame, text, doubtful: true })
            };
            record.findings = record.frames.iter().filter_map(single).collect();
        }
        Ok(Some(record))
    }

    /// Writes it into `folder`.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).expect("plain data") + "\n";
        atomic_write(&folder.join(NAME), text.as_bytes())
    }

    /// The doubtful frames.
    pub fn doubtful(&self) -> impl Iterator<Item = &Frame> {
        self.frames.iter().filter(|f| f.reason.is_some())
    }

    pub(super) fn judged(&mut self, judgements: &[Judgement], fronts: &[Front], areas: &[f64]) {
        let all = judgements.iter().zip(areas).enumerate();
        self.frames = all
            .map(|(frame, (j, area))| Frame {
                frame,
                confidence: j.confidence,
                area: (area * 1e5).round() / 1e5,
                reason: j.fault.map(Fault::own_text),
            })
            .collect();
        let faults: Vec<_> = judgements.iter().map(|j| j.fault).collect();
        self.findings = findings(&faults, fronts);
    }
}
