//! Whole templates: a rectangle of fabric as a frame shows it, or a mesh from a file.

use std::path::Path;

use glam::DVec2;

use super::fix::Fix;
use super::gate::check_misfit;
use super::hem::hem;
use super::irregular::irregular;
use super::outline::Outline;
use super::rectangle::{locate, patch};
use super::remesh::{Over, Resolution, remesh};
use crate::io::model;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Mesh, diagonal, weld};

/// Where the corners of a rectangle are in the first frame.
#[derive(Debug, Clone, Copy)]
pub enum CornersFrom<'a> {
    /// Here `[px]`, clockwise from the upper left.
    Points([DVec2; 4]),
    /// Where the mask has them.
    Mask {
        /// White is fabric.
        mask: &'a Image,
        /// What messages call it.
        place: &'a str,
        /// The sides are straight between the corners; otherwise they follow the mask's outline.
        straight: bool,
    },
}

impl CornersFrom<'_> {
    /// The four corners `[px]`, clockwise from the upper left.
    ///
    /// # Errors
    /// [`Error::Input`] if the mask has none.
    pub fn found(&self) -> Result<[DVec2; 4]> {
        match self {
            Self::Points(corners) => Ok(*corners),
            Self::Mask { mask, place, .. } => Ok(Outline::new(mask, place)?.corners()),
        }
    }
}

/// A template made of a rectangle.
#[derive(Debug, Clone)]
pub struct FromRectangle {
    /// The template `[m]`.
    pub mesh: Mesh,
    /// Where its corners are in the first frame `[px]`, clockwise from the upper left.
    pub corners: [DVec2; 4],
    /// Root mean square distance of a plane rectangle's corners from those `[px]`.
    pub residual: f64,
    /// Whether that rectangle was taken; otherwise the sheet sags or bends.
    pub plane: bool,
    /// Whether the rectangle tilted the other way fits nearly as well.
    pub ambiguous: bool,
}

/// A rectangle of fabric of `size` (width, height) `[m]`, flat or nearly so, as `camera` sees it; `tell` hears
/// what was found.
///
/// # Errors
/// [`Error::Input`] if the mask has no four corners, or if no rectangle of this size can look like this.
pub fn from_rectangle(
    camera: &Camera,
    size: DVec2,
    resolution: Resolution,
    corners: CornersFrom,
    tell: &mut dyn FnMut(String),
) -> Result<FromRectangle> {
    let grid = resolution.grid(size)?;
    let (corners, outline, straight) = match corners {
        CornersFrom::Points(corners) => (corners, None, true),
        CornersFrom::Mask { mask, place, straight } => {
            let mut outline = Outline::new(mask, place)?;
            let corners = outline.corners();
            outline.notes.iter().for_each(|note| tell(format!("note: {note}")));
            (corners, Some(outline), straight)
        }
    };
    let found = locate(camera, size, corners)?;
    check_misfit(found.rigid_error, corners)?;
    tell(format!("corners: {}", corners.map(|p| format!("{:.1},{:.1}", p.x, p.y)).join(" ")));
    let depths = found.positions.map(|p| format!("{:.3} m", p.z)).join(", ");
    let error = found.rigid_error;
    tell(match found.rigid {
        true => format!("depths of the corners: {depths}; a plane rectangle fits them to {error:.2} px"),
        false => format!(
            "depths of the corners: {depths}; no plane rectangle fits (off by {error:.1} px): treated as a \
             sheet that sags or bends"
        ),
    });
    if found.ambiguous {
        tell("note: the rectangle tilted the other way fits nearly as well: look at the template on the first \
              frame, and measure the size exactly".to_owned());
    }
    let mut mesh = patch(found.positions, grid);
    if let (Some(outline), false) = (&outline, straight) {
        hem(&mut mesh, grid, found.positions, camera, outline, corners);
    }
    Ok(FromRectangle { mesh, corners, residual: error, plane: found.rigid, ambiguous: found.ambiguous })
}

/// What is done to a mesh, in this order.
#[derive(Debug, Clone, Copy)]
pub struct Changes {
    /// Unit and axes.
    pub fix: Fix,
    /// Merge vertices nearer to one another than this part of the mesh's size, the diagonal of its bounding box;
    /// `None`: do not. 1e-6 is usual: files round to six digits or more.
    pub weld: Option<f64>,
    /// Re-sample it.
    pub remesh: Option<Resample>,
}

/// As what a mesh is re-sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resample {
    /// A regular grid of quads.
    Grid(Resolution),
    /// Triangles that lie irregularly, of this many vertices in all.
    Irregular(usize),
}

/// The mesh in `path` (OBJ, PLY or glTF), changed; `tell` hears what was found and done.
///
/// # Errors
/// [`Error::Input`] if it cannot be read, has no texture coordinates in the end, or cannot be re-sampled.
pub fn from_file(path: &Path, changes: &Changes, tell: &mut dyn FnMut(String)) -> Result<Mesh> {
    let place = path.display().to_string();
    let mut model = model::read(path)?;
    model.notes.iter().for_each(|note| tell(format!("note: {place}: {note}")));
    changes.fix.apply_to(&mut model.mesh);
    if let Some(part) = changes.weld {
        let tolerance = part * diagonal(&model.mesh.positions);
        let [gone, faces] = weld(&mut model.mesh, tolerance);
        let flat =
            if faces > 0 { format!("; {faces} faces that they were all of went") } else { String::new() };
        tell(format!(
            "merged {gone} vertices that lay on others, within {tolerance:.1e} ({part:.0e} of the size){flat}"
        ));
    }
    let Some(resample) = changes.remesh else {
        let hint = Hint::from("unwrap it in a modelling program, or make a grid of it").with(Remedy::Remesh);
        let without_uv =
            || Error::input(place, "has no texture coordinates (uv), which a template needs", hint);
        return model.has_uv.then_some(model.mesh).ok_or_else(without_uv);
    };
    let over = |over: Over| match over {
        Over::Uv => "texture coordinates",
        Over::Border => "border, between its four corners",
    };
    let (mesh, in_holes) = match resample {
        Resample::Grid(resolution) => {
            let made = remesh(&model.mesh, model.has_uv, resolution, &place)?;
            let [columns, rows] = made.grid;
            tell(format!("a grid of {columns}×{rows} vertices over the {}", over(made.over)));
            (made.mesh, made.in_holes)
        }
        Resample::Irregular(count) => {
            let made = irregular(&model.mesh, model.has_uv, count, &place)?;
            tell(format!("an irregular mesh of {count} vertices over the {}", over(made.over)));
            (made.mesh, made.in_holes)
        }
    };
    if in_holes > 0 {
        tell(format!("note: {in_holes} vertices lie in holes of the mesh and were put on their rims"));
    }
    Ok(mesh)
}
