//! What a person looks at after a reconstruction: pictures of every frame, a contact sheet and one
//! static page with numbers, curves and the command that repeats it.

pub mod colour;
pub mod curves;
mod font;
pub mod html;
mod legend;
pub mod pictures;
pub mod sheet;

pub use pictures::{FramePictures, Kind, Scales, measured_depth_image};
pub use sheet::{chosen_frames, contact_sheet};

use crate::metrics::Evaluation;

/// Everything the page says.
#[derive(Debug, Clone, Default)]
pub struct ReportData {
    /// Name of the scene.
    pub title: String,
    /// One line below the title: what was done, with which preset and version.
    pub subtitle: String,
    /// The command line that repeats this result.
    pub command: String,
    /// Numbers shown first, large.
    pub key_numbers: Vec<KeyNumber>,
    /// Numbers, in the scene folder, of the frames that have pictures.
    pub frames: Vec<usize>,
    /// Kinds of pictures that were written.
    pub kinds: Vec<Kind>,
    /// Folder of the pictures, relative to the page; empty: no pictures.
    pub pictures: String,
    /// Contact sheet, relative to the page; empty: none.
    pub contact_sheet: String,
    /// One row per epoch, ascending.
    pub history: Vec<HistoryRow>,
    /// What was recovered besides the motion.
    pub parameters: Vec<Parameter>,
    /// Comparison with the truth, where there is any.
    pub evaluation: Option<Evaluation>,
    /// Name of each stage and its wall-clock time [s].
    pub timings: Vec<(String, f64)>,
    /// What the user should know before trusting the result.
    pub warnings: Vec<String>,
    /// The complete configuration, as text.
    pub config: String,
}

/// A number with its name and unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyNumber {
    /// What it is.
    pub label: String,
    /// The number, rounded for reading.
    pub value: String,
    /// Its unit; may be empty.
    pub unit: String,
}

impl KeyNumber {
    /// From its three texts.
    pub fn new(label: impl Into<String>, value: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), value: value.into(), unit: unit.into() }
    }
}

/// A recovered parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name in [`HistoryRow::parameters`].
    pub name: String,
    /// What it is.
    pub label: String,
    /// Its value at the end.
    pub value: f64,
    /// Its unit; empty if it has none.
    pub unit: String,
    /// Anything worth saying, such as a bound that was hit; may be empty.
    pub note: String,
}

/// What one epoch of the optimisation left behind.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HistoryRow {
    /// Its number.
    pub epoch: usize,
    /// How many frames took part.
    pub active_frames: usize,
    /// Losses by name.
    pub losses: Vec<(String, f64)>,
    /// Parameters by name.
    pub parameters: Vec<(String, f64)>,
}
