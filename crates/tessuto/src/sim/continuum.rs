//! Cloth as a continuum on any triangle mesh: orthotropic membranes and bending hinges, summed over the mesh.
//!
//! It is the second elastic model of [`Cloth`], beside the springs; integrators, rollouts and their adjoints are the same.
//! Where φ-SfT uses ARCSim, this has constant coefficients instead of measured tables.
//! Source: Kairanda et al. 2022, "φ-SfT: Shape-from-Template with a Physics-Based Deformation Model".

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::cloth::{Cloth, Energy, HessianKind, Stiffness, lumped_masses};
use super::hinge::Hinge;
use super::membrane::{Coefficients, Membrane};
use crate::math::block_matrix::{BlockMatrix, BlockPattern};
use crate::math::factor::{Analysis, Scratch};
use crate::mesh::Mesh;

/// Elements of one parallel task; fewer cost more to hand over than to do.
const TASK: usize = 500;

/// Membranes and hinges of a cloth.
#[derive(Debug, Clone)]
pub struct Continuum {
    /// One of each triangle that has an area.
    pub membranes: Vec<Membrane>,
    /// One of each edge between two of them.
    pub hinges: Vec<Hinge>,
}

/// Elastic properties of a homogeneous fabric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fabric {
    /// Tension per strain along the warp, the sides left free [N/m].
    pub warp: f64,
    /// The same along the weft [N/m].
    pub weft: f64,
    /// ν, geometric mean of the two Poisson ratios, in (−1, 1).
    pub poisson: f64,
    /// Shear force per angle [N/m].
    pub shear: f64,
    /// Moment per curvature and width `[J]`.
    pub bend: f64,
}

/// ∂L/∂ the properties of a [`Fabric`].
pub type FabricGradient = Fabric;

impl Fabric {
    /// c₁₁ = Y₁/(1 − ν²), c₂₂ = Y₂/(1 − ν²), c₁₂ = ν √(Y₁ Y₂)/(1 − ν²) and g of [`super::membrane`].
    pub fn coefficients(&self) -> Coefficients {
        let free = 1.0 / (1.0 - self.poisson * self.poisson);
        let mixed = self.poisson * (self.warp * self.weft).sqrt();
        [self.warp * free, self.weft * free, mixed * free, self.shear]
    }

    /// Given `grad` = ∂L/∂ every element's coefficients, ∂L/∂ the properties that all have in common.
    pub fn vjp(&self, grad: &Stiffness) -> FabricGradient {
        let [g11, g22, g12, shear] =
            grad.membrane.iter().fold([0.0; 4], |sum, g| [0, 1, 2, 3].map(|k| sum[k] + g[k]));
        let nu = self.poisson;
        let free = 1.0 / (1.0 - nu * nu);
        let root = (self.warp * self.weft).sqrt();
        let by_free = g11 * self.warp + g22 * self.weft + g12 * nu * root;
        Fabric {
            warp: free * (g11 + g12 * nu * 0.5 * root / self.warp),
            weft: free * (g22 + g12 * nu * 0.5 * root / self.weft),
            poisson: free * g12 * root + by_free * 2.0 * nu * free * free,
            shear,
            bend: grad.hinge.iter().sum(),
        }
    }

    /// The same in every element of `cloth`.
    pub fn stiffness(&self, cloth: &Cloth) -> Stiffness {
        let mut all = Stiffness::uniform(cloth, [0.0; 3]);
        all.membrane.fill(self.coefficients());
        all.hinge.fill(self.bend);
        all
    }
}

impl Cloth {
    /// The continuum that is at rest in the shape of `template`, its warp along growing u.
    pub fn continuum(template: &Mesh) -> Self {
        let (x, triangles) = (&template.positions, template.triangles());
        let mut pairs = Vec::new();
        let mut triangle_pairs = Vec::with_capacity(triangles.len());
        let mut membranes = Vec::with_capacity(triangles.len());
        // Edge, and the apexes of the triangles on it, in a fixed order.
        let mut apexes: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for (&[a, b, c], corners) in triangles.iter().zip(template.triangle_uvs()) {
            let first = pairs.len();
            pairs.extend([[b, a], [c, a], [c, b]]);
            let own = [first, first + 1, first + 2];
            triangle_pairs.push(own);
            let uvs = corners.map(|k| template.uvs[k as usize]);
            let membrane = Membrane::new([a, b, c], [a, b, c].map(|v| x[v as usize]), uvs, own);
            // What has no area has no normal to bend from either.
            if let Some(membrane) = membrane {
                membranes.push(membrane);
                for [i, j, apex] in [[a, b, c], [b, c, a], [c, a, b]] {
                    apexes.entry([i.min(j), i.max(j)]).or_default().push(apex);
                }
            }
        }
        let mut hinges = Vec::new();
        for ([i, j], apexes) in apexes {
            for two in apexes.windows(2) {
                let [a, b, c, d] = [i, j, two[0], two[1]];
                let first = pairs.len();
                pairs.extend([[b, a], [c, a], [d, a], [c, b], [d, b], [d, c]]);
                hinges.push(Hinge::new([a, b, c, d], x, [0, 1, 2, 3, 4, 5].map(|k| first + k)));
            }
        }
        let pattern = BlockPattern::new(x, &pairs);
        let analysis = Analysis::new(&pattern);
        Self {
            masses: lumped_masses(template),
            edges: Vec::new(),
            bends: Vec::new(),
            shears: Vec::new(),
            continuum: Some(Continuum { membranes, hinges }),
            triangle_pairs,
            pattern: Arc::new(pattern),
            analysis: Arc::new(analysis),
        }
    }
}

impl Continuum {
    pub(super) fn energy(&self, stiffness: &Stiffness, x: &[DVec3]) -> Energy {
        let mut sum = Energy::default();
        for (m, c) in self.membranes.iter().zip(&stiffness.membrane) {
            let [stretch, shear] = m.value(m.gradients(x), *c);
            sum.stretch += stretch;
            sum.shear += shear;
        }
        sum.bend = self.hinges.iter().zip(&stiffness.hinge).map(|(h, b)| h.value(h.arms(x), *b)).sum();
        sum
    }

    pub(super) fn add_gradient(&self, stiffness: &Stiffness, x: &[DVec3], scale: f64, out: &mut [DVec3]) {
        self.add_of_elements(
            out,
            |k| {
                let m = &self.membranes[k];
                m.gradient(m.gradients(x), stiffness.membrane[k]).map(|g| g * scale)
            },
            |k| {
                let h = &self.hinges[k];
                h.gradient(h.arms(x), stiffness.hinge[k] * scale)
            },
        );
    }

    pub(super) fn add_third(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        [a, b]: [&[DVec3]; 2],
        scale: f64,
        out: &mut [DVec3],
    ) {
        self.add_of_elements(
            out,
            |k| {
                let m = &self.membranes[k];
                let c = stiffness.membrane[k].map(|c| c * scale);
                m.third(m.gradients(x), c, m.gradients(a), m.gradients(b))
            },
            |k| {
                let h = &self.hinges[k];
                h.third(h.arms(x), stiffness.hinge[k] * scale, h.arms(a), h.arms(b))
            },
        );
    }

    /// Computes all elements in parallel, then adds them in their order: the same bits for any number of threads.
    fn add_of_elements(
        &self,
        out: &mut [DVec3],
        of_membrane: impl Fn(usize) -> [DVec3; 2] + Send + Sync,
        of_hinge: impl Fn(usize) -> [DVec3; 3] + Send + Sync,
    ) {
        let (mut membranes, mut hinges) = (Vec::new(), Vec::new());
        let range = |n: usize| (0..n).into_par_iter().with_min_len(TASK);
        range(self.membranes.len()).map(of_membrane).collect_into_vec(&mut membranes);
        range(self.hinges.len()).map(of_hinge).collect_into_vec(&mut hinges);
        self.membranes.iter().zip(membranes).for_each(|(m, g)| m.scatter(g, out));
        self.hinges.iter().zip(hinges).for_each(|(h, g)| h.scatter(g, out));
    }

    pub(super) fn add_hessian(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        kind: HessianKind,
        scale: f64,
        (pattern, matrix): (&BlockPattern, &mut BlockMatrix),
        scratch: &mut Scratch,
    ) {
        // Two sums, added in the end: the same bits on one thread and on two.
        let mut second = scratch.zero_matrix(pattern);
        let half = self.hinges.len() / 2;
        let hinges = |range: std::ops::Range<usize>, matrix: &mut BlockMatrix| {
            for k in range {
                let (hinge, b) = (&self.hinges[k], stiffness.hinge[k] * scale);
                let arms = hinge.arms(x);
                let hessian = match kind {
                    HessianKind::Exact => hinge.hessian(arms, b),
                    HessianKind::Projected => hinge.hessian_projected(arms, b),
                    HessianKind::GaussNewton => hinge.hessian_gauss_newton(arms, b),
                };
                let (diagonal, off) = hinge.blocks(&hessian);
                add_blocks(pattern, matrix, &hinge.vertices, &diagonal, &hinge.pairs, &off);
            }
        };
        rayon::join(
            || {
                hinges(0..half, matrix);
                for (m, c) in self.membranes.iter().zip(&stiffness.membrane) {
                    let (f, c) = (m.gradients(x), c.map(|c| c * scale));
                    let hessian = match kind {
                        HessianKind::Exact => m.hessian(f, c),
                        HessianKind::Projected => m.hessian_projected(f, c),
                        HessianKind::GaussNewton => m.hessian_gauss_newton(f, c),
                    };
                    let diagonal = [0, 1, 2].map(|i| m.block(&hessian, i, i));
                    let off = [[1, 0], [2, 0], [2, 1]].map(|[i, j]| m.block(&hessian, i, j));
                    add_blocks(pattern, matrix, &m.vertices, &diagonal, &m.pairs, &off);
                }
            },
            || hinges(half..self.hinges.len(), &mut second),
        );
        matrix.add(&second);
        scratch.recycle_matrix(second);
    }

    pub(super) fn add_gradient_by_stiffness(
        &self,
        x: &[DVec3],
        lambda: &[DVec3],
        scale: f64,
        out: &mut Stiffness,
    ) {
        self.membranes.par_iter().zip(&mut out.membrane).with_min_len(TASK).for_each(|(m, out)| {
            let by = m.gradient_by_coefficients(m.gradients(x), m.gradients(lambda));
            out.iter_mut().zip(by).for_each(|(out, by)| *out += scale * by);
        });
        self.hinges.par_iter().zip(&mut out.hinge).with_min_len(TASK).for_each(|(h, out)| {
            let gradient = h.gradient(h.arms(x), 1.0);
            *out += scale * gradient.iter().zip(h.arms(lambda)).map(|(g, l)| g.dot(l)).sum::<f64>();
        });
    }

    pub(super) fn add_hessian_by_stiffness(
        &self,
        x: &[DVec3],
        [a, b]: [&[DVec3]; 2],
        scale: f64,
        out: &mut Stiffness,
    ) {
        self.membranes.par_iter().zip(&mut out.membrane).with_min_len(TASK).for_each(|(m, out)| {
            let by = m.hessian_by_coefficients(m.gradients(x), m.gradients(a), m.gradients(b));
            out.iter_mut().zip(by).for_each(|(out, by)| *out += scale * by);
        });
        self.hinges.par_iter().zip(&mut out.hinge).with_min_len(TASK).for_each(|(h, out)| {
            *out += scale * h.hessian(h.arms(x), 1.0).form(h.arms(a), h.arms(b));
        });
    }
}

fn add_blocks(
    pattern: &BlockPattern,
    matrix: &mut BlockMatrix,
    vertices: &[u32],
    diagonal: &[DMat3],
    pairs: &[usize],
    off: &[DMat3],
) {
    vertices.iter().zip(diagonal).for_each(|(&v, block)| matrix.add_diagonal(pattern, v as usize, block));
    pairs.iter().zip(off).for_each(|(&pair, block)| matrix.add_pair(pattern, pair, block));
}
