//! Synthetic scenes: a textured cloth in a gust of wind, simulated, rendered and written as a scene
//! folder with complete truth.

pub(crate) mod gust;
pub mod lattice;
pub(crate) mod shade;
pub(crate) mod texture;
pub mod write;

use std::path::PathBuf;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::camera::{Camera, Rect};
use crate::error::{Error, Result};
use crate::mesh::{Mesh, Motion, Positions};
use crate::raster::{Rasterizer, Rendering, Texture};
use crate::scene::{Scene, Truth};
use crate::video::{Frame, HELD_BYTES, PIXEL_BYTES, Video};
use lattice::MeshKind;

/// Side of the texture `[texel]`.
const TEXTURE_SIZE: usize = 512;
/// Images are drawn this much larger and averaged, so that fine texture does not alias.
const OVERSAMPLING: usize = 2;
/// Points that the made-up depth sensor sees in each frame.
const POINT_COUNT: usize = 4000;

/// What to make.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Frames N, at least 2.
    pub frames: usize,
    /// Frames per second.
    pub fps: f64,
    /// Width and height of the images `[px]`.
    pub size: usize,
    /// Columns and rows of vertices.
    pub grid: [usize; 2],
    /// How it is divided into faces.
    pub mesh: MeshKind,
    /// Strength of the gust: largest acceleration it gives the cloth [m/s²].
    pub wind: f64,
    /// Stretch stiffness [N/m].
    pub stretch: f64,
    /// Bend stiffness [J/rad²].
    pub bend: f64,
    /// Shear stiffness [J/rad²].
    pub shear: f64,
    /// How much darker the cloth is where it turns away from the light, in [0, 1].
    pub shading: f64,
    /// Seed of texture, wind and mesh.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            frames: 24,
            fps: 50.0,
            size: 320,
            grid: [21, 21],
            mesh: MeshKind::Quads,
            wind: 9.0,
            stretch: 200.0,
            bend: 1e-3,
            shear: 5e-4,
            shading: 0.4,
            seed: 0,
        }
    }
}

impl Settings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let checks = [
            ("frames", self.frames as f64, 2.0, 10_000.0),
            ("fps", self.fps, 1.0, 10_000.0),
            ("size", self.size as f64, 32.0, 4096.0),
            ("grid columns", self.grid[0] as f64, 3.0, 200.0),
            ("grid rows", self.grid[1] as f64, 3.0, 200.0),
            ("wind", self.wind, 0.0, 100.0),
            ("stretch", self.stretch, 1.0, 1e5),
            ("bend", self.bend, 1e-7, 1.0),
            ("shear", self.shear, 1e-7, 1.0),
            ("shading", self.shading, 0.0, 1.0),
        ];
        for (name, value, low, high) in checks {
            if !(low..=high).contains(&value) {
                let hint = format!("it must lie between {low} and {high}");
                return Err(Error::usage(format!("{name} = {value}"), hint));
            }
        }
        Ok(())
    }

    /// A square image with a horizontal field of view of about 44°.
    fn camera(&self) -> Camera {
        let (f, c) = (1.25 * self.size as f64, (self.size as f64 - 1.0) / 2.0);
        Camera { fx: f, fy: f, cx: c, cy: c, width: self.size, height: self.size }
    }
}

/// Makes a scene in memory, its truth included. The same settings make the same scene.
///
/// # Errors
/// [`Error::Usage`] for settings out of range; [`Error::Numerical`] from the simulation.
pub fn make(settings: &Settings) -> Result<Scene> {
    settings.validate()?;
    let (mesh, motion) = gust::simulate(settings)?;
    let texture = Texture::from_image(&texture::texture(TEXTURE_SIZE, settings.seed));
    let camera = settings.camera();
    let rasterizer = Rasterizer::new(&mesh);
    let template = Mesh { positions: motion[0].clone(), ..mesh };
    let (moving, shading) = (motion.clone(), settings.shading);
    let draw = move |rendering: &mut Rendering, n: usize| {
        view(&rasterizer, &camera, &texture, shading, &moving[n], rendering)
    };
    let held = motion.len() * camera.width * camera.height * PIXEL_BYTES <= HELD_BYTES;
    let views: Vec<(Option<Frame>, Vec<DVec3>)> = (0..motion.len())
        .into_par_iter()
        .map_init(Rendering::new, |rendering, n| {
            let (frame, points) = draw(rendering, n);
            (held.then_some(frame), points)
        })
        .collect();
    let (frames, points): (Vec<_>, _) = views.into_iter().unzip();
    let again = move |n: usize| Ok(draw(&mut Rendering::new(), n).0);
    let frames = match held {
        true => frames.into_iter().flatten().collect(),
        false => Video::streamed(motion.len(), camera.width * camera.height, again),
    };
    Ok(Scene {
        name: format!("synthetic cloth {}", settings.seed),
        folder: PathBuf::new(),
        fps: settings.fps,
        camera,
        crop: Rect { x0: 0, y0: 0, x1: camera.width, y1: camera.height },
        full_size: [camera.width, camera.height],
        first_frame: 0,
        template,
        frames,
        truth: Truth { points: Some(points), vertices: Some(Motion::new(motion)?) },
    })
}

/// Image and depth measurements of one shape.
fn view(
    rasterizer: &Rasterizer,
    camera: &Camera,
    texture: &Texture,
    shading: f64,
    positions: &Positions,
    rendering: &mut Rendering,
) -> (Frame, Vec<DVec3>) {
    let large = enlarged(camera);
    rasterizer.render(&large, positions, texture, rendering);
    let [rgb, mask] = shade::shaded(rasterizer, &large, positions, shading, rendering);
    let frame = Frame { rgb: rgb.downsampled(OVERSAMPLING), mask: mask.downsampled(OVERSAMPLING) };
    (frame, seen_points(&large, rendering))
}

/// The camera whose image, averaged over blocks, is that of `camera`.
fn enlarged(camera: &Camera) -> Camera {
    let s = OVERSAMPLING as f64;
    let centre = |c: f64| s * c + (s - 1.0) / 2.0;
    Camera {
        fx: s * camera.fx,
        fy: s * camera.fy,
        cx: centre(camera.cx),
        cy: centre(camera.cy),
        width: OVERSAMPLING * camera.width,
        height: OVERSAMPLING * camera.height,
    }
}

/// Surface points `[m]` on a regular grid of pixels, as a depth sensor at the camera would see them.
fn seen_points(camera: &Camera, rendering: &Rendering) -> Vec<DVec3> {
    let covered = rendering.inverse_depth.iter().filter(|d| **d > 0.0).count();
    let spacing = (covered as f64 / POINT_COUNT as f64).sqrt().max(1.0);
    let chosen = |length: usize| {
        let count = (length as f64 / spacing) as usize;
        (0..count).map(move |k| ((k as f64 + 0.5) * spacing) as usize)
    };
    let mut points = Vec::with_capacity(POINT_COUNT);
    for y in chosen(rendering.height) {
        for x in chosen(rendering.width) {
            if let Some(depth) = rendering.depth(x, y) {
                points.push(camera.ray(DVec2::new(x as f64, y as f64)) * depth);
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_makes_the_same_scene_and_the_cloth_moves_in_view() {
        let settings = Settings { frames: 4, size: 64, grid: [7, 7], ..Settings::default() };
        let (a, b) = (make(&settings).unwrap(), make(&settings).unwrap());
        let colours = |scene: &Scene, n| scene.frames.frame(n).unwrap().into_owned().rgb;
        assert_eq!(colours(&a, 3), colours(&b, 3));
        assert_eq!(a.truth.vertices, b.truth.vertices);
        let other = make(&Settings { seed: 1, ..settings }).unwrap();
        assert_ne!(colours(&a, 0), colours(&other, 0));
        let vertices = a.truth.vertices.unwrap();
        assert!(vertices[3].iter().zip(&vertices[0]).any(|(p, q)| p.distance(*q) > 1e-3));
        for p in vertices.iter().flatten() {
            let pixel = a.camera.project(*p);
            assert!(pixel.min_element() > 0.0 && pixel.max_element() < 63.0, "{pixel}");
        }
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let error = Settings { frames: 1, ..Settings::default() }.validate().unwrap_err();
        assert!(error.to_string().contains("frames = 1"));
    }
}
