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

/// Frames per second, as a number or as a fraction of whole ones such as `30000/1001`.
pub fn per_second(text: &str) -> Result<f64, String> {
    let hint = "write frames per second, such as 30, 29.97 or 30000/1001";
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| hint.to_owned());
    match text.split_once('/') {
        Some((a, b)) => Ok(number(a)? / number(b)?),
        None => number(text),
    }
}

/// A preset's name.
pub fn preset(text: &str) -> Result<Preset, String> {
    Preset::named(text).map_err(|_| format!("the presets are: {}", Preset::NAMES.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::{parse, per_second};

    #[test]
    fn ranges_must_be_ascending_numbers() {
        assert_eq!(parse("3..8"), Ok(3..8));
        assert_eq!(parse(" 3 .. 8 "), Ok(3..8));
        for bad in ["8..3", "3..3", "3-8", "a..b", "..", "3.."] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn rates_may_be_fractions() {
        assert_eq!((per_second("30"), per_second("30000/1001")), (Ok(30.0), Ok(30_000.0 / 1001.0)));
        assert!(per_second("fast").is_err() && per_second("30/").is_err());
    }
}
