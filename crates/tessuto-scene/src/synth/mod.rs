//! Synthetic scenes: a textured sheet, moved by wind or by hands or bent like paper, with things in front of it
//! and motion blur if wanted, rendered and written as a scene folder with complete truth.

pub(crate) mod breeze;
pub(crate) mod causes;
pub(crate) mod gust;
pub(crate) mod hands;
pub mod lattice;
pub(crate) mod occluder;
pub(crate) mod paper;
pub(crate) mod path;
pub(crate) mod settings;
pub(crate) mod shade;
pub(crate) mod sheet;
pub(crate) mod surroundings;
pub(crate) mod table;
pub(crate) mod texture;
pub(crate) mod trajectory;
pub(crate) mod view;
pub mod write;

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use tessuto_core::parallel;

use occluder::{Behind, Occluder};
pub use settings::{Mover, Settings};
pub use sheet::SIZE as SHEET;
pub use surroundings::filmed;
use tessuto_core::camera::{Camera, Pose, Rect, Viewpoint};
use tessuto_core::error::Result;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Mesh, Motion, Positions, Side};
use tessuto_core::scene::{Depths, Known, Scene, Truth};
use tessuto_core::video::{Frame, HELD_BYTES, PIXEL_BYTES, Video};
use tessuto_render::raster::{Rasterizer, Rendering, Texture};
use trajectory::Trajectory;
use view::{Studio, View, exposed};

/// Side of the texture `[texel]`.
const TEXTURE_SIZE: usize = 512;
/// Random stream of the depth sensor's noise in the first frame.
const STREAM_OF_DEPTH: u64 = 20_000;
/// Most shapes that one blurred frame is made of; odd, so that one is at the frame's time.
const MOST_SHAPES: usize = 33;

/// Makes a scene in memory, its truth included. The same settings make the same scene.
///
/// # Errors
/// [`Error::Usage`](tessuto_core::Error::Usage) for settings out of range;
/// [`Error::Numerical`](tessuto_core::Error::Numerical) from the simulation.
pub fn make(settings: &Settings) -> Result<Scene> {
    scene(settings, |view| view.frame)
}

/// As [`make`], but with frames as the camera recorded them: what moves in front of the sheet is in the images
/// outside of the masks, too.
///
/// # Errors
/// Those of [`make`].
pub fn film(settings: &Settings) -> Result<Scene> {
    scene(settings, |View { frame, filmed, .. }| Frame { rgb: filmed.unwrap_or(frame.rgb), mask: frame.mask })
}

fn scene(settings: &Settings, frame_of: impl Fn(View) -> Frame + Send + Sync + 'static) -> Result<Scene> {
    settings.validate()?;
    let trajectory = match settings.mover {
        Mover::Wind | Mover::Hands => gust::simulate(settings)?,
        Mover::Paper => paper::bend(settings),
        Mover::Table => table::simulate(settings)?,
    };
    let planes = if settings.mover == Mover::Table { vec![table::plane(settings)] } else { Vec::new() };
    let camera = settings.camera();
    let mesh = trajectory.mesh.clone();
    let motion = trajectory.frames.clone();
    let template = Mesh { positions: motion[0].clone(), ..mesh };
    let centre = template.positions.iter().sum::<DVec3>() / template.positions.len() as f64;
    let poses = path::poses(settings, centre);
    let mut rasterizer = Rasterizer::new(&template);
    if let Some(colour) = settings.back {
        let first = Viewpoint { camera, camera_from_world: poses.as_ref().map(|poses| poses[0]) };
        rasterizer = rasterizer.two_sided(Side::front(&template, &first), colour);
    }
    let studio = Studio {
        rasterizer,
        camera,
        texture: Texture::from_image(&texture::texture(TEXTURE_SIZE, settings.seed)),
        shading: settings.shading,
        occluders: occluders(settings, &template.positions),
        amodal: settings.amodal,
    };
    let filming = Filming { settings: settings.clone(), trajectory, studio, frame_of };
    let filming = Arc::new(filming);
    let film = |v: usize, poses: Option<Vec<Pose>>| Filming::film(&filming, v, poses);
    let (frames, points, depths) = film(0, poses.clone());
    let more = (1..settings.views).map(|v| {
        let poses = vec![path::beside(settings, v, centre); motion.len()];
        let (frames, _, depths) = film(v, Some(poses.clone()));
        let (full_size, crop) = ([camera.width, camera.height], whole(&camera));
        let (name, late) = (format!("view{v}"), settings.late);
        tessuto_core::scene::View { name, camera, poses, crop, full_size, frames, depths, late }
    });
    Ok(Scene {
        name: format!("synthetic cloth {}", settings.seed),
        folder: PathBuf::new(),
        fps: settings.fps,
        camera,
        crop: whole(&camera),
        poses,
        pose_unit: Default::default(),
        depths,
        more: more.collect(),
        full_size: [camera.width, camera.height],
        first_frame: 0,
        template,
        frames,
        known: Known { planes, ..Known::default() },
        truth: Truth { points: Some(points), vertices: Some(Motion::new(motion)?), tracks: None },
    })
}

fn whole(camera: &Camera) -> Rect {
    Rect { x0: 0, y0: 0, x1: camera.width, y1: camera.height }
}

/// What is filmed, by cameras that are alike.
struct Filming<F> {
    settings: Settings,
    trajectory: Trajectory,
    studio: Studio,
    frame_of: F,
}

/// Frames, and in every one the points of the surface that are seen, and measured depth if there is a sensor.
type Filmed = (Video, Vec<Vec<DVec3>>, Option<Arc<Depths>>);

impl<F: Fn(View) -> Frame + Send + Sync + 'static> Filming<F> {
    /// By camera `v`, whose frames are seen from `poses`.
    fn film(this: &Arc<Self>, v: usize, poses: Option<Vec<Pose>>) -> Filmed {
        let Self { settings, trajectory, studio, .. } = &**this;
        let (camera, count) = (studio.camera, trajectory.frames.len());
        let late = if v == 0 { 0.0 } else { settings.late };
        let all = this.clone();
        let draw = move |rendering: &mut Rendering, n: usize| {
            let Self { settings, trajectory, studio, .. } = &*all;
            let exposure = settings.blur / settings.fps;
            // The camera stands still while its shutter is open.
            let view = Viewpoint { camera, camera_from_world: poses.as_ref().map(|poses| poses[n]) };
            let time = n as f64 / settings.fps + late;
            let own = if late == 0.0 { trajectory.frames[n].clone() } else { trajectory.at(time) };
            let shapes = shapes(trajectory, studio, own, time, exposure, &view);
            exposed(shapes.iter().map(|(time, positions)| studio.view(positions, &view, *time, rendering)))
        };
        let held = count * camera.width * camera.height * PIXEL_BYTES <= HELD_BYTES;
        let sensor = sensor(settings, &camera);
        let views: Vec<_> = parallel::map_with(count, Rendering::new, |rendering, n| {
            let mut view = draw(rendering, n);
            let points = std::mem::take(&mut view.points);
            let depth = noisy(std::mem::take(&mut view.depth), settings, v * count + n);
            (held.then(|| (this.frame_of)(view)), (points, depth))
        });
        let (frames, measured): (Vec<_>, Vec<_>) = views.into_iter().unzip();
        let (points, maps): (Vec<_>, Vec<_>) = measured.into_iter().unzip();
        let depths =
            sensor.map(|camera| Arc::new(Depths { camera, maps, noise: settings.depth_noise, alike: 1.0 }));
        let all = this.clone();
        let again = move |n: usize| Ok((all.frame_of)(draw(&mut Rendering::new(), n)));
        let frames = match held {
            true => frames.into_iter().flatten().collect(),
            false => Video::streamed(count, camera.width * camera.height, again),
        };
        (frames, points, depths)
    }
}

/// The camera in pixels of the depth sensor's maps, if there is one.
fn sensor(settings: &Settings, camera: &Camera) -> Option<Camera> {
    (settings.depth_noise > 0.0).then(|| camera.downsampled(2))
}

/// What the sensor measures in frame `n` of the true `depth`.
fn noisy(mut depth: Vec<f32>, settings: &Settings, n: usize) -> Vec<f32> {
    let mut rng = Rng::new(settings.seed, STREAM_OF_DEPTH + n as u64);
    depth.iter_mut().for_each(|z| *z *= (1.0 + settings.depth_noise * rng.normal()) as f32);
    depth
}

/// What moves in front of the sheet that is at `positions` `[m]` in the first frame.
fn occluders(settings: &Settings, positions: &Positions) -> Vec<Occluder> {
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = (high - low).truncate();
    let behind =
        Behind { centre: 0.5 * (low + high), area: size.element_product(), radius: 0.5 * size.length() };
    (0..settings.occluders).map(|k| Occluder::new(settings.seed, k, behind)).collect()
}

/// Times `[s]` and shapes that a frame at `time`, when the sheet is at `own`, sees while the shutter is open for
/// `exposure` `[s]`: one for
/// each pixel that anything moves by, spread evenly about the frame's own.
fn shapes(
    trajectory: &Trajectory,
    studio: &Studio,
    own: Positions,
    time: f64,
    exposure: f64,
    view: &Viewpoint,
) -> Vec<(f64, Positions)> {
    if exposure == 0.0 {
        return vec![(time, own)];
    }
    let [before, after] = [-0.5, 0.5].map(|s| trajectory.at(time + s * exposure));
    let way = |(k, p): (usize, &DVec3)| {
        let [a, b, c] = [before[k], *p, after[k]].map(|p| view.project(p));
        a.distance(b) + b.distance(c)
    };
    let sheet = own.iter().enumerate().map(way).fold(0.0, f64::max);
    let things = studio.occluders.iter().map(|o| o.way(&studio.camera, time, exposure)).fold(0.0, f64::max);
    let count = (sheet.max(things).ceil() as usize | 1).min(MOST_SHAPES);
    let shape = |k: usize| {
        let at = time + ((k as f64 + 0.5) / count as f64 - 0.5) * exposure;
        if k == count / 2 { (time, own.clone()) } else { (at, trajectory.at(at)) }
    };
    (0..count).map(shape).collect()
}
