//! What the user has entered, kept as `form.json` in the studio's folder beside the scene. All lengths of the image are
//! pixels of the clip: x is the column, y the row, whole numbers are centres of pixels.

use serde::{Deserialize, Serialize};

use super::place::is_name;

/// Most points of an outline.
const MOST_POINTS: usize = 400;
/// Longest name of an object of masks [bytes].
const LONGEST_OBJECT: usize = 16;

/// All that is entered before something runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Form {
    /// Name of the video in the project.
    pub clip: Option<String>,
    /// First frame, and the one after the last; all frames without.
    pub frames: Option<[usize; 2]>,
    /// Frames per second at which the clip was filmed, where its own time stamps do not say [1/s].
    pub rate: Option<f64>,
    /// Every this many frames one is used.
    pub stride: usize,
    /// Pixels of the clip, in each direction, that become one.
    pub downscale: usize,
    /// What the fabric's border is.
    pub shape: Shape,
    /// The fabric's border in the first frame, clockwise from its upper left corner; of another shape than a sheet in
    /// the order in which it was clicked.
    pub outline: Vec<Point>,
    /// Whether the border of another shape is complete.
    pub closed: bool,
    /// Measured on the table between the two `measured` points of the border [m].
    pub distance: Option<f64>,
    /// Width along the upper side and height of the flat sheet [m].
    pub size: Option<[f64; 2]>,
    /// In what lengths are shown: mm, cm or m.
    pub unit: Unit,
    /// The lens.
    pub camera: Camera,
    /// A photo or video of the place without the fabric, by its name in the project.
    pub plate: Option<String>,
    /// Masks that another program made, a folder or a video by its name in the project; without them they are made
    /// from the outline.
    pub masks: Option<String>,
    /// The fabric among several objects of those masks, as `--object` takes it.
    pub object: Option<String>,
    /// Whether material and light are estimated too.
    pub appearance: bool,
}

/// A point of the outline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    /// One of the sheet's four corners, rather than a point between them.
    pub corner: bool,
    /// One end of the measured distance.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub measured: bool,
}

/// What the fabric's border is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Four sides between four corners.
    Sheet,
    /// Any; it lies flat on a table.
    Other,
}

/// In what lengths are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    Mm,
    Cm,
    M,
}

/// What is known of the lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Camera {
    /// Nothing: the clip's metadata, or else the four corners.
    Auto,
    /// Horizontal field of view [degrees].
    Fov {
        fov: f64,
        /// Nobody measured it: what phones usually have.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        guess: bool,
    },
    /// Focal lengths and principal point [px of the clip].
    Focal { fx: f64, fy: Option<f64>, centre: Option<[f64; 2]> },
    /// A calibration, by its name in the project.
    File { file: String },
}

/// Fabric of another shape than a sheet.
pub struct Other {
    /// Two points of its border.
    pub between: [[f64; 2]; 2],
    /// How far they are from one another [m].
    pub distance: f64,
}

impl Default for Form {
    fn default() -> Self {
        Self {
            clip: None,
            frames: None,
            rate: None,
            stride: 1,
            downscale: 1,
            shape: Shape::Sheet,
            outline: Vec::new(),
            closed: false,
            distance: None,
            size: None,
            unit: Unit::Cm,
            camera: Camera::Auto,
            plate: None,
            masks: None,
            object: None,
            appearance: true,
        }
    }
}

impl Form {
    /// Says what cannot be.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn check(&self) -> Result<(), String> {
        let demand = |ok: bool, text: &str| if ok { Ok(()) } else { Err(text.to_owned()) };
        let length = |v: f64| v > 0.0 && v < 1e6;
        demand(self.frames.is_none_or(|[a, b]| a < b), "the clip must end after it begins")?;
        let rate = self.rate.is_none_or(|rate| (1e-3..=1e5).contains(&rate));
        demand(rate, "the clip was filmed at 0.001 to 100,000 frames per second")?;
        demand((1..=1000).contains(&self.stride), "every how many frames: 1 to 1000")?;
        demand((1..=64).contains(&self.downscale), "frames are made smaller by a factor of 1 to 64")?;
        demand(self.outline.len() <= MOST_POINTS, "an outline has 400 points at most")?;
        let finite = self.outline.iter().all(|p| p.x.abs() < 1e6 && p.y.abs() < 1e6);
        demand(finite, "a point of the outline is far outside of the image")?;
        let size = self.size.is_none_or(|[w, h]| [w, h].iter().all(|v| (1e-4..1e3).contains(v)));
        demand(size, "width and height of the sheet must be lengths above 0.1 mm")?;
        let distance = self.distance.is_none_or(|length| (1e-4..1e3).contains(&length));
        demand(distance, "the measured distance must be a length above 0.1 mm")?;
        let object = |text: &String| {
            let known = |c: char| c.is_ascii_alphanumeric() || ",#".contains(c);
            (1..=LONGEST_OBJECT).contains(&text.len()) && text.chars().all(known)
        };
        let told = self.object.as_ref().is_none_or(object);
        demand(told, "an object of the masks is a number, or a colour such as 128,0,0 or #800000")?;
        let names = [&self.clip, &self.plate, &self.masks];
        demand(names.into_iter().flatten().all(|name| is_name(name)), "a file lies outside of the project")?;
        match &self.camera {
            Camera::Auto => Ok(()),
            Camera::Fov { fov, .. } => {
                demand(*fov > 0.0 && *fov < 179.0, "the field of view lies between 0 and 179 degrees")
            }
            Camera::Focal { fx, fy, centre } => {
                let known = length(*fx) && fy.is_none_or(length);
                demand(known, "a focal length is above 0 px")?;
                demand(
                    centre.is_none_or(|c| c.iter().all(|v| v.is_finite())),
                    "a principal point is a number of px",
                )
            }
            Camera::File { file } => demand(is_name(file), "the calibration lies outside of the project"),
        }
    }

    /// What is measured of fabric of another shape than a sheet, whose border is complete.
    ///
    /// # Errors
    /// A sentence that says what is missing.
    pub fn other(&self) -> Result<Other, &'static str> {
        if self.outline.len() < 3 || !self.closed {
            return Err("click points around the whole fabric in the first frame, and the first one again");
        }
        let measured: Vec<_> = self.outline.iter().filter(|p| p.measured).map(|p| [p.x, p.y]).collect();
        let ends = measured.try_into();
        let between = ends.map_err(|_| "choose the two points between which you measured")?;
        let distance = self.distance.ok_or("enter the distance that you measured between two points")?;
        Ok(Other { between, distance })
    }

    /// The four corners of a sheet, if there are as many.
    pub fn corners(&self) -> Option<[[f64; 2]; 4]> {
        if self.shape != Shape::Sheet {
            return None;
        }
        let corners: Vec<_> = self.outline.iter().filter(|p| p.corner).map(|p| [p.x, p.y]).collect();
        corners.try_into().ok()
    }

    /// A point of the clip in the pixels of the scene, which are means of `downscale`² of the clip's.
    pub fn in_scene(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let factor = self.downscale as f64;
        [x, y].map(|v| (v + 0.5) / factor - 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(change: impl FnOnce(&mut Form)) -> bool {
        let mut form = Form::default();
        change(&mut form);
        form.check().is_ok()
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert!(check(|f| f.frames = Some([3, 9])) && !check(|f| f.frames = Some([9, 9])));
        assert!(check(|f| f.rate = Some(29.97)) && !check(|f| f.rate = Some(0.0)));
        assert!(!check(|f| f.stride = 0) && !check(|f| f.downscale = 99));
        assert!(!check(|f| f.size = Some([0.0, 1.0])) && !check(|f| f.size = Some([f64::NAN, 1.0])));
        assert!(!check(|f| f.distance = Some(-0.1)) && check(|f| f.distance = Some(0.62)));
        let lost = Point { x: f64::NAN, y: 0.0, corner: true, measured: false };
        assert!(!check(|f| f.outline = vec![lost]));
        assert!(
            !check(|f| f.clip = Some("../clip.mp4".into())) && check(|f| f.clip = Some("clip.mp4".into()))
        );
        assert!(!check(|f| f.camera = Camera::Fov { fov: 180.0, guess: false }));
        assert!(!check(|f| f.camera = Camera::Focal { fx: -1.0, fy: None, centre: None }));
        assert!(!check(|f| f.camera = Camera::File { file: "/etc/passwd".into() }));
        assert!(serde_json::from_str::<Form>(r#"{"shell":"rm"}"#).is_err());
    }

    #[test]
    fn pixels_of_the_scene_are_blocks_of_the_clips() {
        let form = Form { downscale: 2, ..Form::default() };
        // The middle of the first two columns is the first one's centre.
        assert_eq!(form.in_scene([0.5, 2.5]), [0.0, 1.0]);
    }
}
