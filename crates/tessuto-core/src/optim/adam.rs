//! Adam.

use rayon::prelude::*;

use crate::math::finite;

/// State of one group of parameters (Kingma and Ba 2015, "Adam: A Method for Stochastic Optimization", alg. 1).
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Adam {
    learning_rate: f64,
    betas: [f64; 2],
    steps: i32,
    mean: Vec<f64>,
    mean_square: Vec<f64>,
}

/// Keeps the denominator positive.
const EPSILON: f64 = 1e-8;
/// Fewest parameters of a parallel task.
const TASK: usize = 1 << 14;

impl Adam {
    /// A group of `len` parameters, with the customary decay rates 0.9 and 0.999.
    pub fn new(len: usize, learning_rate: f64) -> Self {
        let zeros = vec![0.0; len];
        Self { learning_rate, betas: [0.9, 0.999], steps: 0, mean: zeros.clone(), mean_square: zeros }
    }

    /// Whether it is the state of `len` parameters.
    pub fn matches(&self, len: usize) -> bool {
        self.mean.len() == len && self.mean_square.len() == len && self.steps >= 0
    }

    /// Changes the learning rate of the following steps.
    pub fn set_learning_rate(&mut self, learning_rate: f64) {
        self.learning_rate = learning_rate;
    }

    /// Moves `parameters` against `gradient`. Returns whether it did: a gradient that is not finite is skipped.
    /// `rate` scales this step.
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64], rate: f64) -> bool {
        assert_eq!(parameters.len(), self.mean.len());
        assert_eq!(gradient.len(), self.mean.len());
        if !finite(gradient) {
            return false;
        }
        self.steps += 1;
        let ([b1, b2], learning_rate) = (self.betas, self.learning_rate);
        let (c1, c2) = (1.0 - b1.powi(self.steps), 1.0 - b2.powi(self.steps));
        let moments = self.mean.par_iter_mut().zip(&mut self.mean_square);
        let all = parameters.par_iter_mut().zip(gradient).zip(moments).with_min_len(TASK);
        all.for_each(|((p, g), (m, v))| {
            *m = b1 * *m + (1.0 - b1) * g;
            *v = b2 * *v + (1.0 - b2) * g * g;
            *p -= rate * learning_rate * (*m / c1) / ((*v / c2).sqrt() + EPSILON);
        });
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_step_has_the_length_of_the_learning_rate() {
        let mut p = vec![1.0, 2.0];
        assert!(Adam::new(2, 0.1).step(&mut p, &[3.0, -1e-3], 1.0));
        assert!((p[0] - 0.9).abs() < 1e-8 && (p[1] - 2.1).abs() < 1e-5, "{p:?}");
    }

    #[test]
    fn converges_on_a_badly_scaled_quadratic() {
        let (mut p, mut adam) = (vec![1.0, -1.0], Adam::new(2, 0.02));
        for _ in 0..2000 {
            let gradient = [2000.0 * p[0], 2.0 * p[1]];
            adam.step(&mut p, &gradient, 1.0);
        }
        assert!(p.iter().all(|p| p.abs() < 1e-3), "{p:?}");
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        let (mut p, mut adam) = (vec![1.0], Adam::new(1, 0.1));
        assert!(!adam.step(&mut p, &[f64::NAN], 1.0));
        assert_eq!(p, [1.0]);
    }
}
