//! Sums over orthotropic membranes and bending hinges, on any triangle mesh.

use glam::DVec3;
use rayon::prelude::*;

use super::hinge::{self, Bent, Hinge};
use super::membrane::{self, Coefficients, Membrane, Strained, by_corners};
use super::stiffness::{Energy, HessianKind, Stiffness};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern, Columns, Place};
use tessuto_core::math::lanes::{LANES, Lanes, each_matrix, each_vector, gather, in_lanes};
use tessuto_core::math::scalar::{Matrix, Real, Vector, scale as scaled};

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
            let of = |(m, c): (&Membrane, &Coefficients)| m.strained(m.gradients(x), *c).value();
            let values = self.membranes.iter().zip(&stiffness.membrane).map(of);
            values.fold([0.0; 2], |[stretch, shear], [a, b]| [stretch + a, shear + b])
        };
        let of_hinges =
            || self.hinges.iter().zip(&stiffness.hinge).map(|(h, b)| h.bent(h.arms(x), *b).value()).sum();
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
        let each = |values: Lanes, [a, b, c]: [Vector<Lanes>; 3]| {
            let vectors = |gradient| each_vector(scaled(gradient, Lanes::splat(scale)));
            let (values, a, b, c) = (values.to_array(), vectors(a), vectors(b), vectors(c));
            let element = |k: usize| (values[k], [a[k], b[k], c[k]]);
            [element(0), element(1), element(2), element(3)]
        };
        self.add_of_elements(
            out,
            |ks| {
                let (strained, weights) = self.strained(ks, stiffness, x, 1.0);
                let [stretch, shear] = strained.value();
                each(stretch + shear, by_corners(strained.gradient(), weights))
            },
            |ks| {
                let (value, gradient) = self.bent(ks, stiffness, x, 1.0).value_and_gradient();
                each(value, gradient)
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
            |ks| {
                ks.map(|k| {
                    let m = &self.membranes[k];
                    let c = stiffness.membrane[k].map(|c| c * scale);
                    (0.0, m.third(m.gradients(x), c, m.gradients(a), m.gradients(b)))
                })
            },
            |ks| {
                ks.map(|k| {
                    let h = &self.hinges[k];
                    (0.0, h.third(h.arms(x), stiffness.hinge[k] * scale, h.arms(a), h.arms(b)))
                })
            },
        );
    }

    /// Four membranes with their vertices at `x`, and their weights.
    #[inline(always)]
    fn strained(
        &self,
        ks: [usize; LANES],
        stiffness: &Stiffness,
        x: &[DVec3],
        scale: f64,
    ) -> (Strained<Lanes>, membrane::Weights<Lanes>) {
        let coefficient = |c: usize| gather(|k| stiffness.membrane[ks[k]][c] * scale);
        let coefficients = [coefficient(0), coefficient(1), coefficient(2), coefficient(3)];
        Membrane::strained_lanes(ks.map(|k| &self.membranes[k]), x, coefficients)
    }

    /// Four hinges with their vertices at `x`.
    #[inline(always)]
    fn bent(&self, ks: [usize; LANES], stiffness: &Stiffness, x: &[DVec3], scale: f64) -> Bent<Lanes> {
        let stiffnesses = gather(|k| stiffness.hinge[ks[k]] * scale);
        Hinge::bent_lanes(ks.map(|k| &self.hinges[k]), x, stiffnesses)
    }

    /// Adds the gradients of all elements and returns the sum of their numbers: in two sums, the same bits on one
    /// thread and on two.
    fn add_of_elements(
        &self,
        out: &mut [DVec3],
        of_membranes: impl Fn([usize; LANES]) -> [(f64, [DVec3; 3]); LANES] + Send + Sync,
        of_hinges: impl Fn([usize; LANES]) -> [(f64, [DVec3; 3]); LANES] + Send + Sync,
    ) -> f64 {
        let mut second = vec![DVec3::ZERO; out.len()];
        // About as long work for both: membranes, quicker than hinges, are all in the first sum.
        let split = (self.hinges.len() / 2).saturating_sub(self.membranes.len() / 8);
        let hinges = |range: std::ops::Range<usize>, out: &mut [DVec3]| {
            let mut sum = 0.0;
            in_lanes(range, |ks, count| {
                for (&k, (value, gradient)) in ks[..count].iter().zip(of_hinges(ks)) {
                    self.hinges[k].scatter(gradient, out);
                    sum += value;
                }
            });
            sum
        };
        let (first_sum, second_sum) = rayon::join(
            || {
                let mut sum = 0.0;
                in_lanes(0..self.membranes.len(), |ks, count| {
                    for (&k, (value, gradient)) in ks[..count].iter().zip(of_membranes(ks)) {
                        self.membranes[k].scatter(gradient, out);
                        sum += value;
                    }
                });
                sum + hinges(0..split, out)
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
            let span = columns.span();
            let membranes =
                (0..self.membranes.len()).filter(|&k| span.holds_any(pattern, &self.membranes[k].vertices));
            in_lanes(membranes, |ks, count| {
                let (strained, weights) = self.strained(ks, stiffness, x, scale);
                hessian_of_membrane(&strained, kind).blocks(weights, |place, block| {
                    let places = ks
                        .map(|k| &self.membranes[k])
                        .map(|m| Place::of_element(&m.vertices, &m.pairs, place));
                    add_blocks(pattern, &mut columns, &places[..count], block);
                });
            });
            let hinges =
                (0..self.hinges.len()).filter(|&k| span.holds_any(pattern, &self.hinges[k].vertices));
            in_lanes(hinges, |ks, count| {
                let bent = self.bent(ks, stiffness, x, scale);
                hessian_of_hinge(&bent, kind).blocks(|place, block| {
                    let places =
                        ks.map(|k| &self.hinges[k]).map(|h| Place::of_element(&h.vertices, &h.pairs, place));
                    add_blocks(pattern, &mut columns, &places[..count], block);
                });
            });
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
            let (_, gradient) = h.bent(h.arms(x), 1.0).value_and_gradient();
            let along = gradient.iter().zip(h.arms(lambda)).map(|(g, l)| DVec3::from_array(*g).dot(l));
            *out += scale * along.sum::<f64>();
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
            *out += scale * h.bent(h.arms(x), 1.0).hessian().form(h.arms(a), h.arms(b));
        });
    }
}

/// Of one membrane, or of four.
#[inline(always)]
fn hessian_of_membrane<T: Real>(strained: &Strained<T>, kind: HessianKind) -> membrane::Hessian<T> {
    match kind {
        HessianKind::Exact => strained.hessian(),
        HessianKind::Projected => strained.hessian_projected(),
        HessianKind::GaussNewton => strained.hessian_gauss_newton(),
    }
}

/// Of one hinge, or of four.
#[inline(always)]
fn hessian_of_hinge<T: Real>(bent: &Bent<T>, kind: HessianKind) -> hinge::Hessian<T> {
    match kind {
        HessianKind::Exact => bent.hessian(),
        HessianKind::Projected => bent.hessian_projected(),
        HessianKind::GaussNewton => bent.hessian_gauss_newton(),
    }
}

/// Adds one block of each of some elements.
fn add_blocks(pattern: &BlockPattern, columns: &mut Columns, places: &[Place], block: &Matrix<Lanes>) {
    for (place, block) in places.iter().zip(&each_matrix(block)) {
        columns.add_block(pattern, *place, block);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2};

    use super::*;
    use crate::{Cloth, Fabric};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn four_elements_at_a_time_are_as_one_by_one() {
        let fabric = Fabric { warp: 300.0, weft: 200.0, poisson: 0.2, shear: 20.0, bend: 1e-5 };
        let mesh = grid(6, 5, DVec2::splat(0.1), 1.0);
        let cloth = Cloth::continuum(&mesh);
        let (continuum, stiffness) = (cloth.continuum.as_ref().unwrap(), fabric.stiffness(&cloth));
        let mut rng = Rng::new(2, 0);
        let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p + rng.vector() * 0.01).collect();
        for kind in [HessianKind::Exact, HessianKind::Projected, HessianKind::GaussNewton] {
            let [mut fast, mut plain] = [0, 1].map(|_| BlockMatrix::zeros(&cloth.pattern));
            continuum.add_hessian(&stiffness, &x, kind, 1.0, (&cloth.pattern, &mut fast));
            let mut columns = plain.whole();
            let mut add = |place, block: &Matrix<f64>| {
                columns.add_block(&cloth.pattern, place, &DMat3::from_cols_array_2d(block));
            };
            for (m, c) in continuum.membranes.iter().zip(&stiffness.membrane) {
                let strained = m.strained(m.gradients(&x), *c);
                hessian_of_membrane(&strained, kind)
                    .blocks(m.weights, |k, block| add(Place::of_element(&m.vertices, &m.pairs, k), block));
            }
            for (h, b) in continuum.hinges.iter().zip(&stiffness.hinge) {
                let bent = h.bent(h.arms(&x), *b);
                hessian_of_hinge(&bent, kind)
                    .blocks(|k, block| add(Place::of_element(&h.vertices, &h.pairs, k), block));
            }
            let (difference, largest) = fast.difference(&plain);
            // Summed in another order.
            assert!(difference < 1e-14 * largest && largest > 0.0, "{kind:?}: {difference} of {largest}");
        }
        let (mut fast, mut plain) = (vec![DVec3::ZERO; x.len()], vec![DVec3::ZERO; x.len()]);
        let energy = continuum.add_gradient(&stiffness, &x, 1.0, &mut fast);
        for (m, c) in continuum.membranes.iter().zip(&stiffness.membrane) {
            let gradient = m.strained(m.gradients(&x), *c).gradient();
            m.scatter(by_corners(gradient, m.weights).map(DVec3::from_array), &mut plain);
        }
        for (h, b) in continuum.hinges.iter().zip(&stiffness.hinge) {
            h.scatter(h.bent(h.arms(&x), *b).value_and_gradient().1.map(DVec3::from_array), &mut plain);
        }
        let largest = plain.iter().map(|g| g.length()).fold(0.0, f64::max);
        let off = fast.iter().zip(&plain).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-14 * largest && largest > 0.0, "{off} of {largest}");
        let sum = continuum.energy(&stiffness, &x);
        let plain_energy = sum.stretch + sum.bend + sum.shear;
        assert!((energy - plain_energy).abs() < 1e-13 * energy && energy > 0.0, "{energy} {plain_energy}");
    }
}
