//! What is done with a finished result.

use std::path::PathBuf;

use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use tessuto::export::{Clip, Format};
use tessuto::metrics::Evaluation;
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::result::Folder;
use tessuto::run::evaluate as compare;
use tessuto::run::replay::{self, Changes, replay};
use tessuto::view::{Look, RenderOptions, View};
use tessuto::{Error, io, view};

use crate::arrays;
use crate::error::{IntoPython as _, to_python};
use crate::remedy;
use crate::scene::{Scene, range};

/// Whether `folder` is a result: frames per second, and the shapes of motion [N, V].
#[pyfunction]
pub fn check_result(py: Python<'_>, folder: PathBuf) -> PyResult<(f64, usize)> {
    let opened = py.detach(|| Folder::open(&folder)).into_python(py)?;
    Ok((opened.fps, opened.mesh.positions.len()))
}

/// 8-bit colour of an image file, [h, w, 3].
#[pyfunction]
pub fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let image = py.detach(|| io::image::read_bytes(&path)).into_python(py)?;
    let [h, w] = [image.height, image.width];
    arrays::shaped(py, image.data, [h, w, 3])
}

type PyMesh<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Vec<Vec<u32>>, Vec<Vec<u32>>);

/// Positions [V, 3], texture coordinates [U, 2] and the faces' indices of both, of an OBJ file.
#[pyfunction]
pub fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<PyMesh<'_>> {
    let mesh = py.detach(|| io::obj::read(&path)).into_python(py)?;
    let uv = mesh.uvs.iter().flat_map(|uv| uv.to_array()).collect();
    let uv = arrays::shaped(py, uv, [mesh.uvs.len(), 2])?;
    let positions = arrays::to_rows(py, &mesh.positions)?;
    let (faces, uv_faces) = mesh.faces.into_iter().map(|face| (face.vertices, face.uvs)).unzip();
    Ok((positions, uv, faces, uv_faces))
}

fn json(evaluation: &Evaluation) -> String {
    serde_json::to_string(evaluation).expect("plain data")
}

/// The evaluation of `result` as JSON; `warn` is called with what is odd about the scene.
#[pyfunction]
pub fn evaluate(
    py: Python<'_>,
    scene: PathBuf,
    result: PathBuf,
    frames: Option<(usize, usize)>,
    seed: u64,
    warn: &Bound<'_, PyAny>,
) -> PyResult<String> {
    let mut told = Vec::new();
    let heard = &mut |warning: &_| told.push(remedy::warning(warning));
    let evaluation =
        py.detach(|| compare::evaluate(&scene, &result, range(frames), seed, heard)).into_python(py)?;
    told.into_iter().try_for_each(|text| warn.call1((text,)).map(|_| ()))?;
    Ok(json(&evaluation))
}

/// As [`evaluate`], of a scene in memory.
#[pyfunction]
pub fn evaluate_scene(py: Python<'_>, scene: &Scene, result: PathBuf, seed: u64) -> PyResult<String> {
    let compared = py.detach(|| compare::evaluate_loaded(&scene.loaded, &result, seed));
    compared.into_python(py).map(|evaluation| json(&evaluation))
}

/// The motion of `result` under other stiffnesses and forces, and with `contact` by these settings, JSON,
/// [N, V, 3], and a result folder of it at `out`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "what can be changed, and where it goes")]
pub fn simulate(
    py: Python<'_>,
    result: PathBuf,
    stretch: Option<f64>,
    bend: Option<f64>,
    shear: Option<f64>,
    forces: f64,
    contact: Option<String>,
    out: Option<PathBuf>,
    replace: bool,
    command: String,
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let contact = contact.map(|text| serde_json::from_str(&text)).transpose();
    let contact = contact.map_err(|e| crate::error::refused(format!("contact: {e}")))?;
    let work = || {
        // What can be refused is refused before the work.
        let target = out.map(|out| OutputFolder::prepare(&out, FolderKind::Result, replace)).transpose()?;
        let original = Folder::open(&result)?;
        let given = [("stretch", stretch), ("bend", bend), ("shear", shear)];
        let stiffness = given.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect();
        let changes = Changes { stiffness, forces, contact, ..Changes::default() };
        let replayed = replay(&original, &changes)?;
        if let Some(target) = target {
            replay::write(&original, &replayed, target, &command)?;
        }
        Ok(replayed.motion)
    };
    let motion = py.detach(work).into_python(py)?;
    arrays::to_frames(py, &motion, motion.vertex_count())
}

/// Renders `result` into a folder, which it returns.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "what a view can be given")]
pub fn render(
    py: Python<'_>,
    result: PathBuf,
    out: PathBuf,
    angles: Option<(f64, f64)>,
    look: Option<&str>,
    environment: Option<PathBuf>,
    size: Option<(usize, usize)>,
    frames: Option<(usize, usize)>,
    samples: usize,
    replace: bool,
) -> PyResult<PathBuf> {
    let usage = |problem: String, hint: &str| to_python(py, &Error::usage(problem, hint));
    let look = look.map(|look| look.parse::<Look>().map_err(|e| usage(format!("look {look}"), &e)));
    if let Some((width, height)) = size
        && [width, height].iter().any(|side| !(16..=16384).contains(side))
    {
        return Err(usage(format!("size {width}×{height}"), "give 16 to 16384 px"));
    }
    if let Some((first, end)) = frames.filter(|(first, end)| first >= end) {
        return Err(usage(format!("frames {first} to {end}"), "give (first, one past the last)"));
    }
    let options = RenderOptions {
        look: look.transpose()?,
        view: angles.map_or(View::Original, |(left, up)| View::About(left, up)),
        environment,
        size: size.map(|(width, height)| [width, height]),
        frames: range(frames),
        turn: None,
        pictures: None,
        samples,
        replace,
    };
    let work = || {
        let opened = Folder::open(&result)?;
        view::render(&opened, Some(&out), &options, &mut |_, _| {}, &mut |_, _| {})
    };
    py.detach(work).into_python(py).map(|rendered| rendered.folder)
}

/// Key and content of every format that this build can write.
#[pyfunction]
pub fn formats() -> Vec<(&'static str, &'static str)> {
    Format::built().map(|format| (format.key(), format.content())).collect()
}

/// Exports `result`; the files written.
#[pyfunction]
pub fn export(
    py: Python<'_>,
    result: PathBuf,
    to: Vec<String>,
    out: Option<PathBuf>,
    without_lost: bool,
    replace: bool,
) -> PyResult<Vec<PathBuf>> {
    let format = |name: &String| {
        let usage = |hint| to_python(py, &Error::usage(format!("format {name}"), hint));
        name.parse::<Format>().map_err(|e| usage(e.to_string()))
    };
    let formats = to.iter().map(format).collect::<PyResult<Vec<_>>>()?;
    let work = || {
        let mut clip = Clip::of(&Folder::open(&result)?)?;
        if without_lost {
            clip = clip.without_lost()?;
        }
        let folder = out.unwrap_or_else(|| result.join("export"));
        tessuto::export::export(&clip, &formats, &folder, replace)
    };
    py.detach(work).into_python(py)
}
