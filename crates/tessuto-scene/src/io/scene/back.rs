//! The fabric's other side, as scene.json names it.

use tessuto_core::error::{Error, Result};
use tessuto_core::scene::Back;

/// `same`, `plain`, `other`, or the one colour of the other side as `#rrggbb`. `place` is where it is from.
///
/// # Errors
/// [`Error::Input`] for anything else.
pub fn parse(text: &str, place: &str) -> Result<Back> {
    match text {
        "same" => Ok(Back::Same),
        "plain" => Ok(Back::Plain(None)),
        "other" => Ok(Back::Other),
        _ => colour(text).map(|colour| Back::Plain(Some(colour))).ok_or_else(|| {
            let hint = "write \"same\" (the print goes through), \"plain\" (one colour), its colour as \"#rrggbb\", \
                        or \"other\"";
            Error::input(place, format!("\"back\" is \"{text}\""), hint)
        }),
    }
}

/// As [`parse`] reads it.
pub fn name(back: Back) -> String {
    match back {
        Back::Same => "same".to_owned(),
        Back::Other => "other".to_owned(),
        Back::Plain(None) => "plain".to_owned(),
        Back::Plain(Some(colour)) => {
            let [r, g, b] = colour.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            format!("#{r:02x}{g:02x}{b:02x}")
        }
    }
}

fn colour(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
    let digits = digits.bytes().all(|c| c.is_ascii_hexdigit()).then_some(digits)?;
    let number = u32::from_str_radix(digits, 16).ok()?;
    Some([16, 8, 0].map(|shift| ((number >> shift) & 255) as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_as_it_is_written_and_others_are_refused() {
        let colour = Back::Plain(Some([32, 255, 0].map(|v: u8| f32::from(v) / 255.0)));
        for back in [Back::Same, Back::Other, Back::Plain(None), colour] {
            assert_eq!(parse(&name(back), "").unwrap(), back);
        }
        assert_eq!(name(colour), "#20ff00");
        for wrong in ["", "red", "#12345", "#12345g", "#+12345", "#1234567"] {
            let message = parse(wrong, "scene.json").unwrap_err().to_string();
            assert!(message.contains("\"back\"") && message.contains("#rrggbb"), "{message}");
        }
    }
}
