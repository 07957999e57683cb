//! A scene in memory: what was filmed, by which camera, of which cloth. Loading is in the crate `tessuto-estimate`.

mod depth;
mod tracks;

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::camera::{Camera, Pose, Rect, Viewpoint};
use crate::error::{Error, Result};
use crate::mesh::{Mesh, Motion, Positions};
use crate::video::Video;
pub use depth::Depths;
pub use tracks::Tracks;

/// What is known of the true motion, in all frames or in some; used by evaluation only.
#[derive(Debug, Clone, Default)]
pub struct Truth {
    /// Measured surface points `[m]` per frame, in the world's frame; no point where nothing was measured.
    pub points: Option<Vec<Vec<DVec3>>>,
    /// True positions `[m]` of the template's vertices per frame.
    pub vertices: Option<Motion>,
    /// Points of the surface that were followed.
    pub tracks: Option<Tracks>,
}

impl Truth {
    /// Measured points `[m]` of frame `index`, if there are any.
    pub fn points_in(&self, index: usize) -> Option<&[DVec3]> {
        self.points.as_ref()?.get(index).map(Vec::as_slice).filter(|points| !points.is_empty())
    }

    /// Whether anything is known of frame `index`.
    pub fn knows(&self, index: usize) -> bool {
        self.points_in(index).is_some()
            || self.vertices.as_ref().is_some_and(|v| index < v.len())
            || self.tracks.as_ref().is_some_and(|t| t.points.contains_key(&index))
    }
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
    /// Where the camera is in each of `frames`; at the world's origin in all of them if there are none. The world is
    /// the camera's frame in the first frame of the folder.
    pub poses: Option<Vec<Pose>>,
    /// The unit of their lengths.
    pub pose_unit: PoseUnit,
    /// The crop in the full image.
    pub crop: Rect,
    /// Full image width and height `[px]`.
    pub full_size: [usize; 2],
    /// Index, in the folder, of the first of `frames`.
    pub first_frame: usize,
    /// The fabric in frame `first_frame`, in the world's frame `[m]`.
    pub template: Mesh,
    /// The video, N frames.
    pub frames: Video,
    /// What a depth sensor beside the camera measured in the same frames.
    pub depths: Option<Arc<Depths>>,
    /// Further cameras that filmed the same sheet in as many frames.
    pub more: Vec<View>,
    /// What is known of the causes of its motion.
    pub known: Known,
    /// Ground truth, where the folder has it, of the same frames.
    pub truth: Truth,
}

/// A further camera. Its frames are those of the scene's own camera, taken at the same times or a little later.
#[derive(Debug, Clone)]
pub struct View {
    /// Name from scene.json.
    pub name: String,
    /// Camera of the crop.
    pub camera: Camera,
    /// Where it is in each frame, in the scene's world.
    pub poses: Vec<Pose>,
    /// The crop in its full image.
    pub crop: Rect,
    /// Full image width and height `[px]`.
    pub full_size: [usize; 2],
    /// Its video, N frames.
    pub frames: Video,
    /// What a depth sensor beside it measured.
    pub depths: Option<Arc<Depths>>,
    /// How much later than the scene's own camera it takes each frame `[s]`.
    pub late: f64,
}

/// The unit of the lengths of a camera's path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PoseUnit {
    /// Metres, as given.
    #[default]
    Metres,
    /// None, as of poses that were found from images alone: how long it is has to be found first.
    Unknown,
    /// Metres, since one unit was found to be this long, with this standard deviation `[m]`.
    Found {
        /// Metres in one unit.
        length: f64,
        /// Standard deviation `[m]`.
        sd: f64,
    },
}

impl PoseUnit {
    /// What stands behind a length in messages: m, or units where there is no unit.
    pub fn name(self) -> &'static str {
        if self == Self::Unknown { "units" } else { "m" }
    }
}

/// What scene.json says of the causes of a motion.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Known {
    /// Direction of gravity in the world's frame, a unit vector.
    pub down: Option<DVec3>,
    /// Vertices of the template that something holds, in ascending order.
    pub held: Option<Vec<usize>>,
    /// What it lies on.
    pub planes: Vec<Plane>,
    /// What its other side looks like; `None`: the clip tells.
    pub back: Option<Back>,
}

/// What the other side of the fabric looks like, the one that the first frame shows less of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Back {
    /// The same colour at every point: dyed through, so that a print is mirrored.
    Same,
    /// One colour, sRGB in [0, 1] under the first frame's light; `None`: the clip tells which.
    Plain(Option<[f32; 3]>),
    /// Something else: nothing of the front is seen from there.
    Other,
}

/// A plane that the fabric does not pass through, such as a table, in the world's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit vector across it, to the side where the fabric is.
    pub normal: DVec3,
    /// Signed distance of the world's origin, times −1: n·x of its points `[m]`.
    pub height: f64,
}

impl Plane {
    /// How far a point is above it `[m]`; below 0 it is behind.
    #[inline]
    pub fn above(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.height
    }
}

impl Scene {
    /// The way from a point to a pixel of frame `n`, of the crop.
    pub fn viewpoint(&self, n: usize) -> Viewpoint {
        let camera_from_world = self.poses.as_ref().map(|poses| poses[n]);
        Viewpoint { camera: self.camera, camera_from_world }
    }

    /// What the other side looks like, as far as that is known; the same if nothing was told.
    pub fn back(&self) -> Back {
        self.known.back.unwrap_or(Back::Same)
    }

    /// The scene told what the other side looks like.
    pub fn with_back(&self, back: Back) -> Cow<'_, Self> {
        match self.known.back {
            Some(known) if known == back => Cow::Borrowed(self),
            _ => Cow::Owned(Self { known: Known { back: Some(back), ..self.known.clone() }, ..self.clone() }),
        }
    }

    /// The same of every frame, shape `[N]`.
    pub fn viewpoints(&self) -> Vec<Viewpoint> {
        (0..self.frames.len()).map(|n| self.viewpoint(n)).collect()
    }

    /// Number of cameras.
    pub fn view_count(&self) -> usize {
        1 + self.more.len()
    }

    /// The scene as camera `v` alone sees it, 0 the scene's own. The world stays the same.
    pub fn seen_by(&self, v: usize) -> Cow<'_, Self> {
        let Some(view) = v.checked_sub(1).map(|k| self.more[k].clone()) else { return Cow::Borrowed(self) };
        Cow::Owned(Self {
            name: format!("{}, {}", self.name, view.name),
            camera: view.camera,
            poses: Some(view.poses),
            crop: view.crop,
            full_size: view.full_size,
            frames: view.frames,
            depths: view.depths,
            more: Vec::new(),
            ..self.clone()
        })
    }

    /// The frames of a `range` alone, of all cameras, without truth. The template stays that of the clip's first frame.
    ///
    /// Panics if there are no such frames.
    pub fn span(&self, range: Range<usize>) -> Self {
        let depths =
            |depths: &Option<Arc<Depths>>| depths.as_ref().map(|depths| Arc::new(depths.span(range.clone())));
        let view = |view: &View| View {
            poses: view.poses[range.clone()].to_vec(),
            frames: view.frames.span(range.clone()),
            depths: depths(&view.depths),
            ..view.clone()
        };
        Self {
            name: self.name.clone(),
            folder: self.folder.clone(),
            first_frame: self.first_frame + range.start,
            poses: self.poses.as_ref().map(|poses| poses[range.clone()].to_vec()),
            frames: self.frames.span(range.clone()),
            depths: depths(&self.depths),
            more: self.more.iter().map(view).collect(),
            template: self.template.clone(),
            known: self.known.clone(),
            truth: Truth::default(),
            ..*self
        }
    }

    /// What camera `v` sees of a `motion`, shape [N, V], of the scene: where the sheet is when it takes its frames,
    /// straight between the frames and on beyond them.
    pub fn when_seen_by<'a>(&self, v: usize, motion: &'a [Positions]) -> Cow<'a, [Positions]> {
        let late = v.checked_sub(1).map_or(0.0, |k| self.more[k].late);
        if late == 0.0 || motion.len() < 2 {
            return Cow::Borrowed(motion);
        }
        let at = |n: usize| {
            let time = n as f64 + late * self.fps;
            let before = (time.max(0.0) as usize).min(motion.len() - 2);
            let pairs = motion[before].iter().zip(&motion[before + 1]);
            pairs.map(|(p, q)| p.lerp(*q, time - before as f64)).collect()
        };
        Cow::Owned((0..motion.len()).map(at).collect())
    }

    /// Refuses a scene that cannot be computed on. Folders are checked when they are read; this is for scenes made in
    /// memory.
    ///
    /// # Errors
    /// [`Error::Input`] naming the first thing that is wrong.
    pub fn check(&self) -> Result<()> {
        self.check_view()?;
        for (v, view) in self.more.iter().enumerate() {
            if view.frames.len() != self.frames.len() {
                let problem = format!("{} frames of {}", view.frames.len(), self.frames.len());
                return Err(Error::input(
                    format!("view {}", view.name),
                    problem,
                    "film the same times by all",
                ));
            }
            self.seen_by(v + 1).check_view().map_err(|error| error.within(&format!("view {}", view.name)))?;
        }
        Ok(())
    }

    fn check_view(&self) -> Result<()> {
        let camera = &self.camera;
        let fail = |place: String, problem: String, hint: &str| Err(Error::input(place, problem, hint));
        let intrinsics = [("fx", camera.fx), ("fy", camera.fy), ("cx", camera.cx), ("cy", camera.cy)];
        for (key, value) in intrinsics {
            if !value.is_finite() || (key.starts_with('f') && value <= 0.0) {
                let hint = "focal lengths are in pixels and above 0, the principal point is in pixels";
                return fail("camera".into(), format!("{key} is {value}"), hint);
            }
        }
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return fail("scene".into(), format!("fps is {}", self.fps), "give the frames per second");
        }
        if self.frames.is_empty() {
            return fail("scene".into(), "it has no frames".into(), "give one frame at least");
        }
        if let Some(poses) = self.poses.as_ref().filter(|poses| poses.len() != self.frames.len()) {
            let problem = format!("{} poses of {} frames", poses.len(), self.frames.len());
            return fail("poses".into(), problem, "give one pose per frame");
        }
        if self.pose_unit == PoseUnit::Unknown {
            let hint = "find the length of its unit first, or give it";
            return fail("poses".into(), "their lengths have no unit".into(), hint);
        }
        // Frames that are not held have been checked when they were read.
        for (k, frame) in self.frames.held().unwrap_or_default().iter().enumerate() {
            for (what, image, channels) in [("colour", &frame.rgb, 3), ("mask", &frame.mask, 1)] {
                if [image.width, image.height, image.channels] != [camera.width, camera.height, channels] {
                    let found = format!("{}×{} px of {} channels", image.width, image.height, image.channels);
                    let expected = format!("{}×{} px of {channels}", camera.width, camera.height);
                    let place = format!("frame {}, {what}", self.first_frame + k);
                    return fail(place, format!("{found}, expected {expected}"), "give all images one size");
                }
            }
        }
        if let Some(depths) = &self.depths {
            let pixels = depths.camera.width * depths.camera.height;
            if depths.maps.len() != self.frames.len() || depths.maps.iter().any(|map| map.len() != pixels) {
                let problem = format!("{} maps of {} frames", depths.maps.len(), self.frames.len());
                return fail("depth".into(), problem, "give one map per frame, all of one size");
            }
        }
        self.check_template()
    }

    fn check_template(&self) -> Result<()> {
        let (mesh, view) = (&self.template, self.viewpoint(0));
        let fail = |problem: String, hint: &str| Err(Error::input("template", problem, hint));
        if let Some(k) = mesh.positions.iter().position(|p| !p.is_finite() || view.depth(*p) <= 0.0) {
            let problem = format!("vertex {k} is {}, not in front of the camera", mesh.positions[k]);
            return fail(problem, "give camera coordinates in metres: x right, y down, z forward");
        }
        if let Some(k) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
            return fail(format!("texture coordinate {k} is {}", mesh.uvs[k]), "unwrap the mesh again");
        }
        if mesh.faces.is_empty() {
            return fail("it has no face".into(), "give a mesh with faces");
        }
        for (k, face) in mesh.faces.iter().enumerate() {
            let beyond =
                |corners: &[u32], count: usize| corners.iter().find(|c| **c as usize >= count).copied();
            let found = beyond(&face.vertices, mesh.positions.len()).or(beyond(&face.uvs, mesh.uvs.len()));
            if let Some(index) = found {
                return fail(
                    format!("face {k} names corner {index}, which does not exist"),
                    "correct the face",
                );
            }
            if face.vertices.len() < 3 || face.vertices.len() != face.uvs.len() {
                let (n, m) = (face.vertices.len(), face.uvs.len());
                return fail(
                    format!("face {k} has {n} corners and {m} texture coordinates"),
                    "correct the face",
                );
            }
        }
        Ok(())
    }
}
