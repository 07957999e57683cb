//! Robust kernels: residuals beyond a scale count less than their square.

/// Cauchy's kernel ρ(r) = ½ τ² ln(1 + (r/τ)²) and its weight ρ'(r)/r = 1/(1 + (r/τ)²).
pub fn cauchy(residual: f64, tail: f64) -> (f64, f64) {
    let s = (residual / tail).powi(2);
    (0.5 * tail * tail * s.ln_1p(), 1.0 / (1.0 + s))
}

/// Kernel of Geman and McClure for a residual of several components, given r² = ‖r‖²:
/// ρ = ½ σ² r²/(σ² + r²), and its weight 2 ∂ρ/∂r² = (σ²/(σ² + r²))².
pub fn geman_mcclure(sq_residual: f64, sigma: f64) -> (f64, f64) {
    let sq_sigma = sigma * sigma;
    let ratio = sq_sigma / (sq_sigma + sq_residual);
    (0.5 * ratio * sq_residual, ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_derivatives() {
        for r in [0.01, 0.3, 1.0, 7.0] {
            let h = 1e-5 * r;
            let slope = (cauchy(r + h, 2.0).0 - cauchy(r - h, 2.0).0) / (2.0 * h);
            assert!((cauchy(r, 2.0).1 * r / slope - 1.0).abs() < 1e-8);
            let of = |r: f64| geman_mcclure(r * r, 0.5).0;
            let slope = (of(r + h) - of(r - h)) / (2.0 * h);
            assert!((geman_mcclure(r * r, 0.5).1 * r / slope - 1.0).abs() < 1e-8);
        }
    }
}
