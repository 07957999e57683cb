//! Which object of a mask is the fabric.

use std::fmt;
use std::str::FromStr;

/// One of the objects of a mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Object {
    /// Its label: the index in the palette, or the grey value; of colours without a palette the position in the
    /// list that the message gives, from 1.
    Number(u32),
    /// Its colour, 0 to 255.
    Colour([u8; 3]),
}

impl FromStr for Object {
    type Err = String;

    /// `2`, `128,0,0` or `#800000`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("\"{text}\" is neither a label (2) nor a colour (128,0,0 or #800000)");
        let text = text.trim();
        if let Some(hex) = text.strip_prefix('#') {
            let number = u32::from_str_radix(hex, 16).ok().filter(|_| hex.len() == 6);
            let [_, r, g, b] = number.ok_or_else(wrong)?.to_be_bytes();
            return Ok(Self::Colour([r, g, b]));
        }
        if text.contains(',') {
            let parts: Option<Vec<u8>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
            let colour = parts.and_then(|parts| <[u8; 3]>::try_from(parts).ok());
            return colour.map(Self::Colour).ok_or_else(wrong);
        }
        text.parse().map(Self::Number).map_err(|_| wrong())
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(n) => write!(f, "{n}"),
            Self::Colour([r, g, b]) => write!(f, "{r},{g},{b}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_and_colours() {
        let read = |text: &str| text.parse::<Object>();
        assert_eq!(read("2"), Ok(Object::Number(2)));
        assert_eq!(read("128, 0,0"), Ok(Object::Colour([128, 0, 0])));
        assert_eq!(read("#800000"), Ok(Object::Colour([128, 0, 0])));
        for wrong in ["", "red", "#80", "#80000g", "1,2", "1,2,256", "-1"] {
            assert!(read(wrong).unwrap_err().contains("neither a label"), "{wrong}");
        }
    }
}
