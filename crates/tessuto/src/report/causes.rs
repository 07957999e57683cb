//! What moved the fabric, for the page: its parameters beside those of known fabrics, arrows on the mesh, and
//! changed replays.

use serde::Serialize;

use super::EmbeddedMotion;
use tessuto_estimate::motion::causes::Constraint;

/// What is known of the causes of a motion.
#[derive(Debug, Clone, Default, Serialize)]
pub struct CauseData {
    /// What was found, with its spread.
    #[serde(skip)]
    pub rows: Vec<CauseRow>,
    /// Vertices at which arrows are drawn, u32 `[S]`; empty without forces.
    pub sites: String,
    /// The forces per mass there.
    pub forces: Vec<ForceArrows>,
    /// Changed replays.
    pub replays: Vec<Replay>,
}

impl CauseData {
    /// Bytes of its numbers in the page, nearly.
    pub fn size(&self) -> usize {
        let motions = self.forces.iter().map(|f| &f.vectors).chain(self.replays.iter().map(|r| &r.motion));
        self.sites.len() + motions.map(|m| m.boxes.len() + m.steps.len()).sum::<usize>()
    }
}

/// A force per mass at the sites.
#[derive(Debug, Clone, Serialize)]
pub struct ForceArrows {
    /// Key, for the script.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// Vectors [m/s²] at the sites in place of positions; after its last frame it stays.
    pub vectors: EmbeddedMotion,
}

/// The motion as it would have been.
#[derive(Debug, Clone, Serialize)]
pub struct Replay {
    /// Key, for the script.
    pub key: &'static str,
    /// Name of its button.
    pub label: &'static str,
    /// What is different.
    pub note: String,
    /// Index of the frame from which it is.
    pub from: usize,
    /// Positions.
    pub motion: EmbeddedMotion,
}

/// A line of the table of causes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CauseRow {
    /// What it is.
    pub label: String,
    /// Its value.
    pub value: f64,
    /// Unit of the value; empty if it has none.
    pub unit: &'static str,
    /// How sure it is.
    pub spread: Option<CauseSpread>,
    /// What the video says of it; unknown for what follows from others.
    pub constraint: Option<Constraint>,
    /// Between which values 95 of 100 known fabrics are.
    pub known: Option<[f64; 2]>,
    /// Anything worth saying; may be empty.
    pub note: String,
}

/// How sure a number is: one standard deviation either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CauseSpread {
    /// Of its logarithm: within this factor.
    Factor(f64),
    /// Of itself, in its unit.
    Margin(f64),
}

/// Between which values 95 of 100 of 618 fabrics are that were measured by machine.
pub mod known {
    /// Area density [kg/m²].
    pub const DENSITY: [f64; 2] = [0.023, 0.65];
    /// Bending stiffness of warp or weft [N·m].
    pub const BENDING: [f64; 2] = [0.8e-6, 1.2e-4];
    /// Bending length of warp or weft `[m]`.
    pub const BENDING_LENGTH: [f64; 2] = [9.3e-3, 33e-3];
    /// Bending stiffness of the warp over that of the weft.
    pub const WARP_OVER_WEFT: [f64; 2] = [0.29, 6.4];
}

/// Places on a logarithmic bar that is three times as long either way as the known range, in percent: start and
/// width of the known range, start and width of the value with two standard deviations either way.
pub(super) fn bar(value: f64, factor: f64, [low, high]: [f64; 2]) -> [f64; 4] {
    let [start, end] = [(low / 3.0).ln(), (high * 3.0).ln()];
    let at = |x: f64| (100.0 * (x.ln() - start) / (end - start)).clamp(0.0, 100.0);
    let reach = factor * factor;
    let (from, to) = (at(value / reach), at(value * reach));
    // What lies beyond the bar is at its end, and still seen.
    let width = (to - from).max(1.5);
    [at(low), at(high) - at(low), from.min(100.0 - width), width]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_keep_to_their_place() {
        let [low, width, from, span] = bar(1e-5, 1.0, [1e-6, 1e-4]);
        assert!((low + width / 2.0 - 50.0).abs() < 1e-9 && (from - 50.0).abs() < 1.0 && span == 1.5);
        let [.., from, span] = bar(1e-9, 1.5, [1e-6, 1e-4]);
        assert_eq!([from, span], [0.0, 1.5]);
        let [.., from, span] = bar(1.0, 1.5, [1e-6, 1e-4]);
        assert_eq!([from, span], [98.5, 1.5]);
        let [.., span] = bar(1e-5, 3.0, [1e-6, 1e-4]);
        // Two standard deviations either way, of a bar from 1e-6/3 to 3e-4.
        assert!((span - 100.0 * 81f64.ln() / 900f64.ln()).abs() < 1e-9, "{span}");
    }
}
