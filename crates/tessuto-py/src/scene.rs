//! A scene: of a folder, or of arrays.

use std::ops::Range;
use std::path::PathBuf;

use numpy::ndarray::Axis;
use numpy::{Element, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use tessuto::io::image::Samples;
use tessuto::io::scene::{LoadOptions, Loaded, RecordedView, Recording, assemble, back, load};
use tessuto::{Camera, Motion, Rect, Truth};

use crate::arrays;
use crate::error::IntoPython as _;
use crate::remedy;

/// fx, fy, cx, cy `[px]`, width, height `[px]`.
pub type Intrinsics = (f64, f64, f64, f64, usize, usize);

/// The camera of these intrinsics.
pub fn camera((fx, fy, cx, cy, width, height): Intrinsics) -> Camera {
    Camera { fx, fy, cx, cy, width, height }
}

/// Frames `first` to `end` − 1.
pub fn range(frames: Option<(usize, usize)>) -> Option<Range<usize>> {
    frames.map(|(first, end)| first..end)
}

/// A loaded scene.
#[pyclass(frozen, module = "tessuto._native")]
pub struct Scene {
    pub loaded: Loaded,
    /// Its folder, or the name of arrays.
    pub place: PathBuf,
}

/// Name, camera, frames, masks and poses of a further camera.
type Further<'py> = (String, Intrinsics, Images<'py>, Images<'py>, PyReadonlyArray3<'py, f64>);

type ColourAndCoverage<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f32>>);

/// Images of 8 or 16 bits.
#[derive(FromPyObject)]
pub enum Images<'py> {
    Bytes(PyReadonlyArrayDyn<'py, u8>),
    Words(PyReadonlyArrayDyn<'py, u16>),
}

impl Images<'_> {
    /// The samples of each image, the first axis being that of the images.
    fn samples(&self) -> Vec<Samples> {
        match self {
            Self::Bytes(images) => each(images).map(Samples::Bytes).collect(),
            Self::Words(images) => each(images).map(Samples::Words).collect(),
        }
    }
}

fn each<T: Element + Copy>(images: &PyReadonlyArrayDyn<'_, T>) -> impl Iterator<Item = Vec<T>> {
    let images = images.as_array();
    (0..images.shape()[0]).map(move |n| images.index_axis(Axis(0), n).iter().copied().collect())
}

#[pymethods]
impl Scene {
    /// The scene in `folder`.
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf, frames: Option<(usize, usize)>) -> PyResult<Self> {
        let options = LoadOptions { frames: range(frames), ..LoadOptions::default() };
        let loaded = py.detach(|| load(&folder, &options)).into_python(py)?;
        Ok(Self { loaded, place: folder })
    }

    /// The scene of arrays.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "what a scene is made of")]
    fn assemble(
        py: Python<'_>,
        name: String,
        fps: f64,
        intrinsics: Intrinsics,
        crop: Option<(usize, usize, usize, usize)>,
        frames: Images<'_>,
        masks: Images<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        uv: PyReadonlyArray2<'_, f64>,
        faces: Vec<Vec<u32>>,
        uv_faces: Option<Vec<Vec<u32>>>,
        true_vertices: Option<PyReadonlyArray3<'_, f64>>,
        true_points: Option<Vec<PyReadonlyArray2<'_, f64>>>,
        poses: Option<PyReadonlyArray3<'_, f64>>,
        views: Vec<Further<'_>>,
        planes: Vec<([f64; 3], [f64; 3])>,
        back: Option<&str>,
    ) -> PyResult<Self> {
        let template = arrays::mesh(vertices.as_array(), uv.as_array(), faces, uv_faces)?;
        let vertices = true_vertices.map(|array| arrays::frames(array.as_array())).transpose()?;
        let points = true_points
            .map(|frames| frames.iter().map(|points| arrays::positions(points.as_array())).collect())
            .transpose()?;
        let view = |(name, intrinsics, frames, masks, poses): &Further<'_>| {
            Ok(RecordedView {
                name: name.clone(),
                camera: camera(*intrinsics),
                poses: arrays::poses(poses.as_array())?,
                frames: frames.samples(),
                masks: masks.samples(),
            })
        };
        let more = views.iter().map(view).collect::<PyResult<_>>()?;
        let place = PathBuf::from(&name);
        let recording = Recording {
            name,
            fps,
            camera: camera(intrinsics),
            poses: poses.map(|poses| arrays::poses(poses.as_array())).transpose()?,
            crop: crop.map(|(x0, y0, x1, y1)| Rect { x0, y0, x1, y1 }),
            frames: frames.samples(),
            masks: masks.samples(),
            template,
            planes: planes.iter().map(|(point, normal)| [(*point).into(), (*normal).into()]).collect(),
            back: back.map(|text| back::parse(text, "scene")).transpose().into_python(py)?,
            truth: Truth {
                vertices: vertices.map(Motion::new).transpose().into_python(py)?,
                points,
                tracks: None,
            },
            more,
        };
        let loaded = py.detach(|| assemble(recording)).into_python(py)?;
        Ok(Self { loaded, place })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.loaded.scene.name
    }

    #[getter]
    fn place(&self) -> PathBuf {
        self.place.clone()
    }

    #[getter]
    fn fps(&self) -> f64 {
        self.loaded.scene.fps
    }

    #[getter]
    fn frame_count(&self) -> usize {
        self.loaded.scene.frames.len()
    }

    #[getter]
    fn first_frame(&self) -> usize {
        self.loaded.scene.first_frame
    }

    /// Of the crop.
    #[getter]
    fn camera(&self) -> Intrinsics {
        let Camera { fx, fy, cx, cy, width, height } = self.loaded.scene.camera;
        (fx, fy, cx, cy, width, height)
    }

    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let poses = self.loaded.scene.poses.as_ref();
        let rows = |poses: &Vec<tessuto::Pose>| poses.iter().flat_map(tessuto::Pose::rows).collect();
        poses.map(|poses| arrays::shaped(py, rows(poses), [poses.len(), 4, 4])).transpose()
    }

    /// What the other side looks like, as scene.json names it.
    #[getter]
    fn back(&self) -> Option<String> {
        self.loaded.scene.known.back.map(back::name)
    }

    /// Normal and height of every plane that the fabric lies on.
    #[getter]
    fn planes(&self) -> Vec<([f64; 3], f64)> {
        let planes = &self.loaded.scene.known.planes;
        planes.iter().map(|plane| (plane.normal.to_array(), plane.height)).collect()
    }

    /// Names of the further cameras.
    #[getter]
    fn views(&self) -> Vec<String> {
        self.loaded.scene.more.iter().map(|view| view.name.clone()).collect()
    }

    #[getter]
    fn crop(&self) -> (usize, usize, usize, usize) {
        let Rect { x0, y0, x1, y1 } = self.loaded.scene.crop;
        (x0, y0, x1, y1)
    }

    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::to_rows(py, &self.loaded.scene.template.positions)
    }

    #[getter]
    fn uv<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let uvs = &self.loaded.scene.template.uvs;
        arrays::shaped(py, uvs.iter().flat_map(|uv| uv.to_array()).collect(), [uvs.len(), 2])
    }

    #[getter]
    fn faces(&self) -> Vec<Vec<u32>> {
        self.loaded.scene.template.faces.iter().map(|face| face.vertices.clone()).collect()
    }

    #[getter]
    fn uv_faces(&self) -> Vec<Vec<u32>> {
        self.loaded.scene.template.faces.iter().map(|face| face.uvs.clone()).collect()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.loaded.warnings.iter().map(remedy::warning).collect()
    }

    #[getter]
    fn true_vertices<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let truth = self.loaded.scene.truth.vertices.as_ref();
        truth.map(|motion| arrays::to_frames(py, motion, motion.vertex_count())).transpose()
    }

    /// Colour [h, w, 3] and coverage [h, w] of frame `n` within the crop.
    fn frame<'py>(&self, py: Python<'py>, n: usize) -> PyResult<ColourAndCoverage<'py>> {
        let frames = &self.loaded.scene.frames;
        if n >= frames.len() {
            return Err(crate::error::refused(format!("frame {n} of {}", frames.len())));
        }
        let frame = py.detach(|| frames.frame(n).map(std::borrow::Cow::into_owned)).into_python(py)?;
        let [h, w] = [frame.mask.height, frame.mask.width];
        Ok((arrays::shaped(py, frame.rgb.data, [h, w, 3])?, arrays::shaped(py, frame.mask.data, [h, w])?))
    }
}
