//! What the numbers of a verdict are called: on the page, in sentences and by the program.

/// What the overlap of the silhouettes with the masks is called, wherever it is reported.
pub const SILHOUETTE: &str = "silhouette overlap";
/// The likeness of the colours to the video, of the recovered texture in the first frame's light.
pub const TEXTURED: &str = "colours by the texture";
/// The same with material and light.
pub const LIT: &str = "colours re-rendered";
