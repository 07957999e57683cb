//! Between NumPy's arrays and the library's vectors.

use numpy::ndarray::{ArrayView2, ArrayView3, Axis};
use numpy::{Element, PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use tessuto::glam::{DVec2, DVec3};
use tessuto::mesh::{Face, Mesh};
use tessuto::{Pose, Positions};

/// A [V, 3] array.
pub fn positions(array: ArrayView2<f64>) -> PyResult<Positions> {
    if array.ncols() != 3 {
        return Err(crate::error::refused(format!("shape {:?}, expected (V, 3)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect())
}

/// A [V, 3] array of `count` vertices; `what` names it.
pub fn field(array: ArrayView2<f64>, count: usize, what: &str) -> PyResult<Positions> {
    if array.shape() != [count, 3] {
        let found = array.shape();
        return Err(crate::error::refused(format!("{what} has shape {found:?}, expected [{count}, 3]")));
    }
    positions(array)
}

/// An [N, V, 3] array.
pub fn frames(array: ArrayView3<f64>) -> PyResult<Vec<Positions>> {
    array.axis_iter(Axis(0)).map(positions).collect()
}

/// An [N, 4, 4] array of poses, camera from world.
pub fn poses(array: ArrayView3<f64>) -> PyResult<Vec<Pose>> {
    if array.shape()[1..] != [4, 4] {
        return Err(crate::error::refused(format!(
            "poses has shape {:?}, expected (N, 4, 4)",
            array.shape()
        )));
    }
    let pose = |m: ArrayView2<f64>| Pose::from_rows(&std::array::from_fn(|k| m[[k / 4, k % 4]]));
    Ok(array.axis_iter(Axis(0)).map(pose).collect())
}

/// A mesh of [V, 3] positions, texture coordinates [U, 2], and for every face the indices of both.
pub fn mesh(
    vertices: ArrayView2<f64>,
    uv: ArrayView2<f64>,
    faces: Vec<Vec<u32>>,
    uv_faces: Option<Vec<Vec<u32>>>,
) -> PyResult<Mesh> {
    if uv.ncols() != 2 {
        return Err(crate::error::refused(format!("uv has shape {:?}, expected (U, 2)", uv.shape())));
    }
    let of_faces = uv_faces.unwrap_or_else(|| faces.clone());
    if of_faces.len() != faces.len() {
        let (own, all) = (of_faces.len(), faces.len());
        return Err(crate::error::refused(format!("uv_faces has {own} faces, faces has {all}")));
    }
    let faces = faces.into_iter().zip(of_faces).map(|(vertices, uvs)| Face { vertices, uvs }).collect();
    let uvs = uv.rows().into_iter().map(|p| DVec2::new(p[0], p[1])).collect();
    Ok(Mesh { positions: positions(vertices)?, uvs, faces })
}

/// Refuses faces whose corners are not among `vertices` and `uvs`.
pub fn check_faces(mesh: &Mesh) -> PyResult<()> {
    let (vertices, uvs) = (mesh.positions.len(), mesh.uvs.len());
    for (k, face) in mesh.faces.iter().enumerate() {
        let within = |corners: &[u32], count: usize| corners.iter().all(|c| (*c as usize) < count);
        if face.vertices.len() < 3
            || face.vertices.len() != face.uvs.len()
            || !within(&face.vertices, vertices)
            || !within(&face.uvs, uvs)
        {
            let corners = &face.vertices;
            let text =
                format!("face {k} is {corners:?}, of {vertices} vertices and {uvs} texture coordinates");
            return Err(crate::error::refused(text));
        }
    }
    Ok(())
}

/// `values` as an array of this shape, without a copy.
pub fn shaped<T: Element, const N: usize>(
    py: Python<'_>,
    values: Vec<T>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyArray<T, numpy::ndarray::Dim<[usize; N]>>>>
where
    numpy::ndarray::Dim<[usize; N]>: numpy::ndarray::Dimension,
    [usize; N]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; N]>>,
{
    PyArray1::from_vec(py, values).reshape(shape)
}

fn flat(positions: &[DVec3]) -> impl Iterator<Item = f64> + '_ {
    positions.iter().flat_map(|p| p.to_array())
}

/// Vectors as [V, 3].
pub fn to_rows<'py>(py: Python<'py>, positions: &[DVec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    shaped(py, flat(positions).collect(), [positions.len(), 3])
}

/// Frames of `count` vectors as [N, V, 3].
pub fn to_frames<'py>(
    py: Python<'py>,
    frames: &[Positions],
    count: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let mut values = Vec::with_capacity(frames.len() * count * 3);
    frames.iter().for_each(|frame| values.extend(flat(frame)));
    shaped(py, values, [frames.len(), count, 3])
}
