//! Values of options that several commands share.

use std::ops::Range;

use tessuto::config::Preset;

/// `A..B` with A < B: the frames A to B − 1.
pub fn parse(text: &str) -> Result<Range<usize>, String> {
    let hint = "write A..B with A < B, such as 0..20";
    let (a, b) = text.split_once("..").ok_or(hint)?;
    let (a, b) = (a.trim().parse().map_err(|_| hint)?, b.trim().parse().map_err(|_| hint)?);
    if a < b { Ok(a..b) } else { Err(hint.to_owned()) }
}

/// A preset's name.
pub fn preset(text: &str) -> Result<Preset, String> {
    Preset::named(text).map_err(|_| format!("the presets are: {}", Preset::NAMES.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn ranges_must_be_ascending_numbers() {
        assert_eq!(parse("3..8"), Ok(3..8));
        assert_eq!(parse(" 3 .. 8 "), Ok(3..8));
        for bad in ["8..3", "3..3", "3-8", "a..b", "..", "3.."] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
