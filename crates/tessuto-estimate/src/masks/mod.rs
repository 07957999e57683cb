//! Masks from the clip itself: the fabric's corners in the first frame are enough.
//!
//! The camera stands still, so what lies behind the fabric is seen sooner or later: `plate`. The fabric's own motion
//! predicts its outline in the next frame: `flow`. Near the predicted outline each pixel is fabric or not by its
//! colour (`evidence`), all of them at once by a minimum `cut` (`segment`); first forward in time, then every frame
//! again with both its neighbours and the plate (`track`). Coverage at the outline is soft (`matte`). An outline that
//! somebody drew around the fabric binds (`drawn`). Hands and people in front are neither fabric nor background
//! (`front`). What looks wrong is named with its frames (`judge`, `steady`, `findings`). A clip by a camera that
//! moves, whose poses are known and explain its surroundings (`poses`), is held still first by the plane behind the
//! fabric (`moving`).

mod beyond;
mod conserved;
mod cut;
mod drawn;
mod evidence;
mod files;
mod findings;
mod flow;
mod frames;
mod front;
mod judge;
mod matte;
mod moving;
mod page;
mod palette;
mod plate;
mod poses;
mod record;
mod refuse;
mod segment;
mod start;
mod steady;
mod still;
mod track;

use std::path::{Path, PathBuf};

use tessuto_core::parallel;

use crate::io::mask::Object;
use crate::io::scene::colour_files;
use drawn::Drawn;
pub use findings::Finding;
use frames::Frames;
use moving::Steadied;
pub use record::{Border, Click, Frame, Record};
use segment::Mark;
use tessuto_core::camera::Rect;
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::image::region::{self, Field, Region};
use track::{Given, Tracked, track};

/// What the masks are to be made from; what is not given is taken from the [`Record`] of an earlier time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// Corners of the fabric in the first frame (column, row) `[px]`, in order around it; at least three. More than
    /// four are its border as drawn, see [`Border`].
    pub outline: Option<Vec<[f64; 2]>>,
    /// Mask of the first frame, instead of an outline.
    pub first: Option<PathBuf>,
    /// Which of the objects in that mask is the fabric.
    pub object: Option<Object>,
    /// Whether outline or mask are the border itself; by default a mask and an outline of more than four corners are.
    pub border: Option<Border>,
    /// The place without the fabric, of the size of the frames.
    pub plate: Option<EmptyPlace>,
    /// Places to add to those kept.
    pub clicks: Vec<Click>,
    /// Forget the places kept.
    pub forget: bool,
    /// Drop all pieces but the largest.
    pub largest_piece: bool,
}

/// The place without the fabric, by the same camera.
#[derive(Debug, Clone, PartialEq)]
pub enum EmptyPlace {
    /// A file.
    File(PathBuf),
    /// Colours, shape [height, width, 3].
    Image(Image),
}

/// Masks that were made.
#[derive(Debug, Clone)]
pub struct Made {
    /// What masks.json says.
    pub record: Record,
    /// The files and folders that were written.
    pub files: Vec<PathBuf>,
}

/// Makes the masks of the scene in `folder`: begins with the outline or mask that is given, now or before, else
/// with the projection of the scene's template. Writes `masks/`, masks.json, masks.html, and plate.png where a
/// plate is given. `progress` receives the fraction that is done. Masks that tessuto did not write, or that were
/// changed since, are not replaced.
///
/// # Errors
/// [`Error::Usage`](tessuto_core::Error::Usage) if it is not known where the fabric is;
/// [`Error::Input`](tessuto_core::Error::Input) if the clip is none that masks can be made of, naming the frame;
/// [`Error::Output`](tessuto_core::Error::Output).
pub fn make(folder: &Path, request: &Request, progress: &(dyn Fn(f64) + Sync)) -> Result<Made> {
    let (clip, origin) = (colour_files(folder)?, refuse::Origin::of(folder));
    let mut record = Record::read(folder)?.unwrap_or_else(Record::new);
    files::check(folder)?;
    if request.forget {
        record.clicks.clear();
    }
    record.clicks.extend(&request.clicks);
    record.largest_piece = request.largest_piece;
    let size = [clip.camera.width, clip.camera.height];
    refuse::clicks(&record.clicks, size, clip.paths.len())?;
    let mut notes = Vec::new();
    let start = start::first_frame(folder, request, &mut record, size, &mut notes)?;
    let area = start.region.area() as f64;
    notes.extend(poses::expect_fit(folder, &clip, &start.coverage)?);
    let frames = Frames::read(&clip, area)?;
    progress(0.05);
    let given_plate = start::plate(folder, request, &mut record, &clip, &frames)?;
    let mut first = shrunk(&start.region, &frames);
    let mut marks = marks(&record.clicks, &frames);
    let mut plate = given_plate;
    let recorded_size = frames.size;
    let rough_noise = frames::noise(&frames, &first);
    let steadied = moving::steadied(folder, &clip.camera, &frames, &first, (rough_noise, origin))?;
    if let Some(steadied) = &steadied {
        first = steadied.region(&first);
        marks = steadied.marks(&marks);
        plate = plate.map(|plate| steadied.plate(&plate));
    }
    let frames = steadied.as_ref().map_or(&frames, |steadied| &steadied.frames);
    let noise = frames::noise(frames, &first);
    record.noise = (f64::from(noise) * 1e3).round() / 1e3;
    notes.extend(refuse::clip(frames, &first, noise, (origin, steadied.is_some()))?);
    record.notes = notes;
    let given = Given { first, drawn: start.drawn, plate, marks, largest_piece: record.largest_piece, noise };
    let mut tracked = track(frames, &given, &|part| progress(0.1 + 0.8 * part))
        .map_err(|n| refuse::lost(&clip.paths[n], n, origin))?;
    if !start.is_mask {
        refuse::outline(&given.first, &tracked)?;
    }
    let binds = start.drawn == Drawn::Binds;
    let judgements = judge::judge(frames, &tracked, &given);
    let fronts = front::take_out(frames, &mut tracked, binds, noise);
    let mut coverage = coverages(frames, &tracked, noise);
    if let Some(steadied) = &steadied {
        coverage = parallel::numbered(&coverage, |(n, coverage)| steadied.back(coverage, n));
    }
    let pixels = (recorded_size[0] * recorded_size[1]) as f64;
    let areas: Vec<f64> = tracked.regions.iter().map(|r| r.area() as f64 / pixels).collect();
    record.judged(&judgements, &fronts, &areas);
    let before = steadied.as_ref().map_or([0; 2], Steadied::before);
    let mask = |k: usize| {
        let found = frames::enlarged(&coverage[k], frames.factor, size);
        match k == 0 && binds {
            true => {
                let regions = [&given.first, &tracked.regions[0]];
                drawn::mask(&start.coverage, found, regions, (frames.factor, size[0], before))
            }
            false => found,
        }
    };
    let outline = |k: usize| match k == 0 && binds {
        true => page::outline(&Field { rect: start.region.rect, data: mask(0) }, 1),
        false => page::outline(&coverage[k], frames.factor),
    };
    let outlines: Vec<String> = parallel::map(coverage.len(), outline);
    let page = page::page(&clip, &record, size, &outlines)?;
    let files = files::write(folder, &record, &page, size, coverage.len(), &mask)?;
    progress(1.0);
    Ok(Made { record, files })
}

/// Soft coverage of every frame.
fn coverages(frames: &Frames, tracked: &Tracked, noise: f32) -> Vec<Field> {
    let of = |n: usize| {
        let region = &tracked.regions[n];
        let rect = region.bounds().unwrap_or(region.rect).padded(4, frames.size);
        matte::coverage(&frames.images[n], &region.within(rect), &tracked.plate, noise)
    };
    parallel::map(frames.images.len(), of)
}

/// The region on frames that are smaller.
fn shrunk(region: &Region, frames: &Frames) -> Region {
    let [w, h] = frames.size;
    let rect = Rect { x0: 0, y0: 0, x1: w, y1: h };
    let half = frames.factor / 2;
    let inside =
        (0..w * h).map(|i| region.at((i % w) * frames.factor + half, (i / w) * frames.factor + half));
    Region { rect, inside: inside.collect() }
}

/// Clicks, per frame, on frames that may be smaller.
fn marks(clicks: &[Click], frames: &Frames) -> Vec<Vec<Mark>> {
    let mut marks = vec![Vec::new(); frames.images.len()];
    for click in clicks {
        marks[click.frame].push(Mark { at: frames.place([click.x, click.y]), inside: click.inside });
    }
    marks
}
