//! `tessuto frames`.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;
use tessuto::import::{StillSettings, stills};
use tessuto::output::{FolderKind, OutputFolder};

use crate::ffmpeg::ffmpeg;
use crate::say::say;
use crate::threads::Threads;

/// Write frames of a video as images, numbered as by `import`: to choose a part and to read off corners.
#[derive(Args)]
#[command(after_help = "\
Examples:
  # every frame, small
  tessuto frames clip.mp4 look --side 480

  # the frame that import --frames 30..90 starts with
  tessuto frames clip.mp4 first --frames 30..31")]
pub struct Arguments {
    /// Video file.
    clip: PathBuf,
    /// Folder to write.
    out: PathBuf,
    /// Only frames A to B − 1 of the video.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<std::ops::Range<usize>>,
    /// Longer side of the images, as JPEG [px; default: as filmed, as PNG].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=16384))]
    side: Option<u32>,
    /// Frames per second, where the video is to be resampled.
    #[arg(long, value_name = "FPS", value_parser = crate::frames::per_second)]
    fps: Option<f64>,
    /// Frames per second at which the video was filmed; overrules its time stamps.
    #[arg(long, value_name = "FPS", value_parser = crate::frames::per_second)]
    rate: Option<f64>,
    /// Replace earlier images by tessuto that were not changed since.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let settings = StillSettings {
        input: arguments.clip.clone(),
        fps: arguments.fps,
        rate: arguments.rate,
        frames: arguments.frames.clone(),
        side: arguments.side,
        ffmpeg: ffmpeg(),
    };
    let output = OutputFolder::prepare(&arguments.out, FolderKind::Views, arguments.force)?;
    let written = {
        let (bar, count) = (crate::progress::spinner(), AtomicUsize::new(0));
        stills(&settings, output.partial(), &|_| {
            bar.set_message(format!("{} frames", count.fetch_add(1, Ordering::Relaxed) + 1));
        })?
    };
    crate::say_kept(output.publish()?);
    written.notes.iter().for_each(|note| say!("note: {note}"));
    let [width, height] = written.size;
    say!(
        "{}: {} frames of a video of {width}×{height} px, {} per second",
        arguments.out.display(),
        written.written,
        (written.fps * 1e4).round() / 1e4
    );
    Ok(())
}
