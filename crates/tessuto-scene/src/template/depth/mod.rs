//! A template from a depth map of the first frame: a grid that fills the mask in the image, each vertex as deep as
//! the smoothed map says. Where the fabric lies within the grid is known from the corners and the mask's outline,
//! as for a flat sheet.

mod surface;

use glam::{DVec2, DVec3};

use super::hem::hem;
use super::make::CornersFrom;
use super::outline::Outline;
use super::rectangle::{check_order, patch};
use super::remesh::Resolution;
use crate::io::depth::DepthMap;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::Mesh;

/// Longest side of the part of a map that is solved for `[px]`; finer maps are made coarser by medians.
const SIDE: usize = 160;
/// Columns and rows around the fabric, for what lies on its border.
const MARGIN: usize = 2;
/// Measurements this near to the mask's border `[px of the map]` see past it.
const BORDER: f64 = 1.5;
/// Least noise assumed `[m]`: sensors smooth their maps, which hides it.
const NOISE: f64 = 3e-4;
/// Least fraction of the fabric with measurements.
const MEASURED: f64 = 0.2;

/// A template made of a depth map.
#[derive(Debug, Clone)]
pub struct FromDepth {
    /// The template `[m]`.
    pub mesh: Mesh,
    /// Corners in the first frame `[px]`, clockwise from the upper left.
    pub corners: [DVec2; 4],
    /// Standard deviation of a pixel's depth from those around it `[m]`.
    pub noise: f64,
    /// Fraction of the fabric in which nothing usable was measured.
    pub filled: f64,
}

/// The smoothed map, around the fabric.
struct Surface {
    /// Camera of the grid.
    camera: Camera,
    z: Vec<f64>,
}

impl Surface {
    /// Depth in the direction of a ray with z = 1, between the four grid points around it `[m]`.
    fn at(&self, ray: DVec3) -> f64 {
        let (w, h) = (self.camera.width, self.camera.height);
        let p = self.camera.project(ray).clamp(DVec2::ZERO, DVec2::new((w - 1) as f64, (h - 1) as f64));
        let (x, y) = ((p.x as usize).min(w - 2), (p.y as usize).min(h - 2));
        let (s, t) = (p.x - x as f64, p.y - y as f64);
        let row = |y: usize| (1.0 - s) * self.z[y * w + x] + s * self.z[y * w + x + 1];
        (1.0 - t) * row(y) + t * row(y + 1)
    }
}

/// The template of the fabric in `mask`, or between the corners where there is no mask, as `camera` sees it; `map`
/// is the depth that `sensor`, at the same place, measured.
///
/// # Errors
/// [`Error::Input`] if the mask has no four corners, or the map too few measurements on the fabric.
pub fn from_depth(
    camera: &Camera,
    (map, sensor): (&DepthMap, &Camera),
    mask: Option<&Image>,
    corners: CornersFrom,
    resolution: Resolution,
) -> Result<FromDepth> {
    let (found, outline, straight) = match corners {
        CornersFrom::Points(corners) => (corners, None, true),
        CornersFrom::Mask { mask, place, straight } => {
            let mut outline = Outline::new(mask, place)?;
            (outline.corners(), Some(outline), straight)
        }
    };
    check_order(found)?;
    let inside = |p: DVec2| match mask {
        Some(mask) => {
            let (x, y) = (p.x.round(), p.y.round());
            let within = x >= 0.0 && y >= 0.0 && (x as usize) < mask.width && (y as usize) < mask.height;
            within && mask.pixel(x as usize, y as usize)[0] >= 0.5
        }
        None => (0..4).all(|k| (found[(k + 1) % 4] - found[k]).perp_dot(p - found[k]) >= 0.0),
    };
    let (surface, noise, filled) = surface_of(camera, map, sensor, &inside, found)?;
    let deep = |p: DVec2| {
        let ray = camera.ray(p);
        ray * surface.at(ray)
    };
    let positions = found.map(deep);
    let size = DVec2::new(
        positions[0].distance(positions[1]) + positions[3].distance(positions[2]),
        positions[1].distance(positions[2]) + positions[0].distance(positions[3]),
    ) / 2.0;
    let grid = resolution.grid(size)?;
    let mut mesh = patch(positions, grid);
    if let (Some(outline), false) = (&outline, straight) {
        hem(&mut mesh, grid, positions, camera, outline, found);
    }
    mesh.positions.iter_mut().for_each(|p| *p = deep(camera.project(*p)));
    Ok(FromDepth { mesh, corners: found, noise, filled })
}

/// The smoothed map around the fabric, its noise, and the fraction that was filled in.
fn surface_of(
    camera: &Camera,
    map: &DepthMap,
    sensor: &Camera,
    inside: &dyn Fn(DVec2) -> bool,
    corners: [DVec2; 4],
) -> Result<(Surface, f64, f64)> {
    let in_video = |p: DVec2| camera.project(sensor.ray(p));
    let fabric: Vec<bool> = (0..map.z.len())
        .map(|k| inside(in_video(DVec2::new((k % map.width) as f64, (k / map.width) as f64))))
        .collect();
    let few = |found: String| {
        let hint = "see whether the depth map is of the first frame, turned as it is, and of the same camera";
        Error::input("the depth map", found, hint)
    };
    let pixels = (0..fabric.len()).filter(|k| fabric[*k]).map(|k| (k % map.width, k / map.width));
    let corner_pixels = corners.map(|c| sensor.project(camera.ray(c))).map(|p| {
        let clamp = |v: f64, n: usize| v.round().clamp(0.0, (n - 1) as f64) as usize;
        (clamp(p.x, map.width), clamp(p.y, map.height))
    });
    let around = tessuto_core::camera::Rect::around(pixels.chain(corner_pixels)).expect("four corners");
    let around = around.padded(MARGIN, [map.width, map.height]);
    let factor = around.width().max(around.height()).div_ceil(SIDE);
    let usable = |x: usize, y: usize| {
        let p = DVec2::new(x as f64, y as f64);
        let around = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y];
        fabric[y * map.width + x] && around.iter().all(|d| inside(in_video(p + *d * BORDER)))
    };
    // Blocks of the map, each the median of its usable measurements.
    let coarse = sensor.cropped(around).downsampled(factor);
    let (w, h) = (coarse.width, coarse.height);
    if w < 4 || h < 4 {
        return Err(few(format!("shows the fabric in {w}×{h} pixels")));
    }
    let (mut measured, mut whole) = (vec![f64::NAN; w * h], 0usize);
    for (k, out) in measured.iter_mut().enumerate() {
        let (x0, y0) = (around.x0 + k % w * factor, around.y0 + k / w * factor);
        let block = (y0..y0 + factor).flat_map(|y| (x0..x0 + factor).map(move |x| (x, y)));
        whole += usize::from(fabric[(y0 + factor / 2) * map.width + x0 + factor / 2]);
        let mut known: Vec<f64> = block
            .filter(|(x, y)| usable(*x, *y))
            .map(|(x, y)| map.z[y * map.width + x])
            .filter(|z| !z.is_nan())
            .collect();
        known.sort_by(f64::total_cmp);
        *out = known.get(known.len() / 2).copied().unwrap_or(f64::NAN);
    }
    let known = measured.iter().filter(|m| !m.is_nan()).count();
    let fraction = known as f64 / whole.max(1) as f64;
    let noise = surface::noise(&measured, w).filter(|_| fraction >= MEASURED);
    let Some(noise) = noise else {
        return Err(few(format!(
            "measures {:.0} % of the fabric, {:.0} % at least",
            100.0 * fraction,
            100.0 * MEASURED
        )));
    };
    let mean = measured.iter().filter(|m| !m.is_nan()).sum::<f64>() / known as f64;
    let z = surface::smooth(&measured, w, mean / coarse.fx, noise.max(NOISE));
    Ok((Surface { camera: coarse, z }, noise, (1.0 - fraction).max(0.0)))
}
