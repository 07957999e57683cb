//! The way out of an error or a warning: words, and what to change, in the library's terms. A program names its own
//! options for it.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

/// What to do about an error or a warning.
///
/// Written out it ends with its remedies' fields and settings in brackets. A program whose users have other names for
/// these matches on [`remedies`](Self::remedies) instead.
#[derive(Debug, Clone, PartialEq)]
pub struct Hint {
    /// What to do, in words.
    pub text: String,
    /// What to change for it; several are alternatives.
    pub remedies: Vec<Remedy>,
}

/// What to change. Not `non_exhaustive`: a program that gives remedies other names should fail to build where it
/// lacks one.
#[derive(Debug, Clone, PartialEq)]
pub enum Remedy {
    /// Allow to replace what is there: `RunOptions::replace`, or the argument `replace`.
    Replace,
    /// Start afresh: not `RunOptions::resume`.
    NoResume,
    /// Take a part of the video, these frames if some are named: `LoadOptions::frames`,
    /// `import::Settings::frames`.
    Frames(Option<Range<usize>>),
    /// Look at the scene: `check_folder`.
    Check,
    /// Estimate material and light: `run::appearance::run`.
    Appearance,
    /// Take the true motion: `MotionSource`.
    TrueMotion,
    /// A setting and its value: `Config::set`.
    Set(&'static str),
    /// Build with this feature of the crate.
    Feature(String),
    /// `import::Settings::fps`.
    Fps,
    /// Poses of a camera that moves.
    Poses,
    /// Poses that are refined by what stands still around it: `import::Settings::refine_poses`.
    RefinePoses,
    /// The metres in one unit of the camera's poses.
    PoseScale,
    /// `import::Settings::rate`.
    Rate,
    /// `import::Settings::masks`.
    Masks,
    /// Choose one object of masks that hold several: `import::Settings::object`,
    /// `masks::Request::object`.
    Object,
    /// Use every N-th of these frames: `import::Settings::stride`.
    Stride(Range<usize>, usize),
    /// Corners of the fabric in the first frame: `masks::Request::outline`.
    Outline,
    /// The place without the fabric: `masks::Request::plate`.
    Plate,
    /// Make the masks of the scene in this folder from its frames: `masks::make`.
    MakeMasks(PathBuf),
    /// Make a scene of this video or image.
    Import(PathBuf),
    /// `import::Settings::allow_gaps`.
    AllowGaps,
    /// `import::Settings::downscale`.
    Downscale,
    /// `import::Settings::calibration`, of these intrinsics.
    Intrinsics,
    /// Estimate the focal length from the corners of a flat sheet: `template::focal`.
    EstimateCamera,
    /// Which camera `read_calibration` shall take.
    CameraId,
    /// Make the template of the scene in this folder: `template::make`.
    MakeTemplate(PathBuf),
    /// Re-sample the mesh with new texture coordinates:
    /// `Changes::remesh`.
    Remesh,
    /// Re-sample the template of the scene as a grid: `Resample::Grid`.
    Regrid,
    /// Smaller or larger triangles for an outline on a table: `template::table::Side`.
    TriangleSide,
    /// Merge vertices that touch: `Changes::weld`.
    Weld,
    /// What a unit of the depth map is: `read_depth`.
    DepthScale,
    /// Export without the frames that are lost: `Clip::without_lost`.
    WithoutLost,
    /// Repair the template of a scene: `Changes`.
    RepairTemplate(Repair),
}

/// What to do to the template of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Repair {
    /// The scene's folder.
    pub folder: PathBuf,
    /// Swap x and y, before all else.
    pub swap_xy: bool,
    /// Negate x, y, z.
    pub flip: [bool; 3],
    /// Factor from the file's unit to metres.
    pub scale: f64,
    /// Merge vertices that touch.
    pub weld: bool,
}

impl Repair {
    /// Nothing to do to the template of the scene in `folder`.
    pub fn of(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), swap_xy: false, flip: [false; 3], scale: 1.0, weld: false }
    }

    /// Names of the axes that are negated, such as `yz`.
    pub fn flipped(&self) -> String {
        "xyz".chars().zip(self.flip).filter_map(|(axis, flip)| flip.then_some(axis)).collect()
    }
}

impl Hint {
    /// The hint with one more remedy.
    #[must_use]
    pub fn with(mut self, remedy: Remedy) -> Self {
        self.remedies.push(remedy);
        self
    }
}

impl<T: Into<String>> From<T> for Hint {
    fn from(text: T) -> Self {
        Self { text: text.into(), remedies: Vec::new() }
    }
}

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        if self.remedies.is_empty() {
            return Ok(());
        }
        let remedies: Vec<String> = self.remedies.iter().map(Remedy::to_string).collect();
        write!(f, " ({})", remedies.join(", or "))
    }
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Replace => f.write_str("replace = true"),
            Self::NoResume => f.write_str("resume = false"),
            Self::Frames(None) => f.write_str("frames"),
            Self::Frames(Some(range)) => write!(f, "frames = {}..{}", range.start, range.end),
            Self::Check => f.write_str("check"),
            Self::Appearance => f.write_str("run::appearance"),
            Self::TrueMotion => f.write_str("motion = truth"),
            Self::Set(assignment) => f.write_str(assignment),
            Self::Feature(name) => write!(f, "feature {name}"),
            Self::Fps => f.write_str("fps"),
            Self::Poses => f.write_str("poses"),
            Self::RefinePoses => f.write_str("refine_poses = true"),
            Self::PoseScale => f.write_str("pose_scale"),
            Self::Rate => f.write_str("rate"),
            Self::Masks => f.write_str("masks"),
            Self::Object => f.write_str("object"),
            Self::Stride(range, stride) => {
                write!(f, "frames = {}..{}, stride = {stride}", range.start, range.end)
            }
            Self::Outline => f.write_str("outline"),
            Self::Plate => f.write_str("plate"),
            Self::MakeMasks(_) => f.write_str("masks::make"),
            Self::Import(_) => f.write_str("import"),
            Self::AllowGaps => f.write_str("allow_gaps = true"),
            Self::Downscale => f.write_str("downscale"),
            Self::Intrinsics => f.write_str("fx, fy, cx, cy"),
            Self::EstimateCamera => f.write_str("template::focal"),
            Self::CameraId => f.write_str("camera_id"),
            Self::MakeTemplate(_) => f.write_str("template::make"),
            Self::Remesh => f.write_str("remesh"),
            Self::Regrid => f.write_str("remesh the template as a grid"),
            Self::TriangleSide => f.write_str("template::table::Side"),
            Self::Weld => f.write_str("weld = true"),
            Self::DepthScale => f.write_str("scale of the depth map"),
            Self::WithoutLost => f.write_str("without_lost"),
            Self::RepairTemplate(repair) => repair.fmt(f),
        }
    }
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flipped = self.flipped();
        let parts = [
            self.swap_xy.then(|| "swap = xy".to_owned()),
            (!flipped.is_empty()).then(|| format!("flip = {flipped}")),
            (self.scale != 1.0).then(|| format!("scale = {}", self.scale)),
            self.weld.then(|| "weld = true".to_owned()),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

/// Something doubtful that does not stand in the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Warning {
    /// Topic, one word.
    pub topic: String,
    /// What was found, with the figures.
    pub found: String,
    /// What to do about it, if anything need be done.
    pub hint: Option<Hint>,
}

impl Warning {
    /// A warning of one word, what was found, and what to do about it.
    pub fn new(topic: &str, found: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Self { topic: topic.to_owned(), found: found.into(), hint: Some(hint.into()) }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.topic, self.found)?;
        self.hint.iter().try_for_each(|hint| write!(f, "\n  hint: {hint}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hint_ends_with_what_to_change() {
        let hint = Hint::from("leave them out").with(Remedy::Frames(Some(2..5))).with(Remedy::AllowGaps);
        assert_eq!(hint.to_string(), "leave them out (frames = 2..5, or allow_gaps = true)");
        let repair = Repair { flip: [false, true, true], scale: 0.01, ..Repair::of("scene") };
        let warning =
            Warning::new("axes", "strange", Hint::from("turn it").with(Remedy::RepairTemplate(repair)));
        assert_eq!(warning.to_string(), "axes: strange\n  hint: turn it (flip = yz, scale = 0.01)");
    }
}
