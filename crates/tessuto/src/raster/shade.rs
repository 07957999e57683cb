//! Texture colour of each visible pixel, and its adjoint.

use glam::{DVec3, Vec4};

use super::Rendering;
use super::bins::BAND_ROWS;
use super::projected::{Projected, Rays};
use super::texture::Texture;
use super::visibility::Rows;

/// Colours the columns `x0..x1` of `rows` with the texture, background black with mask 0.
pub(super) fn shade(
    rows: &mut Rows,
    [x0, x1]: [usize; 2],
    projected: &[Projected],
    rays: &Rays,
    texture: &Texture,
) {
    for row in 0..rows.count() {
        let y = rays.y[rows.first_row + row];
        let columns = row * rows.width + x0..row * rows.width + x1;
        let mut i = x0;
        // Walk over the runs of pixels that show the same triangle.
        for run in rows.triangle[columns].chunk_by(|a, b| a == b) {
            let end = i + run.len();
            let pixels = row * rows.width + i..row * rows.width + end;
            let rgba = &mut rows.rgba[pixels.clone()];
            if run[0] == Rendering::NO_TRIANGLE {
                rgba.fill([0.0; 4]);
            } else {
                let p = &projected[run[0] as usize];
                let cx = p.texel_x.y * y + p.texel_x.z;
                let cy = p.texel_y.y * y + p.texel_y.z;
                let inverse_depth = &rows.inverse_depth[pixels];
                for ((rgba, &s), &x) in rgba.iter_mut().zip(inverse_depth).zip(&rays.x[i..end]) {
                    let z = 1.0 / s;
                    let color = texture.sample((p.texel_x.x * x + cx) * z, (p.texel_y.x * x + cy) * z);
                    *rgba = color.to_array();
                }
            }
            i = end;
        }
    }
}

/// Sums over pixels of one triangle from which all its gradients follow: rows Σ a r, Σ b r, Σ c r with r = (x, y, 1)
/// the pixel's ray. With L_x, L_y, L_z the loss gradient with respect to texel coordinates and depth,
/// a = L_x z, b = L_y z, c = −(a x_texel + b y_texel) − L_z z², so that dL/db̃_k = a x_k + b y_k + c.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RaySums([DVec3; 3]);

impl RaySums {
    /// Adds the sums of other pixels.
    pub fn add(&mut self, other: &Self) {
        for (sum, o) in self.0.iter_mut().zip(other.0) {
            *sum += o;
        }
    }

    /// Gradients, of the sums of all pixels of triangle `p`, with respect to its corners [1/m] and their
    /// texel coordinates.
    ///
    /// From d b̃ = −M⁻¹ dM b̃: dL/dx_k = −M⁻ᵀ Σ g b̃_k with g_j = dL/db̃_j, where M⁻ᵀ (a x_j + b y_j + c)_j is the same mix of
    /// the planes of x, y and 1.
    pub fn corner_gradients(&self, p: &Projected) -> [(DVec3, [f64; 2]); 3] {
        p.edges.map(|m| {
            let [a, b, c] = self.0.map(|sum| sum.dot(m) * p.inverse_det);
            (-(p.texel_x * a + p.texel_y * b + p.inverse_depth * c), [a, b])
        })
    }
}

/// Image gradients that the adjoint starts from.
#[derive(Clone, Copy)]
pub(super) struct ImageGradients<'a> {
    /// Per pixel and channel.
    pub rgba: &'a [[f32; 4]],
    /// Per pixel, with respect to z [1/m].
    pub depth: Option<&'a [f32]>,
}

/// Sums of triangle `t` over its visible pixels in band `band`, as if there were no antialiasing.
pub(super) fn band_sums(
    rendering: &Rendering,
    texture: &Texture,
    grad: ImageGradients,
    band: usize,
    t: u32,
) -> RaySums {
    let p = &rendering.projected[t as usize];
    let rays = &rendering.rays;
    let mut sums = RaySums::default();
    let first = (band * BAND_ROWS).max(p.rows[0] as usize);
    let end = ((band + 1) * BAND_ROWS).min(p.rows[1] as usize);
    for j in first..end {
        let [i0, i1] = p.span(rays, j);
        let y = rays.y[j];
        let cx = p.texel_x.y * y + p.texel_x.z;
        let cy = p.texel_y.y * y + p.texel_y.z;
        let pixels = j * rendering.width + i0..j * rendering.width + i1;
        let seen = &rendering.triangle[pixels.clone()];
        let inverse_depth = &rendering.inverse_depth[pixels.clone()];
        let grad_rgba = &grad.rgba[pixels.clone()];
        let mut row = [0.0; 3];
        let mut row_x = [0.0; 3];
        for (n, &x) in rays.x[i0..i1].iter().enumerate() {
            if seen[n] != t {
                continue;
            }
            let z = 1.0 / inverse_depth[n];
            let (tx, ty) = ((p.texel_x.x * x + cx) * z, (p.texel_y.x * x + cy) * z);
            let [lx, ly] = texture.sample_vjp(tx, ty, Vec4::from_array(grad_rgba[n]));
            let (a, b) = (lx * z, ly * z);
            let lz = grad.depth.map_or(0.0, |depth| f64::from(depth[pixels.start + n]));
            let abc = [a, b, -(a * tx + b * ty) - lz * z * z];
            for k in 0..3 {
                row[k] += abc[k];
                row_x[k] += abc[k] * x;
            }
        }
        for k in 0..3 {
            sums.0[k] += DVec3::new(row_x[k], row[k] * y, row[k]);
        }
    }
    sums
}

/// Where pixel number `pixel`, which shows triangle `p`, looks into the texture [texel].
#[inline]
pub(super) fn texel_at(rendering: &Rendering, p: &Projected, pixel: usize) -> [f64; 2] {
    let (x, y) = (rendering.rays.x[pixel % rendering.width], rendering.rays.y[pixel / rendering.width]);
    let z = 1.0 / rendering.inverse_depth[pixel];
    [p.texel_x, p.texel_y].map(|plane| (plane.x * x + (plane.y * y + plane.z)) * z)
}

/// Sums of the single pixel number `pixel`, which shows triangle `p`, for the colour gradient `grad`.
pub(super) fn pixel_sums(
    rendering: &Rendering,
    texture: &Texture,
    p: &Projected,
    pixel: usize,
    grad: Vec4,
) -> RaySums {
    let r =
        DVec3::new(rendering.rays.x[pixel % rendering.width], rendering.rays.y[pixel / rendering.width], 1.0);
    let [tx, ty] = texel_at(rendering, p, pixel);
    let [lx, ly] = texture.sample_vjp(tx, ty, grad);
    let z = 1.0 / rendering.inverse_depth[pixel];
    let (a, b) = (lx * z, ly * z);
    RaySums([r * a, r * b, r * -(a * tx + b * ty)])
}

/// Adds the texture gradient of all visible pixels, as if there were no antialiasing.
///
/// One thread does it in row order: neighbouring pixels meet in the same texels, and 180,000 pixels take about 1 ms.
pub(super) fn scatter_texture_vjp(
    rendering: &Rendering,
    texture: &Texture,
    grad_rgba: &[[f32; 4]],
    grads: &mut [[f32; 4]],
) {
    let Some(bounds) = rendering.bins.bounds else { return };
    for j in bounds.y0..bounds.y1 {
        let start = j * rendering.width;
        for pixel in start + bounds.x0..start + bounds.x1 {
            let (t, grad) = (rendering.triangle[pixel], Vec4::from_array(grad_rgba[pixel]));
            if t != Rendering::NO_TRIANGLE {
                let [tx, ty] = texel_at(rendering, &rendering.projected[t as usize], pixel);
                texture.scatter_vjp(tx, ty, grad, grads);
            }
        }
    }
}
