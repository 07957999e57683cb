//! `tessuto render`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use tessuto::camera::Camera;
use tessuto::output::{FolderKind, OutputFolder, manifest};
use tessuto::pbr::EnvironmentMap;
use tessuto::raster::Texture;
use tessuto::result::Folder;
use tessuto::view::{Drawing, Painter, Viewpoint};
use tessuto::{Error, Positions, appearance, io};

use crate::lens::ffmpeg;
use crate::say::say;
use crate::threads::Threads;
use crate::values::{self, View};
use crate::video;

/// Draw a recovered fabric from another place, under another light, plain or by depth.
#[derive(Args)]
#[command(after_help = "\
Writes one picture per frame, named by its number (frame_000.png …), and, where the program ffmpeg is installed
(or named by TESSUTO_FFMPEG), video.mp4.

Examples:
  tessuto render results/curtain                               from 45° to the left
  tessuto render results/curtain --camera 20,35 --size 1280x720
  tessuto render results/curtain --camera original --environment studio.hdr
  tessuto render results/curtain --look depth --frames 0..10 --out depth")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// `original`, or LEFT[,UP]: degrees about the middle of the fabric, as near as it fits.
    #[arg(long, default_value = "45", value_name = "VIEW", value_parser = values::view, allow_hyphen_values = true)]
    camera: View,
    /// Light: a lat-long image, .exr or .hdr, its middle where the recording camera looked [default: the
    /// recovered one].
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    /// Size of the pictures [px] [default: that of the video].
    #[arg(long, value_name = "WxH", value_parser = values::pixels)]
    size: Option<[usize; 2]>,
    /// What to draw [default: material where it was estimated, else texture].
    #[arg(long, value_enum)]
    look: Option<Look>,
    /// Frames A to B − 1, counted from the result's first.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<std::ops::Range<usize>>,
    /// Light samples per pixel; a multiple of 8.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(8..=65536))]
    samples: u32,
    /// Folder to write [default: RESULT/views/LOOK].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace earlier views that nobody changed since.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Look {
    /// The estimated material under a light.
    Material,
    /// The print as seen in the first frame.
    Texture,
    /// Plain grey, lit from the camera.
    Shaded,
    /// Depth as a colour.
    Depth,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let folder = &arguments.result;
    let saved = Folder::open(folder)?;
    let motion = saved.motion()?;
    let range = arguments.frames.clone().unwrap_or(0..motion.len());
    if range.end > motion.len() {
        let problem = format!("--frames {}..{}: there are {}", range.start, range.end, motion.len());
        return Err(Error::usage(problem, "give a range within them").into());
    }
    let has_material = folder.join("material/environment.exr").is_file();
    let look = arguments.look.unwrap_or(if has_material { Look::Material } else { Look::Texture });
    if look == Look::Material && !has_material {
        return Err(input(
            &folder.join("material"),
            "there are no material maps".into(),
            "run `tessuto appearance` first, or choose --look texture",
        ));
    }
    let view = viewpoint(arguments, motion, saved.camera)?;
    let motion: Vec<Positions> = motion.iter().map(|shape| view.shape(shape)).collect();
    let out = arguments.out.clone().unwrap_or_else(|| folder.join("views").join(name(look)));
    let output = OutputFolder::prepare(&out, FolderKind::Views, arguments.force)?;
    let drawing = drawing(arguments, &saved, &view, look)?;
    let painter = Painter::new(&saved.mesh, &motion, view.camera, drawing);
    let bar = ProgressBar::new(range.len() as u64);
    for n in range.clone() {
        let path = output.partial().join(format!("frame_{n:03}.png"));
        io::image::write_png(&path, &painter.draw(n))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some([near, far]) = painter.depths() {
        say!("depth from {near:.3} m (dark) to {far:.3} m (bright)");
    }
    let video = video::encode(&ffmpeg(), output.partial(), range.start, saved.fps);
    crate::say_kept(output.publish()?);
    manifest::record(&[&out])?;
    say!("{}", out.display());
    match video {
        Ok(()) => say!("{}", out.join("video.mp4").display()),
        Err(why) => say!("no video.mp4: {why}"),
    }
    Ok(())
}

fn input(path: &Path, problem: String, hint: &str) -> anyhow::Error {
    Error::input(path.display().to_string(), problem, hint).into()
}

fn name(look: Look) -> &'static str {
    match look {
        Look::Material => "material",
        Look::Texture => "texture",
        Look::Shaded => "shaded",
        Look::Depth => "depth",
    }
}

fn viewpoint(arguments: &Arguments, motion: &[Positions], camera: Camera) -> Result<Viewpoint, Error> {
    let original = Viewpoint::original(camera);
    let sized = arguments.size.map_or(original, |size| original.sized(size));
    match arguments.camera {
        View::Original => Ok(sized),
        View::About(left, up) => Viewpoint::about(motion, sized.camera, left.to_radians(), up.to_radians()),
    }
}

fn drawing(arguments: &Arguments, saved: &Folder, view: &Viewpoint, look: Look) -> Result<Drawing, Error> {
    Ok(match look {
        Look::Material => {
            let maps = saved.path().join("material");
            let file = arguments.environment.clone().unwrap_or_else(|| maps.join("environment.exr"));
            let light = io::hdr::read_environment(&file)?;
            let texels = light.data.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
            let environment = EnvironmentMap { width: light.width, height: light.height, texels };
            let material = appearance::read_material(&maps)?;
            Drawing::material(material, &view.environment(&environment), arguments.samples as usize)
        }
        Look::Texture => {
            let image = io::image::read(&saved.path().join("texture.png"))?;
            Drawing::Texture(Texture::from_image(&image))
        }
        Look::Shaded => Drawing::Shaded,
        Look::Depth => Drawing::Depth,
    })
}
