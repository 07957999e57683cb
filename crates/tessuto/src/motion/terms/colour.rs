//! How well a shape explains one frame: colours of surface points, outline against the mask.

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::super::observed::outline_distance::OutlineDistance;
use super::super::observed::pyramid::Level;
use super::super::observed::samples::{EdgePoint, SurfaceSample};
use crate::camera::Camera;

/// Colour of every surface point as the reference frames show it; `None` where it was not seen.
pub type Reference = Vec<Option<[f32; 3]>>;

/// Surface points of one resolution, with the triangles they lie on.
#[derive(Debug)]
pub struct Points<'a> {
    /// Triangles of the mesh.
    pub triangles: &'a [[u32; 3]],
    /// The points, ordered by triangle.
    pub points: Vec<SurfaceSample>,
    /// Points of the outline.
    pub boundary: &'a [EdgePoint],
    /// `points[start[t]..start[t + 1]]` lie on triangle t.
    start: Vec<usize>,
}

impl<'a> Points<'a> {
    /// Indexes `points` by triangle.
    pub fn new(triangles: &'a [[u32; 3]], points: Vec<SurfaceSample>, boundary: &'a [EdgePoint]) -> Self {
        let mut start = vec![0; triangles.len() + 1];
        points.iter().for_each(|p| start[p.triangle as usize + 1] += 1);
        for t in 0..triangles.len() {
            start[t + 1] += start[t];
        }
        Self { triangles, points, boundary, start }
    }
}

/// What a frame is compared with, and how strictly.
#[derive(Debug, Clone, Copy)]
pub struct DataTerm<'a> {
    /// The frame at the resolution in use.
    pub level: &'a Level,
    /// Pixels of level 0 along one pixel of `level`.
    pub scale: f64,
    /// Outline of the frame's mask, at level 0.
    pub outline: &'a OutlineDistance,
    /// Camera of level 0.
    pub camera: &'a Camera,
    /// Colour differences beyond this count less and less (Geman and McClure), sRGB in [0, 1].
    pub colour_sigma: f64,
    /// Distances of the outline beyond this count less and less [px].
    pub outline_sigma: f64,
    /// Weight of one pixel's colour term.
    pub colour_weight: f64,
    /// Weight of one pixel's length of outline.
    pub outline_weight: f64,
}

/// Value and derivatives of a data term over one triangle: Gauss-Newton blocks (0,0) (1,1) (2,2) (1,0) (2,0) (2,1).
#[derive(Debug, Clone, Copy)]
pub struct Local<const CORNERS: usize, const BLOCKS: usize> {
    /// Robust value.
    pub value: f64,
    /// By the corners.
    pub gradient: [DVec3; CORNERS],
    /// HessianKind blocks.
    pub blocks: [DMat3; BLOCKS],
}

impl<const CORNERS: usize, const BLOCKS: usize> Local<CORNERS, BLOCKS> {
    /// Adds another term over the same corners.
    pub fn add(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient.iter_mut().zip(&other.gradient).for_each(|(a, b)| *a += *b);
        self.blocks.iter_mut().zip(&other.blocks).for_each(|(a, b)| *a += *b);
    }
}

/// ρ(r²) = ½ σ² r²/(σ² + r²) and its weight 2 ∂ρ/∂r² (Geman and McClure).
fn robust(sq_residual: f64, sigma: f64) -> (f64, f64) {
    let sq_sigma = sigma * sigma;
    let share = sq_sigma / (sq_sigma + sq_residual);
    (0.5 * share * sq_residual, share * share)
}

/// Rows of ∂(u, v)/∂(x, y, z) at `p`.
fn projection_rows(camera: &Camera, p: DVec3) -> [DVec3; 2] {
    let (a, b) = (camera.fx / p.z, camera.fy / p.z);
    [DVec3::new(a, 0.0, -a * p.x / p.z), DVec3::new(0.0, b, -b * p.y / p.z)]
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl DataTerm<'_> {
    /// Colour term of every triangle at shape `x`; `visible` and `reference` are per surface point,
    /// `gain` is the brightness of every vertex relative to the reference.
    pub fn colour(
        &self,
        points: &Points,
        reference: &Reference,
        gain: &[[f32; 3]],
        visible: Option<&[bool]>,
        x: &[DVec3],
    ) -> Vec<Local<3, 6>> {
        (0..points.triangles.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|t| {
                if visible.is_some_and(|v| !v[t]) {
                    return Local { value: 0.0, gradient: [DVec3::ZERO; 3], blocks: [DMat3::ZERO; 6] };
                }
                self.triangle_colour(points, t, reference, gain, x)
            })
            .collect()
    }

    fn triangle_colour(
        &self,
        points: &Points,
        triangle: usize,
        reference: &Reference,
        gain: &[[f32; 3]],
        x: &[DVec3],
    ) -> Local<3, 6> {
        let corners = points.triangles[triangle];
        let [a, b, c] = corners.map(|v| x[v as usize]);
        let gains = corners.map(|v| gain[v as usize]);
        let (mut value, mut gradient, mut blocks) = (0.0, [DVec3::ZERO; 3], [DMat3::ZERO; 6]);
        let range = points.start[triangle]..points.start[triangle + 1];
        for (point, reference) in points.points[range.clone()].iter().zip(&reference[range]) {
            let Some(reference) = reference else { continue };
            let w = point.weights;
            let p = a * w[0] + b * w[1] + c * w[2];
            if p.z <= 0.0 {
                continue;
            }
            let Some(colour) = self.level.sample(self.level.camera.project(p)) else { continue };
            let weight = self.colour_weight * point.area * self.scale * self.scale;
            let [ru, rv] = projection_rows(&self.level.camera, p);
            let (mut sq, mut q, mut g) = (0.0, DMat3::ZERO, DVec3::ZERO);
            for k in 0..3 {
                let gain: f64 = (0..3).map(|i| w[i] * f64::from(gains[i][k])).sum();
                let r = f64::from(colour.value[k]) - gain * f64::from(reference[k]);
                let j = ru * f64::from(colour.du[k]) + rv * f64::from(colour.dv[k]);
                sq += r * r;
                g += j * r;
                q += outer(j, j);
            }
            let (rho, share) = robust(sq, self.colour_sigma);
            value += weight * rho;
            let s = weight * share;
            for i in 0..3 {
                gradient[i] += g * (s * w[i]);
            }
            for (block, (i, j)) in blocks.iter_mut().zip([(0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1)]) {
                *block += q * (s * w[i] * w[j]);
            }
        }
        Local { value, gradient, blocks }
    }

    /// Outline term of every boundary point at shape `x`: blocks (0,0) (1,1) (1,0).
    pub fn outline(&self, points: &Points, x: &[DVec3]) -> Vec<Local<2, 3>> {
        points.boundary.iter().map(|point| self.point_outline(point, x)).collect()
    }

    fn point_outline(&self, point: &EdgePoint, x: &[DVec3]) -> Local<2, 3> {
        let zero = Local { value: 0.0, gradient: [DVec3::ZERO; 2], blocks: [DMat3::ZERO; 3] };
        let w = point.weights;
        let p = x[point.vertices[0] as usize] * w[0] + x[point.vertices[1] as usize] * w[1];
        if p.z <= 0.0 {
            return zero;
        }
        let Some((r, slope)) = self.outline.sample(self.camera.project(p)) else { return zero };
        let [ru, rv] = projection_rows(self.camera, p);
        let j = ru * slope.x + rv * slope.y;
        let (rho, share) = robust(r * r, self.outline_sigma);
        let weight = self.outline_weight * point.length;
        let s = weight * share;
        let q = outer(j, j);
        Local {
            value: weight * rho,
            gradient: [j * (s * r * w[0]), j * (s * r * w[1])],
            blocks: [q * (s * w[0] * w[0]), q * (s * w[1] * w[1]), q * (s * w[0] * w[1])],
        }
    }

    /// Colours of the surface points in this frame at shape `x`.
    pub fn observe(&self, points: &Points, visible: Option<&[bool]>, x: &[DVec3]) -> Reference {
        let of = |point: &SurfaceSample| {
            if visible.is_some_and(|v| !v[point.triangle as usize]) {
                return None;
            }
            let corners = points.triangles[point.triangle as usize].map(|v| x[v as usize]);
            let p = corners.iter().zip(point.weights).map(|(x, w)| *x * w).sum::<DVec3>();
            let at: DVec2 = self.level.camera.project(p);
            (p.z > 0.0).then(|| self.level.sample(at)).flatten().map(|c| c.value)
        };
        points.points.par_iter().with_min_len(512).map(of).collect()
    }
}

/// Brightness of every vertex and channel that explains `observed` from `reference` best, smoothed over
/// the mesh: minimises Σ w (g·T − I)² + λ Σ_edges (g_a − g_b)² by Jacobi iterations from `gain`.
pub fn fit_gain(
    points: &Points,
    neighbours: &[Vec<u32>],
    reference: &Reference,
    observed: &Reference,
    smoothness: f64,
    sigma: f64,
    gain: &mut [[f32; 3]],
) {
    let mut data = vec![[[0.0f64; 2]; 3]; gain.len()];
    for ((point, t), i) in points.points.iter().zip(reference).zip(observed) {
        let (Some(t), Some(i)) = (t, i) else { continue };
        let corners = points.triangles[point.triangle as usize];
        let predicted = |k: usize| -> f32 {
            (0..3).map(|c| point.weights[c] as f32 * gain[corners[c] as usize][k]).sum::<f32>() * t[k]
        };
        let sq: f64 = (0..3).map(|k| f64::from(predicted(k) - i[k]).powi(2)).sum();
        let share = robust(sq, sigma).1;
        for (c, &v) in corners.iter().enumerate() {
            for k in 0..3 {
                let w = point.weights[c] * share * f64::from(t[k]);
                data[v as usize][k][0] += w * f64::from(i[k]);
                data[v as usize][k][1] += w * f64::from(t[k]);
            }
        }
    }
    let seen = data.iter().filter(|d| d[1][1] > 0.0).count().max(1);
    let lambda = [0, 1, 2].map(|k| {
        let mean = data.iter().map(|d| d[k][1]).sum::<f64>() / seen as f64;
        (smoothness * mean).max(1e-12)
    });
    for _ in 0..30 {
        let old = gain.to_vec();
        for (v, around) in neighbours.iter().enumerate() {
            for k in 0..3 {
                let sum: f64 = around.iter().map(|&n| f64::from(old[n as usize][k])).sum();
                let [num, den] = data[v][k];
                // A weak pull to 1 keeps what is never seen defined.
                let pull = 1e-3 * lambda[k];
                gain[v][k] =
                    ((num + lambda[k] * sum + pull) / (den + lambda[k] * around.len() as f64 + pull)) as f32;
            }
        }
    }
}
