//! The camera on the command line, for the commands that make scenes.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::Error;
use tessuto::import::{Calibration, Distortion, Focal, camera_files, camera_of, read_calibration};

use crate::ffmpeg::ffmpeg;

/// Options that describe the camera.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub struct Lens {
    #[arg(long, value_name = "FILE|estimate", conflicts_with_all = ["fx", "fov"], help = camera_help())]
    camera: Option<PathBuf>,
    /// Which camera of a COLMAP file that holds several.
    #[arg(long, value_name = "N", requires = "camera")]
    camera_id: Option<u32>,
    /// Focal length along x, in pixels of the input.
    #[arg(long, value_name = "PX", conflicts_with = "fov", allow_negative_numbers = true)]
    fx: Option<f64>,
    /// Focal length along y [default: fx, times width over height of a pixel].
    #[arg(long, value_name = "PX", requires = "fx", allow_negative_numbers = true)]
    fy: Option<f64>,
    /// Principal point, column [default: the middle]; the centre of the first pixel is 0.
    #[arg(long, value_name = "PX", requires = "cy", allow_negative_numbers = true)]
    cx: Option<f64>,
    /// Principal point, row.
    #[arg(long, value_name = "PX", requires = "cx", allow_negative_numbers = true)]
    cy: Option<f64>,
    /// Horizontal field of view, instead of a focal length [degrees].
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    fov: Option<f64>,
    /// Lens distortion as OpenCV has it, to be removed from the frames.
    #[arg(
        long,
        value_name = "K1,K2,P1,P2,K3",
        value_delimiter = ',',
        allow_negative_numbers = true,
        conflicts_with = "camera"
    )]
    distortion: Vec<f64>,
}

/// The files that `--camera` takes.
fn camera_help() -> String {
    format!(
        "Camera file: {}; or `estimate`: to be found by `template --flat` from the corners of the sheet, \
         assumed until then [default: what the video says]",
        camera_files()
    )
}

impl Lens {
    /// Whether the camera shall be found from the corners of the fabric.
    pub fn is_estimated(&self) -> bool {
        self.camera.as_deref() == Some(Path::new("estimate"))
    }

    /// Whether a camera is named.
    pub fn is_given(&self) -> bool {
        self.camera.is_some() || self.fx.is_some() || self.fov.is_some()
    }

    /// The calibration asked for; else what `input` says of its lens; else, if it is estimated later, a stand-in.
    ///
    /// # Errors
    /// Those of [`calibration`](Self::calibration).
    pub fn calibration_of(&self, input: &Path) -> tessuto::Result<Calibration> {
        if self.is_given() && !self.is_estimated() {
            return self.calibration();
        }
        match camera_of(input, &ffmpeg()) {
            Some(found) => {
                let distortion = self.distortion()?;
                let centre = self.cx.zip(self.cy).map(|(x, y)| [x, y]);
                Ok(Calibration { distortion, centre, ..found })
            }
            None if self.is_estimated() => Ok(Calibration::assumed()),
            None => self.calibration(),
        }
    }

    /// The calibration asked for.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is none, or if its values are impossible; [`Error::Input`] of its file.
    pub fn calibration(&self) -> tessuto::Result<Calibration> {
        if self.is_estimated() {
            let hint = "give a camera here; `tessuto template SCENE --flat WxH --corners … --camera estimate` \
                        finds one";
            return Err(Error::usage("--camera estimate needs a scene folder", hint));
        }
        if let Some(path) = &self.camera {
            return read_calibration(path, self.camera_id);
        }
        let focal = match (self.fx, self.fov) {
            (Some(fx), _) => self.fy.map_or(Focal::Across(fx), |fy| Focal::Pixels([fx, fy])),
            (None, Some(fov)) if fov > 0.0 && fov < 179.0 => Focal::Angle(fov.to_radians()),
            (None, Some(fov)) => {
                return Err(Error::usage(
                    format!("--fov is {fov}"),
                    "give the horizontal field of view in degrees, above 0 and below 179",
                ));
            }
            (None, None) => {
                return Err(Error::usage(
                    "the camera is not given",
                    "the file does not say it either; add --camera FILE (COLMAP, nerfstudio, OpenCV), --fx PX \
                     (and --fy, --cx, --cy), --fov DEGREES, or --camera estimate, to find it later from the \
                     corners of a flat sheet; a phone's main camera held upright or across sees 50 to 70 \
                     degrees along its longer side",
                ));
            }
        };
        Ok(Calibration {
            centre: self.cx.zip(self.cy).map(|(x, y)| [x, y]),
            distortion: self.distortion()?,
            ..Calibration::new("the camera options", focal)
        })
    }

    fn distortion(&self) -> tessuto::Result<Distortion> {
        if !matches!(self.distortion.len(), 0 | 2 | 4 | 5) || self.distortion.iter().any(|k| !k.is_finite()) {
            return Err(Error::usage(
                format!("--distortion has {} numbers", self.distortion.len()),
                "give k1,k2 or k1,k2,p1,p2 or k1,k2,p1,p2,k3, as OpenCV orders them",
            ));
        }
        Ok(Distortion::from_opencv(&self.distortion))
    }
}
