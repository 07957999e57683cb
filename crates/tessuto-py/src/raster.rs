//! The rasteriser, and its adjoint.

use std::sync::Arc;

use numpy::{PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use tessuto::mesh::Mesh;
use tessuto::raster::{self, Gradients, Rendering, Texture};
use tessuto::{Camera, Positions};

use crate::arrays::{self, field};
use crate::scene::{Intrinsics, camera};

/// Largest side of an image `[px]`.
const MOST_PIXELS: usize = 1 << 14;

/// Triangles and texture coordinates of a mesh.
#[pyclass(frozen, module = "tessuto._native")]
pub struct Rasterizer {
    rasterizer: Arc<raster::Rasterizer>,
}

#[pymethods]
impl Rasterizer {
    #[new]
    fn new(
        vertex_count: usize,
        uv: PyReadonlyArray2<'_, f64>,
        faces: Vec<Vec<u32>>,
        uv_faces: Option<Vec<Vec<u32>>>,
    ) -> PyResult<Self> {
        let nowhere = numpy::ndarray::Array2::zeros([vertex_count, 3]);
        let mesh: Mesh = arrays::mesh(nowhere.view(), uv.as_array(), faces, uv_faces)?;
        arrays::check_faces(&mesh)?;
        Ok(Self { rasterizer: Arc::new(raster::Rasterizer::new(&mesh)) })
    }

    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let triangles = self.rasterizer.triangles();
        arrays::shaped(py, triangles.concat(), [triangles.len(), 3])
    }

    #[getter]
    fn vertex_count(&self) -> usize {
        self.rasterizer.vertex_count()
    }
}

/// The camera of these intrinsics, refused if it has none or no pixels.
pub fn checked_camera(intrinsics: Intrinsics) -> PyResult<Camera> {
    let camera = camera(intrinsics);
    let focal = [camera.fx, camera.fy].iter().all(|f| f.is_finite() && *f > 0.0);
    let centre = [camera.cx, camera.cy].iter().all(|c| c.is_finite());
    let sides = [camera.width, camera.height].iter().all(|n| (1..=MOST_PIXELS).contains(n));
    match focal && centre && sides {
        true => Ok(camera),
        false => {
            Err(crate::error::refused(format!("{camera:?} is not a camera of 1 to {MOST_PIXELS} px a side")))
        }
    }
}

/// An image, as its adjoint needs it.
#[pyclass(frozen, module = "tessuto._native")]
pub struct Rendered {
    rasterizer: Arc<raster::Rasterizer>,
    camera: Camera,
    positions: Positions,
    texture: Texture,
    rendering: Rendering,
}

type Image<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f32>>, Rendered);

/// Colour and coverage [h, w, 4] and depth [h, w] of a mesh, and their record.
#[pyfunction]
pub fn rasterize<'py>(
    py: Python<'py>,
    rasterizer: &Rasterizer,
    intrinsics: Intrinsics,
    positions: PyReadonlyArray2<'py, f64>,
    texture: PyReadonlyArray3<'py, f32>,
) -> PyResult<Image<'py>> {
    let rasterizer = rasterizer.rasterizer.clone();
    let camera = checked_camera(intrinsics)?;
    let positions = field(positions.as_array(), rasterizer.vertex_count(), "positions")?;
    let texels = texture.as_array();
    let [height, width, channels] = *texels.shape() else { unreachable!("three axes") };
    if channels != 3 || width == 0 || height == 0 {
        let text = format!("texture has shape {:?}, expected [height, width, 3]", texels.shape());
        return Err(crate::error::refused(text));
    }
    let data = texels.iter().copied().collect();
    let texture = Texture::from_image(&tessuto::Image { width, height, channels, data });
    let rendering = py.detach(|| {
        let mut rendering = Rendering::new();
        rasterizer.render(camera, &positions, &texture, &mut rendering);
        rendering
    });
    let shape = [camera.height, camera.width];
    let rgba = arrays::shaped(py, rendering.rgba.concat(), [shape[0], shape[1], 4])?;
    let depth = arrays::shaped(py, rendering.depth_image().data, shape)?;
    Ok((rgba, depth, Rendered { rasterizer, camera, positions, texture, rendering }))
}

/// Gradients by positions, texture and texture coordinates.
type Adjoint<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f64>>);

#[pymethods]
impl Rendered {
    /// The adjoint.
    #[pyo3(signature = (grad_rgba, grad_depth))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        grad_rgba: PyReadonlyArray3<'py, f32>,
        grad_depth: Option<PyReadonlyArray2<'py, f32>>,
    ) -> PyResult<Adjoint<'py>> {
        let Self { rasterizer, camera, positions, texture, rendering } = self;
        let shape = [camera.height, camera.width, 4];
        let depth_shape = grad_depth.as_ref().is_none_or(|g| g.as_array().shape() == &shape[..2]);
        if grad_rgba.as_array().shape() != shape || !depth_shape {
            let text = format!("the gradients are not of the shape of the image, {shape:?}");
            return Err(crate::error::refused(text));
        }
        let values: Vec<f32> = grad_rgba.as_array().iter().copied().collect();
        let of_pixels: Vec<[f32; 4]> = values.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
        let of_depth: Option<Vec<f32>> = grad_depth.map(|g| g.as_array().iter().copied().collect());
        let gradients = py.detach(|| {
            let mut gradients = Gradients::new(rasterizer).with_texture(texture).with_uvs(rasterizer);
            let depth = of_depth.as_deref();
            rasterizer.render_vjp(camera, positions, texture, rendering, &of_pixels, depth, &mut gradients);
            gradients
        });
        let texels = gradients.texture.unwrap_or_default().iter().flat_map(|t| [t[0], t[1], t[2]]).collect();
        let uvs = gradients.uvs.unwrap_or_default();
        Ok((
            arrays::to_rows(py, &gradients.positions)?,
            arrays::shaped(py, texels, [texture.height, texture.width, 3])?,
            arrays::shaped(py, uvs.iter().flat_map(|uv| uv.to_array()).collect(), [uvs.len(), 2])?,
        ))
    }
}
