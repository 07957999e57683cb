//! Pictures of every frame of a result, and its errors at the vertices.

use std::path::Path;

use rayon::prelude::*;

use crate::error::Result;
use crate::image::Image;
use crate::io;
use crate::raster::{Rasterizer, Rendering};
use crate::reconstruct::Reconstruction;
use crate::report::pictures::{FramePictures, Scales, measured_depth_image};
use crate::report::sheet::{chosen_frames, contact_sheet};
use crate::scene::{Scene, Shape};

/// A vertex farther behind the nearest surface [m] is hidden.
const HIDDEN: f64 = 0.01;

/// Images of one frame of the result.
struct Rendered {
    rgb: Image,
    mask: Image,
    depth: Image,
    measured: Option<Image>,
}

fn render(scene: &Scene, result: &Reconstruction) -> Vec<Rendered> {
    let rasterizer = Rasterizer::new(&scene.template);
    let of = |rendering: &mut Rendering, (n, shape): (usize, &Shape)| {
        rasterizer.render(&scene.camera, shape, &result.texture, rendering);
        let (width, height) = (rendering.width, rendering.height);
        let channel = |range: std::ops::Range<usize>| Image {
            width,
            height,
            channels: range.len(),
            data: rendering.rgba.iter().flat_map(|c| c[range.clone()].to_vec()).collect(),
        };
        let points = scene.truth.points.as_ref();
        Rendered {
            rgb: channel(0..3),
            mask: channel(3..4),
            depth: rendering.depth_image(),
            measured: points.map(|p| measured_depth_image(&p[n], &scene.camera)),
        }
    };
    result.motion.par_iter().enumerate().map_init(Rendering::new, of).collect()
}

/// Writes pictures/ and, where there is truth, the errors at the vertices.
pub(super) fn write(folder: &Path, scene: &Scene, result: &Reconstruction) -> Result<()> {
    let rendered = render(scene, result);
    write_errors(folder, scene, &result.motion, &rendered)?;
    let scales = Scales::fitting(rendered.iter().map(|r| (&r.depth, r.measured.as_ref())));
    let pictures: Vec<FramePictures> = rendered
        .iter()
        .zip(&scene.frames)
        .map(|(r, observed)| FramePictures {
            rgb: &r.rgb,
            mask: &r.mask,
            depth: &r.depth,
            observed,
            measured_depth: r.measured.as_ref(),
        })
        .collect();
    let target = folder.join("pictures");
    pictures
        .par_iter()
        .enumerate()
        .map(|(n, p)| p.write(&target, scene.first_frame + n, &scales))
        .collect::<Result<Vec<()>>>()?;
    let chosen: Vec<_> =
        chosen_frames(pictures.len()).into_iter().map(|n| (scene.first_frame + n, pictures[n])).collect();
    io::image::write_png(&target.join("contact_sheet.png"), &contact_sheet(&chosen, &scales))
}

fn write_errors(folder: &Path, scene: &Scene, motion: &[Shape], rendered: &[Rendered]) -> Result<()> {
    let size = [motion.len(), scene.template.positions.len()];
    if scene.truth.points.is_some() {
        let errors: Vec<f32> =
            motion.iter().zip(rendered).flat_map(|(shape, r)| depth_errors(scene, shape, r)).collect();
        io::npy::write(&folder.join("depth_error.npy"), &size, &errors)?;
    }
    if let Some(truth) = &scene.truth.vertices {
        let distance = |(a, b): (&Shape, &Shape)| -> Vec<f32> {
            a.iter().zip(b).map(|(p, q)| p.distance(*q) as f32).collect()
        };
        let errors: Vec<f32> = motion.iter().zip(truth).flat_map(distance).collect();
        io::npy::write(&folder.join("vertex_error.npy"), &size, &errors)?;
    }
    Ok(())
}

/// Depth minus measured depth [m] at every vertex that is in sight, NaN elsewhere and where none was measured.
fn depth_errors(scene: &Scene, shape: &Shape, rendered: &Rendered) -> Vec<f32> {
    let Some(measured) = &rendered.measured else { return vec![f32::NAN; shape.len()] };
    let (width, height) = (measured.width as f64, measured.height as f64);
    let at = |p: &glam::DVec3| {
        let p_pixel = scene.camera.project(*p).round();
        let inside = p.z > 0.0 && p_pixel.min_element() >= 0.0 && p_pixel.x < width && p_pixel.y < height;
        if !inside {
            return f32::NAN;
        }
        let (x, y) = (p_pixel.x as usize, p_pixel.y as usize);
        let (front, truth) = (rendered.depth.pixel(x, y)[0], measured.pixel(x, y)[0]);
        let hidden = front > 0.0 && p.z > f64::from(front) + HIDDEN;
        if truth > 0.0 && !hidden { (p.z - f64::from(truth)) as f32 } else { f32::NAN }
    };
    shape.iter().map(at).collect()
}
