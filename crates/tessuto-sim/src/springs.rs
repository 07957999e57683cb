//! Sums over stretch and angle springs, four at a time.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::angle::{self, Turned};
use super::cloth::{AngleSpring, Cloth, Edge};
use super::stiffness::{HessianKind, Stiffness};
use super::stretch::Stretched;
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern, Columns, Sides};
use tessuto_core::math::lanes::{LANES, Lanes, add_rows, each_row, gather, in_lanes, rows, vectors};
use tessuto_core::math::scalar::{Real, Vector, dot, form, scale as scaled, subtract};

/// Springs of one parallel task; fewer cost more to hand over than to do.
const TASK: usize = 1000;

/// Which halves of the matrices springs are added to: edges; bending, then shearing pairs.
pub(super) type SpringSides = Arc<[Sides; 2]>;

/// Of the springs with these vertices.
pub(super) fn sides(pattern: &BlockPattern, edges: &[Edge], angles: [&[AngleSpring]; 2]) -> SpringSides {
    let of_edges = pattern.sides(edges.iter().map(|e| &e.vertices[..]));
    let of_angles = pattern.sides(angles.into_iter().flatten().map(|a| &a.vertices[..]));
    Arc::new([of_edges, of_angles])
}

/// A cloth's springs and how stiff they are.
#[derive(Clone, Copy)]
pub(super) struct Springs<'a> {
    pub cloth: &'a Cloth,
    pub stiffness: &'a Stiffness,
}

impl<'a> Springs<'a> {
    /// Bending, then shearing pairs.
    fn angle(&self, k: usize) -> &'a AngleSpring {
        let bends = &self.cloth.bends;
        bends.get(k).unwrap_or_else(|| &self.cloth.shears[k - bends.len()])
    }

    fn angle_count(&self) -> usize {
        self.cloth.bends.len() + self.cloth.shears.len()
    }

    fn angle_stiffness(&self, k: usize) -> f64 {
        let bends = &self.stiffness.bend;
        bends.get(k).copied().unwrap_or_else(|| self.stiffness.shear[k - bends.len()])
    }

    /// Four angle springs with their vertices at `x`.
    #[inline(always)]
    fn turned(&self, ks: [usize; LANES], x: &[Lanes], scale: f64) -> Turned<Lanes> {
        turned(ks.map(|k| self.angle(k)), x, gather(|k| self.angle_stiffness(ks[k]) * scale))
    }

    /// Four edges with their ends at `x`.
    #[inline(always)]
    fn stretched(&self, ks: [usize; LANES], x: &[Lanes], scale: f64) -> Stretched<Lanes> {
        let stiffness = gather(|k| self.stiffness.stretch[ks[k]]);
        stretched(ks.map(|k| &self.cloth.edges[k]), x, stiffness, scale)
    }

    /// [`Cloth::add_gradient`].
    pub fn add_gradient(&self, x: &[DVec3], scale: f64, out: &mut [DVec3]) -> f64 {
        let (scale, x) = (Lanes::splat(scale), &rows(x));
        self.add_of_elements(
            out,
            |ks| {
                let edges = self.stretched(ks, x, 1.0);
                (edges.value(), scaled(edges.gradient(), scale))
            },
            |ks| {
                let (values, gradients) = self.turned(ks, x, 1.0).value_and_gradient();
                (values, gradients.map(|g| scaled(g, scale)))
            },
        )
    }

    /// [`Cloth::add_third`].
    pub fn add_third(&self, x: &[DVec3], [a, b]: [&[DVec3]; 2], scale: f64, out: &mut [DVec3]) {
        let (x, a, b) = (&rows(x), &rows(a), &rows(b));
        self.add_of_elements(
            out,
            |ks| {
                let along = |field: &[Lanes]| along(ks.map(|k| &self.cloth.edges[k]), field);
                (Lanes::ZERO, self.stretched(ks, x, scale).third(along(a), along(b)))
            },
            |ks| {
                let arms = |field: &[Lanes]| arms(ks.map(|k| self.angle(k)), field);
                (Lanes::ZERO, self.turned(ks, x, scale).third(arms(a), arms(b)))
            },
        );
    }

    /// Adds the gradients of all springs and returns the sum of their numbers: in two sums, the same bits on one thread
    /// and on two.
    fn add_of_elements(
        &self,
        out: &mut [DVec3],
        of_edges: impl Fn([usize; LANES]) -> (Lanes, Vector<Lanes>) + Send + Sync,
        of_angles: impl Fn([usize; LANES]) -> (Lanes, [Vector<Lanes>; 2]) + Send + Sync,
    ) -> f64 {
        let [mut first, mut second] = [0, 1].map(|_| vec![Lanes::ZERO; out.len()]);
        let angles = |range: Range<usize>, out: &mut [Lanes]| {
            let mut sum = 0.0;
            in_lanes(range, |ks, count| {
                let (values, [gu, gw]) = of_angles(ks);
                let (values, gu, gw) = (values.to_array(), each_row(gu), each_row(gw));
                for k in 0..count {
                    self.angle(ks[k]).scatter([gu[k], gw[k]], out);
                    sum += values[k];
                }
            });
            sum
        };
        let half = self.angle_count() / 2;
        let (first_sum, second_sum) = rayon::join(
            || {
                let mut sum = 0.0;
                in_lanes(0..self.cloth.edges.len(), |ks, count| {
                    let (values, gradients) = of_edges(ks);
                    let (values, gradients) = (values.to_array(), each_row(gradients));
                    for k in 0..count {
                        self.cloth.edges[ks[k]].scatter(gradients[k], &mut first);
                        sum += values[k];
                    }
                });
                sum + angles(0..half, &mut first)
            },
            || angles(half..self.angle_count(), &mut second),
        );
        [first, second].iter().for_each(|rows| add_rows(rows, out));
        first_sum + second_sum
    }

    /// [`Cloth::add_hessian`].
    pub fn add_hessian(&self, x: &[DVec3], kind: HessianKind, scale: f64, matrix: &mut BlockMatrix) {
        let (pattern, x) = (&self.cloth.pattern, &rows(x));
        let add = |mut columns: Columns, side: usize| {
            let edges = &self.cloth.edges;
            let near = self.cloth.sides[0][side].iter().map(|k| *k as usize);
            in_lanes(near, |ks, count| {
                let stretched = self.stretched(ks, x, scale);
                let block = match kind {
                    HessianKind::Exact => stretched.hessian(),
                    HessianKind::Projected | HessianKind::GaussNewton => stretched.hessian_projected(),
                };
                let of = ks.map(|k| &edges[k]);
                for end in 0..2 {
                    columns.add_diagonals(pattern, of.map(|e| e.vertices[end]), count, &block);
                }
                let apart = tessuto_core::math::scalar::negated(block);
                columns.add_pairs(pattern, of.map(|e| e.pair), count, &apart);
            });
            let near = self.cloth.sides[1][side].iter().map(|k| *k as usize);
            in_lanes(near, |ks, count| {
                let of = ks.map(|k| self.angle(k));
                hessian_of_angle(&self.turned(ks, x, scale), kind).blocks(|place, block| match place {
                    0..3 => columns.add_diagonals(pattern, of.map(|a| a.vertices[place]), count, block),
                    _ => columns.add_pairs(pattern, of.map(|a| a.pairs[place - 3]), count, block),
                });
            });
        };
        let [first, second] = matrix.halves(pattern);
        rayon::join(|| add(first, 0), || add(second, 1));
        // The few on the border: the same bits on one thread and on two.
        add(matrix.whole(), 2);
    }
}

/// [`Cloth::add_gradient_by_stiffness`].
pub(super) fn add_gradient_by_stiffness(
    cloth: &Cloth,
    x: &[DVec3],
    lambda: &[DVec3],
    scale: f64,
    out: &mut Stiffness,
) {
    let (x, lambda) = (&rows(x), &rows(lambda));
    let of_edges =
        |edges: [&Edge; LANES]| dot(stretched(edges, x, Lanes::ONE, 1.0).gradient(), along(edges, lambda));
    let of_angles = |springs: [&AngleSpring; LANES]| {
        let [gu, gw] = turned(springs, x, Lanes::ONE).value_and_gradient().1;
        let [lu, lw] = arms(springs, lambda);
        dot(gu, lu) + dot(gw, lw)
    };
    add_each(cloth, scale, out, of_edges, of_angles);
}

/// [`Cloth::add_hessian_by_stiffness`].
pub(super) fn add_hessian_by_stiffness(
    cloth: &Cloth,
    x: &[DVec3],
    [a, b]: [&[DVec3]; 2],
    scale: f64,
    out: &mut Stiffness,
) {
    let (x, a, b) = (&rows(x), &rows(a), &rows(b));
    let of_edges = |edges: [&Edge; LANES]| {
        let hessian = stretched(edges, x, Lanes::ONE, 1.0).hessian();
        form(along(edges, a), hessian, along(edges, b))
    };
    let of_angles = |springs: [&AngleSpring; LANES]| {
        turned(springs, x, Lanes::ONE).form(arms(springs, a), arms(springs, b))
    };
    add_each(cloth, scale, out, of_edges, of_angles);
}

/// Adds `scale` times a number of every spring.
fn add_each(
    cloth: &Cloth,
    scale: f64,
    out: &mut Stiffness,
    of_edges: impl Fn([&Edge; LANES]) -> Lanes + Send + Sync,
    of_angles: impl Fn([&AngleSpring; LANES]) -> Lanes + Send + Sync,
) {
    add_of(&cloth.edges, scale, &mut out.stretch, of_edges);
    add_of(&cloth.bends, scale, &mut out.bend, &of_angles);
    add_of(&cloth.shears, scale, &mut out.shear, &of_angles);
}

fn add_of<E: Sync>(
    springs: &[E],
    scale: f64,
    out: &mut [f64],
    of: impl Fn([&E; LANES]) -> Lanes + Send + Sync,
) {
    springs.par_chunks(TASK).zip(out.par_chunks_mut(TASK)).for_each(|(springs, out)| {
        in_lanes(0..springs.len(), |ks, count| {
            let values = of(ks.map(|k| &springs[k])).to_array();
            ks.iter().zip(values).take(count).for_each(|(k, value)| out[*k] += scale * value);
        });
    });
}

#[inline(always)]
fn turned(springs: [&AngleSpring; LANES], x: &[Lanes], stiffness: Lanes) -> Turned<Lanes> {
    let [u, w] = arms(springs, x);
    Turned { u, w, stiffness, rest_angle: gather(|k| springs[k].rest_angle) }
}

/// `stiffness` where the edges are stretched.
#[inline(always)]
fn stretched(edges: [&Edge; LANES], x: &[Lanes], stiffness: Lanes, scale: f64) -> Stretched<Lanes> {
    let along = along(edges, x);
    let rest_length = gather(|k| edges[k].rest_length);
    let missing = rest_length * rest_length - dot(along, along);
    let compressed = stiffness * gather(|k| edges[k].compression);
    let stiffness = missing.select_above(0.0, compressed, stiffness) * Lanes::splat(scale);
    Stretched { along, stiffness, rest_length }
}

/// (o − a, c − o) of a field's rows at four angle springs.
#[inline(always)]
fn arms(springs: [&AngleSpring; LANES], field: &[Lanes]) -> [Vector<Lanes>; 2] {
    let corner = |c: usize| vectors(field, springs.map(|s| s.vertices[c]));
    let o = corner(1);
    [subtract(o, corner(0)), subtract(corner(2), o)]
}

/// Difference of a field's rows along four edges.
#[inline(always)]
fn along(edges: [&Edge; LANES], field: &[Lanes]) -> Vector<Lanes> {
    let end = |c: usize| vectors(field, edges.map(|e| e.vertices[c]));
    subtract(end(1), end(0))
}

/// Of one angle spring, or of four.
#[inline(always)]
fn hessian_of_angle<T: Real>(turned: &Turned<T>, kind: HessianKind) -> angle::Hessian<T> {
    match kind {
        HessianKind::Exact => turned.hessian(),
        HessianKind::Projected => turned.hessian_projected(),
        HessianKind::GaussNewton => turned.hessian_gauss_newton(),
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2};

    use super::*;
    use crate::cloth::arms;
    use crate::stretch;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    /// Asserts that both are the same but for the order of sums.
    fn check(name: &str, fast: &[DVec3], plain: &[DVec3]) {
        let largest = plain.iter().map(|g| g.length()).fold(0.0, f64::max);
        let off = fast.iter().zip(plain).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-13 * largest && largest > 0.0, "{name}: {off} of {largest}");
    }

    #[test]
    fn four_springs_at_a_time_are_as_one_by_one() {
        let mesh = grid(6, 5, DVec2::splat(0.1), 1.0);
        // Edges that resist less when shorter.
        let cloth = Cloth::flat(&mesh, 0.3);
        let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
        let mut rng = Rng::new(2, 0);
        let mut field =
            |size: f64| -> Vec<DVec3> { mesh.positions.iter().map(|_| rng.vector() * size).collect() };
        let x: Vec<DVec3> = mesh.positions.iter().zip(field(0.01)).map(|(p, d)| *p + d).collect();
        let (a, b) = (field(1.0), field(1.0));
        let angles = || {
            let bends = cloth.bends.iter().zip(&stiffness.bend);
            bends.chain(cloth.shears.iter().zip(&stiffness.shear))
        };
        let edges = || cloth.edges.iter().zip(&stiffness.stretch).map(|(e, k)| (e, e.stiffness(*k, &x)));
        for kind in [HessianKind::Exact, HessianKind::Projected, HessianKind::GaussNewton] {
            let [mut fast, mut plain] = [0, 1].map(|_| BlockMatrix::zeros(&cloth.pattern));
            cloth.add_hessian(&stiffness, &x, kind, 1.0, &mut fast);
            let mut columns = plain.whole();
            for (e, k) in edges() {
                let block: DMat3 = match kind {
                    HessianKind::Exact => stretch::hessian(e.along(&x), k, e.rest_length),
                    _ => stretch::hessian_projected(e.along(&x), k, e.rest_length),
                };
                e.vertices.iter().for_each(|v| columns.add_diagonal(&cloth.pattern, *v as usize, &block));
                columns.add_pair(&cloth.pattern, e.pair, &-block);
            }
            for (spring, k) in angles() {
                let [u, w] = arms(&x, spring.vertices).map(|arm| arm.to_array());
                let turned = Turned { u, w, stiffness: *k, rest_angle: spring.rest_angle };
                let hessian = hessian_of_angle(&turned, kind);
                spring.scatter_hessian(&hessian, &cloth.pattern, &mut columns);
            }
            let (difference, largest) = fast.difference(&plain);
            assert!(difference < 1e-13 * largest && largest > 0.0, "{kind:?}: {difference} of {largest}");
        }
        let [mut gradient, mut third, mut fast_third] = [0, 1, 2].map(|_| vec![DVec3::ZERO; x.len()]);
        let [mut by_first, mut by_second] = [0, 1].map(|_| Stiffness::uniform(&cloth, [0.0; 3]));
        for (k, (e, stiffness)) in edges().enumerate() {
            let (along, l, unit) = (e.along(&x), e.rest_length, e.stiffness(1.0, &x));
            e.scatter(stretch::gradient(along, stiffness, l), &mut gradient);
            e.scatter(stretch::third(along, stiffness, l, e.along(&a), e.along(&b)), &mut third);
            by_first.stretch[k] = stretch::gradient(along, unit, l).dot(e.along(&a));
            by_second.stretch[k] = e.along(&a).dot(stretch::hessian(along, unit, l) * e.along(&b));
        }
        for (k, (spring, stiffness)) in angles().enumerate() {
            let [of_x, of_a, of_b] = [&x, &a, &b].map(|field| arms(field, spring.vertices));
            let ([u, w], rest) = (of_x, spring.rest_angle);
            spring.scatter(angle::gradient(u, w, *stiffness, rest), &mut gradient);
            spring.scatter(angle::third(of_x, *stiffness, rest, of_a, of_b), &mut third);
            let of = |by: &mut Stiffness, value| match k.checked_sub(cloth.bends.len()) {
                None => by.bend[k] = value,
                Some(k) => by.shear[k] = value,
            };
            let [gu, gw] = angle::gradient(u, w, 1.0, rest);
            of(&mut by_first, gu.dot(of_a[0]) + gw.dot(of_a[1]));
            let unit = Turned { u: u.to_array(), w: w.to_array(), stiffness: 1.0, rest_angle: rest };
            let [of_a, of_b] = [of_a, of_b].map(|arms| arms.map(|arm| arm.to_array()));
            of(&mut by_second, unit.form(of_a, of_b));
        }
        let mut fast = vec![DVec3::ZERO; x.len()];
        let energy = cloth.add_gradient(&stiffness, &x, 1.0, &mut fast);
        let plain = cloth.energy(&stiffness, &x).total();
        assert!((energy - plain).abs() < 1e-13 * plain && plain > 0.0, "{energy} {plain}");
        check("gradient", &fast, &gradient);
        cloth.add_third(&stiffness, &x, [&a, &b], 1.0, &mut fast_third);
        check("third", &fast_third, &third);
        let [mut first, mut second] = [0, 1].map(|_| Stiffness::uniform(&cloth, [0.0; 3]));
        cloth.add_gradient_by_stiffness(&x, &a, 1.0, &mut first);
        cloth.add_hessian_by_stiffness(&x, [&a, &b], 1.0, &mut second);
        for (fast, plain) in [(first, by_first), (second, by_second)] {
            let lists = |k: &Stiffness| [k.stretch.clone(), k.bend.clone(), k.shear.clone()].concat();
            let (fast, plain) = (lists(&fast), lists(&plain));
            let largest = plain.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let off = fast.iter().zip(&plain).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            assert!(off < 1e-12 * largest && largest > 0.0, "{off} of {largest}");
        }
    }
}
