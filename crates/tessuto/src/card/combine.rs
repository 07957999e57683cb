//! Several clips of one fabric: one answer from what each constrains.
//!
//! The logarithm of every stiffness over density is a Gaussian of each clip's standard deviation σ, and clips are
//! independent. Their product has the mean Σ x/σ² / Σ 1/σ² and the standard deviation (Σ 1/σ²)^−½. A clip that does
//! not constrain a parameter says its prior and is left out. The prior that is in each of the others counts as often
//! as there are clips: it has at most a sixth of their weight. Where no clip constrains it, their bounds are left: the
//! highest lower one, or else the lowest upper one.
//!
//! Whether the clips agree is χ² = Σ (x − mean)²/σ² against its 95 % limit for one degree of freedom less than
//! clips. Where it is larger, they contradict each other, and the standard deviation is multiplied by (χ²/degrees)^½
//! (Birge 1932).

use crate::result::Measured;
use tessuto_estimate::motion::causes::Constraint;
use tessuto_sim::per_width::PerWidth;

/// What is combined, in the order of [`Measured::sd_of_ln`].
pub const NAMES: [&str; 3] = ["membrane stiffness", "bending stiffness", "shear stiffness"];

/// Of each the motion that constrains it.
const MOTIONS: [&str; 3] = [
    "the fabric held taut between two edges and shaken",
    "the fabric in narrow free folds: held at two corners that come together, or swung by one edge",
    "the fabric held at one corner, or at two opposite ones that are pulled apart: it shears along its bias",
];

/// What one clip says.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Its name.
    pub name: String,
    /// The stiffnesses.
    pub measured: Measured,
}

/// Two clips that cannot both be right.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
    /// The two that differ most, places in the list of clips, the softer one first.
    pub clips: [usize; 2],
    /// Stiffness of the second over that of the first.
    pub factor: f64,
    /// The same in standard deviations of the difference.
    pub deviations: f64,
}

/// One combined parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Standard deviation of the logarithm.
    pub sd_of_ln: f64,
    /// Clips that constrain it; empty: the value is their mean prior.
    pub clips: Vec<usize>,
    /// χ² of these clips.
    pub chi_square: f64,
    /// If it is too large.
    pub contradiction: Option<Contradiction>,
    /// What all clips say.
    pub constraint: Constraint,
}

/// What all clips say.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The stiffnesses.
    pub per_width: PerWidth,
    /// Of membrane, bending and shear.
    pub parameters: [Parameter; 3],
}

impl Answer {
    /// Whether a clip constrains parameter `k`.
    pub fn is_informed(&self, k: usize) -> bool {
        !self.parameters[k].clips.is_empty()
    }

    /// The same fabric, weighing `density` [kg/m²]: a video constrains stiffness in proportion to it.
    pub fn weighing(mut self, density: f64) -> Self {
        self.per_width = scaled(&self.per_width, density);
        self
    }

    /// What a further clip should show: the motion that constrains the parameter which is least known.
    pub fn next_clip(&self) -> String {
        let least = (0..3).max_by(|a, b| {
            let of = |k: usize| (!self.is_informed(k), self.parameters[k].sd_of_ln);
            let ((a_open, a_sd), (b_open, b_sd)) = (of(*a), of(*b));
            a_open.cmp(&b_open).then(a_sd.total_cmp(&b_sd))
        });
        let k = least.unwrap_or(1);
        let known = match self.is_informed(k) {
            true => format!("is known within a factor of {:.2}", self.parameters[k].sd_of_ln.exp()),
            false => "is constrained by no clip".to_owned(),
        };
        format!("{}; the {} {known}", MOTIONS[k], NAMES[k])
    }
}

/// Stiffnesses of the same fabric at another `density` [kg/m²].
pub(super) fn scaled(widths: &PerWidth, density: f64) -> PerWidth {
    let factor = density / widths.area_density;
    PerWidth {
        bending: widths.bending.map(|d| d * factor),
        shear: widths.shear * factor,
        membrane: widths.membrane.map(|e| e * factor),
        area_density: density,
        ..*widths
    }
}

/// Combines `clips` of one fabric.
///
/// # Panics
/// If there are none.
pub fn combine(clips: &[Clip]) -> Answer {
    let first = clips.first().expect("at least one clip").measured.per_width;
    let of_clip: Vec<[[f64; 2]; 3]> = clips.iter().map(|c| logarithms(&c.measured.per_width)).collect();
    let parts = [0, 1, 2].map(|k| {
        let values: Vec<[f64; 2]> = of_clip.iter().map(|c| c[k]).collect();
        combine_one(&values, clips, k)
    });
    let density = first.area_density;
    let [membrane, bending, shear] = [0, 1, 2].map(|k| parts[k].0.map(|ln| ln.exp() * density));
    let bent = clips.iter().map(|c| c.measured.per_width.bent).sum::<f64>() / clips.len() as f64;
    Answer {
        per_width: PerWidth { bending, shear: shear[0], membrane, bent, area_density: density },
        parameters: parts.map(|p| p.1),
    }
}

/// ln of membrane, bending and shear stiffness over density, of warp and weft.
fn logarithms(w: &PerWidth) -> [[f64; 2]; 3] {
    let ln = |k: f64| (k / w.area_density).ln();
    [w.membrane.map(ln), w.bending.map(ln), [ln(w.shear); 2]]
}

/// Means of both directions, and the rest, of parameter `k`.
fn combine_one(values: &[[f64; 2]], clips: &[Clip], k: usize) -> ([f64; 2], Parameter) {
    let sd = |i: usize| clips[i].measured.sd_of_ln[k].max(1e-6);
    let informing: Vec<usize> =
        (0..clips.len()).filter(|i| clips[*i].measured.constraints[k].is_constrained()).collect();
    let used = if informing.is_empty() { (0..clips.len()).collect() } else { informing.clone() };
    let weight = |i: usize| sd(i).powi(-2);
    let sum: f64 = used.iter().map(|i| weight(*i)).sum();
    let mean = [0, 1].map(|way| used.iter().map(|i| weight(*i) * values[*i][way]).sum::<f64>() / sum);
    if informing.is_empty() {
        // Priors, of which one does not confirm another.
        let sd_of_ln = used.iter().map(|i| sd(*i)).fold(f64::INFINITY, f64::min);
        let constraint = bound(values, mean[0], clips, k);
        return (
            mean,
            Parameter { sd_of_ln, clips: informing, chi_square: 0.0, contradiction: None, constraint },
        );
    }
    // Both directions follow from one parameter.
    let middle = |v: &[f64; 2]| 0.5 * (v[0] + v[1]);
    let chi_square: f64 =
        used.iter().map(|i| weight(*i) * (middle(&values[*i]) - middle(&mean)).powi(2)).sum();
    let degrees = used.len() - 1;
    let mut sd_of_ln = sum.powf(-0.5);
    let contradiction = (degrees > 0 && chi_square > limit(degrees)).then(|| {
        sd_of_ln *= (chi_square / degrees as f64).sqrt();
        let apart = |a: usize, b: usize| {
            let off = middle(&values[b]) - middle(&values[a]);
            Contradiction { clips: [a, b], factor: off.exp(), deviations: off / sd(a).hypot(sd(b)) }
        };
        let pairs = used.iter().flat_map(|a| used.iter().map(move |b| apart(*a, *b)));
        pairs.max_by(|a, b| a.deviations.total_cmp(&b.deviations)).expect("two clips")
    });
    let constraint = Constraint::Constrained;
    (mean, Parameter { sd_of_ln, clips: informing, chi_square, contradiction, constraint })
}

/// What `clips` of which none constrains parameter `k` say of it, whose ln is `mean`, of the warp: the highest lower
/// bound, or else the lowest upper one, or else what the first one says that says anything.
fn bound(values: &[[f64; 2]], mean: f64, clips: &[Clip], k: usize) -> Constraint {
    let said =
        || clips.iter().zip(values).map(|(clip, [ln, _])| (clip.measured.constraints[k], (ln - mean).exp()));
    let lower = said().filter_map(|(said, over)| match said {
        Constraint::AtLeast { factor } => Some(factor * over),
        _ => None,
    });
    let upper = said().filter_map(|(said, over)| match said {
        Constraint::AtMost { factor } => Some(factor * over),
        _ => None,
    });
    let traded = said().map(|(said, _)| said).find(|said| said.with().is_some());
    None.or_else(|| lower.reduce(f64::max).map(|factor| Constraint::AtLeast { factor }))
        .or_else(|| upper.reduce(f64::min).map(|factor| Constraint::AtMost { factor }))
        .or(traded)
        .unwrap_or_default()
}

/// Below this is 95 % of χ². From six degrees of freedom on by Wilson and Hilferty 1931.
pub(super) fn limit(degrees: usize) -> f64 {
    const FEW: [f64; 5] = [3.841, 5.991, 7.815, 9.488, 11.070];
    let n = degrees as f64;
    let many = || n * (1.0 - 2.0 / (9.0 * n) + 1.6449 * (2.0 / (9.0 * n)).sqrt()).powi(3);
    degrees.checked_sub(1).and_then(|k| FEW.get(k).copied()).unwrap_or_else(many)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(name: &str, factor: f64, sd: f64, informed: [bool; 3]) -> Clip {
        let per_width = PerWidth {
            bending: [2e-6 * factor, 1e-6 * factor],
            shear: 10.0 * factor,
            membrane: [200.0 * factor, 100.0 * factor],
            bent: 0.2,
            area_density: 0.1,
        };
        let constraints = informed.map(|yes| Constraint::of_deviation(if yes { 0.0 } else { 1.0 }, 1.0));
        Clip { name: name.to_owned(), measured: Measured { per_width, sd_of_ln: [sd; 3], constraints } }
    }

    #[test]
    fn two_equal_clips_are_a_root_of_two_surer_than_one() {
        let one = clip("a", 1.0, 0.3, [true; 3]);
        let answer = combine(&[one.clone(), one.clone()]);
        for p in &answer.parameters {
            assert!((p.sd_of_ln - 0.3 / 2f64.sqrt()).abs() < 1e-12, "{p:?}");
            assert!(p.chi_square < 1e-20 && p.contradiction.is_none(), "{p:?}");
        }
        assert!((answer.per_width.bending[0] / 2e-6 - 1.0).abs() < 1e-12);
        // The surer one counts more: of ln 2 apart a fifth.
        let both = combine(&[clip("a", 1.0, 0.3, [true; 3]), clip("b", 2.0, 0.6, [true; 3])]);
        assert!((both.per_width.shear / 10.0 - 2f64.powf(0.2)).abs() < 1e-9, "{both:?}");
    }

    #[test]
    fn clips_that_contradict_each_other_are_named() {
        let clips = [
            clip("a", 1.0, 0.1, [true, true, false]),
            clip("b", 1.02, 0.1, [true, false, false]),
            clip("c", 3.0, 0.1, [true, true, false]),
        ];
        let answer = combine(&clips);
        let [membrane, bending, shear] = &answer.parameters;
        let found = membrane.contradiction.as_ref().unwrap();
        assert_eq!(found.clips, [0, 2]);
        assert!((found.factor - 3.0).abs() < 1e-9 && found.deviations > 7.0, "{found:?}");
        // One is as sure as it can be given that.
        assert!(membrane.sd_of_ln > 0.3, "{membrane:?}");
        assert_eq!((bending.clips.as_slice(), bending.contradiction.is_some()), (&[0, 2][..], true));
        // What no clip constrains stays as unsure as it was.
        assert!(shear.clips.is_empty() && shear.sd_of_ln == 0.1 && shear.contradiction.is_none());
        assert!(answer.next_clip().contains("shear stiffness is constrained by no clip"));
        let sure = combine(&[clip("a", 1.0, 0.3, [true; 3])]);
        assert!(sure.next_clip().contains("within a factor of 1.35"), "{}", sure.next_clip());
    }

    #[test]
    fn without_values_the_tightest_bound_counts() {
        let bounded = |name: &str, factor: f64, said: Constraint| {
            let mut clip = clip(name, factor, 0.9, [false; 3]);
            clip.measured.constraints = [said; 3];
            clip
        };
        let least = |factor: f64| Constraint::AtLeast { factor };
        // At least 0.5 of 100 and 0.2 of 400 N/m, over their mean of 200.
        let clips = [bounded("a", 1.0, least(0.5)), bounded("b", 4.0, least(0.2))];
        let answer = combine(&clips);
        let bound = |answer: &Answer| answer.parameters[0].constraint.bound(answer.per_width.membrane[1]);
        assert!((bound(&answer).unwrap() / 80.0 - 1.0).abs() < 1e-9, "{answer:?}");
        let most = bounded("c", 1.0, Constraint::AtMost { factor: 2.0 });
        assert!((bound(&combine(std::slice::from_ref(&most))).unwrap() / 200.0 - 1.0).abs() < 1e-9);
        let mixed = combine(&[most, clips[0].clone()]);
        assert!(matches!(mixed.parameters[0].constraint, Constraint::AtLeast { .. }), "{mixed:?}");
        // A value counts more than any bound.
        let told = combine(&[clips[0].clone(), clip("d", 1.0, 0.3, [true; 3])]);
        assert_eq!(told.parameters[0].constraint, Constraint::Constrained);
    }

    #[test]
    fn stiffnesses_follow_the_weight() {
        let answer = combine(&[clip("a", 1.0, 0.3, [true; 3])]).weighing(0.2);
        assert!((answer.per_width.bending[1] / 2e-6 - 1.0).abs() < 1e-12);
        assert!((answer.per_width.shear / 20.0 - 1.0).abs() < 1e-12);
        assert_eq!(answer.per_width.area_density, 0.2);
        assert!((limit(6) / 12.592 - 1.0).abs() < 2e-3, "{}", limit(6));
    }
}
