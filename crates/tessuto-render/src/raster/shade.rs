//! Texture colour of each visible pixel, and its adjoint.

use glam::{DVec3, Vec4};

use super::Rendering;
use super::bins::BAND_ROWS;
use super::projected::{Projected, Rays};
use super::texture::Texture;
use super::visibility::Rows;

/// Colours the columns `x0..x1` of `rows` with the texture, plain triangles with `back`, background black with mask 0.
pub(super) fn shade(
    rows: &mut Rows,
    [x0, x1]: [usize; 2],
    projected: &[Projected],
    rays: &Rays,
    (texture, [r, g, b]): (&Texture, [f32; 3]),
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
            } else if projected[run[0] as usize].plain {
                rgba.fill([r, g, b, 1.0]);
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

/// Sums over pixels of one triangle from which all its gradients follow: rows Σ a r, Σ b r, Σ c r with
/// r = (x, y, 1) the pixel's ray. With L_x, L_y, L_z the loss gradient with respect to texel
/// coordinates and depth, a = L_x z, b = L_y z, c = −(a x_texel + b y_texel) − L_z z², so that
/// dL/db̃_k = a x_k + b y_k + c.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RaySums([DVec3; 3]);

impl RaySums {
    /// Adds the sums of other pixels.
    pub fn add(&mut self, other: &Self) {
        for (sum, o) in self.0.iter_mut().zip(other.0) {
            *sum += o;
        }
    }

    /// Gradients, of the sums of all pixels of triangle `p`, with respect to its corners [1/m] and
    /// their texel coordinates.
    ///
    /// From d b̃ = −M⁻¹ dM b̃: dL/dx_k = −M⁻ᵀ Σ g b̃_k with g_j = dL/db̃_j, where M⁻ᵀ (a x_j + b y_j +
    /// c)_j is the same mix of the planes of x, y and 1.
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

/// Sums of each triangle of band `band`, over its visible pixels there and as if there were no
/// antialiasing, into `sums`, in the order of the band's bin. `slots` is scratch, shape `[T]`.
pub(super) fn band_sums(
    rendering: &Rendering,
    texture: &Texture,
    grad: ImageGradients,
    band: usize,
    slots: &mut [u32],
    sums: &mut Vec<RaySums>,
) {
    let visible = rendering.bins.band(band);
    sums.clear();
    sums.resize(visible.len(), RaySums::default());
    let Some(bounds) = rendering.bins.bounds else { return };
    for (slot, &t) in visible.iter().enumerate() {
        slots[t as usize] = slot as u32;
    }
    for j in (band * BAND_ROWS).max(bounds.y0)..((band + 1) * BAND_ROWS).min(bounds.y1) {
        let mut i = bounds.x0;
        let row = j * rendering.width;
        for run in rendering.triangle[row + bounds.x0..row + bounds.x1].chunk_by(|a, b| a == b) {
            let t = run[0] as usize;
            if run[0] != Rendering::NO_TRIANGLE {
                let run_sums = run_sums(rendering, texture, grad, t, [i, j], run.len());
                sums[slots[t] as usize].add(&run_sums);
            }
            i += run.len();
        }
    }
}

/// Sums over the `count` pixels from column `i` of row `j`, which show triangle `t`.
#[inline]
fn run_sums(
    rendering: &Rendering,
    texture: &Texture,
    grad: ImageGradients,
    t: usize,
    [i, j]: [usize; 2],
    count: usize,
) -> RaySums {
    let p = &rendering.projected[t];
    let y = rendering.rays.y[j];
    let cx = p.texel_x.y * y + p.texel_x.z;
    let cy = p.texel_y.y * y + p.texel_y.z;
    let pixels = j * rendering.width + i..j * rendering.width + i + count;
    let (mut sum_a, mut sum_b, mut sum_c) = (0.0, 0.0, 0.0);
    let (mut sum_ax, mut sum_bx, mut sum_cx) = (0.0, 0.0, 0.0);
    let columns = rendering.rays.x[i..i + count].iter();
    let inverse_depth = &rendering.inverse_depth[pixels.clone()];
    for (n, ((&x, &s), &grad_rgba)) in columns.zip(inverse_depth).zip(&grad.rgba[pixels.clone()]).enumerate()
    {
        let z = 1.0 / s;
        let (tx, ty) = ((p.texel_x.x * x + cx) * z, (p.texel_y.x * x + cy) * z);
        let [lx, ly] = match p.plain {
            true => [0.0; 2],
            false => texture.sample_vjp(tx, ty, Vec4::from_array(grad_rgba)),
        };
        let (a, b) = (lx * z, ly * z);
        let lz = grad.depth.map_or(0.0, |depth| f64::from(depth[pixels.start + n]));
        let c = -(a * tx + b * ty) - lz * z * z;
        sum_a += a;
        sum_b += b;
        sum_c += c;
        sum_ax += a * x;
        sum_bx += b * x;
        sum_cx += c * x;
    }
    RaySums([
        DVec3::new(sum_ax, sum_a * y, sum_a),
        DVec3::new(sum_bx, sum_b * y, sum_b),
        DVec3::new(sum_cx, sum_c * y, sum_c),
    ])
}

/// Where pixel number `pixel`, which shows triangle `p`, looks into the texture `[texel]`.
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
/// One thread does it in row order: neighbouring pixels meet in the same texels, and 180,000 pixels
/// take 2 to 3 ms.
pub(super) fn scatter_texture_vjp(
    rendering: &Rendering,
    texture: &Texture,
    grad_rgba: &[[f32; 4]],
    grads: &mut [[f32; 4]],
) {
    let Some(bounds) = rendering.bins.bounds else { return };
    for j in bounds.y0..bounds.y1 {
        let row = j * rendering.width + bounds.x0..j * rendering.width + bounds.x1;
        for (pixel, &grad) in row.clone().zip(&grad_rgba[row]) {
            let t = rendering.triangle[pixel];
            if t != Rendering::NO_TRIANGLE && !rendering.projected[t as usize].plain {
                let [tx, ty] = texel_at(rendering, &rendering.projected[t as usize], pixel);
                texture.scatter_vjp(tx, ty, Vec4::from_array(grad), grads);
            }
        }
    }
}
