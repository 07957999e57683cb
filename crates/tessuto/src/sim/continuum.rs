//! Sums over orthotropic membranes and bending hinges, on any triangle mesh.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::hinge::Hinge;
use super::membrane::{Coefficients, Membrane};
use super::stiffness::{Energy, HessianKind, Stiffness};
use crate::math::block_matrix::{BlockMatrix, BlockPattern};
use crate::math::factor::Scratch;

/// Elements of one parallel task; fewer cost more to hand over than to do.
const TASK: usize = 500;

/// Membranes and hinges of a cloth; see [`super::fabric`].
#[derive(Debug, Clone)]
pub struct Continuum {
    /// One of each triangle that has an area.
    pub membranes: Vec<Membrane>,
    /// One of each edge between two of them.
    pub hinges: Vec<Hinge>,
}

impl Continuum {
    pub(super) fn energy(&self, stiffness: &Stiffness, x: &[DVec3]) -> Energy {
        let of_membranes = || {
            let of = |(m, c): (&Membrane, &Coefficients)| m.value(m.gradients(x), *c);
            let values = self.membranes.iter().zip(&stiffness.membrane).map(of);
            values.fold([0.0; 2], |[stretch, shear], [a, b]| [stretch + a, shear + b])
        };
        let of_hinges =
            || self.hinges.iter().zip(&stiffness.hinge).map(|(h, b)| h.value(h.arms(x), *b)).sum();
        let ([stretch, shear], bend) = rayon::join(of_membranes, of_hinges);
        Energy { stretch, bend, shear }
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
        // As long work for both: a hinge takes as long as two membranes, which are the first sum's.
        let split = (self.hinges.len() / 2).saturating_sub(self.membranes.len() / 4);
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
                hinges(0..split, matrix);
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
            || hinges(split..self.hinges.len(), &mut second),
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
