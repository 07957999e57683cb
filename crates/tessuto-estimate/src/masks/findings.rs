//! What is said of the masks, frames with the same fault together: a line for a range, not for every frame.

use serde::{Deserialize, Serialize};

use super::front::Front;

/// So many frames between two of a range may lack the fault.
const GAP: usize = 2;

/// What is said of a range of frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// First frame.
    pub first: usize,
    /// Last frame.
    pub last: usize,
    /// What was found there, with its least and largest value.
    pub text: String,
    /// Whether masks of these frames may be wrong.
    pub doubtful: bool,
}

impl Finding {
    /// The frames in words: “frame 12”, “frames 12 to 40”.
    pub fn frames(&self) -> String {
        match self.first == self.last {
            true => format!("frame {}", self.first),
            false => format!("frames {} to {}", self.first, self.last),
        }
    }
}

/// Why a mask may be wrong, each with its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    /// Fraction of the outline on both sides of which colours are alike.
    Alike(f64),
    /// Overlap with what the neighbours predict.
    Predicted(f64),
    /// Fraction of the outline at the border of the image.
    Leaves(f64),
    /// Area, in those of the frames around.
    Jumps(f64),
    /// Fraction that is wrong by what stands still.
    Still(f64),
    /// Fraction that comes from outside and goes there again.
    Passes(f64),
}

impl Fault {
    fn value(self) -> f64 {
        match self {
            Self::Alike(v) | Self::Predicted(v) | Self::Leaves(v) => v,
            Self::Jumps(v) | Self::Still(v) | Self::Passes(v) => v,
        }
    }

    /// In words, for values from `low` to `high`.
    pub fn text(self, [low, high]: [f64; 2]) -> String {
        let percent = |digits: usize| range([low, high].map(|v| 100.0 * v), digits);
        match self {
            Self::Alike(_) => {
                format!("fabric and surroundings look alike along {} % of the outline", percent(0))
            }
            Self::Predicted(_) => format!("it overlaps what its neighbours predict by {} % only", percent(0)),
            Self::Leaves(_) => format!("the fabric leaves the image, along {} % of its outline", percent(0)),
            Self::Jumps(_) => {
                format!("its area is {} times that of the frames around", range([low, high], 2))
            }
            Self::Still(_) => format!(
                "part of its outline stands still while the fabric moves, {} % of it or more: something behind in \
                 the same colours",
                percent(1)
            ),
            Self::Passes(_) => format!(
                "{} % of it come from outside and go there again: something that moves past behind",
                percent(1)
            ),
        }
    }

    /// In words, of one frame.
    pub fn own_text(self) -> String {
        self.text([self.value(); 2])
    }
}

/// “3.1”, or “1.2 to 3.1”.
fn range([low, high]: [f64; 2], digits: usize) -> String {
    let [low, high] = [low, high].map(|v| format!("{v:.digits$}"));
    if low == high { high } else { format!("{low} to {high}") }
}

/// The findings about all frames: their faults, and what is in front of the fabric.
pub(super) fn findings(faults: &[Option<Fault>], fronts: &[Front]) -> Vec<Finding> {
    let mut all = Vec::new();
    let kinds = [
        Fault::Alike(0.0),
        Fault::Predicted(0.0),
        Fault::Leaves(0.0),
        Fault::Jumps(0.0),
        Fault::Still(0.0),
        Fault::Passes(0.0),
    ];
    for kind in kinds {
        let same = |f: &Fault| std::mem::discriminant(f) == std::mem::discriminant(&kind);
        let values: Vec<Option<f64>> = faults.iter().map(|f| f.filter(same).map(Fault::value)).collect();
        all.extend(ranges(&values, true, |values| kind.text(values)));
    }
    let hidden: Vec<_> = fronts.iter().map(|f| (f.hidden > 0.0).then_some(f.hidden)).collect();
    all.extend(ranges(&hidden, false, |values| {
        format!(
            "something that is no fabric, such as a hand, is in front of {} % of it, which the masks leave out",
            range(values.map(|v| 100.0 * v), 1)
        )
    }));
    let touched: Vec<_> = fronts.iter().map(|f| (f.touches && f.hidden == 0.0).then_some(0.0)).collect();
    all.extend(ranges(&touched, false, |_| {
        "something that moves and is no fabric, such as a hand or a person, touches its outline".to_owned()
    }));
    all.sort_by_key(|f| (!f.doubtful, f.first, f.last));
    all
}

/// Runs of frames that have a value, with the least and the largest in words.
fn ranges(values: &[Option<f64>], doubtful: bool, text: impl Fn([f64; 2]) -> String) -> Vec<Finding> {
    let mut runs: Vec<(usize, usize, [f64; 2])> = Vec::new();
    for (n, value) in values.iter().enumerate() {
        let Some(v) = *value else { continue };
        match runs.last_mut() {
            Some((_, last, [low, high])) if n <= *last + GAP + 1 => {
                (*last, *low, *high) = (n, low.min(v), high.max(v));
            }
            _ => runs.push((n, n, [v; 2])),
        }
    }
    runs.into_iter().map(|(first, last, v)| Finding { first, last, text: text(v), doubtful }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_the_same_fault_are_one_finding() {
        let mut faults = vec![None; 40];
        (12..30).filter(|n| n % 5 != 0).for_each(|n| faults[n] = Some(Fault::Still(n as f64 * 1e-3)));
        faults[3] = Some(Fault::Jumps(1.5));
        faults[25] = Some(Fault::Jumps(0.5));
        let mut fronts = vec![Front::default(); 40];
        (5..9).for_each(|n| fronts[n] = Front { hidden: 0.02, touches: true });
        fronts[9].touches = true;
        let found = findings(&faults, &fronts);
        let said: Vec<String> = found.iter().map(|f| format!("{}: {}", f.frames(), f.text)).collect();
        assert_eq!(said.len(), 5, "{said:?}");
        assert_eq!(said[0], "frame 3: its area is 1.50 times that of the frames around");
        assert!(said[1].starts_with("frames 12 to 29: ") && said[1].contains("1.2 to 2.9 %"), "{said:?}");
        assert!(said[2].starts_with("frame 25: "), "{said:?}");
        assert!(said[3].starts_with("frames 5 to 8: ") && said[3].contains("2.0 % of it"), "{said:?}");
        assert!(said[4].starts_with("frame 9: ") && !found[4].doubtful, "{said:?}");
    }
}
