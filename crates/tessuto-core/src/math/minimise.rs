//! Gauss and Newton's method with Levenberg and Marquardt's damping λ: short steps where the quadratic model of an
//! objective fails, whole ones where it holds.
//!
//! What is minimised is a [`Model`]; how long steps are and how often one is tried is the [`Policy`]. Whether a
//! step helped is decided in one place, [`Policy::iterate`], by the values alone, not by what the system promised.
//! Nothing but the point and λ goes from one iteration to the next, so a search that was stopped goes on from
//! these to the same bytes.

/// An objective that is treated as quadratic near a point.
pub trait Model {
    /// What is looked for.
    type Point;
    /// Gradient and matrix at a point, or what they are made of.
    type System;

    /// Fits what an iteration holds fixed to the point at which it begins: values are comparable within one
    /// iteration only.
    fn refresh(&mut self, _point: &Self::Point) {}

    /// The value at `point`, and the system there.
    fn linearise(&mut self, point: &Self::Point) -> (f64, Self::System);

    /// Where the `system` of the point `at` leads with the damping `lambda`, and the value there; `None` where
    /// nothing can be.
    fn step(&mut self, at: &Self::Point, system: &Self::System, lambda: f64) -> Option<(Self::Point, f64)>;

    /// Whether the last step, which took the value from `before` to `after`, is the last of all, beside what the
    /// policy says.
    fn found(&self, _before: f64, _after: f64) -> bool {
        false
    }
}

/// How λ follows the success of steps.
#[derive(Debug, Clone, Copy)]
pub struct Policy {
    /// λ of the first step.
    pub lambda: f64,
    /// Factor after a step that helped, < 1, and what λ is at least then.
    pub accepted: [f64; 2],
    /// Factor after a step that did not, > 1, and what λ is at least then.
    pub rejected: [f64; 2],
    /// Most steps that an iteration tries.
    pub attempts: usize,
    /// Whether a step helps only if it lowers the value; else it does if it does not raise it.
    pub strictly: bool,
    /// A step that gains less than the first, or than the second as a part of the value, is the last one.
    pub least_gain: [f64; 2],
    /// An iteration in which no step helped is the last one if λ is larger than this then.
    pub most: f64,
}

/// What an iteration ends with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The value at the point; not finite if it was not at the start.
    pub value: f64,
    /// Whether the search ends here.
    pub ended: bool,
}

impl Policy {
    /// One attempt an iteration, which may leave the value as it is, as many iterations as there are; λ as it likes.
    pub const PATIENT: Self = Self {
        lambda: 1.0,
        accepted: [1.0, 0.0],
        rejected: [1.0, 0.0],
        attempts: 1,
        strictly: false,
        least_gain: [0.0, 0.0],
        most: f64::INFINITY,
    };

    /// One iteration from `point` on: the first step that helps is taken, if one does.
    pub fn iterate<M: Model>(&self, model: &mut M, point: &mut M::Point, lambda: &mut f64) -> Outcome {
        model.refresh(point);
        let (value, system) = model.linearise(point);
        if !value.is_finite() {
            return Outcome { value, ended: true };
        }
        for _ in 0..self.attempts {
            if let Some((next, after)) = model.step(point, &system, *lambda)
                && (after < value || (after == value && !self.strictly))
            {
                *point = next;
                *lambda = (*lambda * self.accepted[0]).max(self.accepted[1]);
                let little = value - after < self.least_gain[0].max(self.least_gain[1] * value);
                return Outcome { value: after, ended: little || model.found(value, after) };
            }
            *lambda = (*lambda * self.rejected[0]).max(self.rejected[1]);
        }
        Outcome { value, ended: *lambda > self.most }
    }

    /// This many iterations at most; the value that they end with.
    pub fn minimise<M: Model>(&self, model: &mut M, point: &mut M::Point, iterations: usize) -> f64 {
        let (mut lambda, mut value) = (self.lambda, f64::INFINITY);
        for _ in 0..iterations {
            let outcome = self.iterate(model, point, &mut lambda);
            value = outcome.value;
            if outcome.ended {
                break;
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat2, DVec2};

    use super::*;

    const POLICY: Policy =
        Policy { lambda: 1e-3, accepted: [0.3, 1e-6], rejected: [8.0, 1e-2], ..Policy::PATIENT };

    /// Rosenbrock's valley, ½ (1 − x)² + 50 (y − x²)², at which steps from outside of it overshoot.
    #[derive(Default)]
    struct Valley {
        /// A step that leads to less is the last one.
        enough: f64,
        /// Where x is larger there is nothing.
        until: Option<f64>,
        refreshed: usize,
        tried: Vec<f64>,
    }

    impl Model for Valley {
        type Point = DVec2;
        type System = (DMat2, DVec2);

        fn refresh(&mut self, _point: &DVec2) {
            self.refreshed += 1;
        }

        fn linearise(&mut self, p: &DVec2) -> (f64, (DMat2, DVec2)) {
            let (r, j) =
                (DVec2::new(1.0 - p.x, 10.0 * (p.y - p.x * p.x)), [[-1.0, 0.0], [-20.0 * p.x, 10.0]]);
            let j = DMat2::from_cols_array_2d(&j).transpose();
            (value(*p), (j.transpose() * j, j.transpose() * r))
        }

        fn step(&mut self, p: &DVec2, system: &(DMat2, DVec2), lambda: f64) -> Option<(DVec2, f64)> {
            self.tried.push(lambda);
            let damped = system.0 + DMat2::from_diagonal(DVec2::splat(lambda));
            let next = *p - damped.inverse() * system.1;
            self.until.is_none_or(|until| next.x <= until).then(|| (next, value(next)))
        }

        fn found(&self, _before: f64, after: f64) -> bool {
            after < self.enough
        }
    }

    fn value(p: DVec2) -> f64 {
        0.5 * (1.0 - p.x).powi(2) + 50.0 * (p.y - p.x * p.x).powi(2)
    }

    const START: DVec2 = DVec2::new(-1.2, 1.0);

    #[test]
    fn the_bottom_of_the_valley_is_found_though_whole_steps_overshoot() {
        let (mut model, mut p) = (Valley::default(), START);
        let least = POLICY.minimise(&mut model, &mut p, 60);
        assert!(p.distance(DVec2::ONE) < 1e-8 && least < 1e-16, "{p} {least}");
        assert_eq!((model.refreshed, model.tried.len()), (60, 60));
        let rose = model.tried.windows(2).filter(|of| of[1] > of[0]).count();
        assert!((1..30).contains(&rose), "{rose} steps were rejected");
        assert_eq!(model.tried[59], POLICY.accepted[1]);
    }

    #[test]
    fn a_step_that_raises_the_value_is_not_taken_but_shortened() {
        let (mut model, mut p, mut lambda) = (Valley::default(), START, 0.0);
        let outcome = POLICY.iterate(&mut model, &mut p, &mut lambda);
        assert_eq!((p, lambda, outcome.ended), (START, POLICY.rejected[1], false));
        assert_eq!(outcome.value, value(START));
        let several = Policy { attempts: 9, ..POLICY };
        let outcome = several.iterate(&mut model, &mut p, &mut lambda);
        assert!(outcome.value < value(START) && outcome.value == value(p));
        let n = model.tried.len();
        assert!((3..10).contains(&n) && model.tried[1..].windows(2).all(|of| of[1] == 8.0 * of[0]));
        assert_eq!(lambda, 0.3 * model.tried[n - 1]);
    }

    #[test]
    fn where_nothing_can_be_no_step_is_taken_and_too_much_damping_ends_it() {
        let (mut model, mut p) = (Valley { until: Some(-2.0), ..Valley::default() }, START);
        let policy = Policy { attempts: 2, most: 1.0, ..POLICY };
        assert_eq!(policy.minimise(&mut model, &mut p, 50), value(START));
        // 8³ · 10⁻² is the first that is larger than 1.
        assert_eq!((p, model.tried.len()), (START, 4));
    }

    #[test]
    fn a_small_gain_ends_it_and_so_does_a_value_that_is_not_finite() {
        // Three steps are rejected before one is taken, which gains 54 %.
        for (least_gain, enough, iterations) in
            [([1e-3, 0.0], 0.0, 19), ([0.0, 0.6], 0.0, 4), ([0.0, 0.5], 0.0, 11), ([0.0; 2], 1e-3, 18)]
        {
            let (mut model, mut p) = (Valley { enough, ..Valley::default() }, START);
            Policy { least_gain, ..POLICY }.minimise(&mut model, &mut p, 60);
            assert_eq!(model.refreshed, iterations, "{least_gain:?} {enough}: {}", value(p));
        }
        let (mut model, mut p) = (Valley::default(), DVec2::new(f64::NAN, 0.0));
        assert!(POLICY.minimise(&mut model, &mut p, 60).is_nan());
        assert_eq!((model.refreshed, model.tried.len()), (1, 0));
    }

    #[test]
    fn an_equal_value_helps_unless_it_must_be_lower() {
        for strictly in [false, true] {
            let (mut p, mut lambda) = (DVec2::ONE, 1.0);
            let policy = Policy { strictly, ..POLICY };
            policy.iterate(&mut Valley::default(), &mut p, &mut lambda);
            assert_eq!(lambda, if strictly { 8.0 } else { 0.3 });
        }
    }

    #[test]
    fn it_goes_on_from_a_stored_state_to_the_same() {
        let (mut whole, mut lambda) = (START, POLICY.lambda);
        let mut stored = String::new();
        for n in 0..20 {
            if n == 7 {
                stored = serde_json::to_string(&(whole.to_array(), lambda)).unwrap();
            }
            POLICY.iterate(&mut Valley::default(), &mut whole, &mut lambda);
        }
        let (point, mut again): ([f64; 2], f64) = serde_json::from_str(&stored).unwrap();
        let mut point = DVec2::from_array(point);
        for _ in 7..20 {
            POLICY.iterate(&mut Valley::default(), &mut point, &mut again);
        }
        assert_eq!((point, again), (whole, lambda));
        assert_ne!(lambda, POLICY.lambda);
    }
}
