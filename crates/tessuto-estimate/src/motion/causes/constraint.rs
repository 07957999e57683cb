//! What a clip says of each number, in one of five words.
//!
//! Two things of the search at its end decide. One is its Gauss-Newton matrix: the standard deviation of a number,
//! and the deviation it would have if another one were known. The other is a profile: the objective without the
//! number's own prior at factors of [`FACTORS`] below and above its value, where the other numbers follow
//! ([`super::profile`]). A side is closed where the data exclude a factor on it, by [`EXCLUDED`] deviations from the
//! best one.

use serde::{Deserialize, Serialize};

use super::INFORMED;
use super::forces::{FIRST, LENGTHS};
use tessuto_core::math::root::Root;

/// Factors by which a number is tried below and above its value.
pub(super) const FACTORS: [f64; 2] = [3.0, 10.0];
/// Data exclude a value that is this many standard deviations from the one that fits best, √(2 Δ objective).
pub(super) const EXCLUDED: f64 = 2.0;

/// A number that another one can stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Stretch stiffness.
    Stretch,
    /// Bend stiffness.
    Bend,
    /// Shear stiffness.
    Shear,
    /// The direction of gravity.
    Gravity,
    /// The drag coefficient of the air.
    Drag,
    /// Internal friction.
    Friction,
    /// The panel's two lengths.
    Lengths,
    /// The velocity of the wind.
    Wind,
}

impl Cause {
    const ALL: [Self; 8] = [
        Self::Stretch,
        Self::Bend,
        Self::Shear,
        Self::Gravity,
        Self::Drag,
        Self::Friction,
        Self::Lengths,
        Self::Wind,
    ];

    /// Those of a positive value.
    pub(super) const POSITIVE: [Self; 5] =
        [Self::Stretch, Self::Bend, Self::Shear, Self::Drag, Self::Friction];

    /// Its places among this many unknowns.
    pub(super) fn places(self, unknowns: usize) -> std::ops::Range<usize> {
        match self {
            Self::Stretch => 0..1,
            Self::Bend => 1..2,
            Self::Shear => 2..3,
            Self::Gravity => 3..5,
            Self::Drag => 5..6,
            Self::Friction => 6..7,
            Self::Lengths => LENGTHS..FIRST,
            Self::Wind => FIRST..unknowns,
        }
    }

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stretch => "stretch",
            Self::Bend => "bend",
            Self::Shear => "shear",
            Self::Gravity => "gravity",
            Self::Drag => "drag",
            Self::Friction => "friction",
            Self::Lengths => "the panel's lengths",
            Self::Wind => "the wind",
        }
    }
}

/// What a clip says of a number.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Constraint {
    /// Its value, within its standard deviation.
    Constrained,
    /// A lower bound only.
    AtLeast {
        /// The bound over the value that is reported.
        factor: f64,
    },
    /// An upper bound only.
    AtMost {
        /// The bound over the value that is reported.
        factor: f64,
    },
    /// A combination with another number only: it would be constrained if that one were known.
    TradedOff {
        /// The other number.
        with: Cause,
    },
    /// Hardly more than was known without the clip.
    #[default]
    Unconstrained,
}

impl Constraint {
    /// `constrained`, `at_least`, `at_most`, `traded_off` or `unconstrained`.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Constrained => "constrained",
            Self::AtLeast { .. } => "at_least",
            Self::AtMost { .. } => "at_most",
            Self::TradedOff { .. } => "traded_off",
            Self::Unconstrained => "unconstrained",
        }
    }

    /// Whether it is [`Self::Constrained`].
    pub fn is_constrained(&self) -> bool {
        *self == Self::Constrained
    }

    /// The bound of a number of this `value`, where there is one.
    pub fn bound(&self, value: f64) -> Option<f64> {
        match self {
            Self::AtLeast { factor } | Self::AtMost { factor } => Some(value * factor),
            _ => None,
        }
    }

    /// The number that it is traded off with, if it is.
    pub fn with(&self) -> Option<Cause> {
        match self {
            Self::TradedOff { with } => Some(*with),
            _ => None,
        }
    }

    /// Text for people; `shown` writes the bound of a number of this `value`.
    pub fn text(&self, value: f64, shown: impl Fn(f64) -> String) -> String {
        match self {
            Self::AtLeast { factor } => format!("at least {}", shown(value * factor)),
            Self::AtMost { factor } => format!("at most {}", shown(value * factor)),
            Self::TradedOff { with } => format!("traded off with {}", with.name()),
            Self::Constrained | Self::Unconstrained => self.word().to_owned(),
        }
    }

    /// The same of this power of the number: a bending length is the cube root of a stiffness.
    pub fn powered(self, power: f64) -> Self {
        match self {
            Self::AtLeast { factor } => Self::AtLeast { factor: factor.powf(power) },
            Self::AtMost { factor } => Self::AtMost { factor: factor.powf(power) },
            other => other,
        }
    }

    /// From the standard deviation alone, as in results without profiles.
    pub fn of_deviation(sd: f64, before: f64) -> Self {
        if sd < INFORMED * before { Self::Constrained } else { Self::Unconstrained }
    }
}

/// What a clip says of every number.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraints {
    /// Of stretch, bend, shear stiffness.
    pub stiffness: [Constraint; 3],
    /// Of the direction of gravity, which has no bounds.
    pub down: Constraint,
    /// Of the drag.
    pub drag: Constraint,
    /// Of the internal friction.
    pub friction: Constraint,
}

/// Ascending pairs of ln of a factor on one number and the objective there, without the number's own prior.
pub type Profile = Vec<(f64, f64)>;

/// How many standard deviations an objective of `value` is from one of `best`; 0 where it is lower.
pub(super) fn deviations(best: f64, value: f64) -> f64 {
    (2.0 * (value - best).max(0.0)).sqrt()
}

/// ln of the bounds below and above over the value, where `profile` closes a side: of the nearest excluded factors.
fn bounds(profile: &Profile) -> [Option<f64>; 2] {
    let best = (0..profile.len()).min_by(|a, b| profile[*a].1.total_cmp(&profile[*b].1));
    let Some(best) = best else { return [None; 2] };
    let closed = |k: &usize| deviations(profile[best].1, profile[*k].1) >= EXCLUDED;
    [(0..best).rev().find(closed), (best + 1..profile.len()).find(closed)].map(|k| k.map(|k| profile[k].0))
}

/// The word of a number of standard deviation `sd`, `before` without the video, by its `profile`; `partner` is what
/// it would be constrained with.
pub(super) fn judge(profile: &Profile, [sd, before]: [f64; 2], partner: Option<Cause>) -> Constraint {
    match bounds(profile) {
        [Some(_), Some(_)] if sd < INFORMED * before => Constraint::Constrained,
        [Some(ln), None] => Constraint::AtLeast { factor: ln.exp() },
        [None, Some(ln)] => Constraint::AtMost { factor: ln.exp() },
        _ => partner.map_or(Constraint::Unconstrained, |with| Constraint::TradedOff { with }),
    }
}

/// The other cause that `of` would be constrained with, which is below [`INFORMED`] times `before`, if it were known:
/// the one that leaves the least deviation. `matrix` is that of Gauss-Newton, shape [unknowns, unknowns].
pub(super) fn partner(matrix: &[Vec<f64>], of: Cause, before: f64) -> Option<Cause> {
    let unknowns = matrix.len();
    let left = |with: Cause| {
        let known = with.places(unknowns);
        let rest: Vec<usize> = (0..unknowns).filter(|p| !known.contains(p)).collect();
        deviation(matrix, &rest, of)
    };
    let others = Cause::ALL.into_iter().filter(|with| *with != of && !with.places(unknowns).is_empty());
    let (with, sd) = others.map(|with| (with, left(with))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    (sd < INFORMED * before).then_some(with)
}

/// Standard deviation of `of` where only the unknowns `free` are not known.
fn deviation(matrix: &[Vec<f64>], free: &[usize], of: Cause) -> f64 {
    let n = free.len();
    let part: Vec<f64> = free.iter().flat_map(|p| free.iter().map(|q| matrix[*p][*q])).collect();
    let root = Root::of(&part, n);
    let places = of.places(matrix.len());
    let at = (0..n).filter(|k| places.contains(&free[*k]));
    let variance = |k: usize| {
        let unit: Vec<f64> = (0..n).map(|q| f64::from(u8::from(k == q))).collect();
        root.solve(&unit)[k]
    };
    at.map(variance).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ln of the factors of a whole profile.
    fn offsets() -> [f64; 5] {
        let [near, far] = FACTORS.map(f64::ln);
        [-far, -near, 0.0, near, far]
    }

    /// ½ precision (ln − centre)² at the factors.
    fn quadratic(precision: f64, centre: f64) -> Profile {
        offsets().into_iter().map(|x| (x, 0.5 * precision * (x - centre).powi(2))).collect()
    }

    /// A barrier that is steep below `wall` and flat above.
    fn wall(at: f64) -> Profile {
        offsets().into_iter().map(|x| (x, 0.5 * (6.0 * (at - x).max(0.0)).powi(2))).collect()
    }

    #[test]
    fn a_steep_valley_is_constrained() {
        let sd = 0.2;
        assert_eq!(judge(&quadratic(1.0 / (sd * sd), 0.0), [sd, 1.0], None), Constraint::Constrained);
        // The same deviation means nothing where factors of ten fit as well.
        assert_eq!(judge(&quadratic(0.1, 0.0), [sd, 1.0], None), Constraint::Unconstrained);
        // Nor does a valley where the prior was as sure.
        assert_eq!(judge(&quadratic(25.0, 0.0), [sd, 0.3], None), Constraint::Unconstrained);
    }

    #[test]
    fn a_wall_is_a_bound_where_it_is_two_deviations_high() {
        // At −ln 3 it is 6.6 deviations high.
        let near = |factor: f64, expected: f64| (factor / expected - 1.0).abs() < 1e-12;
        let Constraint::AtLeast { factor } = judge(&wall(0.0), [0.9, 1.0], None) else { panic!("no bound") };
        assert!(near(factor, 1.0 / 3.0), "{factor}");
        let mirrored: Profile = wall(0.0).into_iter().rev().map(|(x, value)| (-x, value)).collect();
        let Constraint::AtMost { factor } = judge(&mirrored, [0.1, 1.0], None) else { panic!("no bound") };
        assert!(near(factor, 3.0), "{factor}");
        // 1.2 deviations at −ln 3, 8.4 at −ln 10.
        let Constraint::AtLeast { factor } = judge(&wall(-0.9), [0.9, 1.0], None) else { panic!("no bound") };
        assert!(near(factor, 0.1), "{factor}");
        // The value itself may be excluded: the prior holds it.
        let Constraint::AtLeast { factor } = judge(&wall(1.0), [0.5, 1.0], None) else { panic!("no bound") };
        assert!(near(factor, 1.0), "{factor}");
        assert!((Constraint::AtLeast { factor }.bound(50.0).unwrap() - 50.0 * factor).abs() < 1e-12);
    }

    #[test]
    fn a_sum_that_is_known_trades_its_parts_off() {
        // ln bend + ln drag within 0.02, each within 1 before: each alone within 0.7, 0.02 if the other were known.
        let unknowns = FIRST + 6;
        let mut matrix = vec![vec![0.0; unknowns]; unknowns];
        (0..unknowns).for_each(|p| matrix[p][p] = 1.0);
        for (p, q) in [(1, 1), (1, 5), (5, 1), (5, 5)] {
            matrix[p][q] += 1.0 / 0.02f64.powi(2);
        }
        let all: Vec<usize> = (0..unknowns).collect();
        let sd = deviation(&matrix, &all, Cause::Bend);
        assert!((sd - 0.5f64.sqrt()).abs() < 1e-3, "{sd}");
        assert_eq!(partner(&matrix, Cause::Bend, 1.0), Some(Cause::Drag));
        assert_eq!(partner(&matrix, Cause::Drag, 1.0), Some(Cause::Bend));
        assert_eq!(partner(&matrix, Cause::Shear, 1.0), None);
        let flat = quadratic(0.0, 0.0);
        let traded = judge(&flat, [sd, 1.0], partner(&matrix, Cause::Bend, 1.0));
        assert_eq!(traded, Constraint::TradedOff { with: Cause::Drag });
        assert_eq!(traded.text(1.0, |v| v.to_string()), "traded off with drag");
        // Of shear nothing helps.
        let shear = judge(&flat, [1.0, 1.0], partner(&matrix, Cause::Shear, 1.0));
        assert_eq!(shear, Constraint::Unconstrained);
    }

    #[test]
    fn a_product_with_the_wind_counts_all_of_its_values() {
        let unknowns = FIRST + 6;
        let mut matrix = vec![vec![0.0; unknowns]; unknowns];
        (0..unknowns).for_each(|p| matrix[p][p] = 1.0);
        // Drag and the sum of two values of the wind.
        let row = [(5, 1.0), (FIRST + 3, 1.0), (FIRST + 5, 1.0)];
        for (p, a) in row {
            row.iter().for_each(|(q, b)| matrix[p][*q] += a * b * 1e4);
        }
        assert_eq!(partner(&matrix, Cause::Drag, 1.0), Some(Cause::Wind));
    }

    #[test]
    fn a_simulation_that_fails_excludes_nothing() {
        let mut profile = quadratic(25.0, 0.0);
        profile.truncate(3);
        assert!(matches!(judge(&profile, [0.2, 1.0], None), Constraint::AtLeast { .. }));
        assert_eq!(judge(&Vec::new(), [0.2, 1.0], None), Constraint::Unconstrained);
    }
}
