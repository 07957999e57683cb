//! A scene in memory: what was filmed, by which camera, of which cloth. Loading is in [`crate::io`].

use std::path::PathBuf;

use glam::DVec3;

use crate::camera::{Camera, Rect};
use crate::image::Image;
use crate::mesh::Mesh;

/// Vertex positions [m] of one moment, camera frame, shape [V].
pub type Shape = Vec<DVec3>;

/// One video frame, cut to the scene's crop.
#[derive(Debug, Clone)]
pub struct Frame {
    /// sRGB-encoded colour in [0, 1], shape [height, width, 3]; black where there is no fabric.
    pub rgb: Image,
    /// Share of the pixel that is fabric, in [0, 1], shape [height, width, 1].
    pub mask: Image,
}

/// What is known of the true motion; used by evaluation only.
#[derive(Debug, Clone, Default)]
pub struct Truth {
    /// Measured surface points [m] per frame, camera frame.
    pub points: Option<Vec<Vec<DVec3>>>,
    /// True positions [m] of the template's vertices per frame.
    pub vertices: Option<Vec<Shape>>,
}

/// Everything the reconstruction starts from.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name from scene.json.
    pub name: String,
    /// The folder it was read from.
    pub folder: PathBuf,
    /// Frames per second.
    pub fps: f64,
    /// Camera of the crop (its principal point is shifted).
    pub camera: Camera,
    /// The crop in the full image.
    pub crop: Rect,
    /// Full image width and height [px].
    pub full_size: [usize; 2],
    /// Index, in the folder, of `frames[0]`.
    pub first_frame: usize,
    /// The fabric in frame `first_frame`.
    pub template: Mesh,
    /// The video, shape [N].
    pub frames: Vec<Frame>,
    /// Ground truth, where the folder has it, of the same frames.
    pub truth: Truth,
}
