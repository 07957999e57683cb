//! `tessuto render`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use tessuto::camera::Camera;
use tessuto::image::Image;
use tessuto::output::{FolderKind, OutputFolder, manifest};
use tessuto::pbr::{EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame};
use tessuto::raster::{Rasterizer, Texture};
use tessuto::result::Folder;
use tessuto::view::{Viewpoint, depth_range, draw_depth, draw_shaded, draw_texture};
use tessuto::{Error, Positions, appearance, io};

use crate::say::say;
use crate::threads::Threads;

/// Share of light samples that are drawn uniformly from all directions.
const UNIFORM_SHARE: f64 = 0.05;

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
    #[arg(long, default_value = "45", value_name = "VIEW", value_parser = parse_view, allow_hyphen_values = true)]
    camera: View,
    /// Light: a lat-long render_frame, .exr or .hdr, its middle where the recording camera looked [default: the
    /// recovered one].
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    /// Size of the pictures [px] [default: that of the video].
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
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

#[derive(Debug, Clone, Copy, PartialEq)]
enum View {
    Original,
    /// Degrees to the left and upwards.
    About(f64, f64),
}

fn parse_view(text: &str) -> Result<View, String> {
    let hint = "write original, LEFT or LEFT,UP in degrees, such as 45 or -30,20";
    if text == "original" {
        return Ok(View::Original);
    }
    let (left, up) = text.split_once(',').unwrap_or((text, "0"));
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|a| a.is_finite()).ok_or(hint.to_owned());
    Ok(View::About(number(left)?, number(up)?))
}

fn parse_size(text: &str) -> Result<[usize; 2], String> {
    let hint = "write WIDTHxHEIGHT between 16 and 16384, such as 1280x720";
    let (w, h) = text.split_once('x').ok_or(hint)?;
    let side = |t: &str| t.parse().ok().filter(|n| (16..=16384).contains(n)).ok_or(hint.to_owned());
    Ok([side(w)?, side(h)?])
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
    let painter = Painter::new(arguments, &saved.mesh, &motion, &view, look)?;
    let bar = ProgressBar::new(range.len() as u64);
    for n in range.clone() {
        let path = output.partial().join(format!("frame_{n:03}.png"));
        io::image::write_png(&path, &painter.draw(n, &motion[n]))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Painter { drawing: Drawing::Depth([near, far]), .. } = painter {
        say!("depth from {near:.3} m (dark) to {far:.3} m (bright)");
    }
    let video = encode(output.partial(), range.start, saved.fps);
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

/// Draws frames of one look.
struct Painter {
    rasterizer: Rasterizer,
    geometry: Geometry,
    camera: Camera,
    drawing: Drawing,
}

enum Drawing {
    Material { material: Material, light: Box<EnvironmentSampler>, passes: usize },
    Texture(Texture),
    Shaded,
    Depth([f64; 2]),
}

impl Painter {
    fn new(
        arguments: &Arguments,
        mesh: &tessuto::Mesh,
        motion: &[Positions],
        view: &Viewpoint,
        look: Look,
    ) -> Result<Self, Error> {
        let folder = &arguments.result;
        let drawing = match look {
            Look::Material => {
                let maps = folder.join("material");
                let file = arguments.environment.clone().unwrap_or_else(|| maps.join("environment.exr"));
                let light = io::hdr::read_environment(&file)?;
                let texels = light.data.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
                let environment = EnvironmentMap { width: light.width, height: light.height, texels };
                Drawing::Material {
                    material: appearance::read_material(&maps)?,
                    light: Box::new(EnvironmentSampler::new(&view.environment(&environment), UNIFORM_SHARE)),
                    passes: arguments.samples.div_ceil(8) as usize,
                }
            }
            Look::Texture => {
                Drawing::Texture(Texture::from_image(&io::image::read(&folder.join("texture.png"))?))
            }
            Look::Shaded => Drawing::Shaded,
            Look::Depth => Drawing::Depth(depth_range(motion)),
        };
        let geometry = Geometry::new(mesh, motion);
        Ok(Self { rasterizer: Rasterizer::new(mesh), geometry, camera: view.camera, drawing })
    }

    fn draw(&self, n: usize, shape: &Positions) -> Image {
        let Self { rasterizer, geometry, camera, drawing } = self;
        match drawing {
            Drawing::Material { material, light, passes } => {
                let cloth = RenderScene { rasterizer, geometry, material, light };
                render_frame(&cloth, camera, (n, shape), *passes)
            }
            Drawing::Texture(texture) => draw_texture(rasterizer, camera, shape, texture),
            Drawing::Shaded => draw_shaded(rasterizer, camera, geometry, (n, shape)),
            Drawing::Depth(range) => draw_depth(rasterizer, camera, shape, *range),
        }
    }
}

/// `frame_*.png` in `folder` to `video.mp4`, by the program ffmpeg.
fn encode(folder: &Path, first: usize, fps: f64) -> Result<(), String> {
    let status = Command::new(crate::lens::ffmpeg())
        .current_dir(folder)
        .args(["-v", "error", "-y", "-framerate", &fps.to_string(), "-start_number", &first.to_string()])
        .args(["-i", "frame_%03d.png"])
        // H.264 wants even sides.
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "video.mp4"])
        .stdin(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("ffmpeg ended with {status}")),
        Err(_) => Err("the program ffmpeg is not installed; TESSUTO_FFMPEG may name it".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::{View, parse_size, parse_view};

    #[test]
    fn views_and_sizes_are_read_or_explained() {
        assert_eq!(parse_view("original"), Ok(View::Original));
        assert_eq!(parse_view("-30, 20"), Ok(View::About(-30.0, 20.0)));
        assert!(parse_view("left").unwrap_err().contains("degrees"));
        assert_eq!(parse_size("1280x720"), Ok([1280, 720]));
        assert!(parse_size("1280").is_err() && parse_size("0x9").is_err());
    }
}
