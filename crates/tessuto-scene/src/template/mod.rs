//! Templates: the mesh of the fabric in the first frame, from measurements or from other meshes.
//!
//! - a flat or nearly flat rectangle of known size: `outline`, `hidden`, `rectangle`, `hem`(mod@hem)
//! - any textured mesh, as a regular grid of quads: [`remesh`]; or as an irregular mesh of triangles:
//!   [`irregular`](mod@irregular)
//! - a depth map of the first frame: [`depth`]
//! - a garment of any outline that lies on a table: [`table`]
//! - the camera, from the corners of such a sheet: [`focal`]
//! - a mesh in another unit or with other axes: [`fix`]
//!
//! [`make`] does all of it; [`gate`] refuses what no fabric can be.

pub mod depth;
pub mod fix;
pub mod focal;
pub mod gate;
pub(crate) mod hem;
mod hidden;
pub mod irregular;
pub mod make;
pub(crate) mod outline;
pub(crate) mod rectangle;
pub mod remesh;
pub mod table;

use tessuto_core::camera::Camera;
use tessuto_core::image::Image;
use tessuto_core::mesh::Mesh;
use tessuto_render::raster::coverage::{overlap, template_coverage};

/// Intersection over union of a mesh `[m]`, as `camera` sees it, and a mask of the same size.
pub fn overlap_with_mask(mesh: &Mesh, camera: &Camera, mask: &Image) -> f64 {
    overlap(&template_coverage(mesh, &mesh.positions, camera), mask)
}
