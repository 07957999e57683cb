//! A result, rendered frame by frame into a folder.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::{Viewpoint, depth_range, draw_depth, draw_shaded, draw_texture};
use crate::camera::Camera;
use crate::error::{Error, Hint, Remedy, Result};
use crate::image::Image;
use crate::io;
use crate::mesh::Positions;
use crate::output::{FolderKind, OutputFolder, manifest};
use crate::pbr::{EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame};
use crate::raster::{Rasterizer, Texture};
use crate::result::Folder;

/// Fraction of the light samples that are drawn uniformly over the sphere.
const UNIFORM_FRACTION: f64 = 0.05;

/// What is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// The estimated material under a light.
    Material,
    /// The texture as filmed in the first frame.
    Texture,
    /// Plain grey, lit from the camera.
    Shaded,
    /// Depth as a colour.
    Depth,
}

impl std::str::FromStr for Look {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let all = [Self::Material, Self::Texture, Self::Shaded, Self::Depth];
        let found = all.into_iter().find(|look| look.name() == text);
        found.ok_or_else(|| format!("the looks are: {}", all.map(Self::name).join(", ")))
    }
}

impl Look {
    /// Its name: that of the folder of views.
    pub fn name(self) -> &'static str {
        match self {
            Self::Material => "material",
            Self::Texture => "texture",
            Self::Shaded => "shaded",
            Self::Depth => "depth",
        }
    }
}

/// Where it is seen from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum View {
    /// From the recording camera.
    Original,
    /// Degrees to the left and upwards around the centre of the fabric, at the distance where it fills the image.
    About(f64, f64),
}

/// What to render.
#[derive(Debug, Clone)]
pub struct RenderOptions {
    /// What is drawn: material where it was estimated, else the texture, if it is not given.
    pub look: Option<Look>,
    /// Where it is seen from.
    pub view: View,
    /// Environment map, a lat-long image, in place of the recovered one.
    pub environment: Option<PathBuf>,
    /// Width and height `[px]` in place of the video's.
    pub size: Option<[usize; 2]>,
    /// Frames, counted from the result's first; all of them if it is not given.
    pub frames: Option<Range<usize>>,
    /// Light samples per pixel, rounded up to a multiple of 8.
    pub samples: usize,
    /// Replace earlier views, if they are all tessuto's.
    pub replace: bool,
}

/// What was rendered.
#[derive(Debug)]
pub struct Rendered {
    /// The folder.
    pub folder: PathBuf,
    /// Nearest (dark) and farthest (bright) depth `[m]`, where depth was drawn.
    pub depth: Option<[f64; 2]>,
    /// Where an earlier folder is kept because somebody put files into it meanwhile.
    pub kept: Option<PathBuf>,
}

/// Renders `result` into the folder `out`, RESULT/views/LOOK if it is not given: `frame_000.png` …, named by the number of
/// the frame. `progress` hears of every frame; `finish`, given the folder and the first frame, may add to it what comes of
/// all frames, such as a video.
///
/// # Errors
/// [`Error::Usage`] for a range beyond the motion; [`Error::Input`] for files that cannot be used, and if anything but
/// views of tessuto's is at `out`; [`Error::Output`].
pub fn render(
    result: &Folder,
    out: Option<&Path>,
    options: &RenderOptions,
    progress: &mut dyn FnMut(usize, usize),
    finish: &mut dyn FnMut(&Path, usize),
) -> Result<Rendered> {
    let motion = result.motion()?;
    let range = options.frames.clone().unwrap_or(0..motion.len());
    if range.end > motion.len() {
        let problem = format!("frames {}..{}: there are {}", range.start, range.end, motion.len());
        return Err(Error::usage(problem, "give a range within them"));
    }
    let material = result.material()?;
    let look = options.look.unwrap_or(if material.is_some() { Look::Material } else { Look::Texture });
    let viewpoint = viewpoint(options, motion, result.camera)?;
    let motion: Vec<Positions> = motion.iter().map(|positions| viewpoint.positions(positions)).collect();
    let target = out.map_or_else(|| result.path().join("views").join(look.name()), Path::to_path_buf);
    let output = OutputFolder::prepare(&target, FolderKind::Views, options.replace)?;
    let drawing = match (look, material) {
        (Look::Material, Some(material)) => Drawing::Material {
            material,
            light: Box::new(light(result, options, &viewpoint)?),
            // What lies beyond the last frame is not asked for.
            geometry: Geometry::new(&result.mesh, &motion[..range.end]),
            samples_per_pixel: options.samples,
        },
        (Look::Material, None) => {
            return Err(Error::input(
                result.path().join("material").display().to_string(),
                "there are no material maps",
                Hint::from("draw the texture, or estimate them first").with(Remedy::Appearance),
            ));
        }
        (Look::Texture, _) => {
            Drawing::Texture(Texture::from_image(&io::image::read(&result.path().join("texture.png"))?))
        }
        (Look::Shaded, _) => Drawing::Shaded(Geometry::new(&result.mesh, &motion[..range.end])),
        (Look::Depth, _) => Drawing::Depth(depth_range(&motion)),
    };
    let painter = Painter { rasterizer: Rasterizer::new(&result.mesh), camera: viewpoint.camera, drawing };
    for (done, n) in range.clone().enumerate() {
        let path = output.partial().join(format!("frame_{n:03}.png"));
        io::image::write_png(&path, &painter.draw(n, &motion[n]))?;
        progress(done + 1, range.len());
    }
    finish(output.partial(), range.start);
    let kept = output.publish()?;
    manifest::record(&[&target])?;
    let depth = match painter.drawing {
        Drawing::Depth(range) => Some(range),
        _ => None,
    };
    Ok(Rendered { folder: target, depth, kept })
}

fn viewpoint(options: &RenderOptions, motion: &[Positions], camera: Camera) -> Result<Viewpoint> {
    let original = Viewpoint::original(camera);
    let sized = options.size.map_or(original, |size| original.sized(size));
    match options.view {
        View::Original => Ok(sized),
        View::About(left, up) => Viewpoint::about(motion, sized.camera, left.to_radians(), up.to_radians()),
    }
}

fn light(result: &Folder, options: &RenderOptions, viewpoint: &Viewpoint) -> Result<EnvironmentSampler> {
    let recovered = result.path().join("material/environment.exr");
    let light = io::hdr::read_environment(options.environment.as_ref().unwrap_or(&recovered))?;
    let texels = light.data.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    let map = EnvironmentMap { width: light.width, height: light.height, texels };
    Ok(EnvironmentSampler::new(&viewpoint.environment(&map), UNIFORM_FRACTION))
}

/// Draws frames of one look.
struct Painter<'a> {
    rasterizer: Rasterizer,
    camera: Camera,
    drawing: Drawing<'a>,
}

enum Drawing<'a> {
    Material {
        material: &'a Material,
        light: Box<EnvironmentSampler>,
        geometry: Geometry,
        samples_per_pixel: usize,
    },
    Texture(Texture),
    Shaded(Geometry),
    Depth([f64; 2]),
}

impl Painter<'_> {
    fn draw(&self, n: usize, positions: &Positions) -> Image {
        let Self { rasterizer, camera, drawing } = self;
        match drawing {
            Drawing::Material { material, light, geometry, samples_per_pixel } => {
                let scene = RenderScene { rasterizer, geometry, material, light };
                render_frame(&scene, camera, (n, positions), *samples_per_pixel)
            }
            Drawing::Texture(texture) => draw_texture(rasterizer, camera, positions, texture),
            Drawing::Shaded(geometry) => draw_shaded(rasterizer, camera, geometry, (n, positions)),
            Drawing::Depth(range) => draw_depth(rasterizer, camera, positions, *range),
        }
    }
}
