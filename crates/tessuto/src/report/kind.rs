//! The kinds of images of a result, and what their colours mean.

/// Kinds of images; each has a folder of its own, so that a viewer's arrow keys play the video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The reconstruction's colour.
    Render,
    /// The video's colour.
    Observed,
    /// Root mean square over the channels of their difference.
    Difference,
    /// Rendered minus observed mask.
    MaskDifference,
    /// The reconstruction's depth.
    Depth,
    /// Reconstructed minus measured depth.
    DepthDifference,
}

impl Kind {
    /// All of them, in the order they are shown.
    pub const ALL: [Self; 6] = [
        Self::Render,
        Self::Observed,
        Self::Difference,
        Self::Depth,
        Self::MaskDifference,
        Self::DepthDifference,
    ];

    /// Name of its folder.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Render => "render",
            Self::Observed => "observed",
            Self::Difference => "difference",
            Self::MaskDifference => "mask_difference",
            Self::Depth => "depth",
            Self::DepthDifference => "depth_difference",
        }
    }

    /// What it shows, for people.
    pub fn label(self) -> &'static str {
        match self {
            Self::Render => "rendered",
            Self::Observed => "observed",
            Self::Difference => "colour difference",
            Self::MaskDifference => "mask difference",
            Self::Depth => "depth",
            Self::DepthDifference => "depth − measured depth",
        }
    }

    /// Path of the image of frame `frame`, relative to the folder of images.
    pub fn path(self, frame: usize) -> String {
        format!("{}/frame_{frame:03}.png", self.folder())
    }
}

/// What the ends of the colour bars mean; the same for all frames, so that they can be compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Depth `[m]` at the two ends.
    pub depth: [f64; 2],
    /// Depth difference `[m]` at the ends: ± this.
    pub depth_difference: f64,
    /// Colour difference (sRGB, of 1) at the upper end.
    pub colour_difference: f64,
}
