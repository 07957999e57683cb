//! What a synthetic scene is made of.

use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

use super::lattice::MeshKind;

/// What moves the sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mover {
    /// It hangs from its upper edge in a gust of wind.
    #[default]
    Wind,
    /// Two hands carry, turn and shake it, in the wind.
    Hands,
    /// It is paper, bent from flat without being stretched.
    Paper,
    /// It lies on a table; two hands lift one side of it.
    Table,
}

/// What to make; begin with the defaults and change them [`with`](Settings::with).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Settings {
    /// Frames N, at least 2.
    pub frames: usize,
    /// Frames per second.
    pub fps: f64,
    /// Width and height of the images `[px]`.
    pub size: usize,
    /// Columns and rows of vertices.
    pub grid: [usize; 2],
    /// How it is divided into faces.
    pub mesh: MeshKind,
    /// Strength of the gust: largest acceleration it gives the cloth [m/s²].
    pub wind: f64,
    /// Stretch stiffness [N/m].
    pub stretch: f64,
    /// Bend stiffness [J/rad²].
    pub bend: f64,
    /// Shear stiffness [J/rad²].
    pub shear: f64,
    /// How much darker the cloth is where it turns away from the light, in [0, 1].
    pub shading: f64,
    /// Seed of texture, wind, mesh and all that is drawn at random.
    pub seed: u64,
    /// What moves the sheet; paper knows neither wind nor stiffness.
    #[serde(skip_serializing_if = "is_default")]
    pub mover: Mover,
    /// The wind is moving air that presses on the sheet, gravity is tilted against the camera, and what moves the
    /// sheet is written as truth; otherwise the wind is an acceleration.
    #[serde(skip_serializing_if = "is_default")]
    pub air: bool,
    /// Opaque things of about a tenth of the sheet's size that move in front of it.
    #[serde(skip_serializing_if = "is_default")]
    pub occluders: usize,
    /// Masks show the whole sheet, with what is hidden behind occluders.
    #[serde(skip_serializing_if = "is_default")]
    pub amodal: bool,
    /// Exposure as a fraction of the time from frame to frame, in [0, 1]; its middle is the frame's time.
    #[serde(skip_serializing_if = "is_default")]
    pub blur: f64,
    /// Angle by which the camera goes around the sheet in the course of the clip, to its right `[°]`.
    #[serde(skip_serializing_if = "is_default")]
    pub orbit: f64,
    /// A depth sensor with this noise, as a fraction of the depth, sees the sheet at half the images' size; none at 0.
    #[serde(skip_serializing_if = "is_default")]
    pub depth_noise: f64,
    /// The frames show a room around the sheet, with the sensor's noise; black otherwise.
    #[serde(skip_serializing_if = "is_default")]
    pub surroundings: bool,
    /// How far the hand that holds the camera shakes, root mean square `[m]`; it turns by 1° for each cm.
    #[serde(skip_serializing_if = "is_default")]
    pub shake: f64,
    /// Number of cameras; all but the first stand still.
    #[serde(skip_serializing_if = "is_one")]
    pub views: usize,
    /// Angle around the sheet from each camera to the next, to its right `[°]`.
    #[serde(skip_serializing_if = "is_default")]
    pub apart: f64,
    /// How much later than the first camera the others take each frame `[s]`.
    #[serde(skip_serializing_if = "is_default")]
    pub late: f64,
    /// The side that is lifted from the table is laid over the sheet, not down again.
    #[serde(skip_serializing_if = "is_default")]
    pub fold: bool,
    /// Colour of the sheet's other side, sRGB in [0, 1]; the print goes through if `None`.
    #[serde(skip_serializing_if = "is_default")]
    pub back: Option<[f32; 3]>,
}

/// What was not asked for is not written down: scenes without it are the same bytes as before it existed.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            frames: 24,
            fps: 50.0,
            size: 320,
            grid: [21, 21],
            mesh: MeshKind::Quads,
            wind: 9.0,
            stretch: 200.0,
            bend: 1e-3,
            shear: 5e-4,
            shading: 0.4,
            seed: 0,
            mover: Mover::Wind,
            air: false,
            occluders: 0,
            amodal: false,
            blur: 0.0,
            orbit: 0.0,
            depth_noise: 0.0,
            surroundings: false,
            shake: 0.0,
            views: 1,
            apart: 0.0,
            late: 0.0,
            fold: false,
            back: None,
        }
    }
}

impl Settings {
    /// These settings after `change`.
    ///
    /// ```
    /// use tessuto_scene::synth::Settings;
    ///
    /// let short = Settings::default().with(|s| s.frames = 6);
    /// assert_eq!((short.frames, short.fps), (6, Settings::default().fps));
    /// ```
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let checks = [
            ("frames", self.frames as f64, 2.0, 10_000.0),
            ("fps", self.fps, 1.0, 10_000.0),
            ("size", self.size as f64, 32.0, 4096.0),
            ("grid columns", self.grid[0] as f64, 3.0, 200.0),
            ("grid rows", self.grid[1] as f64, 3.0, 200.0),
            ("wind", self.wind, 0.0, 100.0),
            ("stretch", self.stretch, 1.0, 1e5),
            ("bend", self.bend, 1e-7, 1.0),
            ("shear", self.shear, 1e-7, 1.0),
            ("shading", self.shading, 0.0, 1.0),
            ("occluders", self.occluders as f64, 0.0, 8.0),
            ("blur", self.blur, 0.0, 1.0),
            ("orbit", self.orbit, -180.0, 180.0),
            ("shake", self.shake, 0.0, 0.2),
            ("depth_noise", self.depth_noise, 0.0, 0.2),
            ("views", self.views as f64, 1.0, 16.0),
            ("apart", self.apart, -180.0, 180.0),
            ("late", self.late, 0.0, 1.0),
        ];
        for (name, value, low, high) in checks {
            if !(low..=high).contains(&value) {
                let hint = format!("it must lie between {low} and {high}");
                return Err(Error::usage(format!("{name} = {value}"), hint));
            }
        }
        if let Some(colour) = self.back.filter(|c| c.iter().any(|v| !(0.0..=1.0).contains(v))) {
            return Err(Error::usage(format!("back = {colour:?}"), "each must lie between 0 and 1"));
        }
        Ok(())
    }

    /// How long shapes between the frames are asked for after a frame's time, as a fraction of a frame, twice.
    pub(super) fn between(&self) -> f64 {
        self.blur + 2.0 * self.late * self.fps
    }

    /// A square image with a horizontal field of view of about 44°.
    pub(super) fn camera(&self) -> Camera {
        let (f, c) = (1.25 * self.size as f64, (self.size as f64 - 1.0) / 2.0);
        Camera { fx: f, fy: f, cx: c, cy: c, width: self.size, height: self.size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_named() {
        for (settings, fragment) in [
            (Settings { frames: 1, ..Settings::default() }, "frames = 1"),
            (Settings { blur: 1.5, ..Settings::default() }, "blur = 1.5"),
            (Settings { occluders: 9, ..Settings::default() }, "occluders = 9"),
            (Settings { back: Some([0.5, 2.0, 0.5]), ..Settings::default() }, "back = [0.5, 2.0, 0.5]"),
        ] {
            assert!(settings.validate().unwrap_err().to_string().contains(fragment), "{fragment}");
        }
    }

    #[test]
    fn only_what_was_asked_for_is_written_down() {
        let plain = serde_json::to_value(Settings::default()).unwrap();
        let new = ["orbit", "surroundings", "depth_noise", "shake", "views", "apart", "late", "back"];
        for key in ["mover", "occluders", "amodal", "blur"].into_iter().chain(new) {
            assert!(plain.get(key).is_none(), "{key}");
        }
        let paper = Settings { mover: Mover::Paper, blur: 0.5, ..Settings::default() };
        let paper = serde_json::to_value(paper).unwrap();
        assert_eq!((&paper["mover"], &paper["blur"]), (&"paper".into(), &0.5.into()));
    }
}
