//! What a recording shows besides the motion, taken from a scene or from a result.

use std::path::PathBuf;

use crate::export::Clip;
use crate::result::OtherCamera;
use tessuto_core::camera::{Camera, Pose, Rect};
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_core::scene::{Scene, View};
use tessuto_estimate::io::image::rgb8;
use tessuto_estimate::io::rgb8::Rgb8;
use tessuto_estimate::io::{self, jpeg};

/// Largest side `[px]` and quality of the images: some 40 kB each.
const SIDE: u32 = 640;
const QUALITY: u8 = 72;

/// What is known before the motion is.
pub struct Subject<'a> {
    /// What the viewer calls the recording.
    pub name: &'a str,
    /// The template.
    pub mesh: &'a Mesh,
    /// Frames per second.
    pub fps: f64,
    /// Number of the first frame in the video.
    pub first_frame: usize,
    /// Number of frames.
    pub frame_count: usize,
    /// Camera of the images.
    pub camera: Camera,
    /// Where it is in every frame, if it moves.
    pub poses: Option<&'a [Pose]>,
    /// Image of frame n, from 0, as the camera sees it.
    pub image: Option<FrameImage<'a>>,
    /// Further cameras.
    pub others: Vec<OtherEye<'a>>,
    /// Points `[m]` on the true surface in every frame.
    pub truth: Option<&'a [Positions]>,
}

/// A further camera, and what it filmed.
pub struct OtherEye<'a> {
    /// Its name; of those with equal names the viewer shows the last.
    pub name: &'a str,
    /// Camera of the images.
    pub camera: Camera,
    /// Where it is in every frame.
    pub poses: &'a [Pose],
    /// How much later than the first camera it takes its frames `[s]`.
    pub late: f64,
    /// Image of frame n, from 0.
    pub image: Option<FrameImage<'a>>,
}

/// Gives the image of a frame.
pub type FrameImage<'a> = Box<dyn Fn(usize) -> Result<Rgb8> + Sync + 'a>;

impl<'a> Subject<'a> {
    /// The video and the template of `scene`.
    pub fn of_scene(scene: &'a Scene) -> Self {
        let truth = &scene.truth;
        Self {
            name: &scene.name,
            mesh: &scene.template,
            fps: scene.fps,
            first_frame: scene.first_frame,
            frame_count: scene.frames.len(),
            camera: scene.camera,
            poses: scene.poses.as_deref(),
            image: Some(Box::new(|n| Ok(rgb8(&scene.frames.frame(n)?.rgb)))),
            others: scene.more.iter().map(OtherEye::of_view).collect(),
            truth: truth.points.as_deref().or(truth.vertices.as_deref()),
        }
    }

    /// The template of `clip`, and the video where the result has images of it.
    ///
    /// # Errors
    /// [`Error::Input`] if the first image cannot be read.
    pub fn of_clip(clip: &'a Clip) -> Result<Self> {
        let shown = !clip.images.is_empty();
        let image: FrameImage = Box::new(|n| io::image::read_bytes(&clip.images[n]));
        Ok(Self {
            name: &clip.name,
            mesh: &clip.mesh,
            fps: clip.fps,
            first_frame: clip.first_frame,
            frame_count: clip.frame_count,
            camera: if shown { clip.camera.cropped(clip.crop) } else { clip.camera },
            poses: clip.poses.as_deref(),
            image: shown.then_some(image),
            others: clip.others.iter().zip(&clip.other_images).map(OtherEye::of_camera).collect(),
            truth: None,
        })
    }

    /// Frame `n` as JPEG, small.
    pub(super) fn encoded(&self, image: &FrameImage, camera: &Camera, n: usize) -> Result<Vec<u8>> {
        let rgb = image(n)?;
        let (found, expected) = ([rgb.width, rgb.height], [camera.width, camera.height]);
        if found != expected {
            return Err(Error::input(
                format!("frame {}", self.first_frame + n),
                format!(
                    "its image is {}×{} px, expected {}×{}",
                    found[0], found[1], expected[0], expected[1]
                ),
                "use the folder as tessuto wrote it",
            ));
        }
        Ok(jpeg::encode_part(&rgb, whole(camera), SIDE, QUALITY))
    }
}

impl<'a> OtherEye<'a> {
    fn of_view(view: &'a View) -> Self {
        let image: FrameImage = Box::new(|n| Ok(rgb8(&view.frames.frame(n)?.rgb)));
        let View { name, camera, poses, late, .. } = view;
        Self { name, camera: *camera, poses, late: *late, image: Some(image) }
    }

    fn of_camera((other, images): (&'a OtherCamera, &'a Vec<PathBuf>)) -> Self {
        let OtherCamera { name, camera, poses, crop, late } = other;
        let shown = !images.is_empty();
        let image: FrameImage = Box::new(|n| io::image::read_bytes(&images[n]));
        let camera = if shown { camera.cropped(*crop) } else { *camera };
        Self { name, camera, poses, late: *late, image: shown.then_some(image) }
    }
}

/// Camera of the [encoded](Subject::encoded) images of `camera`.
pub(super) fn small(camera: &Camera) -> Camera {
    let all = whole(camera);
    camera.cropped(all).resized(jpeg::fitted(all, SIDE))
}

fn whole(camera: &Camera) -> Rect {
    Rect { x0: 0, y0: 0, x1: camera.width, y1: camera.height }
}

/// The mesh with one texture coordinate per vertex.
pub(super) struct Corners {
    /// Vertex of each: those of the template in their order, then the others of vertices with several.
    pub vertices: Vec<u32>,
    /// Texture coordinates, (0, 0) being the upper left.
    pub uvs: Vec<[f32; 2]>,
    /// Indices into the two.
    pub triangles: Vec<[u32; 3]>,
}

impl Corners {
    pub fn new(mesh: &Mesh) -> Self {
        let count = mesh.positions.len();
        // Vertices that no face has keep none.
        let mut uv_of: Vec<Option<u32>> = vec![None; count];
        let mut vertices: Vec<u32> = (0..count as u32).collect();
        let mut further = std::collections::BTreeMap::new();
        let mut corner = |vertex: u32, uv: u32| {
            if *uv_of[vertex as usize].get_or_insert(uv) == uv {
                return vertex;
            }
            *further.entry([vertex, uv]).or_insert_with(|| {
                vertices.push(vertex);
                uv_of.push(Some(uv));
                vertices.len() as u32 - 1
            })
        };
        let pairs = mesh.triangles().into_iter().zip(mesh.triangle_uvs());
        let triangles = pairs.map(|(v, uv)| std::array::from_fn(|k| corner(v[k], uv[k]))).collect();
        let place = |uv: &Option<u32>| {
            let uv = uv.map_or(glam::DVec2::ZERO, |k| mesh.uvs[k as usize]);
            [uv.x as f32, (1.0 - uv.y) as f32]
        };
        Self { uvs: uv_of.iter().map(place).collect(), vertices, triangles }
    }

    /// Positions `[m]` of the corners of `positions`.
    pub fn of(&self, positions: &Positions) -> Vec<[f32; 3]> {
        self.vertices.iter().map(|v| positions[*v as usize].as_vec3().to_array()).collect()
    }
}

/// The bytes of an image, shape [height, width, 3].
pub(super) fn rgb_bytes(image: &Image) -> Vec<u8> {
    rgb8(image).data
}
