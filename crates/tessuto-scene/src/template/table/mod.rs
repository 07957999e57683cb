//! A template of any outline: a garment or cloth that lies flat on a table, from the mask of the first frame and the
//! plane of the table.
//!
//! The outline with its holes is traced in the mask to parts of a pixel, smoothed with its corners kept, and seen
//! through the camera on the plane. Triangles of even size fill it. The mesh is flat, so the flat shape is the one
//! at rest; texture coordinates are lengths on the table, of one scale for both directions.
//!
//! The plane comes from a sheet of paper, from measured depths, from one measured distance and the table's tilt, or is
//! given: [`PlaneFrom`].

mod measured;
mod paper;
mod plane;
mod sides;
mod trace;
mod triangles;

use glam::{DVec2, DVec3};

pub use plane::{FoundPlane, Plane, Residual};

use crate::io::depth::DepthMap;
use sides::{Curve, smooth};
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Face, Mesh};
use trace::{Traced, trace};
use triangles::{Border, Sheet, smallest_angle, triangles};

/// How well a person knows a point of an image, in either direction `[px]`.
pub const CLICK: f64 = 1.0;
/// Fewest and most vertices.
pub const VERTICES: [usize; 2] = [16, 4000];
/// An outline may bulge by this from its chords `[px]`, or more where the mask is ragged: it is not known better.
const FINE: f64 = 0.3;

/// The mask is blurred by this part of a triangle's side, and at least and at most by these `[px]`: masks are
/// ragged, and coarse triangles do not show it.
const BLUR: f64 = 0.08;
const BLURRED: [f64; 2] = [0.8, 3.0];

/// Where the plane of the table comes from; all in the camera's frame of the first frame.
#[derive(Debug, Clone, Copy)]
pub enum PlaneFrom<'a> {
    /// It is known.
    Given(Plane),
    /// A sheet of paper lies on the table.
    Paper {
        /// Width and height `[m]`, in either order.
        size: DVec2,
        /// Its corners `[px]`, in any order.
        corners: [DVec2; 4],
    },
    /// A depth map.
    Depth {
        /// What was measured.
        map: &'a DepthMap,
        /// By a camera at the same place, in pixels of the map.
        sensor: &'a Camera,
    },
    /// One distance was measured on the table.
    Distance {
        /// Normal of the table, of any length and either sign.
        normal: DVec3,
        /// Two points on the table `[px]`.
        between: [DVec2; 2],
        /// Their distance `[m]`.
        length: f64,
    },
}

/// How large the triangles are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Side {
    /// So that this number of vertices lies along the longer side of the outline.
    Longer(usize),
    /// Sides of about this length `[m]`.
    Length(f64),
}

/// A template made of an outline.
#[derive(Debug, Clone)]
pub struct FromOutline {
    /// The template `[m]`, flat, of triangles; vertices of borders come first.
    pub mesh: Mesh,
    /// The plane that it lies on `[m]`.
    pub plane: FoundPlane,
    /// Width along the image's rows and height on the table `[m]`.
    pub size: DVec2,
    /// Number of holes.
    pub holes: usize,
    /// Length of a triangle's side `[m]`.
    pub side: f64,
    /// Smallest angle of a triangle `[rad]`.
    pub smallest_angle: f64,
}

/// The fabric of `mask`, which messages call `place`, lying flat on a plane, as `camera` sees it; `tell` hears what was
/// found.
///
/// # Errors
/// [`Error::Input`] if the mask is empty, has several pieces, or touches the border of the image, if the plane is
/// not found or seen edge-on, or if the fabric has a hole or a part too small for triangles of this size;
/// [`Error::Usage`] of numbers that make no plane, or too few or many vertices.
pub fn from_outline(
    camera: &Camera,
    (mask, place): (&Image, &str),
    plane: PlaneFrom,
    side: Side,
    tell: &mut dyn FnMut(String),
) -> Result<FromOutline> {
    let traced = trace(mask, place)?;
    traced.notes.iter().for_each(|note| tell(format!("note: {note}")));
    let found = find(camera, mask, plane, &traced, tell)?;
    found.plane.check_seen(camera, traced.middle)?;
    tell(found.sentence(camera, traced.middle));
    if let Some(angle) = found.rival {
        tell(format!(
            "note: a table tilted otherwise, by {:.0}°, fits nearly as well: look at the template on the first frame, \
             and film nearer or with a larger sheet",
            angle.to_degrees()
        ));
    }
    let flat = flat(camera, &found.plane, &traced)?;
    let [_, size] = extent(&flat.outline[0]);
    let side = length(side, size, flat.area)?;
    let pixel = (flat.area / traced.count as f64).sqrt();
    let sigma = (BLUR * side / pixel).clamp(BLURRED[0], BLURRED[1]);
    let traced = traced.blurred(sigma, place)?;
    let borders: Vec<Border> = std::iter::once(&traced.outer)
        .chain(&traced.holes)
        .map(|points| border(camera, &found.plane, points, [side, pixel], &flat))
        .collect::<Result<_>>()?;
    let name = |p: DVec2| {
        let q = camera.project(flat.at(p));
        format!("pixel {:.0},{:.0}", q.x, q.y)
    };
    let sheet = triangles(&borders, side, place, &name)?;
    let angle = |t: &[u32; 3]| smallest_angle(t.map(|v| sheet.points[v as usize]));
    let smallest_angle = sheet.triangles.iter().map(angle).fold(f64::INFINITY, f64::min);
    let holes = traced.holes.len();
    tell(format!(
        "outline of {:.0}×{:.0} mm with {}, {holes} {}; {} triangles of about {:.0} mm, smallest angle {:.0}°",
        1e3 * size.x,
        1e3 * size.y,
        plural(borders.iter().map(|b| b.corners.len()).sum(), "corner"),
        if holes == 1 { "hole" } else { "holes" },
        sheet.triangles.len(),
        1e3 * side,
        smallest_angle.to_degrees()
    ));
    if sheet.halved > 0 {
        tell("note: the fabric is narrow in places: triangles are smaller there".to_owned());
    }
    tell("note: layers that lie on one another, as those of a shirt, are treated as one sheet".to_owned());
    let mesh = mesh(&sheet, &flat);
    Ok(FromOutline { mesh, plane: found, size, holes, side, smallest_angle })
}

fn plural(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

/// The plane, however it is known.
fn find(
    camera: &Camera,
    mask: &Image,
    plane: PlaneFrom,
    traced: &Traced,
    tell: &mut dyn FnMut(String),
) -> Result<FoundPlane> {
    match plane {
        PlaneFrom::Given(plane) => Ok(FoundPlane::given(Plane::new(plane.point, plane.normal)?)),
        PlaneFrom::Paper { size, corners } => {
            let (found, reordered) = paper::from_paper(camera, size, corners, CLICK, traced.middle)?;
            if reordered {
                tell("note: the paper's corners were given crosswise and put in order".to_owned());
            }
            Ok(found)
        }
        PlaneFrom::Depth { map, sensor } => measured::from_depth(camera, mask, (map, sensor), traced.middle),
        PlaneFrom::Distance { normal, between, length } => {
            plane::from_distance(camera, normal, between, length, CLICK)
        }
    }
}

/// The outline on the plane, in its own axes.
struct Flat {
    origin: DVec3,
    axes: [DVec3; 2],
    /// The outer border first `[m]`.
    outline: Vec<Vec<DVec2>>,
    /// Of the fabric, without its holes `[m²]`.
    area: f64,
}

impl Flat {
    fn at(&self, p: DVec2) -> DVec3 {
        self.origin + self.axes[0] * p.x + self.axes[1] * p.y
    }
}

fn flat(camera: &Camera, plane: &Plane, traced: &Traced) -> Result<Flat> {
    let origin = on_plane(camera, plane, traced.middle)?;
    let axes = plane.axes();
    let mut flat = Flat { origin, axes, outline: Vec::new(), area: 0.0 };
    for points in std::iter::once(&traced.outer).chain(&traced.holes) {
        let line = points.iter().map(|p| Ok(within(&flat, on_plane(camera, plane, *p)?)));
        let line: Vec<DVec2> = line.collect::<Result<_>>()?;
        flat.area += trace::area(&line) / 2.0;
        flat.outline.push(line);
    }
    Ok(flat)
}

/// In the axes of the plane.
fn within(flat: &Flat, p: DVec3) -> DVec2 {
    DVec2::new((p - flat.origin).dot(flat.axes[0]), (p - flat.origin).dot(flat.axes[1]))
}

/// What the camera sees at `p_pixel`, if that is on the plane.
fn on_plane(camera: &Camera, plane: &Plane, p_pixel: DVec2) -> Result<DVec3> {
    plane.meet(camera.ray(p_pixel)).ok_or_else(|| {
        let problem =
            format!("the fabric's pixel {:.0},{:.0} is beyond the plane's horizon", p_pixel.x, p_pixel.y);
        let hint =
            "see whether the plane is the table's, and the mask the garment's alone in the first frame";
        Error::input("the plane of the table", problem, hint)
    })
}

/// Length of a triangle's side on an outline of this size `[m]` and area `[m²]`.
fn length(side: Side, size: DVec2, area: f64) -> Result<f64> {
    let side = match side {
        Side::Longer(count) => size.max_element() / (count.max(2) - 1) as f64,
        Side::Length(length) => length,
    };
    // Equilateral triangles have one vertex for each 0.866 of the square of their side.
    let count = area / (0.866 * side * side);
    let [fewest, most] = VERTICES;
    if (fewest as f64..=most as f64).contains(&count) {
        return Ok(side);
    }
    let problem = format!(
        "triangles of {:.1} mm make {count:.0} vertices, {fewest} to {most} are possible",
        1e3 * side
    );
    let [large, small] = VERTICES.map(|n| 1e3 * (area / (0.866 * n as f64)).sqrt());
    let hint = format!("ask for triangles of {small:.0} to {large:.0} mm; 400 vertices are usual");
    Err(Error::usage(problem, Hint::from(hint).with(Remedy::TriangleSide)))
}

/// A border on the plane, smooth, with its corners. `side` is a triangle's, `pixel` the size of one there `[m]`.
fn border(
    camera: &Camera,
    plane: &Plane,
    traced: &[DVec2],
    [side, pixel]: [f64; 2],
    flat: &Flat,
) -> Result<Border> {
    let line = smooth(traced, side / pixel);
    let points = line.points.iter().map(|p| Ok(within(flat, on_plane(camera, plane, *p)?)));
    let curve = Curve::new(points.collect::<Result<_>>()?);
    let corners = line.corners.iter().map(|k| curve.until(*k)).collect();
    Ok(Border { curve, corners, fine: FINE.max(line.ragged) * pixel })
}

/// The smallest rectangle along the axes around `points`: its first corner and its size.
fn extent(points: &[DVec2]) -> [DVec2; 2] {
    let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    [low, high - low]
}

/// The template: faces are wound as those of a grid, uv are lengths in the longer side of the outline.
fn mesh(sheet: &Sheet, flat: &Flat) -> Mesh {
    let [low, size] = extent(&sheet.points);
    let whole = size.max_element();
    let uv = |p: &DVec2| {
        let q = (*p - low) / whole;
        DVec2::new(q.x, 1.0 - q.y).clamp(DVec2::ZERO, DVec2::ONE)
    };
    let face = |[a, b, c]: &[u32; 3]| Face { vertices: vec![*a, *c, *b], uvs: vec![*a, *c, *b] };
    Mesh {
        positions: sheet.points.iter().map(|p| flat.at(*p)).collect(),
        uvs: sheet.points.iter().map(uv).collect(),
        faces: sheet.triangles.iter().map(face).collect(),
    }
}
