//! Differentiable rasteriser: textured triangle mesh → image with coverage and depth, and back.
//!
//! [`Rasterizer::render`] goes through the steps of the files here, in this order: `projected`
//! (planes of each triangle), `bins` (bands of rows), `visibility` (z-buffer), `shade`
//! (texture), `silhouette` (antialiasing). [`Rasterizer::render_vjp`] goes back. [`mod@reference`]
//! is the same image, written plainly.
//!
//! ```
//! use tessuto_core::glam::DVec2;
//! use tessuto_core::Camera;
//! use tessuto_render::raster::{Gradients, Rasterizer, Rendering, Texture};
//!
//! let mesh = tessuto_core::mesh::grid(4, 4, DVec2::splat(0.2), 1.0);
//! let camera = Camera { fx: 100.0, fy: 100.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
//! let texture = Texture::uniform(8, 8, [0.8, 0.4, 0.2]);
//! let rasterizer = Rasterizer::new(&mesh);
//! let mut rendering = Rendering::new();
//! rasterizer.render(&camera, &mesh.positions, &texture, &mut rendering);
//! let coverage = |r: &Rendering| r.rgba.iter().map(|c| c[3]).sum::<f32>();
//! assert!((coverage(&rendering) - 400.0).abs() < 1.0, "20×20 pixels");
//!
//! // The covered area grows where border vertices move outwards, and where the mesh comes nearer.
//! let mut gradients = Gradients::new(&rasterizer);
//! let grad_rgba = vec![[0.0, 0.0, 0.0, 1.0]; 32 * 32];
//! rasterizer.render_vjp(&camera, &mesh.positions, &texture, &rendering, &grad_rgba, None, &mut gradients);
//! assert!(gradients.positions[3].x > 0.0 && gradients.positions[0].x < 0.0);
//! assert!(gradients.positions.iter().map(|g| g.z).sum::<f64>() < 0.0);
//! ```
//!
//! Geometry is computed in f64, colours in f32. Results are the same, bit for bit, for any number of
//! threads.

use glam::{DVec2, DVec3, Vec4};
use rayon::prelude::*;

use tessuto_core::camera::{Camera, Rect, Viewpoint};
use tessuto_core::mesh::{Mesh, Side};
use tessuto_core::scene::Back;

mod adjacency;
mod bins;
mod blend;
#[doc(hidden)]
pub mod coverage;
mod gradients;
mod projected;
pub mod reference;
mod rendering;
mod shade;
mod silhouette;
mod texture;
mod visibility;

use adjacency::{Across, adjacency};
use bins::BAND_ROWS;
use projected::Projected;
use shade::{ImageGradients, RaySums};
use visibility::Rows;

pub use gradients::Gradients;
pub use projected::NEAR;
pub use rendering::Rendering;
pub use texture::Texture;

/// Draws one mesh in any pose: everything that does not depend on vertex positions.
#[derive(Debug, Clone)]
pub struct Rasterizer {
    triangles: Vec<[u32; 3]>,
    triangle_uvs: Vec<[u32; 3]>,
    uvs: Vec<DVec2>,
    vertex_count: usize,
    one_sided: bool,
    /// The side that shows the texture, and the colour of the other; `None`: both show the texture.
    back: Option<(Side, [f32; 3])>,
    /// Across the edge opposite to each corner, shape [T, 3].
    across: Vec<[Across; 3]>,
}

impl Rasterizer {
    /// The rasteriser of `mesh`'s triangles; its positions are not used.
    pub fn new(mesh: &Mesh) -> Self {
        let triangles = mesh.triangles();
        Self {
            across: adjacency(&triangles),
            triangles,
            triangle_uvs: mesh.triangle_uvs(),
            uvs: mesh.uvs.clone(),
            vertex_count: mesh.positions.len(),
            one_sided: false,
            back: None,
        }
    }

    /// That of a fabric whose other side is `back`, drawn in its colour where that is known. `first` is how the first
    /// frame sees `mesh`.
    pub fn of_fabric(mesh: &Mesh, first: &Viewpoint, back: Back) -> Self {
        let same = Self::new(mesh);
        match back {
            Back::Plain(Some(colour)) => same.two_sided(Side::front(mesh, first), colour),
            Back::Same | Back::Plain(None) | Back::Other => same,
        }
    }

    /// Whether antialiasing leaves the background as it is: pixels whose centre is not covered stay black with
    /// mask 0, and the half of the outline's gradient that comes from them is missing.
    #[must_use]
    pub fn one_sided(mut self, one_sided: bool) -> Self {
        self.one_sided = one_sided;
        self
    }

    /// Triangles that show the side other than `front` are filled with `colour` in place of the texture.
    #[must_use]
    pub fn two_sided(mut self, front: Side, colour: [f32; 3]) -> Self {
        self.back = Some((front, colour));
        self
    }

    /// Vertex indices of each triangle, shape `[T]`.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Indices into [`uvs`](Self::uvs) of each triangle, shape `[T]`.
    pub fn triangle_uvs(&self) -> &[[u32; 3]] {
        &self.triangle_uvs
    }

    /// Texture coordinates.
    pub fn uvs(&self) -> &[DVec2] {
        &self.uvs
    }

    /// Number V of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Texture coordinates, to be moved along their gradients.
    pub fn uvs_mut(&mut self) -> &mut [DVec2] {
        &mut self.uvs
    }

    /// Draws the mesh with vertices at `positions` `[m]` (shape `[V]`) as `view` sees it, textured and
    /// antialiased, over black. A [`Camera`] sees from the origin.
    pub fn render(
        &self,
        view: impl Into<Viewpoint>,
        positions: &[DVec3],
        texture: &Texture,
        out: &mut Rendering,
    ) {
        assert_eq!(positions.len(), self.vertex_count, "as many positions as the mesh has vertices");
        let view = view.into();
        let (camera, positions) = (&view.camera, &view.all_in_camera(positions));
        out.resize(camera.width, camera.height);
        if camera.width == 0 || camera.height == 0 {
            return;
        }
        self.project(camera, positions, texture, out);
        out.bins.update(&out.projected, camera.height);
        silhouette::join_triangles(&self.across, out);
        draw_bands(texture, self.back.map_or([0.0; 3], |(_, colour)| colour), out);
        self.antialias(out);
    }

    /// Adjoint of [`render`](Self::render): adds the gradients of a loss to `grads`.
    ///
    /// - `view`, `positions`, `texture`: as given to `render`;  `rendering`: as it returned
    /// - `grad_rgba`: loss gradient of every pixel and channel, shape [height, width]
    /// - `grad_depth`: loss gradient of every pixel's depth z [1/m], shape [height, width]; ignored
    ///   where there is no triangle
    ///
    /// Depth has no antialiasing, so its gradient does not move silhouettes.
    #[expect(clippy::too_many_arguments, reason = "the forward arguments, then the gradients")]
    pub fn render_vjp(
        &self,
        view: impl Into<Viewpoint>,
        positions: &[DVec3],
        texture: &Texture,
        rendering: &Rendering,
        grad_rgba: &[[f32; 4]],
        grad_depth: Option<&[f32]>,
        grads: &mut Gradients,
    ) {
        let view = view.into();
        let (camera, positions) = (&view.camera, &view.all_in_camera(positions));
        let pixels = camera.width * camera.height;
        assert_eq!(
            [rendering.width, rendering.height],
            [camera.width, camera.height],
            "the camera that rendered"
        );
        assert_eq!(
            [texture.width, texture.height],
            rendering.texture_size,
            "a texture of the size that was rendered"
        );
        assert_eq!(grad_rgba.len(), pixels, "one colour gradient per pixel");
        assert!(grad_depth.is_none_or(|g| g.len() == pixels), "one depth gradient per pixel");
        assert_eq!(grads.positions.len(), self.vertex_count, "as many gradients as the mesh has vertices");
        let image = ImageGradients { rgba: grad_rgba, depth: grad_depth };
        let Gradients { texture: texels, band_sums, triangle_sums, .. } = grads;
        rayon::join(
            || sum_bands(texture, rendering, image, band_sums, triangle_sums),
            || {
                if let Some(texels) = texels {
                    shade::scatter_texture_vjp(rendering, texture, grad_rgba, texels);
                }
            },
        );
        // Gradients by positions in the camera's frame are turned into those in the world before they are added to
        // what was there.
        let moved = view.camera_from_world.is_some();
        let before =
            moved.then(|| std::mem::replace(&mut grads.positions, vec![DVec3::ZERO; self.vertex_count]));
        blends_vjp(positions, texture, rendering, grad_rgba, grads);
        self.gather_corners(rendering, grads);
        for (grad, before) in grads.positions.iter_mut().zip(before.iter().flatten()) {
            *grad = *before + view.turned_to_world(*grad);
        }
    }

    fn project(&self, camera: &Camera, positions: &[DVec3], texture: &Texture, out: &mut Rendering) {
        out.rays.update(camera);
        out.texture_size = [texture.width, texture.height];
        let turned = self.back.map(|(front, _)| front.other().sign());
        self.triangles
            .par_iter()
            .zip(&self.triangle_uvs)
            .with_min_len(256)
            .map(|(corners, uvs)| {
                let corners = corners.map(|v| positions[v as usize]);
                let texels = uvs.map(|u| texture.texel_position(self.uvs[u as usize]));
                let mut p = Projected::new(camera, corners, texels);
                p.plain = turned == Some(p.facing);
                p
            })
            .collect_into_vec(&mut out.projected);
    }

    fn antialias(&self, out: &mut Rendering) {
        let mut blends = std::mem::take(&mut out.blends);
        blends.resize_with(out.height.div_ceil(BAND_ROWS), Vec::new);
        blends.par_iter_mut().enumerate().for_each(|(band, blends)| {
            blends.clear();
            silhouette::find_blends(self, out, band, blends);
        });
        out.blends = blends;
        silhouette::apply_blends(out);
    }

    /// Turns the sums of each triangle into gradients of its corners.
    fn gather_corners(&self, rendering: &Rendering, grads: &mut Gradients) {
        let [width, height] = rendering.texture_size.map(|n| n as f64);
        for (t, sums) in grads.triangle_sums.iter().enumerate() {
            let p = &rendering.projected[t];
            if p.facing == 0 {
                continue;
            }
            for (k, (position, [x, y])) in sums.corner_gradients(p).into_iter().enumerate() {
                grads.positions[self.triangles[t][k] as usize] += position;
                if let Some(uvs) = &mut grads.uvs {
                    uvs[self.triangle_uvs[t][k] as usize] += DVec2::new(x * width, -y * height);
                }
            }
        }
    }
}

/// Draws and shades all bands of the region that is, or was before, not background.
fn draw_bands(texture: &Texture, back: [f32; 3], out: &mut Rendering) {
    let grown = out.bins.bounds.map(|b| Rect {
        // Antialiasing reaches one pixel further than the triangles.
        x0: b.x0.saturating_sub(1),
        y0: b.y0.saturating_sub(1),
        x1: (b.x1 + 1).min(out.width),
        y1: (b.y1 + 1).min(out.height),
    });
    let region = match (out.drawn, grown) {
        (Some(a), Some(b)) => a.union(b),
        (Some(a), None) | (None, Some(a)) => a,
        (None, None) => return,
    };
    out.drawn = grown;
    let (width, columns) = (out.width, [region.x0, region.x1]);
    let (projected, rays, bins) = (&out.projected, &out.rays, &out.bins);
    let band_pixels = BAND_ROWS * width;
    out.triangle
        .par_chunks_mut(band_pixels)
        .zip(out.inverse_depth.par_chunks_mut(band_pixels))
        .zip(out.rgba.par_chunks_mut(band_pixels))
        .enumerate()
        .for_each(|(band, ((triangle, inverse_depth), rgba))| {
            let first_row = band * BAND_ROWS;
            if first_row + BAND_ROWS <= region.y0 || first_row >= region.y1 {
                return;
            }
            let mut rows = Rows { first_row, width, triangle, inverse_depth, rgba };
            visibility::draw(&mut rows, columns, bins.band(band), projected, rays);
            shade::shade(&mut rows, columns, projected, rays, (texture, back));
        });
}

/// Sums over each triangle's pixels, by bands in parallel, then over the bands in their order.
fn sum_bands(
    texture: &Texture,
    rendering: &Rendering,
    image: ImageGradients,
    band_sums: &mut Vec<Vec<RaySums>>,
    triangle_sums: &mut Vec<RaySums>,
) {
    let triangle_count = rendering.projected.len();
    band_sums.resize_with(rendering.height.div_ceil(BAND_ROWS), Vec::new);
    band_sums.par_iter_mut().enumerate().for_each_init(
        || vec![0; triangle_count],
        |slots, (band, sums)| shade::band_sums(rendering, texture, image, band, slots, sums),
    );
    triangle_sums.clear();
    triangle_sums.resize(triangle_count, RaySums::default());
    for (band, sums) in band_sums.iter().enumerate() {
        for (&t, sum) in rendering.bins.band(band).iter().zip(sums) {
            triangle_sums[t as usize].add(sum);
        }
    }
}

/// Adds what the antialiasing changes: gradients of the silhouette edges, and the part of each
/// receiver's gradient that belongs to its partner's colour.
fn blends_vjp(
    positions: &[DVec3],
    texture: &Texture,
    rendering: &Rendering,
    grad_rgba: &[[f32; 4]],
    grads: &mut Gradients,
) {
    for blend in rendering.blends.iter().flatten() {
        let grad = Vec4::from_array(grad_rgba[blend.receiver as usize]);
        for (v, g) in blend.edge.iter().zip(blend.edge_gradients(positions, grad)) {
            grads.positions[*v as usize] += g;
        }
        let moved = grad * blend.weight;
        for (pixel, grad) in [(blend.receiver, -moved), (blend.partner, moved)] {
            let pixel = pixel as usize;
            let t = rendering.triangle[pixel];
            if t == Rendering::NO_TRIANGLE {
                continue;
            }
            let p = &rendering.projected[t as usize];
            if p.plain {
                continue;
            }
            grads.triangle_sums[t as usize].add(&shade::pixel_sums(rendering, texture, p, pixel, grad));
            if let Some(texels) = &mut grads.texture {
                let [x, y] = shade::texel_at(rendering, p, pixel);
                texture.scatter_vjp(x, y, grad, texels);
            }
        }
    }
}
