//! A result, rendered frame by frame into a folder.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::film::{Shot, shots, turned};
use super::{Turn, View, depth_range, draw_depth, draw_shaded, draw_texture};
use crate::result::Folder;
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_estimate::io;
use tessuto_estimate::output::{FolderKind, OutputFolder, manifest};
use tessuto_render::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame,
};
use tessuto_render::raster::{Rasterizer, Texture};

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
    /// What goes once around the fabric during the motion.
    pub turn: Option<Turn>,
    /// How many images the frames are spread over, in place of one each.
    pub pictures: Option<usize>,
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
    /// Where an earlier folder is kept because somebody has put files into it since.
    pub kept: Option<PathBuf>,
    /// What was asked for and had no effect.
    pub notes: Vec<String>,
}

/// Renders `result` into the folder `out`, RESULT/views/LOOK if it is not given: `frame_000.png` …, named by the
/// number of the frame, or of the image where their number is given. `progress` hears of every image; `finish`,
/// given the folder and the first number, may add to it what comes of all of them, such as a video.
///
/// # Errors
/// [`Error::Usage`] for a range beyond the motion, and a turn that cannot be; [`Error::Input`] for files that
/// cannot be used, and if anything but views of tessuto's is at `out`; [`Error::Output`].
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
    let sized = |view: Viewpoint| options.size.map_or(view, |size| view.sized(size));
    let originals = match &options.view {
        View::Camera(name) => result.viewpoints_of(name)?,
        _ => result.viewpoints(),
    };
    let originals: Vec<Viewpoint> = originals.into_iter().map(sized).collect();
    let film = shots(motion, range.clone(), &originals, (&options.view, options.turn, options.pictures))?;
    if options.turn == Some(Turn::Light) && look != Look::Material {
        let problem = format!("a light that goes around, and the look {}", look.name());
        return Err(Error::usage(problem, "only the material is lit: draw that"));
    }
    let mut notes = Vec::new();
    if let Some(environment) = options.environment.as_ref().filter(|_| look != Look::Material) {
        let why = match options.look {
            Some(_) => "only the look material is lit",
            None => "only the look material is lit, and the result has no material yet",
        };
        notes.push(format!(
            "the environment {} has no effect on the look {}: {why}",
            environment.display(),
            look.name()
        ));
    }
    let seen = |shot: &Shot| shot.viewpoint.all_in_camera(&motion[shot.frame]).into_owned();
    let target = out.map_or_else(|| result.path().join("views").join(look.name()), Path::to_path_buf);
    let output = OutputFolder::prepare(&target, FolderKind::Views, options.replace)?;
    let drawing = match (look, material) {
        (Look::Material, Some(material)) => {
            Drawing::Material { material, light: light(result, options)?, samples_per_pixel: options.samples }
        }
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
        (Look::Shaded, _) => Drawing::Shaded,
        (Look::Depth, _) => Drawing::Depth(depth_range(&film.iter().map(seen).collect::<Vec<_>>())),
    };
    let mut painter = Painter {
        mesh: &result.mesh,
        rasterizer: result.rasterizer(look == Look::Material)?,
        drawing,
        lit: None,
    };
    for (done, shot) in film.iter().enumerate() {
        let path = output.partial().join(format!("frame_{:03}.png", shot.number));
        io::image::write_png(&path, &painter.draw(shot, &seen(shot)))?;
        progress(done + 1, film.len());
    }
    finish(output.partial(), film.first().map_or(0, |shot| shot.number));
    let kept = output.publish()?;
    manifest::record(&[&target])?;
    let depth = match painter.drawing {
        Drawing::Depth(range) => Some(range),
        _ => None,
    };
    Ok(Rendered { folder: target, depth, kept, notes })
}

fn light(result: &Folder, options: &RenderOptions) -> Result<EnvironmentMap> {
    let recovered = result.path().join("material/environment.exr");
    let light = io::hdr::read_environment(options.environment.as_ref().unwrap_or(&recovered))?;
    let texels = light.data.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    Ok(EnvironmentMap { width: light.width, height: light.height, texels })
}

/// Draws images of one look.
struct Painter<'a> {
    mesh: &'a Mesh,
    rasterizer: Rasterizer,
    drawing: Drawing<'a>,
    /// The light as the last image had it: turn, viewpoint, and what directions are drawn from.
    lit: Option<(f64, Viewpoint, EnvironmentSampler)>,
}

enum Drawing<'a> {
    Material { material: &'a Material, light: EnvironmentMap, samples_per_pixel: usize },
    Texture(Texture),
    Shaded,
    Depth([f64; 2]),
}

impl Painter<'_> {
    /// The image of `shot`, whose frame has its vertices at `positions`.
    fn draw(&mut self, shot: &Shot, positions: &Positions) -> Image {
        let camera = &shot.viewpoint.camera;
        let geometry = || Geometry::new(self.mesh, std::slice::from_ref(positions));
        let rasterizer = &self.rasterizer;
        match &self.drawing {
            Drawing::Material { material, light, samples_per_pixel } => {
                let same =
                    |(turn, view, _): &(f64, Viewpoint, _)| *turn == shot.light && *view == shot.viewpoint;
                if !self.lit.as_ref().is_some_and(same) {
                    let light = turned(light, shot.light).seen_from(&shot.viewpoint);
                    let sampler = EnvironmentSampler::new(&light, UNIFORM_FRACTION);
                    self.lit = Some((shot.light, shot.viewpoint, sampler));
                }
                let geometry = &geometry();
                self.lit.as_ref().map_or_else(
                    || Image::new(camera.width, camera.height, 3),
                    |(_, _, light)| {
                        let scene = RenderScene { rasterizer, geometry, material, light };
                        render_frame(&scene, camera, (0, positions), *samples_per_pixel)
                    },
                )
            }
            Drawing::Texture(texture) => draw_texture(rasterizer, camera, positions, texture),
            Drawing::Shaded => draw_shaded(rasterizer, camera, &geometry(), (0, positions)),
            Drawing::Depth(range) => draw_depth(rasterizer, camera, positions, *range),
        }
    }
}
