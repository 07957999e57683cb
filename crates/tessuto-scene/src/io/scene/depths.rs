//! What a depth sensor measured in every frame: depth/depth_000.png, .npy or .exr.

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use tessuto_core::parallel;

use super::listing::numbered;
use super::manifest::Manifest;
use crate::io::depth::DepthMap;
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::Depths;
use tessuto_render::raster::coverage::fill_triangle;

/// Folder of the maps, unless the scene names another.
pub(super) const FOLDER: &str = "depth";
const PREFIX: &str = "depth_";
const CONFIDENCE: &str = "confidence_";
const ENDINGS: [&str; 3] = ["png", "npy", "exr"];
/// Longest side of a map `[px]`; of larger ones every second, third … pixel is taken.
const LARGEST: usize = 640;
/// Sides of a map and of the images may have ratios that differ by this.
const SHAPE: f64 = 0.02;
/// How far the template may be from the first map, as a fraction of its depth, before the unit is doubted.
const DOUBTED: f64 = 0.1;

/// The maps of the frames `range` of the scene in `folder`, if it has any, by a camera that sees the template in the
/// first of them from this pose.
///
/// # Errors
/// [`Error::Input`] naming the map that cannot be used.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    range: Range<usize>,
    template: Option<(&Mesh, Pose)>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Depths>> {
    // A folder of this name without any such file is something else's, such as a capture's.
    let entries = std::fs::read_dir(folder.join(&manifest.depth)).into_iter().flatten().flatten();
    if manifest.depth == FOLDER
        && !entries.into_iter().any(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX))
    {
        return Ok(None);
    }
    let numbers = || (range.clone(), manifest.n_frames);
    let files = numbered(folder, &manifest.depth, PREFIX, &ENDINGS, numbers(), warnings)?;
    let confidence = match &manifest.depth_confidence {
        Some(name) => numbered(folder, name, CONFIDENCE, &ENDINGS[..1], numbers(), warnings)?,
        None => Vec::new(),
    };
    let unit = manifest.depth_unit;
    let (whole, first) = (manifest.camera(), DepthMap::read(&files[0], unit)?);
    let size = [first.width, first.height];
    let factor = size[0].max(size[1]).div_ceil(LARGEST);
    let read = |(k, file): (usize, &PathBuf)| {
        let mut map = DepthMap::read(file, unit)?;
        confidence.get(k).map_or(Ok(()), |levels| map.leave_out(levels))?;
        if [map.width, map.height] == size {
            return Ok(thinned(&map, factor));
        }
        let problem =
            format!("is {}×{} pixels, the first map {}×{}", map.width, map.height, size[0], size[1]);
        Err(Error::input(file.display().to_string(), problem, "give all maps one size"))
    };
    let maps: Vec<Vec<f32>> = parallel::try_map(files.len(), |k| read((k, &files[k])))?;
    let camera = camera(&whole, size);
    let ratio = (camera.fx / whole.fx) / (camera.fy / whole.fy);
    if (ratio - 1.0).abs() > SHAPE {
        let problem = format!(
            "is {}×{} pixels, of another shape than the images' {}×{}",
            first.width, first.height, whole.width, whole.height
        );
        let hint = "depth has to show the whole image of the camera: align it with the colours first";
        return Err(Error::input(files[0].display().to_string(), problem, hint));
    }
    let positions: Option<Vec<DVec3>> = template
        .map(|(mesh, pose)| mesh.positions.iter().map(|p| pose.rotation * *p + pose.translation).collect());
    if let Some(off) =
        positions.as_deref().and_then(|at| distance(at, &camera, &first)).filter(|off| off.abs() > DOUBTED)
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
    let camera = of_thinned(&camera, factor);
    let surface = match template.zip(positions) {
        Some(((mesh, _), positions)) => surface(mesh, &positions, &camera),
        None => beyond(&maps),
    };
    Ok(Some(Depths::new(camera, maps, &surface)))
}

/// The map of the first frame of the scene in `folder`, the camera in its pixels, and its file; `None` in a scene
/// without maps.
///
/// # Errors
/// [`Error::Input`] naming the map that cannot be used.
pub fn first(folder: &Path) -> Result<Option<(DepthMap, Camera, PathBuf)>> {
    let manifest = Manifest::read(folder)?;
    if !folder.join(&manifest.depth).is_dir() {
        return Ok(None);
    }
    let numbers = (0..1, manifest.n_frames);
    let file = numbered(folder, &manifest.depth, PREFIX, &ENDINGS, numbers, &mut Vec::new())?.remove(0);
    let mut map = DepthMap::read(&file, manifest.depth_unit)?;
    if let Some(name) = &manifest.depth_confidence {
        let numbers = (0..1, manifest.n_frames);
        let levels = numbered(folder, name, CONFIDENCE, &ENDINGS[..1], numbers, &mut Vec::new())?.remove(0);
        map.leave_out(&levels)?;
    }
    let camera = camera(&manifest.camera(), [map.width, map.height]);
    Ok(Some((map, camera, file)))
}

/// Every `factor`-th pixel of a map along both sides: means would mix what lies on both sides of a border.
fn thinned(map: &DepthMap, factor: usize) -> Vec<f32> {
    let at = |n: usize| n * factor + factor / 2;
    let rows = 0..map.height / factor;
    rows.flat_map(|y| (0..map.width / factor).map(move |x| map.z[at(y) * map.width + at(x)] as f32)).collect()
}

/// The camera in pixels of maps that are [`thinned`].
fn of_thinned(camera: &Camera, factor: usize) -> Camera {
    let (f, first) = (factor as f64, (factor / 2) as f64);
    Camera {
        fx: camera.fx / f,
        fy: camera.fy / f,
        cx: (camera.cx - first) / f,
        cy: (camera.cy - first) / f,
        width: camera.width / factor,
        height: camera.height / factor,
    }
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

/// Depth `[m]` of the mesh at `positions` in the camera's frame, of every pixel of a map, shape [height · width]; NaN
/// beside it, and everywhere if some of it is behind the camera.
fn surface(mesh: &Mesh, positions: &[DVec3], camera: &Camera) -> Vec<f64> {
    let mut depth = vec![f64::NAN; camera.width * camera.height];
    if positions.iter().any(|p| p.z <= 0.0) {
        return depth;
    }
    for triangle in mesh.triangles() {
        let corners = triangle.map(|v| positions[v as usize]);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let size = [camera.width, camera.height];
        fill_triangle(corners.map(|p| camera.project(p)), size, true, |x, y| {
            // n·(z ray) = n·corner.
            let z = normal.dot(corners[0]) / normal.dot(camera.ray(DVec2::new(x as f64, y as f64)));
            let nearest = &mut depth[y * camera.width + x];
            *nearest = nearest.min(z);
        });
    }
    depth
}

/// A plane in the middle of what the first of the `maps` measured, where nobody knows where the template is.
fn beyond(maps: &[Vec<f32>]) -> Vec<f64> {
    let first = maps.first().map_or(&[][..], Vec::as_slice);
    let measured = first.iter().filter(|z| z.is_finite()).map(|z| f64::from(*z)).collect();
    vec![tessuto_core::math::median::median(measured).unwrap_or(f64::NAN); first.len()]
}

/// How much farther the template at `positions` in the camera's frame is than it was measured, as a fraction: the
/// median over its vertices.
fn distance(positions: &[DVec3], camera: &Camera, map: &DepthMap) -> Option<f64> {
    let of_vertex = |p: &DVec3| {
        let q = camera.project(*p).round();
        let inside = p.z > 0.0 && q.min_element() >= 0.0 && q.x < map.width as f64 && q.y < map.height as f64;
        let z = inside.then(|| map.z[q.y as usize * map.width + q.x as usize])?;
        (!z.is_nan()).then(|| p.z / z - 1.0)
    };
    tessuto_core::math::median::median(positions.iter().filter_map(of_vertex).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::depth_unit::Unit;

    /// Confidence maps belong to the view that names them.
    #[test]
    fn what_is_not_confident_is_left_out_in_every_view() {
        let settings = crate::synth::Settings::default().with(|s| {
            (s.frames, s.size, s.grid, s.views, s.apart, s.depth_noise) = (2, 48, [5, 5], 2, 30.0, 0.01)
        });
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        crate::synth::write::write(path, &crate::synth::make(&settings).unwrap(), &settings).unwrap();
        let of_view = |path: &Path| {
            let scene =
                crate::io::scene::load(path, &crate::io::scene::LoadOptions::default()).unwrap().scene;
            let count = |depths: &Depths| {
                let measured = |map: &Vec<f32>, low: bool| {
                    let half = |k: usize| (k % depths.camera.width < depths.camera.width / 2) == low;
                    map.iter().enumerate().filter(|(k, z)| half(*k) && **z > 0.0).count()
                };
                [true, false].map(|low| depths.maps.iter().map(|map| measured(map, low)).sum::<usize>())
            };
            [scene.depths.as_deref(), scene.more[0].depths.as_deref()].map(|depths| count(depths.unwrap()))
        };
        let before = of_view(path);
        let file = path.join("scene.json");
        let mut json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
        json["views"][1]["depth_confidence"] = "view1/sure".into();
        std::fs::write(&file, json.to_string()).unwrap();
        std::fs::create_dir(path.join("view1/sure")).unwrap();
        let size = 24;
        let data = (0..size * size).map(|k| f32::from(u8::from(k % size >= size / 2))).collect();
        let levels = tessuto_core::image::Image { width: size, height: size, channels: 1, data };
        for k in 0..2 {
            crate::io::image::write_png(&path.join(format!("view1/sure/confidence_{k:03}.png")), &levels)
                .unwrap();
        }
        let [first, second] = of_view(path);
        assert_eq!(first, before[0], "the first camera names none");
        assert_eq!(second, [0, before[1][1]]);
        assert!(before[1][0] > 20, "{before:?}");
    }

    #[test]
    fn a_thinned_map_is_seen_by_its_camera() {
        let camera = Camera { fx: 50.0, fy: 60.0, cx: 7.0, cy: 5.5, width: 17, height: 13 };
        // Every pixel holds its place.
        let z = (0..17 * 13).map(f64::from).collect();
        let map =
            DepthMap { width: 17, height: 13, z, unit: Unit { metres: 1.0, told: true }, channel: None };
        for factor in [1, 2, 3] {
            let (found, small) = (thinned(&map, factor), of_thinned(&camera, factor));
            assert_eq!(found.len(), small.width * small.height);
            for (k, place) in found.iter().enumerate() {
                let here = glam::DVec2::new((k % small.width) as f64, (k / small.width) as f64);
                let there = glam::DVec2::new(f64::from(place % 17.0), f64::from((place / 17.0).floor()));
                assert!((small.ray(here) - camera.ray(there)).length() < 1e-12);
            }
        }
    }
}
