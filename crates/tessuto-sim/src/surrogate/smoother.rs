//! The matrix that turns residuals into steps: masses and a Laplacian, the same for all coordinates.
//!
//! A = M/h² + k L with the Laplacian L of the edges: the upper bound of the stretch springs' Hessian by which
//! projective dynamics steps (\[Bouaziz14\]). A banded matrix in the order of the lattice, factorised as R Rᵀ in a
//! fraction of a millisecond.

use glam::DVec3;

use crate::cloth::Cloth;
use crate::lattice::Lattice;

/// R, by rows.
#[derive(Debug)]
pub struct Smoother {
    /// Entries to the left of the diagonal in each row.
    band: usize,
    /// Shape [V, band + 1], the diagonal last and inverted.
    rows: Vec<f64>,
}

impl Smoother {
    /// Of masses over `h`² and `stiffness` times the Laplacian [N/m].
    pub fn new(cloth: &Cloth, lattice: &Lattice, h: f64, stiffness: f64) -> Self {
        let (n, band) = (lattice.vertices.len(), lattice.columns);
        let width = band + 1;
        let mut rows = vec![0.0; n * width];
        for (k, &vertex) in lattice.vertices.iter().enumerate() {
            rows[k * width + band] += cloth.masses[vertex as usize] / (h * h);
            for (side, _) in lattice.edges[k].iter().enumerate().filter(|(_, edge)| edge.is_some()) {
                let gap = [1, lattice.columns][side];
                rows[k * width + band] += stiffness;
                rows[(k + gap) * width + band] += stiffness;
                rows[(k + gap) * width + band - gap] -= stiffness;
            }
        }
        for row in 0..n {
            let (done, own) = rows.split_at_mut(row * width);
            let first = row.saturating_sub(band);
            for column in first..row {
                let above = &done[column * width..][..width];
                // Columns from `start` on are in the bands of both rows.
                let start = first.max(column.saturating_sub(band));
                let (a, b) = (start + band - row, start + band - column);
                let count = column - start;
                let sum: f64 = own[a..a + count].iter().zip(&above[b..b + count]).map(|(x, y)| x * y).sum();
                own[column + band - row] = (own[column + band - row] - sum) * above[band];
            }
            let square: f64 = own[..band].iter().map(|x| x * x).sum();
            own[band] = 1.0 / (own[band] - square).sqrt();
        }
        Self { band, rows }
    }

    /// A⁻¹ `field`, shape `[V]`.
    pub fn solve(&self, lattice: &Lattice, field: &[DVec3]) -> Vec<DVec3> {
        let (band, width, n) = (self.band, self.band + 1, field.len());
        let mut x: Vec<DVec3> = lattice.vertices.iter().map(|v| field[*v as usize]).collect();
        for row in 0..n {
            let own = &self.rows[row * width..][..width];
            let first = row.saturating_sub(band);
            let (done, rest) = x.split_at_mut(row);
            let known = done[first..].iter().zip(&own[first + band - row..band]);
            let sum = known.fold(DVec3::ZERO, |sum, (x, r)| sum + *x * *r);
            rest[0] = (rest[0] - sum) * own[band];
        }
        for row in (0..n).rev() {
            let own = &self.rows[row * width..][..width];
            let first = row.saturating_sub(band);
            let (others, rest) = x.split_at_mut(row);
            let value = rest[0] * own[band];
            rest[0] = value;
            others[first..]
                .iter_mut()
                .zip(&own[first + band - row..band])
                .for_each(|(x, r)| *x -= value * *r);
        }
        let mut out = vec![DVec3::ZERO; n];
        lattice.vertices.iter().zip(&x).for_each(|(v, x)| out[*v as usize] = *x);
        out
    }
}

/// aᵀ L b of the Laplacian L of the edges.
pub fn along_laplacian(cloth: &Cloth, a: &[DVec3], b: &[DVec3]) -> f64 {
    cloth.edges.iter().map(|e| e.along(a).dot(e.along(b))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    #[test]
    fn it_solves() {
        let mesh = grid(6, 5, glam::DVec2::new(0.1, 0.09), 1.0);
        let cloth = Cloth::new(&mesh);
        let lattice = cloth.lattice.as_deref().unwrap();
        let mut rng = Rng::new(1, 0);
        let b: Vec<DVec3> = (0..30).map(|_| rng.vector()).collect();
        let (h, k) = (5e-3, 70.0);
        let x = Smoother::new(&cloth, lattice, h, k).solve(lattice, &b);
        let mut product: Vec<DVec3> = x.iter().zip(&cloth.masses).map(|(x, m)| *x * (m / (h * h))).collect();
        cloth.edges.iter().for_each(|e| e.scatter(e.along(&x) * k, &mut product));
        for (p, b) in product.iter().zip(&b) {
            assert!(p.distance(*b) < 1e-10, "{p} {b}");
        }
    }
}
