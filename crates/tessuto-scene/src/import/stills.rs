//! Single frames of a video, numbered as [`import`](super::import) numbers them: to choose which ones to import,
//! and to see the first of them before there is a scene.

use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::json;

use super::frames::in_order;
use super::video::{Raw, Reading, Video};
use super::{Focal, camera_of};
use crate::io::rgb8::Rgb8;
use crate::io::{atomic_write, image, jpeg};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Result};

/// Quality of frames that are made smaller, in percent.
const QUALITY: u8 = 82;

/// Which frames, and how large.
#[derive(Debug, Clone)]
pub struct StillSettings {
    /// A video file.
    pub input: PathBuf,
    /// Frames per second that it is resampled to, as for the import.
    pub fps: Option<f64>,
    /// Frames per second at which its frames were filmed, whatever its time stamps say, as for the import.
    pub rate: Option<f64>,
    /// Only these frames of the video, counted from 0.
    pub frames: Option<Range<usize>>,
    /// Longer side of the written images `[px]`, which are JPEG then; PNG of the video's size without.
    pub side: Option<u32>,
    /// The program that decodes videos.
    pub ffmpeg: PathBuf,
}

/// What was written.
#[derive(Debug, Clone)]
pub struct Stills {
    /// Number of images.
    pub written: usize,
    /// Frames per second of the video.
    pub fps: f64,
    /// Width and height of the video `[px]`.
    pub size: [usize; 2],
    /// What was changed or assumed.
    pub notes: Vec<String>,
}

/// Writes `frame_00012.png` or `.jpg` for every frame asked for into the existing `folder`, and `clip.json`, which
/// reports frame rate, size, the numbers of the frames and, where the file has it, the focal length in terms of
/// 35-mm film `[mm]`; `progress` receives the number of a frame that has been written.
///
/// # Errors
/// [`Error::Usage`] if the frames asked for do not exist; [`Error::Input`] of the video; [`Error::Output`].
pub fn stills(settings: &StillSettings, folder: &Path, progress: &(dyn Fn(usize) + Sync)) -> Result<Stills> {
    let mut notes = Vec::new();
    for (name, fps) in [("fps", settings.fps), ("rate", settings.rate)] {
        if let Some(fps) = fps.filter(|fps| !(*fps > 0.0 && *fps <= 100_000.0)) {
            return Err(Error::usage(format!("{name} is {fps}"), "give frames per second, above 0"));
        }
    }
    let end = settings.frames.as_ref().map(|r| r.end);
    let reading = Reading { ffmpeg: &settings.ffmpeg, fps: settings.fps, rate: settings.rate, end };
    let video = Video::probe(&settings.input, reading, &mut notes)?;
    let mut stream = video.stream(end, &settings.ffmpeg)?;
    let Some(first) = stream.next() else { return Err(video.empty()) };
    let first = first?;
    let (size, mut count) = (first.size, 0);
    let begin = settings.frames.as_ref().map_or(0, |r| r.start);
    let frames = std::iter::once(Ok(first)).chain(&mut stream).enumerate().inspect(|_| count += 1);
    // One thread at a time reads; all of them compress.
    let chosen = frames.filter(|(n, _)| *n >= begin).par_bridge();
    let written = in_order(chosen, |(n, frame)| {
        let (ending, bytes) = encoded(frame?, settings.side);
        atomic_write(&folder.join(format!("frame_{n:05}.{ending}")), &bytes)?;
        progress(n);
        Ok(())
    })?;
    let expected = settings.frames.as_ref().map_or(count, |r| r.end);
    if written == 0 || count < expected {
        return Err(Error::usage(
            format!("frames {begin}..{expected} of {count} frames"),
            "name frames that the video has",
        ));
    }
    notes.extend(stream.complaints());
    let lens = camera_of(&settings.input, &settings.ffmpeg);
    let lens = lens.and_then(|lens| if let Focal::Film(mm) = lens.focal { Some(mm) } else { None });
    let text = json!({ "fps": video.fps, "width": size[0], "height": size[1], "frames": [begin, count], "lens": lens });
    atomic_write(&folder.join("clip.json"), format!("{text:#}\n").as_bytes())?;
    Ok(Stills { written, fps: video.fps, size, notes })
}

/// Ending and bytes of the file for a frame.
fn encoded(frame: Raw, side: Option<u32>) -> (&'static str, Vec<u8>) {
    let [width, height] = frame.size;
    let Some(side) = side else { return ("png", image::encode_png_bytes(&frame.rgb, frame.size, 3)) };
    let whole = Rect { x0: 0, y0: 0, x1: width, y1: height };
    let pixels = Rgb8::new([width, height], frame.rgb);
    ("jpg", jpeg::encode_part(&pixels, whole, side, QUALITY))
}
