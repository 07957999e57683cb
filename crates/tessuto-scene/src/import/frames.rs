//! The frames of the input: numbered images of a folder, or a video.

use std::ops::Range;
use std::path::PathBuf;

use rayon::prelude::*;

use super::stage::{Colours, Stage};
use super::video::{Reading, Video};
use super::{Settings, names, times};
use crate::io::{expect_file, image};
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// The input, before anything of it is decoded.
pub(super) struct Source {
    /// Frames per second of the input, all frames taken.
    pub fps: f64,
    pub kind: Kind,
}

pub(super) enum Kind {
    /// The images of a folder in the order of time.
    Images(Vec<PathBuf>),
    Video(Box<Video>),
}

impl Source {
    /// Looks at the input.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame rate of images is not given; [`Error::Input`].
    pub fn open(settings: &Settings, notes: &mut Vec<String>) -> Result<Self> {
        let input = &settings.input;
        expect_file(input)?;
        if !input.exists() {
            let hint = "name a video file, or a folder of PNG or JPEG images";
            return Err(Error::input(input.display().to_string(), "does not exist", hint));
        }
        if !input.is_dir() {
            let reading = Reading {
                ffmpeg: &settings.ffmpeg,
                fps: settings.fps,
                rate: settings.rate,
                end: settings.frames.as_ref().map(|r| r.end),
            };
            let video = Video::probe(input, reading, notes)?;
            return Ok(Self { fps: video.fps, kind: Kind::Video(Box::new(video)) });
        }
        let mut images = names::list(input, notes)?;
        let given = settings.fps.or(settings.rate);
        let told = times::order(&mut images, input, settings.allow_gaps, given, notes)?;
        let Some(fps) = given.or(told) else {
            return Err(Error::usage(
                "images have no frame rate",
                Hint::from("give the frames per second of the recording, before frames are left out")
                    .with(Remedy::Fps),
            ));
        };
        if !settings.allow_gaps && told.is_none() {
            names::check_gaps(&images, input, notes)?;
        }
        Ok(Self { fps, kind: Kind::Images(images) })
    }

    /// Writes the colour frames.
    ///
    /// # Errors
    /// That of the lowest frame; [`Error::Usage`] if the frames asked for do not exist.
    pub fn write(&self, stage: &Stage, notes: &mut Vec<String>) -> Result<Colours> {
        let settings = stage.settings;
        match &self.kind {
            Kind::Images(images) => {
                let chosen = choose(settings, images.len())?;
                let size = image::size(&images[chosen[0]])?;
                let mut colours = Colours::new(settings, size, 1.0, chosen.len(), notes)?;
                colours.read = images.len();
                in_order(chosen.into_par_iter().enumerate(), |(k, n)| {
                    stage.colour_file(&colours, k, &images[n])
                })?;
                notes.extend(stage.notes());
                Ok(colours)
            }
            Kind::Video(video) => {
                let end = settings.frames.as_ref().map(|r| r.end);
                let mut stream = video.stream(end, &settings.ffmpeg)?;
                let Some(first) = stream.next() else { return Err(video.empty()) };
                let first = first?;
                let mut colours = Colours::new(settings, first.size, video.pixel_aspect(), 0, notes)?;
                let begin = settings.frames.as_ref().map_or(0, |r| r.start);
                let mut count = 0;
                let frames =
                    std::iter::once(Ok(first)).chain(&mut stream).enumerate().inspect(|_| count += 1);
                let chosen =
                    frames.filter(|(n, _)| *n >= begin && (n - begin).is_multiple_of(settings.stride));
                // One thread at a time reads; all of them undistort and compress.
                let written = in_order(chosen.enumerate().par_bridge(), |(k, (_, frame))| {
                    stage.colour(&colours, k, frame?)
                })?;
                colours.frames = 0..written;
                notes.extend(stream.complaints());
                choose(settings, count)?;
                colours.read = count;
                Ok(colours)
            }
        }
    }
}

/// `f` of every item on all cores; the number of items, or the first error in their order.
pub(super) fn in_order<T: Send>(
    items: impl ParallelIterator<Item = (usize, T)>,
    f: impl Fn((usize, T)) -> Result<()> + Send + Sync,
) -> Result<usize> {
    let mut results: Vec<(usize, Result<()>)> = items.map(|(k, item)| (k, f((k, item)))).collect();
    results.sort_by_key(|(k, _)| *k);
    let count = results.len();
    results.into_iter().map(|(_, result)| result).collect::<Result<Vec<()>>>()?;
    Ok(count)
}

/// The numbers of the frames to take of `count`.
pub(super) fn choose(settings: &Settings, count: usize) -> Result<Vec<usize>> {
    let range: Range<usize> = settings.frames.clone().unwrap_or(0..count);
    if range.start >= range.end || range.end > count {
        return Err(Error::usage(
            format!("frames {}..{} of {count} frames", range.start, range.end),
            Hint::from(format!("ask for frames A..B with 0 ≤ A < B ≤ {count}")).with(Remedy::Frames(None)),
        ));
    }
    Ok(range.step_by(settings.stride).collect())
}
