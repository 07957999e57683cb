//! Small scenes and a finite difference for the rasteriser's tests.

use glam::{DVec2, DVec3};
use tessuto::Camera;
use tessuto::math::rng::Rng;
use tessuto::mesh::{Mesh, Side, grid};
use tessuto::raster::reference::PlainTexture;
use tessuto::raster::{Rasterizer, Texture};

pub const CAMERA: Camera = Camera { fx: 130.0, fy: 120.0, cx: 47.3, cy: 38.6, width: 96, height: 80 };

/// A mesh in a pose, with a texture.
pub struct Scene {
    pub rasterizer: Rasterizer,
    pub positions: Vec<DVec3>,
    pub texture: Texture,
}

impl Scene {
    /// A cloth of 9×8 vertices that covers most of the image. Vertices are moved by up to `crumple`
    /// [m], which folds it over and over where that is more than the 5 cm between them.
    pub fn cloth(seed: u64, crumple: f64, texture: Texture) -> Self {
        let mut rng = Rng::new(seed, 0);
        let mut mesh = grid(9, 8, DVec2::new(0.45, 0.35), 1.0);
        for p in &mut mesh.positions {
            *p += rng.vector() * crumple;
        }
        // Keep away from the outer half texel, where the lookup is clamped and has a kink.
        for uv in &mut mesh.uvs {
            *uv = DVec2::splat(0.1) + *uv * 0.8;
        }
        Self { rasterizer: Rasterizer::new(&mesh), positions: mesh.positions, texture }
    }

    /// The same cloth with one `colour` on its other side.
    pub fn two_sided(mut self, colour: [f32; 3]) -> Self {
        let flat = grid(9, 8, DVec2::new(0.45, 0.35), 1.0);
        self.rasterizer = self.rasterizer.two_sided(Side::front(&flat, &CAMERA.into()), colour);
        self
    }

    /// A flat rectangle with half sides `half` [m] around `centre` [m], 1 m away and turned by `angle`
    /// [rad] in the image.
    #[allow(dead_code)]
    pub fn rectangle(angle: f64, half: DVec2, centre: DVec2) -> Self {
        let mut mesh: Mesh = grid(2, 2, half * 2.0, 1.0);
        for p in &mut mesh.positions {
            *p = (centre + DVec2::from_angle(angle).rotate(p.truncate())).extend(1.0);
        }
        let texture = Texture::uniform(2, 2, [0.5; 3]);
        Self { rasterizer: Rasterizer::new(&mesh), positions: mesh.positions, texture }
    }
}

/// Colours that grow linearly with the texel; exact in f32, so that the lookup has no kinks at texel
/// borders.
#[allow(dead_code)]
pub fn ramp() -> Texture {
    let mut texture = Texture::uniform(32, 16, [0.0; 3]);
    for (i, texel) in texture.texels.iter_mut().enumerate() {
        let (x, y) = ((i % 32) as f32 / 32.0, (i / 32) as f32 / 16.0);
        *texel = [x, y, 0.5 + 0.25 * x - 0.5 * y, 1.0];
    }
    texture
}

/// Independent random colours.
pub fn noise(seed: u64) -> Texture {
    let mut rng = Rng::new(seed, 1);
    let mut texture = Texture::uniform(24, 31, [0.0; 3]);
    for texel in &mut texture.texels {
        *texel = [rng.uniform() as f32, rng.uniform() as f32, rng.uniform() as f32, 1.0];
    }
    texture
}

pub fn plain(texture: &Texture) -> PlainTexture {
    let texels = texture.texels.iter().map(|t| t.map(f64::from)).collect();
    PlainTexture { width: texture.width, height: texture.height, texels }
}
