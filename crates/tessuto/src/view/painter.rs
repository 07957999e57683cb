//! Draws frame after frame in one look.

use crate::camera::Camera;
use crate::image::Image;
use crate::mesh::{Mesh, Positions};
use crate::pbr::{EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame};
use crate::raster::{Rasterizer, Texture};

use super::looks::{depth_range, draw_depth, draw_shaded, draw_texture};

/// Fraction of the light samples that are drawn uniformly from all directions.
const UNIFORM_FRACTION: f64 = 0.05;

/// What to draw.
pub enum Drawing {
    /// A material under a light, made by [`material`](Self::material).
    Material(Box<Lit>),
    /// The texture as seen in the first frame.
    Texture(Texture),
    /// Plain grey, lit from the camera.
    Shaded,
    /// Depth as a colour.
    Depth,
}

/// See [`Drawing::Material`].
pub struct Lit {
    material: Material,
    light: EnvironmentSampler,
    passes: usize,
}

impl Drawing {
    /// A material under the light of `environment`, with so many `samples` per pixel, rounded up to a multiple of 8.
    pub fn material(material: Material, environment: &EnvironmentMap, samples: usize) -> Self {
        let light = EnvironmentSampler::new(environment, UNIFORM_FRACTION);
        Self::Material(Box::new(Lit { material, light, passes: samples.div_ceil(8) }))
    }
}

/// A [`Drawing`] with what it needs of the motion. Only looks with a light need normals and shadows.
enum Prepared {
    Material(Box<Lit>, Geometry),
    Texture(Texture),
    Shaded(Geometry),
    Depth([f64; 2]),
}

/// See the module.
pub struct Painter<'a> {
    motion: &'a [Positions],
    rasterizer: Rasterizer,
    camera: Camera,
    drawing: Prepared,
}

impl<'a> Painter<'a> {
    /// Draws the frames of `motion`, shape [N, V], in the axes of `camera`.
    pub fn new(mesh: &Mesh, motion: &'a [Positions], camera: Camera, drawing: Drawing) -> Self {
        let drawing = match drawing {
            Drawing::Material(lit) => Prepared::Material(lit, Geometry::new(mesh, motion)),
            Drawing::Texture(texture) => Prepared::Texture(texture),
            Drawing::Shaded => Prepared::Shaded(Geometry::new(mesh, motion)),
            Drawing::Depth => Prepared::Depth(depth_range(motion)),
        };
        Self { motion, rasterizer: Rasterizer::new(mesh), camera, drawing }
    }

    /// Depths `[m]` of the darkest and the brightest colour, where depth is drawn.
    pub fn depths(&self) -> Option<[f64; 2]> {
        if let Prepared::Depth(range) = self.drawing { Some(range) } else { None }
    }

    /// Frame `n`: sRGB on black.
    pub fn draw(&self, n: usize) -> Image {
        let Self { rasterizer, camera, .. } = self;
        let positions = &self.motion[n];
        match &self.drawing {
            Prepared::Material(lit, geometry) => {
                let Lit { material, light, passes } = &**lit;
                let scene = RenderScene { rasterizer, geometry, material, light };
                render_frame(&scene, camera, (n, positions), *passes)
            }
            Prepared::Texture(texture) => draw_texture(rasterizer, camera, positions, texture),
            Prepared::Shaded(geometry) => draw_shaded(rasterizer, camera, geometry, (n, positions)),
            Prepared::Depth(range) => draw_depth(rasterizer, camera, positions, *range),
        }
    }
}
