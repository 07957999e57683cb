//! What is good: a scale for the numbers that a reader cannot judge without one. It grades, where the verdict decides.

/// From what value on a number is how good.
#[derive(Debug)]
pub struct Scale {
    /// What is measured.
    name: &'static str,
    /// What a number is shown in, and how many of these its unit is.
    unit: (&'static str, f64),
    /// The least (or, of what should be small, the largest) values that are very good, good and fair.
    steps: [f64; 3],
    /// Whether less is better.
    falling: bool,
}

/// Grades, the best first.
const WORDS: [&str; 4] = ["very good", "good", "fair", "poor"];

/// Intersection over union with the mask. Of a sheet 100 pixels wide, a border that is off by half a pixel all
/// around leaves 98 %, by one and a half 94 %; below 90 % the verdict doubts plain cloth.
pub const SILHOUETTES: Scale =
    Scale { name: "silhouette overlap", unit: ("%", 100.0), steps: [0.97, 0.94, 0.9], falling: false };
/// Peak signal-to-noise ratio `[dB]`: 30 is a root mean square error of 8 of 255, which is hardly seen, 25 one of
/// 14, 20 one of 26.
pub const COLOURS: Scale =
    Scale { name: "colours, PSNR", unit: ("dB", 1.0), steps: [30.0, 25.0, 20.0], falling: false };
/// Strain that one thread in a hundred exceeds: woven cloth in the hand gives a few per cent, knitted cloth ten or
/// more; at 50 % the verdict doubts.
pub const STRAINS: Scale =
    Scale { name: "strain, 99 of 100 threads", unit: ("%", 100.0), steps: [0.05, 0.15, 0.5], falling: true };

impl Scale {
    /// How good `value` is, in a word; what is no number is poor.
    pub fn grade(&self, value: f64) -> &'static str {
        let reached = |step: &f64| if self.falling { value <= *step } else { value >= *step };
        WORDS[self.steps.iter().position(reached).unwrap_or(self.steps.len())]
    }

    /// The scale in words.
    pub fn sentence(&self) -> String {
        let (unit, factor) = self.unit;
        let side = if self.falling { "up to" } else { "from" };
        let step = |(word, step): (&&str, &f64)| format!("{word} {side} {:.0} {unit}", factor * step);
        let steps: Vec<String> = WORDS.iter().zip(&self.steps).map(step).collect();
        format!("{}: {}", self.name, steps.join(", "))
    }
}

/// All scales in words.
pub fn sentences() -> String {
    [&SILHOUETTES, &COLOURS, &STRAINS].map(Scale::sentence).join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_grade_whose_step_it_reaches() {
        let grades = |scale: &Scale, values: [f64; 4]| values.map(|value| scale.grade(value));
        assert_eq!(grades(&COLOURS, [30.0, 28.7, 20.0, 19.9]), WORDS);
        assert_eq!(grades(&SILHOUETTES, [0.99, 0.969, 0.9, 0.5]), WORDS);
        assert_eq!(grades(&STRAINS, [0.05, 0.06, 0.5, 0.51]), WORDS);
        assert_eq!(COLOURS.grade(f64::NAN), "poor");
        assert_eq!(
            STRAINS.sentence(),
            "strain, 99 of 100 threads: very good up to 5 %, good up to 15 %, fair up to 50 %"
        );
        assert!(
            sentences().contains("colours, PSNR: very good from 30 dB, good from 25 dB, fair from 20 dB")
        );
    }
}
