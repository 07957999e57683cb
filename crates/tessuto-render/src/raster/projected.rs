//! One triangle as seen by the camera: homogeneous edge and interpolation planes, and its rows.

use glam::{DVec2, DVec3};

use tessuto_core::camera::Camera;

/// Triangles that reach nearer than this `[m]` to the camera's plane are not drawn: rays through a
/// triangle that crosses the plane z = 0 do not describe it.
pub const NEAR: f64 = 1e-3;

/// Rays through the pixel centres, r = (`x[i]`, `y[j]`, 1).
#[derive(Debug, Clone, Default)]
pub(super) struct Rays {
    /// (i − cx)/fx of every column.
    pub x: Vec<f64>,
    /// (j − cy)/fy of every row.
    pub y: Vec<f64>,
    /// Focal lengths fx and fy `[px]`.
    pub focal: [f64; 2],
}

impl Rays {
    /// Rays of `camera`, into the existing memory.
    pub fn update(&mut self, camera: &Camera) {
        self.focal = [camera.fx, camera.fy];
        self.x.clear();
        self.x.extend((0..camera.width).map(|i| (i as f64 - camera.cx) / camera.fx));
        self.y.clear();
        self.y.extend((0..camera.height).map(|j| (j as f64 - camera.cy) / camera.fy));
    }
}

/// A triangle with corners x_k `[m]`, seen along rays r. With M = (x_0 x_1 x_2), the numbers
/// b̃ = M⁻¹ r are its barycentric coordinates times s = Σ b̃_k = 1/z, and any quantity q that is
/// linear on the surface obeys s q = (Σ q_k rows_k(M⁻¹)) · r: a *plane*.
///
/// Source: Olano and Greer 1997, "Triangle Scan Conversion using 2D Homogeneous Coordinates".
#[derive(Debug, Clone, Copy)]
pub(super) struct Projected {
    /// m_k = ± x_{k+1} × x_{k+2}, the plane through the camera and the edge opposite to corner k,
    /// turned so that m_k · r > 0 inside. Rows of M⁻¹ are m_k/|det M|. The neighbour across an edge
    /// has exactly the opposite plane, bit for bit.
    pub edges: [DVec3; 3],
    /// Whether rays with m_k · r = 0 belong to the triangle.
    pub owns_edge: [bool; 3],
    /// 1/|det M| [1/m³].
    pub inverse_det: f64,
    /// Sign of det M: +1, −1, or 0 for a triangle that is not drawn.
    pub facing: i8,
    /// Whether it is of one colour, without texture.
    pub plain: bool,
    /// Plane of 1, so that inverse_depth · r = 1/z [1/m].
    pub inverse_depth: DVec3,
    /// Plane of the texel coordinate x.
    pub texel_x: DVec3,
    /// Plane of the texel coordinate y.
    pub texel_y: DVec3,
    /// First column, and one past the last, of the bounding box.
    pub columns: [u32; 2],
    /// First row, and one past the last, of the bounding box.
    pub rows: [u32; 2],
    /// −fx/m_k.x: the edge passes row j at column cx + (m_k.y `y[j]` + m_k.z) · this.
    root_scale: [f64; 3],
    /// Principal point, column `[px]`.
    cx: f64,
}

impl Projected {
    /// A triangle that is not drawn.
    const HIDDEN: Self = Self {
        edges: [DVec3::ZERO; 3],
        owns_edge: [false; 3],
        inverse_det: 0.0,
        facing: 0,
        plain: false,
        inverse_depth: DVec3::ZERO,
        texel_x: DVec3::ZERO,
        texel_y: DVec3::ZERO,
        columns: [0; 2],
        rows: [0; 2],
        root_scale: [0.0; 3],
        cx: 0.0,
    };

    /// The triangle with `corners` `[m]` and their texel coordinates `texels`. Not drawn are triangles
    /// seen exactly from the side, those that reach nearer than [`NEAR`] and those with corners that
    /// are not finite.
    pub fn new(camera: &Camera, corners: [DVec3; 3], texels: [DVec2; 3]) -> Self {
        let [x0, x1, x2] = corners;
        // Equal to x0 × x1 + x1 × x2 + x2 × x0, without the cancellation.
        let normal = (x1 - x0).cross(x2 - x0);
        let det = x0.dot(normal);
        let visible = corners.iter().all(|x| x.z > NEAR) && det.abs() > 0.0 && det.is_finite();
        if !visible {
            return Self::HIDDEN;
        }
        let sign = det.signum();
        let edges = [x1.cross(x2) * sign, x2.cross(x0) * sign, x0.cross(x1) * sign];
        let inverse_det = 1.0 / det.abs();
        let pixels = corners.map(|x| camera.project(x));
        let (min, max) = (pixels[0].min(pixels[1]).min(pixels[2]), pixels[0].max(pixels[1]).max(pixels[2]));
        let plane = |q: [f64; 3]| (edges[0] * q[0] + edges[1] * q[1] + edges[2] * q[2]) * inverse_det;
        Self {
            edges,
            owns_edge: edges.map(owns_edge),
            inverse_det,
            facing: sign as i8,
            plain: false,
            inverse_depth: normal * (sign * inverse_det),
            texel_x: plane(texels.map(|t| t.x)),
            texel_y: plane(texels.map(|t| t.y)),
            columns: pixel_range(min.x, max.x, camera.width),
            rows: pixel_range(min.y, max.y, camera.height),
            root_scale: edges.map(|m| -camera.fx / m.x),
            cx: camera.cx,
        }
    }

    /// m_k · r. The order of operations is the same everywhere, so that all passes agree on the sign.
    #[inline]
    pub fn edge_value(&self, k: usize, x: f64, y: f64) -> f64 {
        let m = self.edges[k];
        m.x * x + (m.y * y + m.z)
    }

    /// First column, and one past the last, covered in row `j`.
    ///
    /// In a row, m_k · r as rounded never falls (or never rises) with the column, so each edge covers
    /// a half-line; its end is estimated and then corrected by the test itself. The result is exactly
    /// that of testing every pixel.
    #[inline]
    pub fn span(&self, rays: &Rays, j: usize) -> [usize; 2] {
        let y = rays.y[j];
        let [mut begin, mut end] = self.columns.map(|c| c as usize);
        for k in 0..3 {
            let m = self.edges[k];
            let c = m.y * y + m.z;
            let owns = self.owns_edge[k];
            let inside = |i: usize| {
                let e = m.x * rays.x[i] + c;
                e > 0.0 || (e == 0.0 && owns)
            };
            // `max` and `min` also take care of an estimate that is infinite or no number.
            let root = self.cx + c * self.root_scale[k];
            let mut i = root.ceil().max(begin as f64).min(end as f64) as usize;
            if m.x > 0.0 {
                while i > begin && inside(i - 1) {
                    i -= 1;
                }
                while i < end && !inside(i) {
                    i += 1;
                }
                begin = i;
            } else if m.x < 0.0 {
                while i < end && inside(i) {
                    i += 1;
                }
                while i > begin && !inside(i - 1) {
                    i -= 1;
                }
                end = i;
            } else if !(c > 0.0 || (c == 0.0 && owns)) {
                return [begin, begin];
            }
        }
        [begin, end]
    }
}

/// Exactly one of the planes m and −m owns the rays that lie in it: the answer is that of the ray
/// moved by an infinitesimal step to the right and a still smaller one down.
fn owns_edge(m: DVec3) -> bool {
    m.x > 0.0 || (m.x == 0.0 && (m.y > 0.0 || (m.y == 0.0 && m.z > 0.0)))
}

/// Pixels within [min, max], cut to 0..size. The margin is above the rounding error of a projection and
/// only costs an empty span.
fn pixel_range(min: f64, max: f64, size: usize) -> [u32; 2] {
    const MARGIN: f64 = 1e-6;
    let first = (min - MARGIN).ceil().clamp(0.0, size as f64);
    let end = ((max + MARGIN).floor() + 1.0).clamp(first, size as f64);
    [first as u32, end as u32]
}
