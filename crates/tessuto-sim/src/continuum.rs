//! Sums over orthotropic membranes and bending hinges, on any triangle mesh.

use glam::DVec3;
use rayon::prelude::*;

use super::hinge::{self, Bent, Hinge};
use super::membrane::{self, Coefficients, Membrane, Strained, by_corners};
use super::stiffness::{Energy, HessianKind, Stiffness};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern, Columns, Sides};
use tessuto_core::math::lanes::{LANES, Lanes, add_rows, each_row, gather, in_lanes, rows};
use tessuto_core::math::scalar::{Real, Vector, dot, scale as scaled};

/// Elements of one parallel task; fewer cost more to hand over than to do.
const TASK: usize = 500;

/// Membranes and hinges of a cloth; see [`super::fabric`].
#[derive(Debug, Clone)]
pub struct Continuum {
    /// One of each triangle that has an area.
    pub membranes: Vec<Membrane>,
    /// One of each edge between two of them.
    pub hinges: Vec<Hinge>,
    /// Membranes, then hinges.
    sides: [Sides; 2],
}

impl Continuum {
    /// The continuum of these elements, whose pairs are the `pattern`'s.
    pub fn new(membranes: Vec<Membrane>, hinges: Vec<Hinge>, pattern: &BlockPattern) -> Self {
        let of_membranes = pattern.sides(membranes.iter().map(|m| &m.vertices[..]));
        let of_hinges = pattern.sides(hinges.iter().map(|h| &h.vertices[..]));
        Self { membranes, hinges, sides: [of_membranes, of_hinges] }
    }

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
        let (scale, x) = (Lanes::splat(scale), &rows(x));
        self.add_of_elements(
            out,
            |ks| {
                let (strained, weights) = self.strained(ks, stiffness, x, 1.0);
                let [stretch, shear] = strained.value();
                each(stretch + shear, by_corners(strained.gradient(), weights).map(|g| scaled(g, scale)))
            },
            |ks| {
                let (value, gradient) = self.bent(ks, stiffness, x, 1.0).value_and_gradient();
                each(value, gradient.map(|g| scaled(g, scale)))
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
        let (x, a, b) = (&rows(x), &rows(a), &rows(b));
        self.add_of_elements(
            out,
            |ks| {
                let (strained, weights) = self.strained(ks, stiffness, x, scale);
                let of = |field: &[Lanes]| {
                    Membrane::gradients_lanes(ks.map(|k| &self.membranes[k]), weights, field)
                };
                each(Lanes::ZERO, by_corners(strained.third(of(a), of(b)), weights))
            },
            |ks| {
                let of = |field: &[Lanes]| Hinge::arms_lanes(ks.map(|k| &self.hinges[k]), field);
                each(Lanes::ZERO, self.bent(ks, stiffness, x, scale).third(of(a), of(b)))
            },
        );
    }

    /// Four membranes with their vertices at `x`, and their weights.
    #[inline(always)]
    fn strained(
        &self,
        ks: [usize; LANES],
        stiffness: &Stiffness,
        x: &[Lanes],
        scale: f64,
    ) -> (Strained<Lanes>, membrane::Weights<Lanes>) {
        let coefficient = |c: usize| gather(|k| stiffness.membrane[ks[k]][c] * scale);
        let coefficients = [coefficient(0), coefficient(1), coefficient(2), coefficient(3)];
        Membrane::strained_lanes(ks.map(|k| &self.membranes[k]), x, coefficients)
    }

    /// Four hinges with their vertices at `x`.
    #[inline(always)]
    fn bent(&self, ks: [usize; LANES], stiffness: &Stiffness, x: &[Lanes], scale: f64) -> Bent<Lanes> {
        let stiffnesses = gather(|k| stiffness.hinge[ks[k]] * scale);
        Hinge::bent_lanes(ks.map(|k| &self.hinges[k]), x, stiffnesses)
    }

    /// Adds the gradients of all elements and returns the sum of their numbers: in two sums, the same bits on one
    /// thread and on two.
    fn add_of_elements(
        &self,
        out: &mut [DVec3],
        of_membranes: impl Fn([usize; LANES]) -> [(f64, [Lanes; 3]); LANES] + Send + Sync,
        of_hinges: impl Fn([usize; LANES]) -> [(f64, [Lanes; 3]); LANES] + Send + Sync,
    ) -> f64 {
        let [mut first, mut second] = [0, 1].map(|_| vec![Lanes::ZERO; out.len()]);
        // About as long work for both: membranes, quicker than hinges, are all in the first sum.
        let split = (self.hinges.len() / 2).saturating_sub(self.membranes.len() / 8);
        let hinges = |range: std::ops::Range<usize>, out: &mut [Lanes]| {
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
                        self.membranes[k].scatter(gradient, &mut first);
                        sum += value;
                    }
                });
                sum + hinges(0..split, &mut first)
            },
            || hinges(split..self.hinges.len(), &mut second),
        );
        [first, second].iter().for_each(|rows| add_rows(rows, out));
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
        let x = &rows(x);
        let add = |mut columns: Columns, side: usize| {
            let membranes = self.sides[0][side].iter().map(|k| *k as usize);
            in_lanes(membranes, |ks, count| {
                let (strained, weights) = self.strained(ks, stiffness, x, scale);
                let of = ks.map(|k| &self.membranes[k]);
                hessian_of_membrane(&strained, kind).blocks(weights, |place, block| match place {
                    0..3 => columns.add_diagonals(pattern, of.map(|m| m.vertices[place]), count, block),
                    _ => columns.add_pairs(pattern, of.map(|m| m.pairs[place - 3]), count, block),
                });
            });
            let hinges = self.sides[1][side].iter().map(|k| *k as usize);
            in_lanes(hinges, |ks, count| {
                let bent = self.bent(ks, stiffness, x, scale);
                let of = ks.map(|k| &self.hinges[k]);
                hessian_of_hinge(&bent, kind).blocks(|place, block| match place {
                    0..4 => columns.add_diagonals(pattern, of.map(|h| h.vertices[place]), count, block),
                    _ => columns.add_pairs(pattern, of.map(|h| h.pairs[place - 4]), count, block),
                });
            });
        };
        let [first, second] = matrix.halves(pattern);
        rayon::join(|| add(first, 0), || add(second, 1));
        // The few on the border: the same bits on one thread and on two.
        add(matrix.whole(), 2);
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
        let (x, lambda) = (&rows(x), &rows(lambda));
        self.add_by_bending(scale, &mut out.hinge, |hinges| {
            let [e, u, w] = Hinge::arms_lanes(hinges, lambda);
            let [ge, gu, gw] = Hinge::bent_lanes(hinges, x, Lanes::ONE).value_and_gradient().1;
            dot(ge, e) + dot(gu, u) + dot(gw, w)
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
        let (x, a, b) = (&rows(x), &rows(a), &rows(b));
        self.add_by_bending(scale, &mut out.hinge, |hinges| {
            let [a, b] = [a, b].map(|field| Hinge::arms_lanes(hinges, field));
            Hinge::bent_lanes(hinges, x, Lanes::ONE).hessian().form(a, b)
        });
    }

    /// Adds `scale` times a number `of` every hinge.
    fn add_by_bending(
        &self,
        scale: f64,
        out: &mut [f64],
        of: impl Fn([&Hinge; LANES]) -> Lanes + Send + Sync,
    ) {
        self.hinges.par_chunks(TASK).zip(out.par_chunks_mut(TASK)).for_each(|(hinges, out)| {
            in_lanes(0..hinges.len(), |ks, count| {
                let values = of(ks.map(|k| &hinges[k])).to_array();
                ks.iter().zip(values).take(count).for_each(|(k, value)| out[*k] += scale * value);
            });
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

/// The numbers and the rows of four elements, element by element.
#[inline(always)]
fn each(values: Lanes, [a, b, c]: [Vector<Lanes>; 3]) -> [(f64, [Lanes; 3]); LANES] {
    let (values, a, b, c) = (values.to_array(), each_row(a), each_row(b), each_row(c));
    let element = |k: usize| (values[k], [a[k], b[k], c[k]]);
    [element(0), element(1), element(2), element(3)]
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2};

    use super::*;
    use crate::{Cloth, Fabric};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::math::scalar::Matrix;
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
            let mut add = |vertices: &[u32], pairs: &[usize], place: usize, block: &Matrix<f64>| {
                let block = &DMat3::from_cols_array_2d(block);
                match vertices.get(place) {
                    Some(vertex) => columns.add_diagonal(&cloth.pattern, *vertex as usize, block),
                    None => columns.add_pair(&cloth.pattern, pairs[place - vertices.len()], block),
                }
            };
            for (m, c) in continuum.membranes.iter().zip(&stiffness.membrane) {
                let strained = m.strained(m.gradients(&x), *c);
                hessian_of_membrane(&strained, kind)
                    .blocks(m.weights, |k, block| add(&m.vertices, &m.pairs, k, block));
            }
            for (h, b) in continuum.hinges.iter().zip(&stiffness.hinge) {
                let bent = h.bent(h.arms(&x), *b);
                hessian_of_hinge(&bent, kind).blocks(|k, block| add(&h.vertices, &h.pairs, k, block));
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
