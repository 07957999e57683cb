//! Direct light on points of the cloth, and its adjoint.

use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use tessuto::mesh::Mesh;
use tessuto::pbr::{
    CHANNELS, EnvironmentMap, EnvironmentSampler, Geometry, Material, Shader, SurfacePoint, radiance,
    radiance_vjp, visible_points,
};
use tessuto::raster::{Rasterizer, Rendering};

use crate::arrays;
use crate::raster::checked_camera;
use crate::scene::Intrinsics;

/// What the pixels of a camera see of a cloth.
#[pyclass(frozen, module = "tessuto._native")]
pub struct LitPoints {
    geometry: Geometry,
    points: Vec<SurfacePoint>,
    pixels: Vec<u32>,
}

#[pymethods]
impl LitPoints {
    #[new]
    fn new(
        py: Python<'_>,
        intrinsics: Intrinsics,
        vertices: PyReadonlyArray2<'_, f64>,
        uv: PyReadonlyArray2<'_, f64>,
        faces: Vec<Vec<u32>>,
        uv_faces: Option<Vec<Vec<u32>>>,
    ) -> PyResult<Self> {
        let camera = checked_camera(intrinsics)?;
        let mesh: Mesh = arrays::mesh(vertices.as_array(), uv.as_array(), faces, uv_faces)?;
        arrays::check_faces(&mesh)?;
        Ok(py.detach(|| {
            let geometry = Geometry::new(&mesh, std::slice::from_ref(&mesh.positions));
            let rasterizer = Rasterizer::new(&mesh);
            let rendering = &mut Rendering::new();
            let all = |_: &Rendering, _| true;
            let seen = visible_points(&rasterizer, camera, &geometry, 0, &mesh.positions, rendering, all);
            let (pixels, points) = seen.into_iter().unzip();
            Self { geometry, points, pixels }
        }))
    }

    /// Index row·width + column of every point's pixel.
    #[getter]
    fn pixels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.pixels)
    }

    /// Positions [P, 3] `[m]`.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let values = self.points.iter().flat_map(|point| point.position.to_array()).collect();
        arrays::shaped(py, values, [self.points.len(), 3])
    }
}

fn material(planes: &PyReadonlyArray3<f32>) -> PyResult<Material> {
    let array = planes.as_array();
    match *array.shape() {
        [CHANNELS, height, width] if height > 0 && width > 0 => {
            let values: Vec<f32> = array.iter().copied().collect();
            Ok(Material::from_planes(width, height, &values))
        }
        _ => {
            let text =
                format!("material has shape {:?}, expected [{CHANNELS}, height, width]", array.shape());
            Err(crate::error::refused(text))
        }
    }
}

fn environment(radiance: &PyReadonlyArray3<f32>) -> PyResult<EnvironmentMap> {
    let array = radiance.as_array();
    match *array.shape() {
        [height, width, 3] if height > 0 && width > 0 => {
            let values: Vec<f32> = array.iter().copied().collect();
            let texels = values.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            Ok(EnvironmentMap { width, height, texels })
        }
        _ => {
            let text = format!("environment has shape {:?}, expected [height, width, 3]", array.shape());
            Err(crate::error::refused(text))
        }
    }
}

/// How directions are drawn: seed, samples per point, fraction that is uniform over the sphere.
type Sampling = (u32, usize, f64);

fn sampler(
    light: &PyReadonlyArray3<f32>,
    proposal: &PyReadonlyArray3<f32>,
    (_, samples, uniform_fraction): Sampling,
) -> PyResult<EnvironmentSampler> {
    let (light, proposal) = (environment(light)?, environment(proposal)?);
    if [light.width, light.height] != [proposal.width, proposal.height] {
        return Err(crate::error::refused("proposal and environment differ in shape"));
    }
    if samples == 0 || !(0.0..=1.0).contains(&uniform_fraction) {
        let text = format!("samples is {samples}, above 0; uniform_fraction is {uniform_fraction}, 0 to 1");
        return Err(crate::error::refused(text));
    }
    let mut sampler = EnvironmentSampler::new(&proposal, uniform_fraction);
    sampler.set_radiance(&light);
    Ok(sampler)
}

/// Linear colour [P, 3] of every point.
#[pyfunction]
#[pyo3(signature = (points, planes, light, proposal, sampling))]
pub fn direct_light<'py>(
    py: Python<'py>,
    points: &LitPoints,
    planes: PyReadonlyArray3<'py, f32>,
    light: PyReadonlyArray3<'py, f32>,
    proposal: PyReadonlyArray3<'py, f32>,
    sampling: Sampling,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (material, sampler) = (material(&planes)?, sampler(&light, &proposal, sampling)?);
    let (seed, samples, _) = sampling;
    let colours = py.detach(|| {
        let shader = Shader { geometry: &points.geometry, material: &material, light: &sampler };
        radiance(&shader, &points.points, seed, samples)
    });
    arrays::shaped(py, colours.concat(), [colours.len(), 3])
}

type Adjoint<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>);

/// The adjoint: gradients by material and environment.
#[pyfunction]
#[pyo3(signature = (points, planes, light, proposal, sampling, grad))]
pub fn direct_light_vjp<'py>(
    py: Python<'py>,
    points: &LitPoints,
    planes: PyReadonlyArray3<'py, f32>,
    light: PyReadonlyArray3<'py, f32>,
    proposal: PyReadonlyArray3<'py, f32>,
    sampling: Sampling,
    grad: PyReadonlyArray2<'py, f32>,
) -> PyResult<Adjoint<'py>> {
    let (material, sampler) = (material(&planes)?, sampler(&light, &proposal, sampling)?);
    let found = grad.as_array();
    if found.shape() != [points.points.len(), 3] {
        let expected = [points.points.len(), 3];
        let text = format!("the gradient has shape {:?}, expected {expected:?}", found.shape());
        return Err(crate::error::refused(text));
    }
    let adjoints: Vec<[f32; 3]> = found.rows().into_iter().map(|g| [g[0], g[1], g[2]]).collect();
    let (seed, samples, _) = sampling;
    let gradients = py.detach(|| {
        let shader = Shader { geometry: &points.geometry, material: &material, light: &sampler };
        radiance_vjp(&shader, &points.points, seed, samples, &adjoints)
    });
    let [width, height] = sampler.size();
    Ok((
        arrays::shaped(py, gradients.material, [CHANNELS, material.height, material.width])?,
        arrays::shaped(py, gradients.light.concat(), [height, width, 3])?,
    ))
}
