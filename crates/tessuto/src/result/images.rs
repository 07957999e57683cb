//! Images of every frame of a result, and its errors at the vertices.

use std::borrow::Cow;
use std::path::Path;

use super::shutter;
use crate::report::Kind;
use crate::report::images::{FrameImages, Ranges, Scales, measured_depth_image};
use crate::report::sheet::{chosen_frames, contact_sheet};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_core::video::Frame;
use tessuto_estimate::Reconstruction;
use tessuto_estimate::io;
use tessuto_estimate::metrics::verdict::criteria::CORRELATION;
use tessuto_estimate::metrics::{AgreementMeter, FrameAgreement, overlaps, print_correlation};
use tessuto_render::raster::{Rasterizer, Rendering};

/// A vertex farther behind the nearest surface `[m]` is hidden.
const HIDDEN: f64 = 0.01;

/// Folder, in that of the result, of the images that further camera `k` sees.
pub(crate) fn of_other(k: usize) -> String {
    format!("pictures/view_{}", k + 1)
}

/// What is written of a further camera's frames.
const OF_OTHER: [Kind; 4] = [Kind::Render, Kind::Observed, Kind::Difference, Kind::MaskDifference];

/// Renders frames of a result, one by one: all of them together could fill the memory.
struct Painter<'a> {
    scene: &'a Scene,
    /// The scene as each further camera sees it, and where the sheet is then.
    others: Vec<(Cow<'a, Scene>, Cow<'a, [Positions]>)>,
    result: &'a Reconstruction,
    rasterizer: Rasterizer,
    meter: AgreementMeter,
}

/// Images of one frame of the result.
struct Rendered {
    rgb: Image,
    mask: Image,
    depth: Image,
    measured: Option<Image>,
}

/// Numbers of one frame.
struct Measured {
    agreement: FrameAgreement,
    /// Depth errors at the vertices `[m]`.
    errors: Vec<f32>,
}

impl Painter<'_> {
    fn render(&self, rendering: &mut Rendering, n: usize) -> Rendered {
        let (scene, shape) = (self.scene, &self.result.motion[n]);
        self.rasterizer.render(scene.viewpoint(n), shape, &self.result.texture, rendering);
        let measured =
            scene.truth.points_in(n).map(|points| measured_depth_image(points, scene.viewpoint(n)));
        Rendered { measured, ..Rendered::of(rendering) }
    }

    /// How well the print lies on that of the video if the shutter was open for some of the time.
    fn blurred_correlation(
        &self,
        rendering: &mut Rendering,
        n: usize,
        observed: &Frame,
    ) -> impl Iterator<Item = f64> {
        let view = self.scene.viewpoint(n);
        let draw = |shape: &Positions| {
            self.rasterizer.render(view, shape, &self.result.texture, rendering);
            rendering.rgba.clone()
        };
        let exposures = shutter::exposures(&self.result.motion, n, &view, draw);
        exposures.into_iter().flatten().filter_map(|[rgb, mask]| print_correlation(&rgb, &mask, observed))
    }

    /// Draws frame `n` through further camera `k` into the result's `folder`, and lowers `agreement` to that of the
    /// silhouette as it sees it, where that is worse. Colours are judged by the first camera, which the texture is
    /// from.
    fn through_other(
        &self,
        agreement: &mut FrameAgreement,
        (k, folder): (usize, &Path),
        rendering: &mut Rendering,
        n: usize,
        scales: &Scales,
    ) -> Result<()> {
        let (other, motion) = &self.others[k];
        self.rasterizer.render(other.viewpoint(n), &motion[n], &self.result.texture, rendering);
        let drawn = Rendered::of(rendering);
        let observed = &*other.frames.frame(n)?;
        let folder = folder.join(of_other(k));
        drawn.images(observed).write_kinds(&OF_OTHER, &folder, self.scene.first_frame + n, scales)?;
        let [silhouette, uncovered] = overlaps(&drawn.mask, observed);
        agreement.silhouette = [agreement.silhouette, silhouette].into_iter().flatten().reduce(f64::min);
        agreement.uncovered = [agreement.uncovered, uncovered].into_iter().flatten().reduce(f64::max);
        Ok(())
    }

    /// Writes the images of frame `n` into the result's `folder` and measures it.
    fn finish(
        &self,
        rendered: &Rendered,
        rendering: &mut Rendering,
        n: usize,
        folder: &Path,
        scales: &Scales,
    ) -> Result<Measured> {
        let (scene, shape) = (self.scene, &self.result.motion[n]);
        let number = scene.first_frame + n;
        let observed = &*scene.frames.frame(n)?;
        rendered.images(observed).write(&folder.join("pictures"), number, scales)?;
        let mut agreement = self.meter.measure(number, shape, &rendered.rgb, &rendered.mask, observed);
        for k in 0..self.others.len() {
            self.through_other(&mut agreement, (k, folder), rendering, n, scales)?;
        }
        agreement.deviation = self.result.deviations.as_ref().map(|frames| root_mean_square(&frames[n]));
        // Blur is a reason to look for only where the sharp print is not there.
        if let Some(sharp) = agreement.correlation.filter(|sharp| *sharp < CORRELATION) {
            agreement.correlation =
                Some(self.blurred_correlation(rendering, n, observed).fold(sharp, f64::max));
        }
        Ok(Measured {
            agreement,
            errors: depth_errors(&scene.viewpoint(n), shape, &rendered.depth, rendered.measured.as_ref()),
        })
    }
}

/// Writes pictures/ and, where there is truth, the errors at the vertices; returns how well the frames agree with the
/// video. Every frame is rendered once.
pub(super) fn write(folder: &Path, scene: &Scene, result: &Reconstruction) -> Result<Vec<FrameAgreement>> {
    let rasterizer = Rasterizer::of_fabric(&scene.template, &scene.viewpoint(0), result.back);
    let meter = AgreementMeter::new(&scene.template);
    let others =
        (1..scene.view_count()).map(|v| (scene.seen_by(v), scene.when_seen_by(v, &result.motion))).collect();
    let painter = Painter { scene, others, result, rasterizer, meter };
    // The frames of the contact sheet stay; their pixels and the vertices of all frames set the scales.
    let chosen = chosen_frames(result.motion.len());
    let render = |rendering: &mut Rendering, k: usize| Ok(painter.render(rendering, chosen[k]));
    let kept = scene.frames.map(0..chosen.len(), Rendering::new, render)?;
    let of_pixels = kept.iter().map(|r| Ranges::of(&r.depth, r.measured.as_ref()));
    let of_frame = |(n, shape): (usize, &Positions)| Ranges::of_vertices(shape, &scene.viewpoint(n));
    let of_vertices = result.motion.iter().enumerate().map(of_frame);
    let scales = Scales::fitting(of_pixels.chain(of_vertices));
    let finish = |rendering: &mut Rendering, n: usize| match chosen.binary_search(&n) {
        Ok(k) => painter.finish(&kept[k], rendering, n, folder, &scales),
        Err(_) => painter.finish(&painter.render(rendering, n), rendering, n, folder, &scales),
    };
    let measured = scene.frames.map(0..result.motion.len(), Rendering::new, finish)?;
    write_errors(folder, scene, &result.motion, &measured)?;
    let observed: Vec<_> = chosen.iter().map(|n| scene.frames.frame(*n)).collect::<Result<_>>()?;
    let numbers = chosen.iter().map(|n| scene.first_frame + n);
    let shown: Vec<_> =
        numbers.zip(kept.iter().zip(&observed)).map(|(n, (r, frame))| (n, r.images(frame))).collect();
    io::image::write_png(&folder.join("pictures/contact_sheet.png"), &contact_sheet(&shown, &scales))?;
    Ok(measured.into_iter().map(|m| m.agreement).collect())
}

impl Rendered {
    /// What was drawn; nothing of it was measured.
    fn of(rendering: &Rendering) -> Self {
        let (width, height) = (rendering.width, rendering.height);
        let channel = |range: std::ops::Range<usize>| Image {
            width,
            height,
            channels: range.len(),
            data: rendering.rgba.iter().flat_map(|c| &c[range.clone()]).copied().collect(),
        };
        Self { rgb: channel(0..3), mask: channel(3..4), depth: rendering.depth_image(), measured: None }
    }

    fn images<'a>(&'a self, observed: &'a Frame) -> FrameImages<'a> {
        FrameImages {
            rgb: &self.rgb,
            mask: &self.mask,
            depth: &self.depth,
            observed,
            measured_depth: self.measured.as_ref(),
        }
    }
}

fn write_errors(folder: &Path, scene: &Scene, motion: &[Positions], measured: &[Measured]) -> Result<()> {
    let size = [motion.len(), scene.template.positions.len()];
    if (0..motion.len()).any(|n| scene.truth.points_in(n).is_some()) {
        let errors: Vec<f32> = measured.iter().flat_map(|m| &m.errors).copied().collect();
        io::npy::write(&folder.join("depth_error.npy"), &size, &errors)?;
    }
    if let Some(truth) = &scene.truth.vertices {
        let distance = |(a, b): (&Positions, &Positions)| -> Vec<f32> {
            a.iter().zip(b).map(|(p, q)| p.distance(*q) as f32).collect()
        };
        let errors: Vec<f32> = motion.iter().zip(truth.iter()).flat_map(distance).collect();
        io::npy::write(&folder.join("vertex_error.npy"), &size, &errors)?;
    }
    Ok(())
}

fn root_mean_square(numbers: &[f64]) -> f64 {
    (numbers.iter().map(|x| x * x).sum::<f64>() / numbers.len().max(1) as f64).sqrt()
}

/// Depth minus measured depth `[m]` at every vertex that is in sight, NaN elsewhere and where none was measured.
fn depth_errors(view: &Viewpoint, shape: &Positions, depth: &Image, measured: Option<&Image>) -> Vec<f32> {
    let Some(measured) = measured else { return vec![f32::NAN; shape.len()] };
    let (width, height) = (measured.width as f64, measured.height as f64);
    let at = |p: &glam::DVec3| {
        let (p_pixel, z) = (view.project(*p).round(), view.depth(*p));
        let inside = z > 0.0 && p_pixel.min_element() >= 0.0 && p_pixel.x < width && p_pixel.y < height;
        if !inside {
            return f32::NAN;
        }
        let (x, y) = (p_pixel.x as usize, p_pixel.y as usize);
        let (front, truth) = (depth.pixel(x, y)[0], measured.pixel(x, y)[0]);
        let hidden = front > 0.0 && z > f64::from(front) + HIDDEN;
        if truth > 0.0 && !hidden { (z - f64::from(truth)) as f32 } else { f32::NAN }
    };
    shape.iter().map(at).collect()
}
