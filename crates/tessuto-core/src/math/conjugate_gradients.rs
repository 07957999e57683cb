//! Preconditioned conjugate gradients for symmetric systems, over any vectors that can be added and multiplied.

use glam::DVec3;

use super::dot;

/// What conjugate gradients need of a vector.
pub trait Vector: Clone {
    /// Σ aᵢ bᵢ.
    fn dot(&self, other: &Self) -> f64;
    /// self + s·other, in place.
    fn add_scaled(&mut self, s: f64, other: &Self);
    /// s·self + other, in place.
    fn scale_and_add(&mut self, s: f64, other: &Self);
}

impl Vector for Vec<DVec3> {
    fn dot(&self, other: &Self) -> f64 {
        dot(self, other)
    }

    fn add_scaled(&mut self, s: f64, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| *a += *b * s);
    }

    fn scale_and_add(&mut self, s: f64, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| *a = *b + *a * s);
    }
}

/// A vector of vectors, such as one for each frame.
impl<V: Vector> Vector for Vec<V> {
    fn dot(&self, other: &Self) -> f64 {
        self.iter().zip(other).map(|(a, b)| a.dot(b)).sum()
    }

    fn add_scaled(&mut self, s: f64, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.add_scaled(s, b));
    }

    fn scale_and_add(&mut self, s: f64, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.scale_and_add(s, b));
    }
}

/// What of the residual r has to become small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// rᵀr, which is known before the last residual would be preconditioned.
    Plain,
    /// rᵀP⁻¹r of the preconditioner P.
    Preconditioned,
}

/// How conjugate gradients ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The residual is small enough.
    Converged,
    /// A direction without positive curvature was met, or a number that is not finite.
    Indefinite,
    /// The most iterations were taken.
    Limit,
}

/// Solves A x = `rhs` from x = 0, given the products with A and with the inverse of a preconditioner P, until the
/// residual's square by `measure` is at most `tolerance` of its start, or for `limit` iterations. Where it does
/// not converge, x is still a direction of descent of ½ xᵀAx − rhsᵀx: its first step is P's own solution. Returns
/// also the number of iterations.
pub fn conjugate_gradients<V: Vector>(
    rhs: &V,
    mut multiply: impl FnMut(&V) -> V,
    mut precondition: impl FnMut(&V) -> V,
    (measure, tolerance): (Measure, f64),
    limit: usize,
) -> (V, End, usize) {
    let mut residual = rhs.clone();
    let mut p = precondition(&residual);
    let mut rz = residual.dot(&p);
    let start = if measure == Measure::Plain { rhs.dot(rhs) } else { rz };
    let is_small = |square: f64| square <= tolerance * start;
    let mut x: Option<V> = None;
    for n in 0..limit {
        let product = multiply(&p);
        let curvature = p.dot(&product);
        let curved = curvature > 0.0;
        if !curved {
            return (x.unwrap_or(p), End::Indefinite, n);
        }
        let scale = rz / curvature;
        let x = x.get_or_insert_with(|| zero_like(&p));
        x.add_scaled(scale, &p);
        residual.add_scaled(-scale, &product);
        if measure == Measure::Plain && is_small(residual.dot(&residual)) {
            return (x.clone(), End::Converged, n + 1);
        }
        if measure == Measure::Plain && n + 1 == limit {
            break;
        }
        let z = precondition(&residual);
        let next = residual.dot(&z);
        if measure == Measure::Preconditioned && is_small(next) {
            return (x.clone(), End::Converged, n + 1);
        }
        let beta = next / rz;
        rz = next;
        p.scale_and_add(beta, &z);
    }
    (x.unwrap_or(p), End::Limit, limit)
}

fn zero_like<V: Vector>(v: &V) -> V {
    let mut zero = v.clone();
    zero.add_scaled(-1.0, v);
    zero
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn a_definite_system_is_solved_and_an_indefinite_one_is_told() {
        let mut rng = Rng::new(5, 0);
        let rhs: Vec<Vec<DVec3>> = (0..3).map(|_| (0..20).map(|_| rng.vector()).collect()).collect();
        let weight = |n: usize, i: usize| 1.0 + (n * 20 + i) as f64;
        let scaled = |v: &Vec<Vec<DVec3>>, f: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<DVec3>> {
            let row =
                |(n, row): (usize, &Vec<DVec3>)| row.iter().enumerate().map(|(i, v)| *v * f(n, i)).collect();
            v.iter().enumerate().map(row).collect()
        };
        // The diagonal and a coupling of all: A = diag + 1 1ᵀ.
        let multiply = |v: &Vec<Vec<DVec3>>| {
            let sum: DVec3 = v.iter().flatten().copied().sum();
            let mut out = scaled(v, &weight);
            out.iter_mut().flatten().for_each(|o| *o += sum);
            out
        };
        let precondition = |v: &Vec<Vec<DVec3>>| scaled(v, &|n, i| 1.0 / weight(n, i));
        for measure in [Measure::Plain, Measure::Preconditioned] {
            let (x, end, _) = conjugate_gradients(&rhs, multiply, precondition, (measure, 1e-24), 100);
            assert_eq!(end, End::Converged);
            let mut left = multiply(&x);
            left.add_scaled(-1.0, &rhs);
            assert!(left.dot(&left) < 1e-20 * rhs.dot(&rhs));
            let negative = |v: &Vec<Vec<DVec3>>| scaled(v, &|_, i| if i == 3 { -1.0 } else { 1.0 });
            assert_eq!(
                conjugate_gradients(&rhs, negative, Clone::clone, (measure, 1e-24), 100).1,
                End::Indefinite
            );
            assert_eq!(conjugate_gradients(&rhs, multiply, precondition, (measure, 0.0), 2).1, End::Limit);
        }
    }
}
