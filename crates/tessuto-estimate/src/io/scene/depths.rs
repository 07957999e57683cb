//! What a depth sensor measured in every frame: depth/depth_000.png, .npy or .exr.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::listing::numbered;
use super::manifest::Manifest;
use crate::io::depth::DepthMap;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::Depths;

const ENDINGS: [&str; 3] = ["png", "npy", "exr"];
/// Sides of a map and of the images may have ratios that differ by this.
const SHAPE: f64 = 0.02;
/// How far the template may be from the first map, as a fraction of its depth, before the unit is doubted.
const DOUBTED: f64 = 0.1;

/// The maps of the frames `range` of the scene in `folder`, if it has any.
///
/// # Errors
/// [`Error::Input`] naming the map that cannot be used.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<&Mesh>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Depths>> {
    if !folder.join(&manifest.depth).is_dir() {
        return Ok(None);
    }
    let files = numbered(folder, &manifest.depth, "depth_", &ENDINGS, (range, manifest.n_frames), warnings)?;
    let unit = manifest.depth_unit;
    let maps: Vec<DepthMap> =
        files.par_iter().map(|file| DepthMap::read(file, unit)).collect::<Result<_>>()?;
    let (whole, first) = (manifest.camera(), &maps[0]);
    for (file, map) in files.iter().zip(&maps) {
        if [map.width, map.height] != [first.width, first.height] {
            let problem = format!(
                "is {}×{} pixels, the first map {}×{}",
                map.width, map.height, first.width, first.height
            );
            return Err(Error::input(file.display().to_string(), problem, "give all maps one size"));
        }
    }
    let camera = camera(&whole, [first.width, first.height]);
    let ratio = (camera.fx / whole.fx) / (camera.fy / whole.fy);
    if (ratio - 1.0).abs() > SHAPE {
        let problem = format!(
            "is {}×{} pixels, of another shape than the images' {}×{}",
            first.width, first.height, whole.width, whole.height
        );
        let hint = "depth has to show the whole image of the camera: align it with the colours first";
        return Err(Error::input(files[0].display().to_string(), problem, hint));
    }
    let within = template.map_or_else(Vec::new, |mesh| covered(mesh, &camera));
    if let Some(off) =
        template.and_then(|mesh| distance(mesh, &camera, first)).filter(|off| off.abs() > DOUBTED)
    {
        let found = format!(
            "{}: the template lies {:.0} % {} than it was measured",
            files[0].display(),
            100.0 * off.abs(),
            if off > 0.0 { "farther" } else { "nearer" }
        );
        let hint = Hint::from("check the unit of the depth, and the size of the template");
        warnings.push(Warning::new("depth", found, hint.with(Remedy::DepthScale)));
    }
    let of_map = |map: DepthMap| map.z.into_iter().map(|z| z as f32).collect();
    Ok(Some(Depths::new(camera, maps.into_iter().map(of_map).collect(), &within)))
}

/// The camera in pixels of maps of this size that show its whole image.
fn camera(whole: &Camera, [width, height]: [usize; 2]) -> Camera {
    let scale = [width as f64 / whole.width as f64, height as f64 / whole.height as f64];
    // The corner of the image, half a pixel from the first centre, is what both have in common.
    let centre = |c: f64, s: f64| (c + 0.5) * s - 0.5;
    Camera {
        fx: whole.fx * scale[0],
        fy: whole.fy * scale[1],
        cx: centre(whole.cx, scale[0]),
        cy: centre(whole.cy, scale[1]),
        width,
        height,
    }
}

/// The pixels of a map that the template covers.
fn covered(mesh: &Mesh, camera: &Camera) -> Vec<bool> {
    if mesh.positions.iter().any(|p| p.z <= 0.0) {
        return Vec::new();
    }
    tessuto_render::raster::coverage::template_coverage(mesh, &mesh.positions, camera)
}

/// How much farther the template is than it was measured, as a fraction: the median over its vertices.
fn distance(mesh: &Mesh, camera: &Camera, map: &DepthMap) -> Option<f64> {
    let of_vertex = |p: &glam::DVec3| {
        let q = camera.project(*p).round();
        let inside = p.z > 0.0 && q.min_element() >= 0.0 && q.x < map.width as f64 && q.y < map.height as f64;
        let z = inside.then(|| map.z[q.y as usize * map.width + q.x as usize])?;
        (!z.is_nan()).then(|| p.z / z - 1.0)
    };
    tessuto_core::math::median::median(mesh.positions.iter().filter_map(of_vertex).collect())
}
