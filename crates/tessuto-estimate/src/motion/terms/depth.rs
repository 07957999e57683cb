//! Surface points against measured depth:
//!
//!   E = Σ_p k a_p s_p ρ((z_p − m(π(x_p)))/(σ m); τ),
//!
//! with a point's depth z along the camera's axis, the map m, linear between its pixels, the noise σ of one of these
//! as a fraction, the area a_p that p stands for in the first frame, the part s_p of it that its triangle still
//! fills, the number k of independent pixels of the map in one of a_p times what such a pixel counts as, and Geman
//! and McClure's ρ of tail τ. Nothing is compared where the sheet hides itself, and where a pixel around has no
//! measurement or another surface's. What is hidden, and s, are held fixed.

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::robust::Noise;
use super::{FrameSystem, Term, outer};
use crate::motion::observed::samples::SurfaceSamples;
use tessuto_core::camera::Viewpoint;
use tessuto_sim::Cloth;

/// Triangles of one parallel task.
const TASK: usize = 64;
/// Pixels of a surface differ by less, as a fraction of their depth, and by less than this many spreads of their
/// noise: beyond both, a border lies between them.
const BORDER: f64 = 0.05;
const SPREADS: f64 = 6.0;

/// A measured map.
#[derive(Debug, Clone)]
pub struct Map<'a> {
    /// How it is seen, in its own pixels.
    pub view: Viewpoint,
    /// Depths `[m]`, shape [height · width]; NaN where nothing was measured.
    pub z: &'a [f32],
}

/// See the module.
pub struct Depth<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// The surface points.
    pub samples: &'a SurfaceSamples,
    /// What was measured in this frame, if anything.
    pub map: Option<Map<'a>>,
    /// σ as a fraction of the depth, and τ.
    pub noise: Noise,
    /// k, see the module.
    pub weight: f64,
    /// Whether a point is hidden by the sheet itself; empty if none is.
    pub hidden: &'a [bool],
    /// Part of its area in the first frame that every triangle fills in this one, shape `[T]`; empty: all.
    pub shares: &'a [f64],
}

impl Map<'_> {
    /// Depth at a pixel position, and its derivatives; `None` where it is not known, as beside a `border`: where pixels
    /// differ by more than this fraction.
    fn at(&self, p_pixel: DVec2, border: f64) -> Option<(f64, DVec2)> {
        let (width, height) = (self.view.camera.width, self.view.camera.height);
        let corner = p_pixel.floor();
        let inside =
            corner.min_element() >= 0.0 && corner.x + 1.0 < width as f64 && corner.y + 1.0 < height as f64;
        if !inside {
            return None;
        }
        let first = corner.y as usize * width + corner.x as usize;
        let z = [0, 1, width, width + 1].map(|k| f64::from(self.z[first + k]));
        let (least, most) =
            z.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), z| (a.min(*z), b.max(*z)));
        if z.iter().any(|z| z.is_nan()) || most - least > border * least {
            return None;
        }
        let f = p_pixel - corner;
        let row = |a: f64, b: f64| a + f.x * (b - a);
        let (above, below) = (row(z[0], z[1]), row(z[2], z[3]));
        let slope = DVec2::new((1.0 - f.y) * (z[1] - z[0]) + f.y * (z[3] - z[2]), below - above);
        Some((above + f.y * (below - above), slope))
    }
}

impl Depth<'_> {
    /// Calls `add` for every point of a triangle that counts: its weights, what it counts, its residual as a fraction
    /// of the depth, and the residual's slope in the world.
    fn visit(&self, triangle: usize, x: &[DVec3], mut add: impl FnMut([f64; 3], f64, f64, DVec3)) {
        let Some(map) = &self.map else { return };
        let view = &map.view;
        let corners = self.samples.triangles[triangle].map(|v| view.in_camera(x[v as usize]));
        let share = self.shares.get(triangle).copied().unwrap_or(1.0) * self.weight;
        let border = BORDER.max(SPREADS * self.noise.sigma);
        for index in self.samples.of_triangle(triangle) {
            if self.hidden.get(index) == Some(&true) {
                continue;
            }
            let point = &self.samples.points[index];
            let w = point.weights;
            let p = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            if p.z <= 0.0 {
                continue;
            }
            let Some((m, slope)) = map.at(view.camera.project(p), border) else { continue };
            let [ru, rv] = view.camera.projection_rows(p);
            // (z − m)/m = z/m − 1.
            let by_map = ru * slope.x + rv * slope.y;
            let j = (DVec3::Z - by_map * (p.z / m)) / m;
            add(w, share * point.area, p.z / m - 1.0, view.turned_to_world(j));
        }
    }

    fn triangle_value(&self, triangle: usize, x: &[DVec3]) -> f64 {
        let mut sum = 0.0;
        self.visit(triangle, x, |_, weight, r, _| sum += weight * self.noise.geman_mcclure(r * r).0);
        sum
    }

    /// Adds what of the value every vertex bears, shape `[V]`: the corners of a triangle a third each.
    pub fn add_shares(&self, x: &[DVec3], shares: &mut [f64]) {
        if self.map.is_none() {
            return;
        }
        for (triangle, corners) in self.samples.triangles.iter().enumerate() {
            let third = self.triangle_value(triangle, x) / 3.0;
            corners.iter().for_each(|v| shares[*v as usize] += third);
        }
    }
}

impl Term for Depth<'_> {
    fn name(&self) -> &'static str {
        "depth"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        if self.map.is_none() {
            return 0.0;
        }
        let triangles = (0..self.samples.triangles.len()).into_par_iter().with_min_len(TASK);
        // Summed in order: the same bits for any number of threads.
        let values: Vec<f64> = triangles.map(|t| self.triangle_value(t, x)).collect();
        values.iter().sum()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        if self.map.is_none() {
            return 0.0;
        }
        type Local = (f64, [DVec3; 3], [DMat3; 6]);
        let of_triangle = |triangle: usize| -> Local {
            let (mut value, mut gradient, mut blocks) = (0.0, [DVec3::ZERO; 3], [DMat3::ZERO; 6]);
            self.visit(triangle, x, |w, weight, r, j| {
                let (rho, ratio) = self.noise.geman_mcclure(r * r);
                value += weight * rho;
                let square = outer(j, j) * (weight * ratio);
                gradient.iter_mut().zip(w).for_each(|(g, w)| *g += j * (weight * ratio * r * w));
                let pairs = [(0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1)];
                blocks.iter_mut().zip(pairs).for_each(|(block, (a, b))| *block += square * (w[a] * w[b]));
            });
            (value, gradient, blocks)
        };
        let triangles = (0..self.samples.triangles.len()).into_par_iter().with_min_len(TASK);
        let locals: Vec<Local> = triangles.map(of_triangle).collect();
        let pattern = &self.cloth.pattern;
        let mut value = 0.0;
        let corners = self.samples.triangles.iter().zip(&self.cloth.triangle_pairs);
        for ((of_local, gradient, blocks), (corners, pairs)) in locals.iter().zip(corners) {
            value += of_local;
            for k in 0..3 {
                let vertex = corners[k] as usize;
                system.gradient[vertex] += gradient[k];
                system.matrix.add_diagonal(pattern, vertex, &blocks[k]);
                system.matrix.add_pair(pattern, pairs[k], &blocks[3 + k]);
            }
        }
        value
    }
}
