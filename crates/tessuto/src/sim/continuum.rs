//! Sums over orthotropic membranes and bending hinges, on any triangle mesh.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::hinge::Hinge;
use super::membrane::{Coefficients, Membrane};
use super::stiffness::{Energy, HessianKind, Stiffness};
use crate::math::block_matrix::{BlockMatrix, BlockPattern, Columns};

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

    pub(super) fn add_gradient(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        scale: f64,
        out: &mut [DVec3],
    ) -> f64 {
        self.add_of_elements(
            out,
            |k| {
                let (m, c) = (&self.membranes[k], stiffness.membrane[k]);
                let f = m.gradients(x);
                (m.value(f, c).iter().sum(), m.gradient(f, c).map(|g| g * scale))
            },
            |k| {
                let h = &self.hinges[k];
                let (value, gradient) = h.value_and_gradient(h.arms(x), stiffness.hinge[k]);
                (value, gradient.map(|g| g * scale))
            },
        )
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
                (0.0, m.third(m.gradients(x), c, m.gradients(a), m.gradients(b)))
            },
            |k| {
                let h = &self.hinges[k];
                (0.0, h.third(h.arms(x), stiffness.hinge[k] * scale, h.arms(a), h.arms(b)))
            },
        );
    }

    /// Adds the gradients of all elements and returns the sum of their numbers: in two sums, the same bits on one thread and on two.
    fn add_of_elements(
        &self,
        out: &mut [DVec3],
        of_membrane: impl Fn(usize) -> (f64, [DVec3; 2]) + Send + Sync,
        of_hinge: impl Fn(usize) -> (f64, [DVec3; 3]) + Send + Sync,
    ) -> f64 {
        let mut second = vec![DVec3::ZERO; out.len()];
        // About as long work for both: membranes, quicker than hinges, are all in the first sum.
        let split = (self.hinges.len() / 2).saturating_sub(self.membranes.len() / 8);
        let hinges = |range: std::ops::Range<usize>, out: &mut [DVec3]| {
            let add = |k: usize| {
                let (value, gradient) = of_hinge(k);
                self.hinges[k].scatter(gradient, out);
                value
            };
            range.map(add).sum::<f64>()
        };
        let (first_sum, second_sum) = rayon::join(
            || {
                let add = |(k, m): (usize, &Membrane)| {
                    let (value, gradient) = of_membrane(k);
                    m.scatter(gradient, out);
                    value
                };
                let membranes: f64 = self.membranes.iter().enumerate().map(add).sum();
                membranes + hinges(0..split, out)
            },
            || hinges(split..self.hinges.len(), &mut second),
        );
        out.iter_mut().zip(&second).for_each(|(out, g)| *out += *g);
        first_sum + second_sum
    }

    pub(super) fn add_hessian(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        kind: HessianKind,
        scale: f64,
        (pattern, matrix): (&BlockPattern, &mut BlockMatrix),
    ) {
        // Elements on the border are computed for both halves: the same bits on one thread and on two.
        let add = |mut columns: Columns| {
            for (m, c) in self.membranes.iter().zip(&stiffness.membrane) {
                if !columns.hold_any(pattern, &m.vertices) {
                    continue;
                }
                let (f, c) = (m.gradients(x), c.map(|c| c * scale));
                let hessian = match kind {
                    HessianKind::Exact => m.hessian(f, c),
                    HessianKind::Projected => m.hessian_projected(f, c),
                    HessianKind::GaussNewton => m.hessian_gauss_newton(f, c),
                };
                let (diagonal, off) = m.blocks(&hessian);
                add_blocks(pattern, &mut columns, &m.vertices, &diagonal, &m.pairs, &off);
            }
            for (hinge, b) in self.hinges.iter().zip(&stiffness.hinge) {
                if !columns.hold_any(pattern, &hinge.vertices) {
                    continue;
                }
                let (arms, b) = (hinge.arms(x), b * scale);
                let hessian = match kind {
                    HessianKind::Exact => hinge.hessian(arms, b),
                    HessianKind::Projected => hinge.hessian_projected(arms, b),
                    HessianKind::GaussNewton => hinge.hessian_gauss_newton(arms, b),
                };
                let (diagonal, off) = hinge.blocks(&hessian);
                add_blocks(pattern, &mut columns, &hinge.vertices, &diagonal, &hinge.pairs, &off);
            }
        };
        let [first, second] = matrix.halves(pattern);
        rayon::join(|| add(first), || add(second));
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
    columns: &mut Columns,
    vertices: &[u32],
    diagonal: &[DMat3],
    pairs: &[usize],
    off: &[DMat3],
) {
    vertices.iter().zip(diagonal).for_each(|(&v, block)| columns.add_diagonal(pattern, v as usize, block));
    pairs.iter().zip(off).for_each(|(&pair, block)| columns.add_pair(pattern, pair, block));
}
