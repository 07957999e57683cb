//! Friction of a pair, by the smoothed law of Coulomb, whose force and plane are those of the step's start.
//!
//!   D = μ λ f(‖u‖),   u = (I − n nᵀ) Σ wₖ (x′ₖ − xₖ),   f′(y) = (2 − y/ε) y/ε for y below ε = slip·h, else 1,
//!
//! with the pressing force λ, the normal n and the weights w at the positions x before the step. The force grows
//! smoothly from rest to μ λ at the speed `slip`: what should stick creeps by less than that.

use glam::{DMat3, DVec3};

use super::closest::{Corners, outer, sum};
use super::pair::{Gap, Law, Pair};

/// A pair that touches at the start of a step.
#[derive(Debug, Clone, Copy)]
pub struct Slip {
    /// The pair.
    pub pair: Pair,
    gap: Gap,
    /// λ `[N]`.
    force: f64,
    /// ε `[m]`.
    reach: f64,
}

/// ∂ of [`Slip::vjp`].
pub struct SlipGradients {
    /// By the positions before the step.
    pub before: [DVec3; 4],
    /// By μ.
    pub friction: f64,
}

impl Slip {
    /// Of a pair with this gap; `reach` is ε.
    pub fn new(pair: Pair, gap: Gap, law: &Law, reach: f64) -> Self {
        Self { pair, gap, force: pair.pressing(law, &gap), reach }
    }

    /// u of the way of every corner `[m]`.
    fn slide(&self, way: &Corners) -> DVec3 {
        across(self.gap.normal, sum(&self.gap.weights, way))
    }

    /// f, φ = f′/y and φ′/y.
    fn law(&self, y: f64) -> [f64; 3] {
        let e = self.reach;
        if y >= e {
            return [y, y.recip(), -y.powi(-3)];
        }
        let inverse = (e * e).recip();
        // At rest the part along u is nothing, whatever its factor.
        let turn = if y > 1e-9 * e { -inverse / y } else { 0.0 };
        [y * y / e - y * y * y * inverse / 3.0 + e / 3.0, 2.0 / e - y * inverse, turn]
    }

    /// D for μ = `friction` and the corners' `way` x′ − x `[m]`, and its derivatives by x′.
    pub fn energy_and_gradient(&self, friction: f64, way: &Corners) -> (f64, [DVec3; 4]) {
        let u = self.slide(way);
        let [value, ratio, _] = self.law(u.length());
        let scale = friction * self.force;
        (scale * value, self.gap.weights.map(|w| u * (scale * ratio * w)))
    }

    /// ∂²D of two corners is this times both weights; never negative.
    pub fn hessian(&self, friction: f64, way: &Corners) -> DMat3 {
        let u = self.slide(way);
        let [_, ratio, turn] = self.law(u.length());
        let (n, scale) = (self.gap.normal, friction * self.force);
        ((DMat3::IDENTITY - outer(n, n)) * ratio + outer(u, u) * turn) * scale
    }

    /// w of the corners.
    pub fn weights(&self) -> &[f64; 4] {
        &self.gap.weights
    }

    /// Derivatives of Σ mₖ·∂D/∂x′ₖ for the corners' `m`, by everything but x′. `x` are the corners before the step.
    pub fn vjp(&self, law: &Law, friction: f64, x: &Corners, way: &Corners, m: &Corners) -> SlipGradients {
        let (n, w) = (self.gap.normal, &self.gap.weights);
        let (a, b) = (sum(w, m), sum(w, way));
        let (u, along) = (across(n, b), across(n, a));
        let [_, ratio, turn] = self.law(u.length());
        let work = a.dot(u);
        let scale = friction * self.force;
        let by_a = u * (scale * ratio);
        let by_b = (along * ratio + u * (turn * work)) * scale;
        let b_n = b.dot(n);
        let by_normal = (a * b_n + b * a.dot(n)) * (-scale * ratio) - b * (scale * turn * work * b_n);
        let by_weights = [0, 1, 2, 3].map(|k| by_a.dot(m[k]) + by_b.dot(way[k]));
        let by_force = friction * ratio * work;
        let mut before = self.pair.pull_back(law, &self.gap, x, (by_force, by_normal, by_weights));
        before.iter_mut().zip(w).for_each(|(g, w)| *g -= by_b * *w);
        SlipGradients { before, friction: self.force * ratio * work }
    }
}

/// The part of `v` across the unit vector `n`.
fn across(n: DVec3, v: DVec3) -> DVec3 {
    v - n * n.dot(v)
}

#[cfg(test)]
mod tests {
    use super::super::pair::Kind;
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn derivatives_are_differences() {
        let law = Law { thickness: 0.5, stiffness: 20.0 };
        let mut rng = Rng::new(6, 0);
        let kinds =
            [Kind::PointTriangle, Kind::EdgeEdge(1e-3), Kind::EdgeEdge(10.0), Kind::Plane(DVec3::Z, -0.5)];
        let mut worst = [0.0f64; 4];
        let mut tried = 0;
        while tried < 400 {
            let pair =
                Pair { nodes: [0, 1, 2, 3], kind: kinds[tried % 4], area: 0.7, offset: 0.0, surface: 0 };
            let x: Corners = [0; 4].map(|_| rng.vector());
            let is_plane = matches!(pair.kind, Kind::Plane(..));
            let Some(gap) = pair.gap(&x, 0.45).filter(|g| g.size > 0.05) else { continue };
            // Sticks, and slides.
            let reach = if tried % 3 == 0 { 5.0 } else { 0.05 };
            let slip = |x: &Corners| Slip::new(pair, pair.gap(x, f64::INFINITY).unwrap(), &law, reach);
            let here = slip(&x);
            let (after, m, d) =
                ([0; 4].map(|_| rng.vector()), [0; 4].map(|_| rng.vector()), [0; 4].map(|_| rng.vector()));
            let count = if is_plane { 1 } else { 4 };
            let way = |x: &Corners, after: &Corners| -> Corners { [0, 1, 2, 3].map(|k| after[k] - x[k]) };
            let dot = |a: &Corners, b: &Corners| (0..count).map(|k| a[k].dot(b[k])).sum::<f64>();
            let moved = |x: &Corners, s: f64| -> Corners { [0, 1, 2, 3].map(|k| x[k] + d[k] * s) };
            let step = 1e-6;
            let jumps = [step, -step].map(|s| pair.gap(&moved(&x, s), f64::INFINITY).unwrap());
            if (0..4)
                .any(|k| (0.5 * (jumps[0].weights[k] + jumps[1].weights[k]) - gap.weights[k]).abs() > 1e-8)
            {
                continue;
            }
            tried += 1;
            let mut note = |k: usize, analytic: f64, of: &dyn Fn(f64) -> f64| {
                let numeric = (of(step) - of(-step)) / (2.0 * step);
                worst[k] = worst[k].max((analytic - numeric).abs() / (0.1 + numeric.abs()));
            };
            let mu = 0.4;
            let gradient =
                |x: &Corners, after: &Corners, mu: f64| slip(x).energy_and_gradient(mu, &way(x, after)).1;
            let first = gradient(&x, &after, mu);
            note(0, dot(&first, &d), &|s| here.energy_and_gradient(mu, &way(&x, &moved(&after, s))).0);
            let (k, w) = (here.hessian(mu, &way(&x, &after)), here.weights());
            let bent = sum(w, &m).dot(k * sum(w, &d));
            if count == 4 {
                note(1, bent, &|s| dot(&m, &gradient(&x, &moved(&after, s), mu)));
            }
            let back = here.vjp(&law, mu, &x, &way(&x, &after), &m);
            note(2, dot(&back.before, &d), &|s| dot(&m, &gradient(&moved(&x, s), &after, mu)));
            note(3, back.friction, &|s| dot(&m, &gradient(&x, &after, mu + s)));
        }
        println!("worst: {:?}", worst.map(|w| format!("{w:.1e}")));
        assert!(worst.iter().all(|w| *w > 0.0 && *w < 1e-4), "{worst:?}");
    }
}
