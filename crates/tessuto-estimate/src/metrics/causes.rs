//! How good the causes of a motion are, against `gt/physics.json`, `gt/calm.npy` and `gt/stiffer.npy`.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::motion::causes::Constraint;
use tessuto_core::mesh::Positions;

/// What is known of a scene's causes; keys that are not there are not known.
#[derive(Debug, Clone, Default, Deserialize)]
pub struct KnownCauses {
    /// Stretch stiffness [N/m].
    pub stretch: Option<f64>,
    /// Bend stiffness [J/rad²].
    pub bend: Option<f64>,
    /// Shear stiffness [J/rad²].
    pub shear: Option<f64>,
    /// Drag coefficient of the air.
    pub drag: Option<f64>,
    /// Gravity, camera frame [m/s²].
    pub gravity: Option<[f64; 3]>,
    /// Vertices that are held.
    pub held: Option<Vec<usize>>,
}

/// A number that was found against the true one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// log10 of found over true.
    pub log10: f64,
    /// Whether the truth lies within two standard deviations.
    pub inside: bool,
    /// Whether the result says that the video constrains it.
    pub informed: bool,
    /// What the result says of it; unconstrained in metrics of earlier versions that have no such word.
    #[serde(default)]
    pub constraint: Constraint,
    /// Whether that is true: of a value, that the truth lies within two standard deviations, of a bound, that it
    /// lies on its side. Nothing else is claimed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub right: Option<bool>,
}

/// A number as it was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Its value.
    pub value: f64,
    /// Standard deviation of its natural logarithm.
    pub sd_of_ln: f64,
    /// See [`Ratio::constraint`].
    pub constraint: Constraint,
}

impl Found {
    fn against(&self, truth: f64) -> Ratio {
        let ln = (self.value / truth).ln();
        let inside = ln.abs() <= 2.0 * self.sd_of_ln;
        let constraint = self.constraint;
        let right = match constraint {
            Constraint::Constrained => Some(inside),
            Constraint::AtLeast { factor } => Some(truth >= self.value * factor),
            Constraint::AtMost { factor } => Some(truth <= self.value * factor),
            Constraint::TradedOff { .. } | Constraint::Unconstrained => None,
        };
        let informed = constraint.is_constrained();
        Ratio { log10: ln / std::f64::consts::LN_10, inside, informed, constraint, right }
    }
}

/// The direction of gravity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// How far it is off `[deg]`.
    pub degrees: f64,
    /// Whether that is within two standard deviations.
    pub inside: bool,
}

/// Held vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Held {
    /// How many are held.
    pub truth: usize,
    /// How many were said to be.
    pub found: usize,
    /// How many of these are.
    pub right: usize,
}

/// A motion that was simulated from the causes that were found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Foretold {
    /// Mean distance of the vertices from the truth `[m]`.
    pub error: f64,
    /// The same of what needs no causes `[m]`: after the clip the better one of cloth that stops and cloth that
    /// goes straight on; the clip itself where another stiffness was to be predicted.
    pub baseline: f64,
    /// Their ratio, below 1 where the causes help.
    pub ratio: f64,
}

impl Foretold {
    /// Of `simulated` motion, all shapes [N, V].
    pub fn new(simulated: &[Positions], truth: &[Positions], baselines: &[Vec<Positions>]) -> Self {
        let error = distance(simulated, truth);
        let baseline = baselines.iter().map(|b| distance(b, truth)).fold(f64::INFINITY, f64::min);
        Self { error, baseline, ratio: error / baseline }
    }
}

/// Mean distance of the vertices `[m]`.
pub fn distance(a: &[Positions], b: &[Positions]) -> f64 {
    let pairs = || a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    pairs().map(|(a, b)| a.distance(*b)).sum::<f64>() / pairs().count().max(1) as f64
}

/// What goes on after the two shapes at the end of `motion` without causes, for `count` frames: as it is, and
/// straight on.
pub fn carried_on(motion: &[Positions], count: usize) -> Vec<Vec<Positions>> {
    let last = &motion[motion.len() - 1];
    let before = &motion[motion.len().saturating_sub(2)];
    let straight = |k: usize| last.iter().zip(before).map(|(a, b)| *a + (*a - *b) * k as f64).collect();
    vec![vec![last.clone(); count], (1..=count).map(straight).collect()]
}

/// All of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CauseMetrics {
    /// Stretch stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stretch: Option<Ratio>,
    /// Bend stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<Ratio>,
    /// Shear stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear: Option<Ratio>,
    /// Drag coefficient.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drag: Option<Ratio>,
    /// Gravity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Direction>,
    /// What holds the cloth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held: Option<Held>,
    /// Root mean square of what no cause explains over that of the motion's acceleration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unexplained: Option<f64>,
    /// After the clip, in still air and held still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calm: Option<Foretold>,
    /// With ten times the bend stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffer: Option<Foretold>,
}

impl CauseMetrics {
    /// Stretch, bend, shear stiffness and drag, gravity with the standard deviation of its direction `[rad]`, and
    /// `held` vertices against `known` causes.
    pub fn new(known: &KnownCauses, found: [Found; 4], (gravity, sd): (DVec3, f64), held: &[usize]) -> Self {
        let of = |k: usize, truth: Option<f64>| truth.filter(|t| *t > 0.0).map(|t| found[k].against(t));
        let direction = |truth: [f64; 3]| {
            let angle = gravity.angle_between(DVec3::from_array(truth));
            Direction { degrees: angle.to_degrees(), inside: angle <= 2.0 * sd }
        };
        let of_held = |truth: &Vec<usize>| Held {
            truth: truth.len(),
            found: held.len(),
            right: held.iter().filter(|v| truth.contains(v)).count(),
        };
        Self {
            stretch: of(0, known.stretch),
            bend: of(1, known.bend),
            shear: of(2, known.shear),
            drag: of(3, known.drag),
            gravity: known.gravity.map(direction),
            held: known.held.as_ref().map(of_held),
            ..Self::default()
        }
    }

    /// Name, value and meaning of what is there, for people.
    pub fn rows(&self) -> Vec<(&'static str, String, String)> {
        let mut rows = Vec::new();
        let ratios =
            [("stretch", self.stretch), ("bend", self.bend), ("shear", self.shear), ("drag", self.drag)];
        for (name, ratio) in ratios {
            let Some(r) = ratio else { continue };
            let inside = if r.inside { "within" } else { "beyond" };
            let said = r.constraint.text(10f64.powf(r.log10), |over| format!("{over:.2} × the truth"));
            let meaning = format!("of the truth, {inside} two standard deviations; {said}");
            rows.push((name, format!("{:.2} ×", 10f64.powf(r.log10)), meaning));
        }
        if let Some(g) = self.gravity {
            let inside = if g.inside { "within" } else { "beyond" };
            let meaning = format!("off the true direction, {inside} two standard deviations");
            rows.push(("gravity", format!("{:.1}°", g.degrees), meaning));
        }
        if let Some(h) = self.held {
            let meaning =
                format!("vertices are held as was found, of {}; {} were said to be", h.truth, h.found);
            rows.push(("held", h.right.to_string(), meaning));
        }
        if let Some(u) = self.unexplained {
            let meaning = "root mean square of the residual force over that of the motion";
            rows.push(("unexplained", format!("{u:.1} ×"), meaning.to_owned()));
        }
        let foretold = [
            ("calm", self.calm, "off the truth after the clip, in still air"),
            ("stiffer", self.stiffer, "off the truth with ten times the bend stiffness"),
        ];
        for (name, foretold, meaning) in foretold {
            let Some(f) = foretold else { continue };
            let meaning =
                format!("{meaning}; without causes {:.1} mm, ratio {:.2}", 1e3 * f.baseline, f.ratio);
            rows.push((name, format!("{:.1} mm", 1e3 * f.error), meaning));
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_and_directions_know_whether_they_are_inside() {
        let known = KnownCauses {
            bend: Some(1e-3),
            gravity: Some([0.0, 9.81, 0.0]),
            held: Some(vec![0, 4, 7]),
            ..KnownCauses::default()
        };
        let found = |value: f64| Found { value, sd_of_ln: 0.3, constraint: Constraint::Constrained };
        let down = DVec3::new(0.0, 1.0, 0.1);
        let metrics = CauseMetrics::new(&known, [found(2e-3); 4], (down, 0.04), &[0, 1, 7]);
        let bend = metrics.bend.unwrap();
        assert!((bend.log10 - 2f64.log10()).abs() < 1e-12 && !bend.inside);
        assert!(
            (metrics.gravity.unwrap().degrees - 5.710593).abs() < 1e-5 && !metrics.gravity.unwrap().inside
        );
        assert_eq!(metrics.held, Some(Held { truth: 3, found: 3, right: 2 }));
        assert!(metrics.stretch.is_none() && metrics.drag.is_none());
        assert_eq!(metrics.rows().len(), 3);
        let near = found(1.5e-3).against(1e-3);
        assert!(near.inside && near.informed && near.right == Some(true) && bend.right == Some(false));
        let of = |constraint: Constraint| Found { constraint, ..found(2e-3) }.against(1e-3).right;
        assert_eq!(of(Constraint::AtLeast { factor: 0.4 }), Some(true));
        assert_eq!(of(Constraint::AtLeast { factor: 0.6 }), Some(false));
        assert_eq!(of(Constraint::AtMost { factor: 0.6 }), Some(true));
        assert_eq!(of(Constraint::AtMost { factor: 0.4 }), Some(false));
        assert_eq!(of(Constraint::Unconstrained), None);
    }

    #[test]
    fn the_better_baseline_counts() {
        let shape = |z: f64| vec![DVec3::Z * z; 2];
        let motion = [shape(0.0), shape(1.0)];
        let truth = [shape(2.0), shape(3.0)];
        let foretold = Foretold::new(&[shape(2.0), shape(2.5)], &truth, &carried_on(&motion, 2));
        assert_eq!((foretold.error, foretold.baseline), (0.25, 0.0));
        let still = Foretold::new(
            &[shape(1.0), shape(1.5)],
            &[shape(1.0), shape(1.0)],
            &carried_on(&[shape(0.5)], 2),
        );
        assert_eq!((still.error, still.baseline, still.ratio), (0.25, 0.5, 0.5));
    }
}
