//! Gradients that the adjoint adds to.

use glam::{DVec2, DVec3};

use super::shade::RaySums;
use super::{Rasterizer, Texture};

/// Loss gradients, summed over all adjoint calls since [`clear`](Self::clear).
#[derive(Debug, Clone, Default)]
pub struct Gradients {
    /// With respect to vertex positions [1/m], shape `[V]`.
    pub positions: Vec<DVec3>,
    /// With respect to texels, shape [height, width]; left out if `None`. The fourth channel is that
    /// of the texels' fixed 1.
    pub texture: Option<Vec<[f32; 4]>>,
    /// With respect to the mesh's texture coordinates; left out if `None`.
    pub uvs: Option<Vec<DVec2>>,
    /// Scratch: sums of each band's triangles.
    pub(super) band_sums: Vec<Vec<RaySums>>,
    /// Scratch: sums of each triangle, shape `[T]`.
    pub(super) triangle_sums: Vec<RaySums>,
}

impl Gradients {
    /// Zero gradients of the positions of `rasterizer`'s mesh.
    pub fn new(rasterizer: &Rasterizer) -> Self {
        Self { positions: vec![DVec3::ZERO; rasterizer.vertex_count()], ..Self::default() }
    }

    /// Also of the texels of `texture`.
    pub fn with_texture(mut self, texture: &Texture) -> Self {
        self.texture = Some(vec![[0.0; 4]; texture.texels.len()]);
        self
    }

    /// Also of the texture coordinates of `rasterizer`'s mesh.
    pub fn with_uvs(mut self, rasterizer: &Rasterizer) -> Self {
        self.uvs = Some(vec![DVec2::ZERO; rasterizer.uvs().len()]);
        self
    }

    /// Back to zero.
    pub fn clear(&mut self) {
        self.positions.fill(DVec3::ZERO);
        if let Some(texture) = &mut self.texture {
            texture.fill([0.0; 4]);
        }
        if let Some(uvs) = &mut self.uvs {
            uvs.fill(DVec2::ZERO);
        }
    }
}
