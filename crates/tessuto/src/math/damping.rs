//! Levenberg and Marquardt's damping λ: small steps where the quadratic model fails, whole ones where it holds.

/// λ and how it follows the success of steps.
#[derive(Debug, Clone, Copy)]
pub struct Damping {
    /// λ.
    pub lambda: f64,
    /// Factor after a step that helped, < 1.
    pub accepted: f64,
    /// Factor after a step that did not, > 1.
    pub rejected: f64,
    /// λ is at least this after a step that helped.
    pub least: f64,
    /// λ is at least this after a step that did not.
    pub least_rejected: f64,
}

impl Damping {
    /// A step helped.
    pub fn accept(&mut self) {
        self.lambda = (self.lambda * self.accepted).max(self.least);
    }

    /// A step did not help.
    pub fn reject(&mut self) {
        self.lambda = (self.lambda * self.rejected).max(self.least_rejected);
    }
}
