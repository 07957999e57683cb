//! Masks as segmenters and drawing programs write them: white on black, labels, colours of objects, transparency.
//!
//! One file does not say what its values mean: an object may be absent in it, or alone. So the files of a clip
//! are looked at first (`Look`), then `understand` decides for all of them, and every file is read alike. Every
//! reader of masks goes through here.

mod choice;
mod decide;
mod look;
mod objects;

use std::path::Path;

use crate::io::image::{ImageFile, open};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Hint, Result};
use tessuto_core::image::Image;

pub use choice::Object;
pub(crate) use decide::{Reading, understand};
pub(crate) use look::Look;

use look::{Plane, parts};

/// A mask in [0, 1], shape [height, width, 1], and what a user should know of how it was read. `object` chooses
/// one of several.
///
/// Grey is luminance over the largest value of the format; a mask of two values is black and white whatever they
/// are; of colours and labels one object is fabric; transparency is the mask where the colours are none.
///
/// # Errors
/// [`Error::Input`] naming the file: what is no mask, several objects, none of them chosen.
pub fn read(path: &Path, object: Option<&Object>) -> Result<(Image, Option<String>)> {
    let (mask, note, ..) = read_so(path, object)?;
    Ok((mask, note))
}

/// [`read`], with how it was read and the brightest value of the file.
fn read_so(path: &Path, object: Option<&Object>) -> Result<(Image, Option<String>, Reading, f32)> {
    let mut file = open(path)?;
    let place = path.display().to_string();
    let reading = understand(&place, [&file.look()], object)?;
    let mask = file.mask_as(&reading, file.full());
    let brightest = file.brightest(&reading, &mask);
    let notes: Vec<&str> =
        file.notes.iter().copied().chain(reading.notes.iter().map(String::as_str)).collect();
    let note = (!notes.is_empty()).then(|| format!("{place}: {}", notes.join("; ")));
    Ok((mask, note, reading, brightest))
}

/// [`read`], of which some must be fabric.
///
/// # Errors
/// Those of [`read`]; [`Error::Input`] naming the file of an empty mask.
pub fn read_fabric(path: &Path, object: Option<&Object>) -> Result<(Image, Option<String>)> {
    let (mask, note, reading, brightest) = read_so(path, object)?;
    if mask.data.iter().all(|v| *v < tessuto_core::video::COVERED) {
        let hint = Hint::from("give a mask in which the fabric is white");
        return Err(empty(path, brightest, "", &reading, hint));
    }
    Ok((mask, note))
}

/// The largest value of `mask`, of 255.
pub(crate) fn brightest(mask: &Image) -> f32 {
    255.0 * mask.data.iter().copied().fold(0.0, f32::max)
}

/// The error of a mask without fabric; `part` says of which part of the image.
pub(crate) fn empty(path: &Path, brightest: f32, part: &str, reading: &Reading, hint: Hint) -> Error {
    let fabric = reading.fabric.as_deref().unwrap_or("128 or more");
    let found =
        format!("the mask is empty{part}: its brightest value is {brightest:.0} of 255, fabric is {fabric}");
    Error::input(path.display().to_string(), found, hint)
}

impl ImageFile {
    /// What the file holds, for [`understand`].
    pub(crate) fn look(&self) -> Look {
        Look::of(&parts(self.pixels()), self.palette.clone(), self.lossy)
    }

    /// The brightest value of the file [of 255], of which `mask` was made; of its transparency, where that is the mask.
    pub(crate) fn brightest(&self, reading: &Reading, mask: &Image) -> f32 {
        match reading.plane {
            Plane::Alpha => brightest(mask),
            Plane::Colour | Plane::OverBlack => self.brightest_luminance(),
        }
    }

    /// Mask values of `region` as `reading` has them, shape [height, width, 1].
    pub(crate) fn mask_as(&mut self, reading: &Reading, region: Rect) -> Image {
        if reading.is_luminance() {
            return self.luminance(region);
        }
        let parts = parts(self.pixels());
        if parts.alpha.is_some() && reading.plane != Plane::Colour {
            self.notes.retain(|note| *note != crate::io::image::ALPHA_IGNORED);
        }
        let keys = parts.keys(reading.plane);
        let width = self.full().x1;
        let mut out = Image::new(region.width(), region.height(), 1);
        let mut last = (u32::MAX, 0.0);
        for (y, row) in out.data.chunks_exact_mut(region.width()).enumerate() {
            let start = (region.y0 + y) * width + region.x0;
            for (value, key) in row.iter_mut().zip(&keys[start..]) {
                // Neighbours are mostly alike.
                if last.0 != *key {
                    last = (*key, reading.value(*key));
                }
                *value = last.1;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests;
