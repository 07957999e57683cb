//! Small dense symmetric systems, by Cholesky's method.

/// The lower triangular R with R Rᵀ = A.
#[derive(Debug, Clone, PartialEq)]
pub struct Root {
    size: usize,
    /// Rows, full length.
    rows: Vec<f64>,
}

impl Root {
    /// Of the positive semi-definite `matrix`, shape [size, size], of which the lower half is read; a column is
    /// zero where rounding has left nothing of the matrix.
    pub fn of(matrix: &[f64], size: usize) -> Self {
        let mut rows = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                let [a, b] = [i, j].map(|k| &rows[k * size..][..j]);
                let left = matrix[i * size + j] - a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let pivot = rows[j * size + j];
                rows[i * size + j] = match i == j {
                    true => left.max(0.0).sqrt(),
                    false if pivot > 0.0 => left / pivot,
                    false => 0.0,
                };
            }
        }
        Self { size, rows }
    }

    /// R `x`.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let row = |i: usize| self.rows[i * self.size..][..=i].iter().zip(x).map(|(r, x)| r * x).sum();
        (0..self.size).map(row).collect()
    }

    /// A⁻¹ `rhs`; zero where A has nothing.
    pub fn solve(&self, rhs: &[f64]) -> Vec<f64> {
        let n = self.size;
        let divided = |left: f64, pivot: f64| if pivot > 0.0 { left / pivot } else { 0.0 };
        let mut x = rhs.to_vec();
        for i in 0..n {
            let row = &self.rows[i * n..][..=i];
            let left = x[i] - row[..i].iter().zip(&x).map(|(r, x)| r * x).sum::<f64>();
            x[i] = divided(left, row[i]);
        }
        for i in (0..n).rev() {
            let left = x[i] - (i + 1..n).map(|k| self.rows[k * n + i] * x[k]).sum::<f64>();
            x[i] = divided(left, self.rows[i * n + i]);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn solutions_and_products_are_those_of_the_matrix() {
        let (n, mut rng) = (7, Rng::new(2, 0));
        let half: Vec<f64> = (0..n * n).map(|_| rng.signed()).collect();
        let entry = |i: usize, j: usize| (0..n).map(|k| half[i * n + k] * half[j * n + k]).sum::<f64>();
        let matrix: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        let root = Root::of(&matrix, n);
        let rhs: Vec<f64> = (0..n).map(|_| rng.signed()).collect();
        let x = root.solve(&rhs);
        for i in 0..n {
            let product: f64 = (0..n).map(|j| matrix[i * n + j] * x[j]).sum();
            assert!((product - rhs[i]).abs() < 1e-9, "{product} {}", rhs[i]);
            // Rows of R are what multiplies to the matrix.
            let unit: Vec<f64> = (0..n).map(|j| f64::from(u8::from(j == i))).collect();
            let column = root.multiply(&unit);
            let diagonal: f64 = (0..n).map(|j| root.rows[i * n + j].powi(2)).sum();
            assert!((diagonal - matrix[i * n + i]).abs() < 1e-12 && column[..i].iter().all(|v| *v == 0.0));
        }
        assert_eq!(Root::of(&[0.0; 4], 2).solve(&[1.0, 1.0]), [0.0, 0.0]);
    }
}
