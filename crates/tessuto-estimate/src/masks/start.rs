//! What masks begin with: the fabric in the first frame, and the empty place.

use std::path::Path;

use glam::DVec2;

use super::drawn::{self, Drawn};
use super::frames::{self, Frames};
use super::plate::Plate;
use super::record::{Border, Record};
use super::region::Region;
use super::{EmptyPlace, Request, files, refuse};
use crate::io::scene::{self, ColourFiles};
use crate::io::{image, mask, obj};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_render::raster::coverage::template_coverage;

/// Corners up to this many are those of a sheet, whose border bends between them.
const CORNERS: usize = 4;

/// Where the fabric is in the first frame.
pub(super) struct First {
    pub region: Region,
    /// The same as coverage, shape [height · width].
    pub coverage: Vec<f32>,
    pub drawn: Drawn,
    /// Whether it is a mask, not an outline that may be around the wrong thing.
    pub is_mask: bool,
}

/// Where the fabric is in the first frame, and how far that is true.
pub(super) fn first_frame(
    folder: &Path,
    request: &Request,
    record: &mut Record,
    size: [usize; 2],
    notes: &mut Vec<String>,
) -> Result<First> {
    let given = request.first.is_some() || request.outline.is_some();
    if given || request.border.is_some() {
        record.border = request.border;
    }
    let drawn = |usual: Drawn| match (record.border, usual) {
        (Some(Border::Drawn), _) => Drawn::Binds,
        (Some(Border::Found), Drawn::Binds) => Drawn::Near,
        (_, usual) => usual,
    };
    let rect = Rect { x0: 0, y0: 0, x1: size[0], y1: size[1] };
    let kept = record.first.as_ref().filter(|_| !given).map(|name| folder.join(name));
    if let Some(path) = request.first.as_ref().or(kept.as_ref()) {
        let object = request.object.as_ref().filter(|_| request.first.is_some());
        let (mask, note) = mask::read_fabric(path, object)?;
        refuse::size(path, [mask.width, mask.height], size)?;
        if request.first.is_some() {
            notes.extend(note);
            files::keep(folder, files::DRAWN, &mask)?;
            (record.first, record.outline) = (Some(files::DRAWN.to_owned()), None);
        }
        let region = Region { rect, inside: mask.data.iter().map(|v| *v >= 0.5).collect() };
        return Ok(First { region, coverage: mask.data, drawn: drawn(Drawn::Binds), is_mask: true });
    }
    if let Some(outline) = request.outline.clone() {
        (record.first, record.outline) = (None, Some(outline));
    }
    if let Some(outline) = &record.outline {
        refuse::polygon(outline, size)?;
        let corners: Vec<DVec2> = outline.iter().map(|p| DVec2::from_array(*p)).collect();
        let region = Region::polygon(&corners, size);
        let coverage = drawn::polygon_coverage(&corners, size);
        let usual = if outline.len() > CORNERS { Drawn::Binds } else { Drawn::Corners };
        let drawn = match drawn(usual) {
            Drawn::Near => Drawn::Corners,
            drawn => drawn,
        };
        return Ok(First { region, coverage, drawn, is_mask: false });
    }
    let inside = projection(folder)?;
    let coverage = inside.iter().map(|i| f32::from(u8::from(*i))).collect();
    let region = Region { rect, inside };
    Ok(First { region, coverage, drawn: drawn(Drawn::Corners), is_mask: false })
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
    files::keep(folder, files::PLATE, &kept)?;
    record.plate = Some(files::PLATE.to_owned());
    Ok(Some(Plate::given(&read)))
}
