//! Robust kernels: what is far off counts as an outlier.
//!
//! A residual r of spread σ is counted in spreads, u = r/σ. Both kernels c(u; τ) are ½ u² as long as u is small
//! against the tail τ, so that a residual of one σ costs ½; beyond this many spreads they grow less and less:
//!
//! | kernel | c(u; τ) | weight c'(u)/u | far beyond τ |
//! |---|---|---|---|
//! | Cauchy | ½ τ² ln(1 + (u/τ)²) | 1/(1 + (u/τ)²) | grows as ln u |
//! | Geman and McClure | ½ u²/(1 + (u/τ)²) | 1/(1 + (u/τ)²)² | ½ τ² at most |
//!
//! Of both k c(u; τ) = c(√k u; √k τ): what counts k times has a noise that is smaller by √k, and the same cut-off σ τ.

/// Cauchy's kernel of a residual of `u` spreads, and its weight.
pub fn cauchy(u: f64, tail: f64) -> (f64, f64) {
    let s = (u / tail).powi(2);
    (0.5 * tail * tail * s.ln_1p(), 1.0 / (1.0 + s))
}

/// Geman and McClure's kernel of a residual of several components, whose squares in spreads add up to `sq_u`, and
/// its weight.
pub fn geman_mcclure(sq_u: f64, tail: f64) -> (f64, f64) {
    let sq_tail = tail * tail;
    let ratio = sq_tail / (sq_tail + sq_u);
    (0.5 * ratio * sq_u, ratio * ratio)
}

/// What a residual of the images is counted in, and from where on it is an outlier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Spread σ, in the residual's unit.
    pub sigma: f64,
    /// Tail τ `[σ]`.
    pub tail: f64,
}

impl Noise {
    /// The cut-off σ τ, in the residual's unit.
    pub fn cut_off(self) -> f64 {
        self.sigma * self.tail
    }

    /// [`cauchy`] of `residual`, and the weight of its square: c'(r/σ)/r.
    pub fn cauchy(self, residual: f64) -> (f64, f64) {
        let (value, weight) = cauchy(residual / self.sigma, self.tail);
        (value, weight / (self.sigma * self.sigma))
    }

    /// [`geman_mcclure`] of the residual with this square, and the weight of it: c'(r/σ)/r.
    pub fn geman_mcclure(self, sq_residual: f64) -> (f64, f64) {
        let precision = 1.0 / (self.sigma * self.sigma);
        let (value, weight) = geman_mcclure(sq_residual * precision, self.tail);
        (value, weight * precision)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Kernel = fn(f64, f64) -> (f64, f64);
    type OfNoise = fn(Noise, f64) -> (f64, f64);
    const KERNELS: [Kernel; 2] = [cauchy, |u, tail| geman_mcclure(u * u, tail)];
    const OF_NOISE: [OfNoise; 2] = [Noise::cauchy, |n, r| n.geman_mcclure(r * r)];

    #[test]
    fn weights_are_the_derivatives() {
        let noise = Noise { sigma: 0.3, tail: 2.0 };
        for (kernel, of_noise) in KERNELS.into_iter().zip(OF_NOISE) {
            for r in [0.01, 0.3, 1.0, 7.0] {
                let h = 1e-5 * r;
                let slope = (kernel(r + h, 2.0).0 - kernel(r - h, 2.0).0) / (2.0 * h);
                assert!((kernel(r, 2.0).1 * r / slope - 1.0).abs() < 1e-8);
                let slope = (of_noise(noise, r + h).0 - of_noise(noise, r - h).0) / (2.0 * h);
                assert!((of_noise(noise, r).1 * r / slope - 1.0).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn one_spread_costs_a_half_and_what_is_beyond_the_tail_less_than_its_square() {
        let noise = Noise { sigma: 0.3, tail: 1e4 };
        for cost in [noise.cauchy(0.3).0, noise.geman_mcclure(0.09).0] {
            assert!((cost - 0.5).abs() < 1e-6, "{cost}");
        }
        let noise = Noise { tail: 5.0, ..noise };
        let far = 1e3 * noise.cut_off();
        assert!((noise.cauchy(far).0 / (25.0 * 1e3f64.ln()) - 1.0).abs() < 1e-6);
        assert!((noise.geman_mcclure(far * far).0 / 12.5 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn what_counts_more_often_has_a_smaller_noise_and_the_same_cut_off() {
        for kernel in KERNELS {
            for (u, tail, k) in [(0.2, 3.0, 4.0), (2.5, 1.5, 0.3), (40.0, 7.0, 13.0f64)] {
                let (often, smaller) = (k * kernel(u, tail).0, kernel(k.sqrt() * u, k.sqrt() * tail).0);
                assert!((often / smaller - 1.0).abs() < 1e-12, "{often} {smaller}");
            }
        }
    }
}
