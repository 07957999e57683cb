//! What the template is for: a scene, or a single image.

use std::path::PathBuf;

use tessuto::glam::DVec3;
use tessuto::io::scene::first_frame;
use tessuto::io::{image, mask};
use tessuto::{Camera, Error, Image, Result};

use super::Arguments;
use crate::say::say;

/// What the template is for.
pub(super) struct View {
    pub camera: Camera,
    pub mask: Option<(Image, PathBuf)>,
    /// Metres in one unit of the file to write.
    pub metres: f64,
    /// Which way gravity pulls, where that is known.
    pub down: Option<DVec3>,
}

/// The first frame that the arguments name.
pub(super) fn view(arguments: &Arguments, scene: bool) -> Result<View> {
    if scene {
        let first = first_frame(&arguments.target)?;
        return Ok(View { camera: first.camera, mask: first.mask, metres: first.metres, down: first.down });
    }
    let size = image::size(&arguments.target)?;
    let calibration = arguments.lens.calibration()?;
    if !calibration.distortion.is_none() {
        let hint = "import the images first, which removes it, and name the scene folder here";
        return Err(Error::input(&calibration.place, "has lens distortion, which is not removed here", hint));
    }
    let mut notes = Vec::new();
    let camera = calibration.scaled_to(size, &mut notes)?;
    notes.iter().for_each(|note| say!("note: {note}"));
    let mask = arguments.mask.as_ref().map(|path| {
        let (mask, note) = mask::read_fabric(path, arguments.choice.object.as_ref())?;
        note.iter().for_each(|note| say!("note: {note}"));
        if [mask.width, mask.height] != size {
            let problem =
                format!("is {}×{} pixels, but the image {}×{}", mask.width, mask.height, size[0], size[1]);
            return Err(Error::input(path.display().to_string(), problem, "give the mask of this image"));
        }
        Ok((mask, path.clone()))
    });
    Ok(View { camera, mask: mask.transpose()?, metres: 1.0, down: None })
}
