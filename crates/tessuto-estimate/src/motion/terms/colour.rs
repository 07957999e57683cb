//! Colours of surface points against what other frames show of them:
//!
//!   E = Σ_p k s_p a_p [ ρ(‖I(π(x_p)) − g_p T_p‖/σ; τ) + ω ρ(‖I(π(x_p)) − A_p‖/σ; τ) ],
//!
//! with the frame's colour I, the projection π, the point's colour T in the first frame, its brightness g relative
//! to that (per channel, see [`crate::motion::spacetime`]), the mean colour A in the frames before and after and
//! its weight ω, the area a_p that p stands for in the first frame, in pixels of which each counts as k
//! independent ones, the part s_p of it that p's triangle still fills, and Geman and McClure's ρ of the noise σ of
//! one pixel and its tail τ. T, g, A, s and what is hidden are held fixed.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::robust::Noise;
use super::{FrameSystem, Term};
use crate::motion::observed::pyramid::Level;
use crate::motion::observed::samples::{SurfaceSample, SurfaceSamples};
use tessuto_sim::Cloth;

/// Colour of every surface point as other frames show it, sRGB; `None` where it was not seen.
pub type PointColours = Vec<Option<[f32; 3]>>;

/// Triangles of one parallel task.
const TASK: usize = 64;

/// See the module.
pub struct Colour<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// The surface points.
    pub samples: &'a SurfaceSamples,
    /// The frame at the resolution in use.
    pub level: &'a Level,
    /// T.
    pub reference: &'a PointColours,
    /// g of every vertex, linear between them, shape [V, 3].
    pub gain: &'a [[f32; 3]],
    /// A; empty while not known.
    pub adjacent: &'a PointColours,
    /// ω.
    pub adjacent_weight: f64,
    /// σ of one pixel, all channels together, sRGB in [0, 1], and τ.
    pub noise: Noise,
    /// Whether a point is hidden by the sheet itself, which shows nothing of it; empty if none is. Held fixed.
    pub hidden: &'a [bool],
    /// k: number of independent pixels that one of `level` counts as.
    pub weight: f64,
    /// Part of its area in the first frame that every triangle fills in this one, shape `[T]`; empty: all. Held fixed.
    pub shares: &'a [f64],
    /// Pixels of `level` that count as the worst of differences, ½ τ², in the value: those that mask or mesh cover
    /// alone. None while steps are taken, as they have no slope; where motions are compared, or leaving the image
    /// would pay.
    pub uncovered: f64,
}

/// Value and derivatives over one triangle: blocks (0,0) (1,1) (2,2) (1,0) (2,0) (2,1).
struct Local {
    value: f64,
    gradient: [DVec3; 3],
    blocks: [DMat3; 6],
}

/// What one point compares: its difference from the first frame with its weight, that from the adjacent frames
/// with its weight.
type Differences = [Option<([f64; 3], f64)>; 2];

/// Derivative of each channel's colour by the point in the camera's frame.
type Slope = [DVec3; 3];

impl Colour<'_> {
    /// Where a point of a triangle with these corners is, if it may count. All in the camera's frame.
    #[inline]
    fn place(&self, point: &SurfaceSample, index: usize, [a, b, c]: [DVec3; 3]) -> Option<DVec3> {
        let known = self.reference[index].is_some() || self.adjacent.get(index).is_some_and(Option::is_some);
        if !known || self.hidden.get(index) == Some(&true) {
            return None;
        }
        let w = point.weights;
        let p = a * w[0] + b * w[1] + c * w[2];
        (p.z > 0.0).then_some(p)
    }

    /// Its differences where the frame shows `colour`.
    #[inline]
    fn differences(
        &self,
        point: &SurfaceSample,
        index: usize,
        colour: [f32; 3],
        gains: [[f32; 3]; 3],
        share: f64,
    ) -> Differences {
        let w = point.weights;
        let against = |seen: [f32; 3], gain: [f64; 3]| {
            [0, 1, 2].map(|k| f64::from(colour[k]) - gain[k] * f64::from(seen[k]))
        };
        let gain = || [0, 1, 2].map(|k| (0..3).map(|i| w[i] * f64::from(gains[i][k])).sum());
        let adjacent = self.adjacent.get(index).copied().flatten();
        let area = share * point.area;
        [
            self.reference[index].map(|seen| (against(seen, gain()), area * self.weight)),
            adjacent.map(|seen| {
                (against(seen, [w[0] + w[1] + w[2]; 3]), area * self.weight * self.adjacent_weight)
            }),
        ]
    }

    /// Calls `add` for every point of a triangle that counts, with what `look` finds at its place in the camera's
    /// frame beside the frame's colour. So the camera's pose is a matter of a triangle's corners, not of every
    /// point.
    #[inline]
    fn visit<S>(
        &self,
        triangle: usize,
        x: &[DVec3],
        look: impl Fn(DVec3) -> Option<([f32; 3], S)>,
        mut add: impl FnMut(&SurfaceSample, Differences, S),
    ) {
        let corners = self.samples.triangles[triangle];
        let positions = corners.map(|v| self.level.view.in_camera(x[v as usize]));
        let gains = corners.map(|v| self.gain[v as usize]);
        let share = self.share(triangle);
        for index in self.samples.of_triangle(triangle) {
            let point = &self.samples.points[index];
            let Some(p) = self.place(point, index, positions) else { continue };
            let Some((colour, beside)) = look(p) else { continue };
            add(point, self.differences(point, index, colour, gains, share), beside);
        }
    }

    /// The frame's colour at `p` in the camera's frame.
    #[inline]
    fn colour(&self, p: DVec3) -> Option<([f32; 3], ())> {
        self.level.colour(self.level.view.camera.project(p)).map(|colour| (colour, ()))
    }

    /// The same with its slope.
    #[inline]
    fn slope(&self, p: DVec3) -> Option<([f32; 3], Slope)> {
        let camera = &self.level.view.camera;
        let colour = self.level.sample(camera.project(p))?;
        let [ru, rv] = camera.projection_rows(p);
        let slope = [0, 1, 2].map(|k| ru * f64::from(colour.du[k]) + rv * f64::from(colour.dv[k]));
        Some((colour.value, slope))
    }

    fn triangle_value(&self, triangle: usize, x: &[DVec3]) -> f64 {
        let mut sums = [0.0; 2];
        self.visit(
            triangle,
            x,
            |p| self.colour(p),
            |_, differences, ()| {
                for (sum, of) in sums.iter_mut().zip(differences) {
                    let Some((r, weight)) = of else { continue };
                    *sum += weight * self.noise.geman_mcclure(r.iter().map(|r| r * r).sum()).0;
                }
            },
        );
        sums[0] + sums[1]
    }

    /// Adds what of the value every vertex bears, shape `[V]`: the corners of a triangle a third each. Pixels that mask
    /// or mesh cover alone no vertex bears.
    pub fn add_shares(&self, x: &[DVec3], shares: &mut [f64]) {
        for (triangle, corners) in self.samples.triangles.iter().enumerate() {
            let third = self.triangle_value(triangle, x) / 3.0;
            corners.iter().for_each(|v| shares[*v as usize] += third);
        }
    }

    /// Area of the points that the frame shows, as far as it shows them [px of `level`].
    pub fn area(&self, x: &[DVec3]) -> f64 {
        let of_triangle = |triangle: usize| {
            let mut seen = 0.0;
            let add = |point: &SurfaceSample, _: Differences, ()| seen += point.area;
            self.visit(triangle, x, |p| self.colour(p), add);
            seen * self.share(triangle)
        };
        (0..self.samples.triangles.len()).map(of_triangle).sum()
    }

    fn share(&self, triangle: usize) -> f64 {
        self.shares.get(triangle).copied().unwrap_or(1.0)
    }

    fn triangle_system(&self, triangle: usize, x: &[DVec3]) -> Local {
        let (mut value, mut gradient) = (0.0, [DVec3::ZERO; 3]);
        // Of symmetric blocks only the lower triangles, as columns.
        let mut blocks = [[0.0; 6]; 6];
        self.visit(
            triangle,
            x,
            |p| self.slope(p),
            |point, differences, j| {
                let w = point.weights;
                let (mut s, mut g) = (0.0, DVec3::ZERO);
                for (r, weight) in differences.into_iter().flatten() {
                    let (rho, ratio) = self.noise.geman_mcclure(r.iter().map(|r| r * r).sum());
                    value += weight * rho;
                    s += weight * ratio;
                    j.iter().zip(r).for_each(|(j, r)| g += *j * (r * weight * ratio));
                }
                let mut q = [0.0; 6];
                for j in j {
                    let terms = [j.x * j.x, j.y * j.x, j.z * j.x, j.y * j.y, j.z * j.y, j.z * j.z];
                    q.iter_mut().zip(terms).for_each(|(q, term)| *q += term);
                }
                gradient.iter_mut().zip(w).for_each(|(gradient, w)| *gradient += g * w);
                let pairs = [(0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1)];
                for (block, (a, b)) in blocks.iter_mut().zip(pairs) {
                    let weight = s * w[a] * w[b];
                    block.iter_mut().zip(q).for_each(|(block, q)| *block += weight * q);
                }
            },
        );
        let whole = |[xx, yx, zx, yy, zy, zz]: [f64; 6]| {
            DMat3::from_cols(DVec3::new(xx, yx, zx), DVec3::new(yx, yy, zy), DVec3::new(zx, zy, zz))
        };
        let view = &self.level.view;
        Local {
            value,
            gradient: gradient.map(|g| view.turned_to_world(g)),
            blocks: blocks.map(|block| view.matrix_turned_to_world(whole(block))),
        }
    }
}

impl Term for Colour<'_> {
    fn name(&self) -> &'static str {
        "colour"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        let triangles = (0..self.samples.triangles.len()).into_par_iter().with_min_len(TASK);
        // Summed in order: the same bits for any number of threads.
        let values: Vec<f64> = triangles.map(|t| self.triangle_value(t, x)).collect();
        values.iter().sum::<f64>() + self.uncovered * self.weight * 0.5 * self.noise.tail.powi(2)
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        let pattern = &self.cloth.pattern;
        let triangles = (0..self.samples.triangles.len()).into_par_iter().with_min_len(TASK);
        let locals: Vec<Local> = triangles.map(|t| self.triangle_system(t, x)).collect();
        let mut value = 0.0;
        let corners = self.samples.triangles.iter().zip(&self.cloth.triangle_pairs);
        for (local, (corners, pairs)) in locals.iter().zip(corners) {
            value += local.value;
            for k in 0..3 {
                let vertex = corners[k] as usize;
                system.gradient[vertex] += local.gradient[k];
                system.matrix.add_diagonal(pattern, vertex, &local.blocks[k]);
                system.matrix.add_pair(pattern, pairs[k], &local.blocks[3 + k]);
            }
        }
        value
    }
}
