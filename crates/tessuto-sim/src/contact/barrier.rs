//! The barrier: 0 from a gap of one thickness on, without bound towards 0, twice differentiable.
//!
//! B(y) = −(1 − y)² ln y for a gap of y thicknesses, 0 < y < 1 (Li et al. 2020, "Incremental Potential Contact").

/// B, B′ and B″ at y > 0.
#[inline]
pub fn barrier(y: f64) -> [f64; 3] {
    if y >= 1.0 {
        return [0.0; 3];
    }
    let (ln, rest) = (y.ln(), 1.0 - y);
    let ratio = rest / y;
    [-rest * rest * ln, 2.0 * rest * ln - rest * ratio, 4.0 * ratio - 2.0 * ln + ratio * ratio]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_differences() {
        let mut worst = 0.0f64;
        for y in [1e-3, 0.05, 0.4, 0.8, 0.99] {
            let step = 1e-5 * y;
            let [_, first, second] = barrier(y);
            let (plus, minus) = (barrier(y + step), barrier(y - step));
            for (k, analytic) in [first, second].into_iter().enumerate() {
                let numeric = (plus[k] - minus[k]) / (2.0 * step);
                assert!(analytic != 0.0);
                worst = worst.max((analytic / numeric - 1.0).abs());
            }
        }
        println!("worst {worst:.1e}");
        assert!(worst < 1e-6, "{worst}");
        assert!(barrier(1.0) == [0.0; 3] && barrier(2.0) == [0.0; 3] && barrier(1e-9)[0] > 10.0);
    }
}
