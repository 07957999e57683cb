//! `tessuto render`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use tessuto::result::Folder;
use tessuto::view::{Look, RenderOptions, Turn, View, render};

use crate::say::say;
use crate::threads::Threads;
use crate::{values, video};

/// Render a recovered fabric from another viewpoint, under another environment map, plain or as depth.
#[derive(Args)]
#[command(after_help = "\
Examples:
  # from 45° to the left
  tessuto render results/curtain
  tessuto render results/curtain --camera 20,35 --size 1280x720
  tessuto render results/curtain --camera original --environment studio.hdr
  tessuto render results/curtain --look depth --frames 0..10 --out depth

  # a turntable
  tessuto render results/curtain --camera 0,15 --turn camera --frames 0..1 \\
    --pictures 72 --out turntable
  tessuto render results/curtain --camera original --turn light \\
    --environment studio.hdr --out relit

Writes one image per frame, named by its number (frame_000.png …), and video.mp4 where \
ffmpeg is installed (or named by TESSUTO_FFMPEG).")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// `original`, the name of a further camera, or LEFT[,UP]: degrees around the centre of the fabric, at the distance
    /// where it fills the image.
    #[arg(long, default_value = "45", value_name = "VIEW", value_parser = values::view, allow_hyphen_values = true)]
    camera: View,
    /// Environment map: lat-long image, .exr or .hdr, its centre in the direction of the recording camera [default: the
    /// recovered one].
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    /// Size of the images [px] [default: that of the video].
    #[arg(long, value_name = "WxH", value_parser = values::pixels)]
    size: Option<[usize; 2]>,
    /// What to draw: material (the estimated one), texture (as filmed in the first frame), shaded (grey) or depth (as a
    /// colour) [default: material where it was estimated, else texture].
    #[arg(long)]
    look: Option<Look>,
    /// Frames A to B − 1, counted from the result's first.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<std::ops::Range<usize>>,
    /// Go once around the fabric in the course of the images.
    #[arg(long, value_enum)]
    turn: Option<Around>,
    /// Number of images that the frames are spread over [default: one each]. One frame and many images make a
    /// turntable of a fabric at rest.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pictures: Option<u32>,
    /// Light samples per pixel, rounded up to a multiple of 8.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(8..=65536))]
    samples: u32,
    /// Folder to write [default: RESULT/views/LOOK].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace earlier views that were not changed since.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Around {
    /// The camera, to the left: a turntable.
    Camera,
    /// The light, about the vertical.
    Light,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let result = Folder::open(&arguments.result)?;
    let options = RenderOptions {
        look: arguments.look,
        view: arguments.camera.clone(),
        size: arguments.size,
        environment: arguments.environment.clone(),
        frames: arguments.frames.clone(),
        turn: arguments.turn.map(|turn| match turn {
            Around::Camera => Turn::Camera,
            Around::Light => Turn::Light,
        }),
        pictures: arguments.pictures.map(|n| n as usize),
        samples: arguments.samples as usize,
        replace: arguments.force,
    };
    let bar = ProgressBar::new(0);
    let mut progress = |done: usize, of: usize| {
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    };
    let mut encoded = Ok(());
    let mut finish = |folder: &Path, first: usize| encoded = video::encode(folder, first, result.fps);
    let rendered = render(&result, arguments.out.as_deref(), &options, &mut progress, &mut finish)?;
    bar.finish_and_clear();
    crate::say_kept(rendered.kept);
    rendered.notes.iter().for_each(|note| say!("note: {note}"));
    if let Some([near, far]) = rendered.depth {
        say!("depth from {near:.3} m (dark) to {far:.3} m (bright)");
    }
    say!("{}", rendered.folder.display());
    match encoded {
        Ok(()) => say!("{}", rendered.folder.join("video.mp4").display()),
        Err(why) => say!("no video.mp4: {why}"),
    }
    Ok(())
}
