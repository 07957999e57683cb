//! Domain-free numerics: random streams, sparse symmetric systems, gradient checks.

mod arcs;
pub mod block_matrix;
pub mod conjugate_gradients;
pub mod delaunay;
mod dissection;
pub mod factor;
pub mod gradient_check;
pub mod hyper_dual;
pub mod lanes;
pub mod median;
pub mod minimise;
mod multifrontal;
pub mod rng;
pub mod root;
pub mod scalar;

use glam::{DMat3, DVec3};

/// Dot product of two fields of vectors.
#[inline]
pub fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// a bᵀ.
#[inline]
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The 3·V numbers of a field of vectors.
#[inline]
pub fn flat(field: &[DVec3]) -> &[f64] {
    bytemuck::cast_slice(field)
}

/// A field of vectors from its 3·V numbers.
pub fn vectors(numbers: &[f64]) -> Vec<DVec3> {
    numbers.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Whether every number is finite.
#[inline]
pub fn finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}
