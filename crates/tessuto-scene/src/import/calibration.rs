//! What is known of the camera before the size of the frames is: from options or a calibration file.

use super::lens::Distortion;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

/// Intrinsics of a lens, in pixels of images of `size`; the centre of pixel (column i, row j) is at (i, j).
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Where it comes from, for messages.
    pub place: String,
    /// Focal lengths.
    pub focal: Focal,
    /// Principal point; the middle of the image where `None`.
    pub centre: Option<[f64; 2]>,
    /// Width and height of the images it is for; any where `None`.
    pub size: Option<[usize; 2]>,
    /// Lens distortion.
    pub distortion: Distortion,
    /// Width over height of a pixel, where [`focal`](Self::focal) does not give fy.
    pub pixel_aspect: f64,
    /// Standard deviation of the focal length, as a fraction of it, where that is known.
    pub uncertainty: Option<f64>,
    /// What a user should know of it.
    pub notes: Vec<String>,
}

/// A camera file as text, and as JSON where it is that.
pub(super) struct Contents<'a> {
    pub text: &'a str,
    pub json: Option<&'a serde_json::Value>,
    /// Names the file in messages.
    pub place: &'a str,
    /// Which of several cameras.
    pub camera_id: Option<u32>,
}

/// A kind of camera file: each is a row in the file that reads it.
pub(super) struct Reader {
    /// Names of the files and the program that writes them, for messages.
    pub about: &'static str,
    /// Ends of the files' names, in lower case.
    pub endings: &'static [&'static str],
    /// Whether a file of such a name is of this kind.
    pub knows: fn(&Contents) -> bool,
    pub read: fn(&Contents) -> Result<Calibration>,
}

/// A focal length, as it is stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Focal {
    /// fx and fy `[px]`.
    Pixels([f64; 2]),
    /// fx `[px]`; fy is by the shape of the pixels.
    Across(f64),
    /// Horizontal field of view `[rad]`.
    Angle(f64),
    /// In 35 mm terms `[mm]`: the lens that has the same diagonal field of view on film of 36 mm × 24 mm.
    Film(f64),
}

/// What is assumed of a lens of which nothing is known, in 35 mm terms `[mm]`, and its standard deviation as a
/// fraction: main cameras of phones have 24 to 28 mm as photos and up to a third more as stabilised videos.
const ASSUMED: (f64, f64) = (28.0, 0.2);

impl Calibration {
    /// A stand-in for a lens of which nothing is known, until it is estimated.
    pub fn assumed() -> Self {
        let (mm, uncertainty) = ASSUMED;
        Self { uncertainty: Some(uncertainty), ..Self::new("assumed", Focal::Film(mm)) }
    }

    /// A camera without distortion, known from `place`.
    pub fn new(place: impl Into<String>, focal: Focal) -> Self {
        Self {
            place: place.into(),
            focal,
            centre: None,
            size: None,
            distortion: Distortion::default(),
            pixel_aspect: 1.0,
            uncertainty: None,
            notes: Vec::new(),
        }
    }

    /// The camera of images of `size` `[px]`; a calibration for images of the same shape but another size is scaled,
    /// with a note.
    ///
    /// # Errors
    /// [`Error::Input`] if the shapes differ.
    pub fn scaled_to(&self, size: [usize; 2], notes: &mut Vec<String>) -> Result<Camera> {
        let [w, h] = size.map(|n| n as f64);
        notes.extend(self.notes.iter().map(|n| format!("{}: {n}", self.place)));
        let mut scale = [1.0, 1.0];
        if let Some(own) = self.size.filter(|own| *own != size) {
            scale = [w / own[0] as f64, h / own[1] as f64];
            // One pixel of rounding in either side.
            let ratio = scale[0] / scale[1] - 1.0;
            if ratio.abs() > 1.5 / w.min(h).min(own[0] as f64).min(own[1] as f64) {
                let turned = own[0].abs_diff(own[1]) > 0 && (own[0] > own[1]) != (size[0] > size[1]);
                return Err(Error::input(
                    &self.place,
                    format!(
                        "is for images of {}×{} pixels, but the frames have {}×{}",
                        own[0], own[1], size[0], size[1]
                    ),
                    if turned {
                        "the video is turned by 90° against the calibration: calibrate with images held \
                         alike, or give fx fy cx cy of the turned image"
                    } else {
                        "give the camera of these images; a video is often cut from the middle of the sensor, \
                         which no scale makes good"
                    },
                ));
            }
            notes.push(format!(
                "{}: calibrated at {}×{}, scaled to the frames' {}×{}; right only if the video shows the whole image",
                self.place, own[0], own[1], size[0], size[1]
            ));
        }
        // The size whose pixels the values are in.
        let own = self.size.map_or([w, h], |own| own.map(|n| n as f64));
        let [fx, fy] = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::Across(fx) => [fx, fx * self.pixel_aspect],
            Focal::Angle(angle) => {
                let fx = own[0] / (2.0 * (angle / 2.0).tan());
                [fx, fx * self.pixel_aspect]
            }
            Focal::Film(mm) => {
                // In widths of a pixel the image is so much less high.
                let fx = mm * own[0].hypot(own[1] / self.pixel_aspect) / 36f64.hypot(24.0);
                [fx, fx * self.pixel_aspect]
            }
        };
        let centre = self.centre.unwrap_or([(own[0] - 1.0) / 2.0, (own[1] - 1.0) / 2.0]);
        // The upper left corner of the image, half a pixel from the first centre, is what scaling keeps.
        let scaled = |c: f64, s: f64| (c + 0.5) * s - 0.5;
        let camera = Camera {
            fx: fx * scale[0],
            fy: fy * scale[1],
            cx: scaled(centre[0], scale[0]),
            cy: scaled(centre[1], scale[1]),
            width: size[0],
            height: size[1],
        };
        let sane = |v: f64| v.is_finite() && v.abs() < 1e6;
        let all_sane = [camera.fx, camera.fy, camera.cx, camera.cy].into_iter().all(sane);
        if !(all_sane && camera.fx > 0.0 && camera.fy > 0.0) {
            return Err(Error::input(
                &self.place,
                format!("fx {fx}, fy {fy}, centre {centre:?} is not a camera"),
                "focal lengths are in pixels and above 0: width / (2 tan(half the horizontal field of view))",
            ));
        }
        Ok(camera)
    }
}
