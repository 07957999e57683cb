//! The figures that were printed.
//!
//! Source: \[SAFT\], supplement, Tables 2–5 and 7, scenes R1–R9; means over the frames. The powers of ten of
//! Tables 4 and 5 follow from inequalities (no point-to-surface distance is far above the Chamfer distance, no
//! mean square below the squared mean).

/// Scenes of the columns.
const SCENES: [&str; 9] = ["R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8", "R9"];

/// A row of a printed table.
#[derive(Debug, Clone, Copy)]
pub struct Printed {
    /// Key of the quantity, as in [`tessuto_estimate::metrics::QUANTITIES`].
    pub quantity: &'static str,
    /// Key of the ablation that it is of; `None` for whole methods.
    pub ablation: Option<&'static str>,
    /// Name of the method.
    pub label: &'static str,
    /// Factor to SI units.
    pub scale: f64,
    /// Values of R1–R9; NaN where the copy is illegible.
    pub values: [f64; 9],
    /// The printed mean.
    pub mean: f64,
}

impl Printed {
    /// The value of `scene`, in SI units, if it was printed.
    pub fn value(&self, scene: &str) -> Option<f64> {
        let column = SCENES.iter().position(|s| *s == scene)?;
        Some(self.values[column] * self.scale).filter(|v| v.is_finite())
    }
}

const fn row(
    quantity: &'static str,
    label: &'static str,
    scale: f64,
    values: [f64; 9],
    mean: f64,
) -> Printed {
    Printed { quantity, ablation: None, label, scale, values, mean }
}

const fn ablation(key: &'static str, label: &'static str, values: [f64; 9], mean: f64) -> Printed {
    Printed { quantity: "cd2", ablation: Some(key), label, scale: 1e-4, values, mean }
}

const SAFT: &str = "SAFT, published";
const PHI: &str = "φ-SfT, published";
const PG: &str = "PG-SfT, published";

/// All printed rows.
pub const PUBLISHED: [Printed; 17] = [
    row("depth", SAFT, 1e-2, [0.54, 0.71, 0.76, 1.64, 1.31, 0.81, 1.28, 0.63, 0.51], 0.91),
    row("depth", PHI, 1e-2, [2.50, 1.48, 1.29, 1.99, 2.27, 1.71, 1.66, 1.13, 1.01], 1.67),
    row("depth", PG, 1e-2, [1.60, 1.13, 2.03, 2.08, 2.00, 2.37, 1.54, 2.00, 1.70], 1.83),
    row("cd1", SAFT, 1e-2, [1.08, 1.24, 1.44, 2.92, 2.57, 1.57, 2.38, 1.22, 1.04], 1.72),
    row("cd1", PHI, 1e-2, [2.21, 2.63, 2.34, 3.56, 4.31, 3.22, 3.04, 2.14, 1.95], 2.82),
    row("cd1", PG, 1e-2, [2.97, 2.14, 3.69, 4.02, 3.64, 4.38, 3.01, 3.79, 3.24], 3.43),
    row("p2s1_published", SAFT, 1e-3, [0.70, 1.42, 1.58, 6.80, 6.94, 2.87, 3.90, 1.97, 1.76], 3.10),
    row("p2s1_published", PHI, 1e-3, [7.73, 3.96, 4.45, 12.44, 21.87, 14.08, 11.85, 8.25, 7.20], 10.20),
    row("p2s1_published", PG, 1e-3, [2.46, 5.70, 4.94, 7.61, 4.52, 20.12, 4.05, 15.26, 5.84], 7.83),
    row("p2s2_published", SAFT, 1e-5, [0.34, 1.14, 2.49, 14.32, 25.26, 2.55, 4.42, 1.27, 1.93], 5.97),
    row("p2s2_published", PHI, 1e-5, [22.65, 15.21, 9.71, 27.38, 62.83, 30.26, 23.78, 10.81, 8.85], 23.50),
    row("p2s2_published", PG, 1e-5, [3.86, 8.24, 11.21, 17.51, 20.59, 73.12, 6.82, 30.55, 12.38], 20.48),
    row("cd2", SAFT, 1e-4, [1.01, 1.55, 2.70, 8.29, 7.12, 2.18, 4.84, 1.23, 1.04], 3.33),
    ablation(
        "saft-fixed",
        "SAFT, stiffnesses fixed, published",
        [1.64, 4.18, 2.31, 15.28, 7.32, 5.24, 3.15, 2.12, 1.33],
        4.73,
    ),
    ablation(
        "saft-fixed-no-force",
        "SAFT, stiffnesses fixed, without R_F, published",
        [5.12, 5.47, 2.29, 14.56, 6.83, 5.45, 3.29, 2.89, 1.18],
        5.23,
    ),
    ablation(
        "saft-fixed-no-energy",
        "SAFT, stiffnesses fixed, without R_E, published",
        [4.77, 1.56, 4.02, 9.79, 25.65, f64::NAN, 4.73, 1.72, 1.54],
        6.37,
    ),
    ablation(
        "saft-fixed-no-regulariser",
        "SAFT, stiffnesses fixed, without R_F and R_E, published",
        [4.52, 4.44, 2.30, 15.70, 7.42, 5.74, 3.24, 1.58, 1.42],
        5.15,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_have_the_printed_means() {
        for row in PUBLISHED.iter().filter(|row| row.values.iter().all(|v| v.is_finite())) {
            let mean = row.values.iter().sum::<f64>() / 9.0;
            assert!((mean - row.mean).abs() < 0.0051, "{row:?}: {mean}");
        }
    }

    #[test]
    fn the_powers_of_ten_obey_the_inequalities() {
        let of = |quantity: &str, label: &str| {
            *PUBLISHED.iter().find(|r| r.quantity == quantity && r.label == label).unwrap()
        };
        for label in [SAFT, PHI, PG] {
            let [cd1, p1, p2] = ["cd1", "p2s1_published", "p2s2_published"].map(|q| of(q, label));
            for scene in SCENES {
                let [cd1, p1, p2] = [cd1, p1, p2].map(|row| row.value(scene).unwrap());
                assert!(p1 < cd1, "{label} {scene}");
                // Sums of two means, hence the half.
                assert!(p2 >= 0.5 * p1 * p1, "{label} {scene}: {p2} {p1}");
            }
        }
        assert_eq!(of("cd1", SAFT).value("S1"), None);
    }
}
