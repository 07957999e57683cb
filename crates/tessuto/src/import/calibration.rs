//! What is known of the camera before the size of the pictures is: from options or a calibration file.

use std::path::Path;

use super::lens::Distortion;
use super::{colmap, nerfstudio, opencv};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::io::read_bounded;

/// Intrinsics of a lens, in pixels of pictures of `size`; the centre of pixel (column i, row j) is at (i, j).
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Where it comes from, for messages.
    pub place: String,
    /// Focal lengths.
    pub focal: Focal,
    /// Principal point; the middle of the picture where `None`.
    pub centre: Option<[f64; 2]>,
    /// Width and height of the pictures it is for; any where `None`.
    pub size: Option<[usize; 2]>,
    /// Lens distortion.
    pub distortion: Distortion,
    /// What a user should know of it.
    pub notes: Vec<String>,
}

/// A focal length, as it is stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Focal {
    /// fx and fy `[px]`.
    Pixels([f64; 2]),
    /// Horizontal field of view `[rad]`.
    Angle(f64),
}

impl Calibration {
    /// A camera without distortion, known from `place`.
    pub fn new(place: impl Into<String>, focal: Focal) -> Self {
        Self {
            place: place.into(),
            focal,
            centre: None,
            size: None,
            distortion: Distortion::default(),
            notes: Vec::new(),
        }
    }

    /// Reads nerfstudio's transforms.json, COLMAP's cameras.txt (or the folder that holds it) or a calibration of
    /// OpenCV in YAML or JSON, told apart by their content. `camera_id` chooses one of several COLMAP cameras.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file, and an unknown camera model by its name.
    pub fn read(path: &Path, camera_id: Option<u32>) -> Result<Self> {
        let inside = path.join("cameras.txt");
        let path = if path.is_dir() && inside.is_file() { inside.as_path() } else { path };
        let place = path.display().to_string();
        if path.file_name().is_some_and(|n| n == "cameras.bin") || path.is_dir() {
            return Err(Error::input(
                place,
                "is no camera file that is read",
                "name cameras.txt; COLMAP makes it: colmap model_converter --input_path IN --output_path OUT --output_type TXT",
            ));
        }
        let text = String::from_utf8(read_bounded(path, 256 << 20)?).map_err(|e| {
            Error::input(
                &place,
                format!("is not text: {e}"),
                "give transforms.json, cameras.txt, or OpenCV YAML or JSON",
            )
        })?;
        let text = text.trim_start_matches('\u{feff}');
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "txt" => colmap::parse(text, &place, camera_id),
            "yml" | "yaml" => opencv::parse_yaml(text, &place),
            "json" => {
                let value: serde_json::Value = serde_json::from_str(text).map_err(|e| {
                    Error::input(
                        format!("{place}:{}", e.line()),
                        format!("is not valid JSON: {e}"),
                        "correct this line",
                    )
                })?;
                let nerfstudio =
                    ["frames", "fl_x", "camera_angle_x"].iter().any(|key| value.get(key).is_some());
                if nerfstudio {
                    nerfstudio::parse(&value, &place)
                } else {
                    opencv::parse_json(&value, &place)
                }
            }
            _ => Err(Error::input(
                place,
                format!("has the ending \"{ending}\""),
                "camera files are transforms.json (nerfstudio), cameras.txt (COLMAP), .yml, .yaml or .json (OpenCV)",
            )),
        }
    }

    /// The camera of pictures of `size` `[px]`; a calibration for pictures of the same shape but another size is scaled,
    /// with a note.
    ///
    /// # Errors
    /// [`Error::Input`] if the shapes differ.
    pub fn fit(&self, size: [usize; 2], notes: &mut Vec<String>) -> Result<Camera> {
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
                        "is for pictures of {}×{} pixels, but the frames have {}×{}",
                        own[0], own[1], size[0], size[1]
                    ),
                    if turned {
                        "the video is turned by 90° against the calibration: calibrate with pictures held alike, or give fx fy cx cy of the turned picture"
                    } else {
                        "give the camera of these pictures; a video is often cut from the middle of the sensor, which no scale makes good"
                    },
                ));
            }
            notes.push(format!(
                "{}: calibrated at {}×{}, scaled to the frames' {}×{}; right only if the video shows the whole picture",
                self.place, own[0], own[1], size[0], size[1]
            ));
        }
        // The size whose pixels the values are in.
        let own = self.size.map_or([w, h], |own| own.map(|n| n as f64));
        let [fx, fy] = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::Angle(angle) => [own[0] / (2.0 * (angle / 2.0).tan()); 2],
        };
        let centre = self.centre.unwrap_or([(own[0] - 1.0) / 2.0, (own[1] - 1.0) / 2.0]);
        // The upper left corner of the picture, half a pixel from the first centre, is what scaling keeps.
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
                format!("fx {fx}, fy {fy}, centre {centre:?} is no camera"),
                "focal lengths are in pixels and above 0: width / (2 tan(half the horizontal field of view))",
            ));
        }
        Ok(camera)
    }
}
