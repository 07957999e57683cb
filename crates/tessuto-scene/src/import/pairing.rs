//! Which mask belongs to which frame: by name, by number, or one by one where nothing else is possible; never by a
//! guess.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::frames::Kind;
use super::names::{bare, list, name, numbers, twice};
use super::times::are_times;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Names in a message at most.
const NAMED: usize = 5;
/// Of fewer frames nobody can know whether there are twice as many masks.
const FEW: usize = 3;

/// The frames of the input, and the masks in a folder.
struct Pairs<'a> {
    kind: &'a Kind,
    folder: &'a Path,
    /// Numbers, in the input, of the frames that need masks.
    wanted: &'a [usize],
    /// How many frames the input has; `None` of a part of a video.
    count: Option<usize>,
    /// In their order.
    files: Vec<PathBuf>,
    /// Of the masks, where their names have some.
    numbers: Option<Vec<u64>>,
}

/// The mask file of every frame of `wanted`; `whole` if no part of the input was chosen.
///
/// # Errors
/// [`Error::Input`] if some have none, or if it is not clear which they have.
pub(super) fn pair(
    kind: &Kind,
    folder: &Path,
    wanted: &[usize],
    whole: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<PathBuf>> {
    let files = list(folder, notes)?;
    let count = match kind {
        Kind::Images(images) => Some(images.len()),
        Kind::Video(_) => wanted.last().map(|n| n + 1).filter(|_| whole),
    };
    let pairs = Pairs { kind, folder, wanted, count, numbers: numbers(&files), files };
    let found = match kind {
        Kind::Images(images) => pairs.of_images(images, notes)?,
        Kind::Video(_) => pairs.of_video(notes)?,
    };
    if found.iter().any(Option::is_none) {
        return Err(pairs.missing(&found));
    }
    pairs.check_surplus(notes)?;
    Ok(found.into_iter().flatten().cloned().collect())
}

type Found<'a> = Vec<Option<&'a PathBuf>>;

impl Pairs<'_> {
    fn of_images(&self, images: &[PathBuf], notes: &mut Vec<String>) -> Result<Found<'_>> {
        if let Some(note) = self.one_by_one(images) {
            notes.push(format!("{}: {note}", self.folder.display()));
            return Ok(self.wanted.iter().map(|n| Some(&self.files[*n])).collect());
        }
        let by_name: BTreeMap<String, &PathBuf> = self.files.iter().map(|f| (bare(f), f)).collect();
        let named: Found<'_> = self.wanted.iter().map(|n| by_name.get(&bare(&images[*n])).copied()).collect();
        if named.iter().any(Option::is_some) {
            return Ok(named);
        }
        let masks = self.by_number()?;
        let own = numbers(images);
        let of_frame = |n: &usize| own.as_ref().and_then(|own| masks.get(&own[*n]).copied());
        Ok(self.wanted.iter().map(of_frame).collect())
    }

    fn of_video(&self, notes: &mut Vec<String>) -> Result<Found<'_>> {
        let masks = self.by_number()?;
        let offset = u64::from(!masks.contains_key(&0) && masks.contains_key(&1));
        if offset == 1 {
            notes.push(format!(
                "{}: masks are numbered from 1; mask 1 belongs to the first frame",
                self.folder.display()
            ));
        }
        Ok(self.wanted.iter().map(|n| masks.get(&(*n as u64 + offset)).copied()).collect())
    }

    /// Why masks belong to frames in their order, if they do: there are as many, none is missing in between, and
    /// numbers begin at 0 on one side and at 1 on the other, or have nothing to do with each other.
    fn one_by_one(&self, images: &[PathBuf]) -> Option<String> {
        let masks = self.numbers.as_ref().filter(|n| gapless(n) && n.len() == images.len())?;
        let by_name: Vec<String> = self.files.iter().map(|f| bare(f)).collect();
        if are_times(images) {
            let none = !images.iter().any(|image| by_name.contains(&bare(image)));
            return none
                .then(|| "masks are numbered, frames named by their times; paired in order".to_owned());
        }
        let frames = numbers(images).filter(|n| gapless(n))?;
        let (first, mask) = (*frames.first()?, *masks.first()?);
        let off_by_one = first.abs_diff(mask) == 1 && first.min(mask) == 0;
        let apart = first > *masks.last()? || mask > *frames.last()?;
        (off_by_one || apart).then(|| {
            format!(
                "masks are numbered from {mask}, frames from {first}, as many of each; paired in order, so \
                 that {} belongs to {}",
                name(&self.files[0]),
                name(&images[0])
            )
        })
    }

    fn by_number(&self) -> Result<BTreeMap<u64, &PathBuf>> {
        let Some(numbers) = &self.numbers else { return Ok(BTreeMap::new()) };
        if let Some((first, second)) = twice(numbers) {
            let (a, b) = (name(&self.files[first]), name(&self.files[second]));
            return Err(Error::input(
                self.folder.display().to_string(),
                format!("{a} and {b} are both mask {}", numbers[first]),
                "give masks the names of their frames, or one number each; of masks of several objects those of one",
            ));
        }
        Ok(numbers.iter().copied().zip(&self.files).collect())
    }

    /// Number of the first frame; a video's is 0.
    fn first_frame(&self) -> Option<u64> {
        match self.kind {
            Kind::Images(images) => numbers(images)?.first().copied(),
            Kind::Video(_) => Some(0),
        }
    }

    /// The error of frames without masks. A part of the clip is offered only where numbers leave no doubt of what
    /// belongs together.
    fn missing(&self, found: &Found<'_>) -> Error {
        let missing: Vec<usize> = (0..found.len()).filter(|k| found[*k].is_none()).collect();
        let mut names: Vec<String> = missing.iter().take(NAMED).map(|k| self.frame(*k)).collect();
        if missing.len() > NAMED {
            names.push("…".into());
        }
        let problem =
            format!("has no mask for {} of {} frames: {}", missing.len(), found.len(), names.join(", "));
        let error =
            |problem: String, hint: Hint| Error::input(self.folder.display().to_string(), problem, hint);
        let there: Vec<bool> = found.iter().map(Option::is_some).collect();
        let start = self.numbers.as_ref().and_then(|n| n.iter().min().copied());
        if let Some((frame, mask)) = self.first_frame().zip(start)
            && frame.abs_diff(mask) == 1
            && frame.min(mask) == 0
        {
            let problem = format!(
                "{problem}; masks are numbered from {mask}, frames from {frame}: it is not clear which belong together"
            );
            let hint = "number masks as their frames, or make the one that is missing: as many of each, \
                        numbered without gap, are paired in order";
            return error(problem, hint.into());
        }
        if let Some((first, step)) = every(&there) {
            let range = self.wanted[first]..self.wanted[found.len() - 1] + 1;
            let problem = format!("{problem}; masks are there for every {}", ordinal(step));
            let stride = step * self.stride();
            let hint = Hint::from("take these frames alone, or segment the others too");
            return error(problem, hint.with(Remedy::Stride(range, stride)));
        }
        let Some(run) = longest(&there) else {
            return error(
                problem,
                "masks need the names of the frames, or the same numbers; white is fabric".into(),
            );
        };
        let part = Remedy::Frames(Some(self.wanted[run.start]..self.wanted[run.end - 1] + 1));
        let masks = self.files.len();
        if let Some(ratio) = self.count.and_then(|frames| ratio(frames, masks))
            && self.numbers.as_ref().is_some_and(|n| gapless(n))
        {
            let problem = format!(
                "{problem}; {masks} masks of {} frames are of the first ones, or of every {}",
                self.count.unwrap_or_default(),
                ordinal(ratio)
            );
            let hint = format!(
                "if they are of every {}, number them as their frames (0, {ratio}, {} …); if they are of the \
                 first frames, take these",
                ordinal(ratio),
                2 * ratio
            );
            return error(problem, Hint::from(hint).with(part));
        }
        error(
            problem,
            Hint::from("segment these frames too, or take the longest part that has masks").with(part),
        )
    }

    /// Refuses twice as many masks as frames, or three times: they may be of another rate. Other masks without
    /// frames are noted.
    fn check_surplus(&self, notes: &mut Vec<String>) -> Result<()> {
        let masks = self.files.len();
        let Some(frames) = self.count.filter(|frames| masks > *frames) else { return Ok(()) };
        let place = self.folder.display();
        let gapless = self.numbers.as_ref().is_some_and(|n| gapless(n));
        if let Some(ratio) = ratio(masks, frames).filter(|_| frames >= FEW && gapless) {
            let problem = format!(
                "holds {masks} masks for {frames} frames, {ratio} for each: are they of another frame rate?"
            );
            let hint = match self.kind {
                Kind::Video(_) => {
                    "import the video at its own rate (and leave frames out by a stride), or keep the masks \
                     of these frames alone"
                }
                Kind::Images(_) => "keep the masks of these frames alone, with their names or numbers",
            };
            return Err(Error::input(place.to_string(), problem, hint));
        }
        notes.push(format!(
            "{place}: {} of {masks} masks belong to no frame and are left out",
            masks - frames
        ));
        Ok(())
    }

    fn stride(&self) -> usize {
        self.wanted.windows(2).map(|p| p[1] - p[0]).next().unwrap_or(1)
    }

    fn frame(&self, k: usize) -> String {
        match self.kind {
            Kind::Images(images) => name(&images[self.wanted[k]]),
            Kind::Video(_) => format!("frame {}", self.wanted[k]),
        }
    }
}

fn gapless(numbers: &[u64]) -> bool {
    numbers.windows(2).all(|p| p[1] == p[0].wrapping_add(1))
}

fn ordinal(n: usize) -> String {
    match n {
        2 => "second".into(),
        3 => "third".into(),
        n => format!("{n}th"),
    }
}

/// How many times `many` is `few`, except for one of rounding; two or more.
fn ratio(many: usize, few: usize) -> Option<usize> {
    let ratio = (many + few / 2) / few.max(1);
    (ratio >= 2 && (few * ratio).abs_diff(many) < ratio).then_some(ratio)
}

/// The first of those that are there and the step, if they are every second, third, … one up to the end.
fn every(there: &[bool]) -> Option<(usize, usize)> {
    let found: Vec<usize> = (0..there.len()).filter(|k| there[*k]).collect();
    let (first, last) = (*found.first()?, *found.last()?);
    let step = found.windows(2).map(|p| p[1] - p[0]).next()?;
    let even = found.windows(2).all(|p| p[1] - p[0] == step);
    (step >= 2 && even && first < step && there.len() - last <= step).then_some((first, step))
}

/// The longest run of what is there.
pub(super) fn longest(there: &[bool]) -> Option<Range<usize>> {
    let mut best = 0..0;
    let mut start = 0;
    for k in 0..=there.len() {
        if !there.get(k).copied().unwrap_or(false) {
            if k - start > best.len() {
                best = start..k;
            }
            start = k + 1;
        }
    }
    (!best.is_empty()).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_runs() {
        assert_eq!(
            [ratio(60, 30), ratio(59, 30), ratio(61, 20), ratio(12, 11), ratio(45, 30)],
            [Some(2), Some(2), Some(3), None, None]
        );
        assert_eq!(every(&[true, false, true, false, true, false]), Some((0, 2)));
        assert_eq!(every(&[false, true, false, false, true, false, false]), Some((1, 3)));
        assert_eq!(every(&[true, false, true, true]), None);
        assert_eq!(every(&[true, true, false, false]), None);
        assert_eq!(longest(&[false, true, true, false, true]), Some(1..3));
        assert_eq!(longest(&[false]), None);
    }
}
