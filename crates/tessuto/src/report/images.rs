//! Images of a reconstruction: what was rendered, what was filmed, and how they differ.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::colour::{Colour, NOTHING, UNKNOWN, diverging, heat, mix, sequential};
pub use super::kind::{Kind, Scales};
use super::legend::{self, Legend};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::video::Frame;
use tessuto_estimate::io;

/// What the scales must cover of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Ranges {
    /// Least and largest depth `[m]`; the first is larger where there is none.
    depth: [f64; 2],
    /// Number of pixels for which each of the [`STEPS`] is the first to cover the depth difference.
    differences: [usize; STEPS.len()],
}

/// Ends that a scale of depth differences may have `[m]`.
const STEPS: [f64; 13] = [1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];

impl Ranges {
    /// Of a depth image and, where there is one, a measured one `[m]`; 0 is no depth.
    pub fn of(depth: &Image, measured: Option<&Image>) -> Self {
        let mut out = Self { depth: [f64::INFINITY, f64::NEG_INFINITY], differences: [0; STEPS.len()] };
        for z in depth.data.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)) {
            out.depth = [out.depth[0].min(z), out.depth[1].max(z)];
        }
        let measured = measured.map_or(&[][..], |m| &m.data);
        for (a, b) in depth.data.iter().zip(measured).filter(|(a, b)| **a > 0.0 && **b > 0.0) {
            let difference = f64::from((a - b).abs());
            let step = STEPS.iter().position(|s| difference <= *s).unwrap_or(STEPS.len() - 1);
            out.differences[step] += 1;
        }
        out
    }

    /// Of the depths alone of vertices `[m]` that `view` sees.
    pub fn of_vertices(vertices: &[DVec3], view: &Viewpoint) -> Self {
        let size = DVec2::new(view.camera.width as f64, view.camera.height as f64);
        let seen = |p: &&DVec3| {
            view.project_in_front(**p).is_some_and(|p_pixel| {
                let p_pixel = p_pixel.round();
                p_pixel.cmpge(DVec2::ZERO).all() && p_pixel.cmplt(size).all()
            })
        };
        let depths = vertices.iter().filter(seen).map(|p| view.depth(*p));
        let depth = depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], z| [l.min(z), h.max(z)]);
        Self { depth, differences: [0; STEPS.len()] }
    }
}

impl Scales {
    /// Scales that fit all frames: whole centimetres of depth, and a depth difference that 95 % of the pixels stay
    /// below.
    pub fn fitting(frames: impl IntoIterator<Item = Ranges>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut differences = [0; STEPS.len()];
        for frame in frames {
            (low, high) = (low.min(frame.depth[0]), high.max(frame.depth[1]));
            differences.iter_mut().zip(frame.differences).for_each(|(sum, n)| *sum += n);
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let depth = [(low * 100.0).floor() / 100.0, (high * 100.0).floor() / 100.0 + 0.01];
        let count: usize = differences.iter().sum();
        let within = |k: &usize| 20 * differences[..=*k].iter().sum::<usize>() >= 19 * count;
        let step = (0..STEPS.len()).find(within).unwrap_or(STEPS.len() - 1);
        let depth_difference = if count == 0 { 1e-2 } else { STEPS[step] };
        Self { depth, depth_difference, colour_difference: 0.3 }
    }
}

/// One frame's images, all of the crop's size.
#[derive(Debug, Clone, Copy)]
pub struct FrameImages<'a> {
    /// Rendered sRGB colour, shape [height, width, 3].
    pub rgb: &'a Image,
    /// Rendered coverage in [0, 1], shape [height, width, 1].
    pub mask: &'a Image,
    /// Rendered depth `[m]`, 0 where there is no fabric, shape [height, width, 1].
    pub depth: &'a Image,
    /// The video.
    pub observed: &'a Frame,
    /// Measured depth `[m]`, 0 where there is none; see [`measured_depth_image`].
    pub measured_depth: Option<&'a Image>,
}

impl FrameImages<'_> {
    /// Write `<folder>/<kind>/frame_<frame>.png` for every kind there is data for.
    pub fn write(&self, folder: &Path, frame: usize, scales: &Scales) -> Result<()> {
        self.write_kinds(&Kind::ALL, folder, frame, scales)
    }

    /// The same of these kinds.
    pub fn write_kinds(&self, kinds: &[Kind], folder: &Path, frame: usize, scales: &Scales) -> Result<()> {
        for kind in kinds {
            let Some(mut image) = self.image(*kind, scales) else { continue };
            if let Some(legend) = Legend::of(*kind, scales) {
                image = legend::below(&image, &legend);
            }
            let path = folder.join(kind.path(frame));
            let parent = path.parent().unwrap_or(folder);
            std::fs::create_dir_all(parent)
                .map_err(|source| Error::Output { path: parent.to_path_buf(), source })?;
            io::image::write_png(&path, &image)?;
        }
        Ok(())
    }

    /// The image of this kind without its legend, shape [height, width, 3]; None without data.
    pub fn image(&self, kind: Kind, scales: &Scales) -> Option<Image> {
        let (width, height) = (self.rgb.width, self.rgb.height);
        let paint = |colour: &dyn Fn(usize) -> Colour| {
            let mut image = Image::new(width, height, 3);
            let pixels = image.data.chunks_exact_mut(3).enumerate();
            pixels.for_each(|(i, pixel)| pixel.copy_from_slice(&colour(i)));
            image
        };
        let depth = &self.depth.data;
        Some(match kind {
            Kind::Render => self.rgb.clone(),
            Kind::Observed => self.observed.rgb.clone(),
            Kind::Difference => {
                let (a, b) = (&self.rgb.data, &self.observed.rgb.data);
                let squared = |i: usize| (3 * i..3 * i + 3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>();
                let scale = scales.colour_difference as f32;
                paint(&|i| heat((squared(i) / 3.0).sqrt() / scale))
            }
            Kind::MaskDifference => {
                let (a, b) = (&self.mask.data, &self.observed.mask.data);
                let base = |i: usize| mix(NOTHING, diverging(0.0), a[i].max(b[i]));
                let end = |i: usize| diverging((a[i] - b[i]).signum());
                paint(&|i| mix(base(i), end(i), (a[i] - b[i]).abs()))
            }
            Kind::Depth => {
                let [low, high] = scales.depth.map(|z| z as f32);
                let colour = |z: f32| sequential((z - low) / (high - low));
                paint(&|i| if depth[i] > 0.0 { colour(depth[i]) } else { NOTHING })
            }
            Kind::DepthDifference => {
                let measured = &self.measured_depth?.data;
                let scale = scales.depth_difference as f32;
                paint(&|i| match (depth[i] > 0.0, measured[i] > 0.0) {
                    (true, true) => diverging((depth[i] - measured[i]) / scale),
                    (true, false) => UNKNOWN,
                    (false, _) => NOTHING,
                })
            }
        })
    }
}

/// Depth image `[m]` of measured `points` `[m]` as `view` sees them: each point at its rounded projection, the
/// nearer one where two meet, gaps between points filled from their neighbours, 0 elsewhere.
/// Shape [height, width, 1]. For looking at, not for measuring.
pub fn measured_depth_image(points: &[DVec3], view: impl Into<Viewpoint>) -> Image {
    let view = view.into();
    let camera = &view.camera;
    let mut image = Image::new(camera.width, camera.height, 1);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in points.iter().map(|p| view.in_camera(*p)).filter(|p| p.z > 0.0) {
        let p_pixel = camera.project(p).round();
        let last = DVec2::new(camera.width as f64 - 1.0, camera.height as f64 - 1.0);
        if p_pixel.cmpge(DVec2::ZERO).all() && p_pixel.cmple(last).all() {
            (low, high) = (low.min(p_pixel), high.max(p_pixel));
            let value = &mut image.pixel_mut(p_pixel.x as usize, p_pixel.y as usize)[0];
            if *value == 0.0 || p.z < f64::from(*value) {
                *value = p.z as f32;
            }
        }
    }
    // As many steps as the points' typical distance [px], so that an even scatter becomes a surface.
    let distance = ((high - low).max(DVec2::ZERO).element_product() / points.len().max(1) as f64).sqrt();
    for _ in 0..distance.round().min(6.0) as usize {
        image = grown(&image);
    }
    image
}

/// Pixels of value 0 become the mean of those of their 8 neighbours that are not 0.
fn grown(image: &Image) -> Image {
    let mut out = image.clone();
    for y in 0..image.height {
        for x in (0..image.width).filter(|x| image.pixel(*x, y)[0] == 0.0) {
            let (mut sum, mut count) = (0.0, 0.0);
            for ny in y.saturating_sub(1)..(y + 2).min(image.height) {
                for nx in x.saturating_sub(1)..(x + 2).min(image.width) {
                    let value = image.pixel(nx, ny)[0];
                    sum += value;
                    count += f32::from(u8::from(value > 0.0));
                }
            }
            if count > 0.0 {
                out.pixel_mut(x, y)[0] = sum / count;
            }
        }
    }
    out
}
