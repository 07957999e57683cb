//! Pictures of every frame of a result, and its errors at the vertices.

use std::path::Path;

use crate::error::Result;
use crate::image::Image;
use crate::io;
use crate::mesh::Positions;
use crate::raster::{Rasterizer, Rendering};
use crate::reconstruct::Reconstruction;
use crate::report::pictures::{FramePictures, Ranges, Scales, measured_depth_image};
use crate::report::sheet::{chosen_frames, contact_sheet};
use crate::scene::Scene;
use crate::video::Frame;

/// A vertex farther behind the nearest surface [m] is hidden.
const HIDDEN: f64 = 0.01;

/// Draws frames of a result, one by one: all of them together could fill the memory.
struct Painter<'a> {
    scene: &'a Scene,
    result: &'a Reconstruction,
    rasterizer: Rasterizer,
}

/// Images of one frame of the result.
struct Rendered {
    rgb: Image,
    mask: Image,
    depth: Image,
    measured: Option<Image>,
}

impl Painter<'_> {
    fn draw(&self, rendering: &mut Rendering, n: usize) -> Rendered {
        let (scene, shape) = (self.scene, &self.result.motion[n]);
        self.rasterizer.render(&scene.camera, shape, &self.result.texture, rendering);
        let (width, height) = (rendering.width, rendering.height);
        let channel = |range: std::ops::Range<usize>| Image {
            width,
            height,
            channels: range.len(),
            data: rendering.rgba.iter().flat_map(|c| c[range.clone()].to_vec()).collect(),
        };
        Rendered {
            rgb: channel(0..3),
            mask: channel(3..4),
            depth: rendering.depth_image(),
            measured: self.measured(n),
        }
    }

    fn measured(&self, n: usize) -> Option<Image> {
        self.scene.truth.points.as_ref().map(|p| measured_depth_image(&p[n], &self.scene.camera))
    }

    /// What the scales must cover of frame `n`, and the depth errors at the vertices.
    fn measure(&self, rendering: &mut Rendering, n: usize) -> (Ranges, Vec<f32>) {
        let shape = &self.result.motion[n];
        self.rasterizer.render(&self.scene.camera, shape, &self.result.texture, rendering);
        let (depth, measured) = (rendering.depth_image(), self.measured(n));
        let errors = depth_errors(self.scene, shape, &depth, measured.as_ref());
        (Ranges::of(&depth, measured.as_ref()), errors)
    }
}

/// Writes pictures/ and, where there is truth, the errors at the vertices.
pub(super) fn write(folder: &Path, scene: &Scene, result: &Reconstruction) -> Result<()> {
    let painter = Painter { scene, result, rasterizer: Rasterizer::new(&scene.template) };
    let all = 0..result.motion.len();
    let measured =
        scene.frames.map(all.clone(), Rendering::new, |rendering, n| Ok(painter.measure(rendering, n)))?;
    write_errors(folder, scene, &result.motion, &measured)?;
    let scales = Scales::fitting(measured.iter().map(|(ranges, _)| *ranges));
    let target = folder.join("pictures");
    scene.frames.map(all, Rendering::new, |rendering, n| {
        let drawn = painter.draw(rendering, n);
        drawn.pictures(&*scene.frames.frame(n)?).write(&target, scene.first_frame + n, &scales)
    })?;
    let chosen = chosen_frames(result.motion.len())
        .into_iter()
        .map(|n| Ok((scene.first_frame + n, painter.draw(&mut Rendering::new(), n), scene.frames.frame(n)?)));
    let chosen: Vec<_> = chosen.collect::<Result<_>>()?;
    let shown: Vec<_> = chosen.iter().map(|(n, drawn, observed)| (*n, drawn.pictures(observed))).collect();
    io::image::write_png(&target.join("contact_sheet.png"), &contact_sheet(&shown, &scales))
}

impl Rendered {
    fn pictures<'a>(&'a self, observed: &'a Frame) -> FramePictures<'a> {
        FramePictures {
            rgb: &self.rgb,
            mask: &self.mask,
            depth: &self.depth,
            observed,
            measured_depth: self.measured.as_ref(),
        }
    }
}

fn write_errors(
    folder: &Path,
    scene: &Scene,
    motion: &[Positions],
    measured: &[(Ranges, Vec<f32>)],
) -> Result<()> {
    let size = [motion.len(), scene.template.positions.len()];
    if scene.truth.points.is_some() {
        let errors: Vec<f32> = measured.iter().flat_map(|(_, errors)| errors).copied().collect();
        io::npy::write(&folder.join("depth_error.npy"), &size, &errors)?;
    }
    if let Some(truth) = &scene.truth.vertices {
        let distance = |(a, b): (&Positions, &Positions)| -> Vec<f32> {
            a.iter().zip(b).map(|(p, q)| p.distance(*q) as f32).collect()
        };
        let errors: Vec<f32> = motion.iter().zip(truth).flat_map(distance).collect();
        io::npy::write(&folder.join("vertex_error.npy"), &size, &errors)?;
    }
    Ok(())
}

/// Depth minus measured depth [m] at every vertex that is in sight, NaN elsewhere and where none was measured.
fn depth_errors(scene: &Scene, shape: &Positions, depth: &Image, measured: Option<&Image>) -> Vec<f32> {
    let Some(measured) = measured else { return vec![f32::NAN; shape.len()] };
    let (width, height) = (measured.width as f64, measured.height as f64);
    let at = |p: &glam::DVec3| {
        let p_pixel = scene.camera.project(*p).round();
        let inside = p.z > 0.0 && p_pixel.min_element() >= 0.0 && p_pixel.x < width && p_pixel.y < height;
        if !inside {
            return f32::NAN;
        }
        let (x, y) = (p_pixel.x as usize, p_pixel.y as usize);
        let (front, truth) = (depth.pixel(x, y)[0], measured.pixel(x, y)[0]);
        let hidden = front > 0.0 && p.z > f64::from(front) + HIDDEN;
        if truth > 0.0 && !hidden { (p.z - f64::from(truth)) as f32 } else { f32::NAN }
    };
    shape.iter().map(at).collect()
}
