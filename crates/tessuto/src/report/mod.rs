//! What a person looks at after a reconstruction: images of every frame, a contact sheet and one
//! self-contained page with the moving fabric, the video, numbers, curves and the command that repeats it.

pub mod causes;
pub mod chart;
pub(crate) mod colour;
pub mod embed;
pub mod film;
mod font;
pub(crate) mod images;
mod kind;
mod legend;
pub mod page;
pub mod scale;
mod scripts;
pub(crate) mod sheet;

pub use causes::CauseData;
pub use chart::Chart;
pub use embed::{EmbeddedMotion, Field, Surface};
pub use film::Film;
pub use images::{FrameImages, Kind, Ranges, Scales, measured_depth_image};
pub use scale::Scale;
pub use sheet::{chosen_frames, contact_sheet};

use tessuto_core::camera::Camera;
use tessuto_estimate::metrics::{Evaluation, FrameVerdict, Verdict};

/// Everything the page says.
#[derive(Debug, Clone, Default)]
pub struct ReportData {
    /// Name of the scene.
    pub title: String,
    /// One line below the title: what was done, with which preset and version.
    pub subtitle: String,
    /// The command line that repeats this result.
    pub command: String,
    /// Whether the result is good, where that is known.
    pub verdict: Option<Verdict>,
    /// The verdict on every frame, where that is known.
    pub verdicts: Vec<FrameVerdict>,
    /// Numbers shown first, large; a few.
    pub key_numbers: Vec<KeyNumber>,
    /// The moving fabric.
    pub cloth: Option<ClothData>,
    /// The video and the drawn frames.
    pub film: Film,
    /// Further cameras, with what they filmed.
    pub others: Vec<OtherLens>,
    /// Texture and material maps.
    pub maps: Vec<Map>,
    /// The light.
    pub light: Option<LightData>,
    /// Line charts besides those of `evaluation`.
    pub charts: Vec<Chart>,
    /// What was recovered besides the motion; not listed where `causes` are.
    pub parameters: Vec<Parameter>,
    /// What moved the fabric, where that was searched.
    pub causes: Option<CauseData>,
    /// Comparison with the truth, where there is any.
    pub evaluation: Option<Evaluation>,
    /// Name of each stage and its wall-clock time `[s]`.
    pub timings: Vec<(String, f64)>,
    /// What the user should know before trusting the result.
    pub warnings: Vec<String>,
    /// The complete configuration, as text.
    pub config: String,
    /// Whether the page belongs to a run that goes on; its script then asks `state` beside it for news.
    pub live: bool,
}

/// The moving fabric, for the 3D view.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ClothData {
    /// Frames per second.
    pub fps: f64,
    /// Number of the first frame in the video.
    pub first_frame: usize,
    /// Frames of the video; the motion of a running reconstruction may have fewer.
    pub frame_count: usize,
    /// Camera of the whole image.
    pub camera: Camera,
    /// R and t of every frame by rows, [R t], of a camera that moves; none of one that stands still.
    pub poses: Vec<[f64; 12]>,
    /// Topology.
    pub surface: Surface,
    /// Positions.
    pub motion: EmbeddedMotion,
    /// What it can be coloured by.
    pub fields: Vec<Field>,
    /// The other side, if it has one colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub back: Option<BackData>,
}

/// The other side of a fabric that has one colour there.
#[derive(Debug, Clone, serde::Serialize)]
pub struct BackData {
    /// Whether the print is on the side that the triangles' normals point to.
    pub outward: bool,
    /// As filmed, `#rrggbb`.
    pub texture: String,
    /// Its albedo.
    pub diffuse: String,
}

/// A further camera that filmed the fabric.
#[derive(Debug, Clone, serde::Serialize)]
pub struct OtherLens {
    /// Name of its view.
    pub name: String,
    /// Camera of the whole image.
    pub camera: Camera,
    /// R and t by rows, [R t], of every frame; one of a camera that stands still.
    pub poses: Vec<[f64; 12]>,
    /// How many frames later than the first camera it takes its images.
    pub late: f64,
    /// What it filmed, and the recovered sheet drawn through it.
    pub film: Film,
}

/// An image on the fabric's surface.
#[derive(Debug, Clone)]
pub struct Map {
    /// Key, for the script: `texture`, `diffuse`, `roughness` or `metallic`.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// JPEG, base64.
    pub image: String,
}

/// The light as a lat-long image; its middle is where the camera looks, the top row is up.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct LightData {
    /// Width `[px]`.
    pub width: usize,
    /// Height `[px]`.
    pub height: usize,
    /// Linear radiance, f32 `[height, width, 3]`, base64.
    pub radiance: String,
    /// The same for looking at, JPEG, base64.
    #[serde(skip)]
    pub image: String,
    /// Whether parts of the image are hatched: nothing shows the light from there.
    #[serde(skip)]
    pub unobserved: bool,
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
    /// How good it is, in a word, where there is a scale for it.
    pub grade: Option<&'static str>,
    /// That scale, in words.
    pub scale: String,
}

impl KeyNumber {
    /// From its three texts.
    pub fn new(label: impl Into<String>, value: impl Into<String>, unit: impl Into<String>) -> Self {
        let (grade, scale) = (None, String::new());
        Self { label: label.into(), value: value.into(), unit: unit.into(), grade, scale }
    }

    /// The same, with what `scale` says of its `value`, in the scale's unit.
    #[must_use]
    pub fn graded(self, scale: &Scale, value: f64) -> Self {
        Self { grade: Some(scale.grade(value)), scale: scale.sentence(), ..self }
    }
}

/// A recovered parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name in the [steps](tessuto_estimate::session::Epoch::parameters).
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
