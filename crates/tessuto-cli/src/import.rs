//! `tessuto import`.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;
use tessuto::import::{CARRIED_OVER, Masks, Settings, check_target, copy_template, import};
use tessuto::masks::Request;
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::text::quoted;

use crate::ffmpeg::ffmpeg;
use crate::lens::Lens;
use crate::masks::{Source, make_masks};
use crate::say::say;
use crate::threads::Threads;

/// Make a scene folder from a video or images and a camera, with masks or with the fabric's outline, and check it.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto import clip.mp4 scenes/towel --fov 63 --outline \"312,208 930,215 941,640 305,622\"
  tessuto import clip.mp4 scenes/curtain --masks masks.mp4 --fov 63 --template curtain.obj
  tessuto import frames/ scenes/flag --fps 25 --alpha --camera colmap/cameras.txt --downscale 2
  tessuto import clip.mov scenes/towel --masks masks/ --camera calibration.yml --frames 120..180
  tessuto template scenes/towel --flat 0.7x0.5m --from-mask     (if there is no template yet)

With --outline the masks are made from the clip, as tessuto masks makes them; its corners are in pixels of the scene's
first frame. Videos are decoded by ffmpeg, found in the search path or by the variable TESSUTO_FFMPEG. White in a mask
is fabric; masks pair with frames by name, else by number; a video of masks pairs frame by frame.")]
pub struct Arguments {
    /// Video file, or folder of PNG or JPEG images.
    input: PathBuf,
    /// Scene folder to write.
    out: PathBuf,
    /// Masks: folder of images, or a video; white is fabric.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["alpha", "outline"])]
    masks: Option<PathBuf>,
    /// Take the masks from the alpha channel of the images.
    #[arg(long, conflicts_with = "outline")]
    alpha: bool,
    #[command(flatten)]
    source: Source,
    /// Black is fabric in the masks.
    #[arg(long)]
    invert_masks: bool,
    /// The fabric in the first frame: OBJ, PLY or glTF, camera axes, metres, with uv.
    #[arg(long, value_name = "FILE")]
    template: Option<PathBuf>,
    /// Frames per second; required for images. A video of another rate is resampled.
    #[arg(long)]
    fps: Option<f64>,
    /// Only frames A to B − 1 of the input.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<std::ops::Range<usize>>,
    /// Use every N-th frame.
    #[arg(long, value_name = "N", default_value_t = 1)]
    stride: usize,
    /// Shrink frames by this integer factor.
    #[arg(long, value_name = "N", default_value_t = 1)]
    downscale: usize,
    /// Treat numbered images with gaps as evenly spaced in time.
    #[arg(long)]
    allow_gaps: bool,
    /// Replace a scene that tessuto wrote and nobody changed; its template is kept where no other is given.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    lens: Lens,
}

/// Runs the command: writes the scene, prints what was changed and what `check` finds.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let out = &arguments.out;
    check_target(
        out,
        arguments.force,
        [
            Some(&arguments.input),
            arguments.masks.as_ref(),
            arguments.template.as_ref(),
            arguments.source.plate.as_ref(),
        ],
    )?;
    let kept = Some(out.join("template.obj")).filter(|kept| arguments.template.is_none() && kept.is_file());
    let settings = Settings {
        input: arguments.input.clone(),
        masks: match &arguments.masks {
            Some(path) => Masks::Path(path.clone()),
            None if arguments.alpha => Masks::Alpha,
            None => Masks::Later,
        },
        plate: arguments.source.plate.clone(),
        invert_masks: arguments.invert_masks,
        calibration: arguments.lens.calibration_of(&arguments.input)?,
        fps: arguments.fps,
        frames: arguments.frames.clone(),
        stride: arguments.stride,
        downscale: arguments.downscale,
        allow_gaps: arguments.allow_gaps,
        template: arguments.template.clone().or_else(|| kept.clone()),
        ffmpeg: ffmpeg(),
    };
    let name = out.canonicalize().unwrap_or_else(|_| out.clone());
    let name = name.file_name().map_or_else(|| "scene".to_owned(), |n| n.to_string_lossy().into_owned());
    let carried_over: &[&str] = if kept.is_some() { &CARRIED_OVER } else { &[] };
    let output = OutputFolder::prepare_keeping(out, FolderKind::Scene, arguments.force, carried_over)?;
    let imported = {
        let (bar, count) = (crate::progress::spinner(), AtomicUsize::new(0));
        import(&settings, &name, output.partial(), &|written| {
            let count = count.fetch_add(1, Ordering::Relaxed) + 1;
            bar.set_message(format!("{count} files, {written}"));
        })?
    };
    if let Some(kept) = &kept {
        copy_template(kept, output.partial())?;
    }
    if arguments.source.outline.is_some() {
        let plate = output.partial().join("plate.png");
        let plate = arguments.source.plate.is_some().then_some(plate);
        make_masks(output.partial(), out, &Request { plate, ..arguments.source.request() })?;
    }
    crate::say_kept(output.publish()?);
    imported.notes.iter().for_each(|note| say!("note: {note}"));
    say!(
        "{}: {} frames of {}×{} px, {} per second",
        out.display(),
        imported.frames,
        imported.camera.width,
        imported.camera.height,
        (imported.fps * 1e4).round() / 1e4
    );
    if settings.masks == Masks::Later && arguments.source.outline.is_none() {
        say!("next: masks, from the fabric's corners in the first frame:");
        say!("  {}", crate::remedy::make_masks(&quoted(out)));
        return Ok(());
    }
    if settings.template.is_some() {
        return crate::check::check(out, None);
    }
    crate::check::check_without_template(out)
}
