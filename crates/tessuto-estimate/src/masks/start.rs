//! What masks begin with: the fabric in the first frame, and the empty place.

use std::path::Path;

use glam::DVec2;

use super::frames::{self, Frames};
use super::plate::Plate;
use super::record::Record;
use super::region::Region;
use super::{EmptyPlace, Request, files, refuse};
use crate::io::scene::{self, ColourFiles};
use crate::io::{image, mask, obj};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_render::raster::coverage::template_coverage;

/// Where the fabric is in the first frame, and whether that is rough.
pub(super) fn first_frame(
    folder: &Path,
    request: &Request,
    record: &mut Record,
    size: [usize; 2],
    notes: &mut Vec<String>,
) -> Result<(Region, bool)> {
    let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
    if let Some(path) = &request.first {
        let (mask, note) = mask::read_fabric(path, request.object.as_ref())?;
        notes.extend(note);
        refuse::size(path, [mask.width, mask.height], size)?;
        record.outline = None;
        return Ok((Region { rect, inside: mask.data.iter().map(|v| *v >= 0.5).collect() }, false));
    }
    if let Some(outline) = request.outline.clone() {
        record.outline = Some(outline);
    }
    if let Some(outline) = &record.outline {
        refuse::polygon(outline, size)?;
        let corners: Vec<DVec2> = outline.iter().map(|p| DVec2::from_array(*p)).collect();
        return Ok((Region::polygon(&corners, size), true));
    }
    Ok((Region { rect, inside: projection(folder)? }, true))
}

/// The pixels of the first frame that the scene's template covers.
fn projection(folder: &Path) -> Result<Vec<bool>> {
    let path = folder.join("template.obj");
    if !path.is_file() {
        let hint = Hint::from("give the fabric's corners in the first frame, in order around it")
            .with(Remedy::Outline);
        return Err(Error::usage(
            format!("it is not known where the fabric of {} is", folder.display()),
            hint,
        ));
    }
    let first = scene::first_frame(folder)?;
    let mut mesh = obj::read(&path)?;
    mesh.positions.iter_mut().for_each(|p| *p *= first.metres);
    let covered = template_coverage(&mesh, &mesh.positions, first.camera);
    let count = covered.iter().filter(|c| **c).count();
    if count < refuse::FEWEST {
        let hint = Hint::from("see whether template and camera are right, or give the fabric's corners")
            .with(Remedy::Outline);
        let found = format!("the template covers {count} pixels of frame 0");
        return Err(Error::input(path.display().to_string(), found, hint));
    }
    Ok(covered)
}

/// The empty place that is given now, or was given before.
pub(super) fn plate(
    folder: &Path,
    request: &Request,
    record: &mut Record,
    clip: &ColourFiles,
    frames: &Frames,
) -> Result<Option<Plate>> {
    let size = [clip.camera.width, clip.camera.height];
    let (read, kept) = match &request.plate {
        Some(EmptyPlace::File(path)) => (frames::read_one(path, size, frames.factor)?, image::read(path)?),
        Some(EmptyPlace::Image(image)) => {
            refuse::size(Path::new("the empty place"), [image.width, image.height], size)?;
            let bytes: Vec<u8> =
                image.data.iter().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8).collect();
            (frames::companded(&bytes, size, frames.factor), image.clone())
        }
        None if record.plate.is_some() => {
            let read = frames::read_one(&folder.join(files::PLATE), size, frames.factor)?;
            return Ok(Some(Plate::given(&read)));
        }
        None => return Ok(None),
    };
    files::keep_plate(folder, &kept)?;
    record.plate = Some(files::PLATE.to_owned());
    Ok(Some(Plate::given(&read)))
}
