//! What a unit of a depth map is in metres: no file says it, so that it is given or assumed, and doubted where
//! another one makes more sense.

use glam::DVec3;

use tessuto_core::mesh::diagonal;

/// Units of common sensors and data sets `[m]`.
const COMMON: [(f64, &str); 6] = [
    (1e-3, "millimetres"),
    (2.5e-4, "RealSense L515"),
    (2e-4, "TUM RGB-D"),
    (1e-4, "RealSense D405"),
    (1e-2, "centimetres"),
    (1.0, "metres"),
];
/// A sheet with a longer diagonal `[m]` is doubted where another common unit makes it smaller; a bath towel has 1.6.
const LARGE: f64 = 2.0;
/// Diagonals `[m]` and distances `[m]` that another unit must make to be named.
const LIKELY: [std::ops::RangeInclusive<f64>; 2] = [0.1..=LARGE, 0.2..=30.0];

/// What a unit of a depth map is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// `[m]`.
    pub metres: f64,
    /// Whether that was given; else it is what such files usually have.
    pub told: bool,
}

impl Unit {
    /// In words: `0.25 mm (RealSense L515)`.
    pub fn name(&self) -> String {
        let same = |(metres, _): &&(f64, &str)| (metres / self.metres - 1.0).abs() < 1e-6;
        match COMMON.iter().find(same) {
            Some((metres, _)) if *metres == 1e-3 || *metres >= 1e-2 => length(self.metres),
            Some((metres, name)) => format!("{} ({name})", length(*metres)),
            None => length(self.metres),
        }
    }

    /// Why a sheet of these `positions` `[m]`, as the depth map has it, may be of another unit: it is large, and
    /// another common unit, which is named with what it makes of it, would make it less so.
    pub fn doubt(&self, positions: &[DVec3]) -> Option<String> {
        let distance = positions.iter().map(|p| p.z).sum::<f64>() / positions.len().max(1) as f64;
        self.doubt_of(diagonal(positions), distance)
    }

    /// The same of a sheet with this `diagonal` `[m]` at this `distance` `[m]`.
    fn doubt_of(&self, diagonal: f64, distance: f64) -> Option<String> {
        if self.told || diagonal <= LARGE {
            return None;
        }
        let makes = |ratio: f64| [diagonal * ratio, distance * ratio];
        let others: Vec<String> = COMMON
            .iter()
            .map(|(metres, _)| (Self { metres: *metres, told: true }, makes(metres / self.metres)))
            .filter(|(_, made)| made.iter().zip(&LIKELY).all(|(value, likely)| likely.contains(value)))
            .map(|(unit, [d, z])| format!("{d:.2} m at {z:.2} m with {}", unit.name()))
            .collect();
        let found = format!(
            "the sheet has a diagonal of {diagonal:.2} m at {distance:.2} m if a unit of the depth map is {}",
            self.name()
        );
        (!others.is_empty()).then(|| format!("{found}, which nothing says; {}", others.join(", ")))
    }

    /// The common units that bring `median` `[m]`, a depth in this unit, between `usual` ones, in words.
    pub(super) fn others(&self, median: f64, usual: &std::ops::RangeInclusive<f64>) -> String {
        let fits = COMMON
            .iter()
            .map(|(metres, _)| (Self { metres: *metres, told: true }, median * metres / self.metres));
        let named: Vec<String> = fits
            .filter(|(_, depth)| usual.contains(depth))
            .map(|(unit, depth)| format!("{depth:.2} m with {}", unit.name()))
            .collect();
        named.join(", ")
    }
}

fn length(metres: f64) -> String {
    match metres {
        m if m >= 1.0 => format!("{m} m"),
        m if m >= 1e-2 => format!("{} cm", rounded(m * 1e2)),
        m => format!("{} mm", rounded(m * 1e3)),
    }
}

/// Six digits, without those that binary fractions add.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_names_and_large_sheets_are_doubted() {
        let mm = Unit { metres: 1e-3, told: false };
        let named =
            [1.0, 1e-2, 1e-3, 2.5e-4, 2e-4, 1e-4, 4e-3].map(|metres| Unit { metres, told: true }.name());
        let expected = [
            "1 m",
            "1 cm",
            "1 mm",
            "0.25 mm (RealSense L515)",
            "0.2 mm (TUM RGB-D)",
            "0.1 mm (RealSense D405)",
            "4 mm",
        ];
        assert_eq!(named, expected);
        // A half metre at a metre, by a sensor of quarter millimetres.
        let doubt = mm.doubt_of(2.83, 4.0).unwrap();
        assert!(doubt.contains("2.83 m at 4.00 m if a unit of the depth map is 1 mm"), "{doubt}");
        assert!(doubt.contains("0.71 m at 1.00 m with 0.25 mm (RealSense L515)"), "{doubt}");
        assert!(!doubt.contains("with 1 mm") && !doubt.contains("with 1 cm"), "{doubt}");
        assert_eq!(mm.doubt_of(0.71, 1.0), None);
        assert_eq!(Unit { told: true, ..mm }.doubt_of(2.83, 4.0), None);
    }
}
