//! Pictures of a reconstruction: what was rendered, what was filmed, and how they differ.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::colour::{Colour, NOTHING, UNKNOWN, diverging, heat, mix, sequential};
use super::legend::{self, Legend};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::io;
use crate::scene::Frame;

/// Sorts of pictures; each has a folder of its own, so that a viewer's arrow keys play the video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The reconstruction's colour.
    Render,
    /// The video's colour.
    Observed,
    /// Root mean square over the channels of their difference.
    Difference,
    /// Rendered minus observed mask.
    MaskDifference,
    /// The reconstruction's depth.
    Depth,
    /// Reconstructed minus measured depth.
    DepthDifference,
}

impl Kind {
    /// All of them, in the order they are shown.
    pub const ALL: [Self; 6] = [
        Self::Render,
        Self::Observed,
        Self::Difference,
        Self::Depth,
        Self::MaskDifference,
        Self::DepthDifference,
    ];

    /// Name of its folder.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Render => "render",
            Self::Observed => "observed",
            Self::Difference => "difference",
            Self::MaskDifference => "mask_difference",
            Self::Depth => "depth",
            Self::DepthDifference => "depth_difference",
        }
    }

    /// What it shows, for people.
    pub fn label(self) -> &'static str {
        match self {
            Self::Render => "rendered",
            Self::Observed => "observed",
            Self::Difference => "colour difference",
            Self::MaskDifference => "mask difference",
            Self::Depth => "depth",
            Self::DepthDifference => "depth − measured depth",
        }
    }

    /// Path of the picture of frame `frame`, relative to the folder of pictures.
    pub fn path(self, frame: usize) -> String {
        format!("{}/frame_{frame:03}.png", self.folder())
    }
}

/// What the ends of the colour bars mean; the same for all frames, so that they can be compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Depth [m] at the two ends.
    pub depth: [f64; 2],
    /// Depth difference [m] at the ends: ± this.
    pub depth_difference: f64,
    /// Colour difference (sRGB, of 1) at the upper end.
    pub colour_difference: f64,
}

impl Scales {
    /// Scales that fit the frames' depth images and, where there are any, measured ones [m].
    pub fn fitting<'a>(frames: impl IntoIterator<Item = (&'a Image, Option<&'a Image>)>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut differences: Vec<f32> = Vec::new();
        for (depth, measured) in frames {
            for z in depth.data.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)) {
                (low, high) = (low.min(z), high.max(z));
            }
            if let Some(measured) = measured {
                let pairs = depth.data.iter().zip(&measured.data).filter(|(a, b)| **a > 0.0 && **b > 0.0);
                differences.extend(pairs.map(|(a, b)| (a - b).abs()));
            }
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // Whole centimetres; the difference that 95 % of the pixels stay below, rounded up.
        let depth = [(low * 100.0).floor() / 100.0, (high * 100.0).floor() / 100.0 + 0.01];
        let rank = differences.len() * 95 / 100;
        let typical = match differences.len() {
            0 => 0.01,
            _ => f64::from(*differences.select_nth_unstable_by(rank, f32::total_cmp).1),
        };
        Self { depth, depth_difference: rounded_up(typical.max(1e-3)), colour_difference: 0.3 }
    }
}

/// The next of 1, 2, 5, 10, 20, 50 … (times powers of ten).
pub(super) fn rounded_up(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= value * 0.999).unwrap_or(10.0 * power)
}

/// One frame's images, all of the crop's size.
#[derive(Debug, Clone, Copy)]
pub struct FramePictures<'a> {
    /// Rendered sRGB colour, shape [height, width, 3].
    pub rgb: &'a Image,
    /// Rendered coverage in [0, 1], shape [height, width, 1].
    pub mask: &'a Image,
    /// Rendered depth [m], 0 where there is no fabric, shape [height, width, 1].
    pub depth: &'a Image,
    /// The video.
    pub observed: &'a Frame,
    /// Measured depth [m], 0 where there is none; see [`measured_depth_image`].
    pub measured_depth: Option<&'a Image>,
}

impl FramePictures<'_> {
    /// Write `<folder>/<kind>/frame_<frame>.png` for every kind there is data for.
    pub fn write(&self, folder: &Path, frame: usize, scales: &Scales) -> Result<()> {
        for kind in Kind::ALL {
            let Some(mut picture) = self.picture(kind, scales) else { continue };
            if let Some(legend) = Legend::of(kind, scales) {
                picture = legend::below(&picture, &legend);
            }
            let path = folder.join(kind.path(frame));
            let parent = path.parent().unwrap_or(folder);
            std::fs::create_dir_all(parent)
                .map_err(|source| Error::Output { path: parent.to_path_buf(), source })?;
            io::image::write_png(&path, &picture)?;
        }
        Ok(())
    }

    /// The picture of this kind without its legend, shape [height, width, 3]; None without data.
    pub fn picture(&self, kind: Kind, scales: &Scales) -> Option<Image> {
        let (width, height) = (self.rgb.width, self.rgb.height);
        let paint = |colour: &dyn Fn(usize) -> Colour| {
            let data = (0..width * height).flat_map(colour).collect();
            Image { width, height, channels: 3, data }
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

/// Depth image [m] of measured `points` [m], camera frame: each point at its rounded projection, the
/// nearer one where two meet, gaps between points filled from their neighbours, 0 elsewhere.
/// Shape [height, width, 1] of `camera`. For looking at, not for measuring.
pub fn measured_depth_image(points: &[DVec3], camera: &Camera) -> Image {
    let mut image = Image::new(camera.width, camera.height, 1);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in points.iter().filter(|p| p.z > 0.0) {
        let p_pixel = camera.project(*p).round();
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
