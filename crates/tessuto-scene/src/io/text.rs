//! Text files as programs save them: UTF-8 with or without a byte order mark, UTF-16 with one. Other encodings are
//! refused by name.

use std::borrow::Cow;
use std::path::Path;

use super::read_bounded;
use tessuto_core::error::{Error, Result};

/// Largest text file `[bytes]`.
const MAX_TEXT: u64 = 256 << 20;
/// Byte order marks: of UTF-8, and of UTF-16 with the low and with the high byte first.
const UTF8: &[u8] = b"\xEF\xBB\xBF";
const UTF16: [&[u8]; 2] = [b"\xFF\xFE", b"\xFE\xFF"];

/// The text in the file at `path`, of 256 MiB at most, UTF-8 with or without a byte order mark or UTF-16 with one.
///
/// # Errors
/// [`Error::Input`] naming the file and, where it is no text, the line.
pub fn read_text(path: &Path) -> Result<String> {
    decode(read_bounded(path, MAX_TEXT)?, &path.display().to_string())
}

/// The text in `bytes`, those of the file `place`, without its byte order mark.
///
/// # Errors
/// [`Error::Input`] with the line and the first byte that is no text.
pub fn decode(bytes: Vec<u8>, place: &str) -> Result<String> {
    let bytes = match without_mark(&bytes, place)? {
        Cow::Owned(bytes) => bytes,
        Cow::Borrowed(rest) if rest.len() == bytes.len() => bytes,
        Cow::Borrowed(rest) => rest.to_vec(),
    };
    let text = String::from_utf8(bytes).map_err(|e| {
        let (good, bytes) = (e.utf8_error().valid_up_to(), e.as_bytes());
        let line = 1 + bytes[..good].iter().filter(|b| **b == b'\n').count();
        let problem = format!("is not UTF-8 text: byte {:#04X} at offset {good} is no letter", bytes[good]);
        // What older programs of Windows save has such single bytes.
        let hint = "save it as UTF-8 (a spreadsheet: as \"CSV UTF-8\")";
        Error::input(format!("{place}, line {line}"), problem, hint)
    })?;
    match text.find('\0') {
        None => Ok(text),
        Some(at) => {
            let line = 1 + text[..at].matches('\n').count();
            let problem = "holds a zero byte: it is no text, or UTF-16 without a byte order mark";
            Err(Error::input(format!("{place}, line {line}"), problem, "save it as UTF-8"))
        }
    }
}

/// `bytes` of the file `place` without a byte order mark, UTF-16 as UTF-8; what has no mark may be in any encoding, or
/// be no text.
pub(crate) fn without_mark<'a>(bytes: &'a [u8], place: &str) -> Result<Cow<'a, [u8]>> {
    if let Some(rest) = bytes.strip_prefix(UTF8) {
        return Ok(Cow::Borrowed(rest));
    }
    let Some(high_first) = UTF16.iter().position(|mark| bytes.starts_with(mark)) else {
        return Ok(Cow::Borrowed(bytes));
    };
    let pairs = bytes[2..].chunks_exact(2);
    let cut = !pairs.remainder().is_empty();
    let units = pairs.map(|b| if high_first == 1 { [b[1], b[0]] } else { [b[0], b[1]] });
    let text: std::result::Result<String, _> = char::decode_utf16(units.map(u16::from_le_bytes)).collect();
    match text {
        Ok(text) if !cut => Ok(Cow::Owned(text.into_bytes())),
        _ => Err(Error::input(place, "begins as UTF-16 text does, but is none", "save it as UTF-8")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, high_first: bool) -> Vec<u8> {
        let bytes = |c: u16| if high_first { c.to_be_bytes() } else { c.to_le_bytes() };
        format!("\u{feff}{text}").encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn a_mark_is_passed_over_and_encodings_are_told_apart() {
        let text = "Länge 漢 😀\r\n2";
        let marked = format!("\u{feff}{text}").into_bytes();
        for bytes in [text.as_bytes().to_vec(), marked, utf16(text, false), utf16(text, true)] {
            assert_eq!(decode(bytes, "a.csv").unwrap(), text);
        }
        // A second mark is a letter, as any other.
        assert_eq!(decode("\u{feff}\u{feff}a".into(), "a.csv").unwrap(), "\u{feff}a");
        assert_eq!(decode(Vec::new(), "a.csv").unwrap(), "");
    }

    #[test]
    fn what_is_no_text_is_refused_with_file_line_and_byte() {
        let bare: Vec<u8> = "a\nb".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let cut = utf16("ab", false)[..5].to_vec();
        let lone = b"\xFF\xFE\x00\xD8a\0".to_vec();
        for (bytes, said) in [
            (b"name\nVorh\xE4nge".to_vec(), "a.csv, line 2: is not UTF-8 text: byte 0xE4 at offset 9"),
            (b"name\nVorh\xE4nge".to_vec(), "CSV UTF-8"),
            (bare, "a.csv, line 1: holds a zero byte"),
            (cut, "a.csv: begins as UTF-16"),
            (lone, "a.csv: begins as UTF-16"),
        ] {
            let message = decode(bytes, "a.csv").unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }
}
