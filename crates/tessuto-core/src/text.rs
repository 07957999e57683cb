//! Text helpers: names that were mistyped, paths that a shell takes, hexadecimal, base64.

use std::path::{Path, is_separator};

/// Most edits between a mistyped name and the one that was meant.
const CLOSE: usize = 3;
/// Longest mistyped name that is compared `[characters]`; one of a damaged file may be as long as the file.
const LONGEST: usize = 64;

/// Fewest insertions, deletions and replacements of characters that turn `a` into `b`, upper and lower case alike.
pub fn edits(a: &str, b: &str) -> usize {
    let a: String = a.chars().take(LONGEST).collect();
    strsim::levenshtein(&a.to_lowercase(), &b.to_lowercase())
}

/// Words for what has another name here.
const SYNONYMS: [(&str, &str); 5] = [
    ("contour", "outline"),
    ("curvature", "signed_bend"),
    ("color", "colour"),
    ("lr", "learning_rate"),
    ("resolution", "size"),
];

/// The key of `known` that was probably meant by `key`: the one with the fewest edits to it, or between their
/// parts after the last dot, whatever stands before them; `None` if no key is close.
pub fn nearest_key<'a>(key: &str, known: &'a [String]) -> Option<&'a str> {
    let (section, last) = key.rsplit_once('.').unwrap_or(("", key));
    let last = SYNONYMS.iter().find(|(word, _)| *word == last).map_or(last, |(_, name)| name);
    // A third of a word, or it is another one; of two equal words, the one of the section that was named.
    let close = (last.chars().count() / 3).min(CLOSE);
    let distance = |k: &&'a str| {
        let (own_section, own_last) = k.rsplit_once('.').unwrap_or(("", k));
        let of_last = edits(last, own_last);
        let whole = Some(edits(key, k)).filter(|d| *d <= CLOSE);
        let part = Some(of_last).filter(|d| *d <= close);
        let best = [whole, part].into_iter().flatten().min();
        best.map(|d| (d.min(of_last), edits(section, own_section)))
    };
    known
        .iter()
        .map(String::as_str)
        .filter_map(|k| Some((distance(&k)?, k)))
        .min_by_key(|(d, _)| *d)
        .map(|(_, k)| k)
}

/// Lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// `bytes` in the alphabet of RFC 4648 §4, padded.
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = Vec::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |w, b| w << 8 | u32::from(*b)) << (8 * (3 - chunk.len()));
        let digit = |k: usize| ALPHABET[(word >> (18 - 6 * k)) as usize & 63];
        out.extend((0..4).map(|k| if k <= chunk.len() { digit(k) } else { b'=' }));
    }
    String::from_utf8(out).expect("ASCII")
}

/// The bytes behind [`base64`]; `None` if a character is foreign.
pub fn from_base64(text: &str) -> Option<Vec<u8>> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let (mut bits, mut held, mut out) = (0u32, 0, Vec::with_capacity(text.len() / 4 * 3));
    for c in text.trim_end_matches('=').bytes() {
        bits = bits << 6 | u32::from(digit(c)?);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

/// `path` as a POSIX shell takes it: as it is where no character is special, else in single quotes.
pub fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || is_separator(c) || "._-+:,@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_key_finds_the_one_meant() {
        let known = ["texture.size", "texture.epochs", "rollout.weights.energy"].map(str::to_owned);
        assert_eq!(nearest_key("texture.epoch", &known), Some("texture.epochs"));
        assert_eq!(nearest_key("Energi", &known), Some("rollout.weights.energy"));
        assert_eq!(nearest_key("viscosity", &known), None);
        let known = [
            "texture.size",
            "spacetime.outline",
            "spacetime.colour",
            "spacetime.signed_bend",
            "rollout.weights.colour",
        ]
        .map(str::to_owned);
        // Another section, another word.
        assert_eq!(nearest_key("trajectory.outline", &known), Some("spacetime.outline"));
        assert_eq!(nearest_key("trajectory.curvature", &known), Some("spacetime.signed_bend"));
        assert_eq!(nearest_key("spacetime.contour", &known), Some("spacetime.outline"));
        assert_eq!(nearest_key("spacetime.color", &known), Some("spacetime.colour"));
        assert_eq!(nearest_key("rollout.color", &known), Some("rollout.weights.colour"));
        assert_eq!(nearest_key("spacetime.wool", &known), None);
        assert_eq!(edits(&"x".repeat(1 << 20), "fps"), LONGEST);
    }

    #[test]
    fn texts_of_the_standard() {
        for (plain, text) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(plain.as_bytes()), text);
            assert_eq!(from_base64(text).unwrap(), plain.as_bytes());
        }
        assert_eq!(base64(&[0xFB, 0xFF]), "+/8=");
        assert_eq!(from_base64("Zm9v-"), None);
    }

    #[test]
    fn a_shell_takes_any_path() {
        assert_eq!(quoted(Path::new("scenes/Vorhang_ü-2.0")), "scenes/Vorhang_ü-2.0");
        for path in ["a b", "it's", "$HOME", "a;b", "", "~x", "#1", "a\nb", "(1)", "*"] {
            let echo = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(Path::new(path)))])
                .output();
            match echo {
                Ok(said) => assert_eq!(String::from_utf8_lossy(&said.stdout), path),
                // No shell here: the form alone.
                Err(_) => assert!(quoted(Path::new(path)).starts_with('\''), "{path}"),
            }
        }
    }
}
