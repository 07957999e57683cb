//! The header of a .npy file: a magic number, a length, and a dictionary written as Python would print it.
//!
//! Source: NumPy, "NEP 1: a simple file format for NumPy arrays", versions 1 to 3.

/// Longest header read `[bytes]`; that of an array of numbers takes about 100.
const LONGEST: usize = 1 << 16;
/// The header ends at a multiple of this `[bytes]`.
const ALIGNMENT: usize = 64;

/// What the header says of the values.
#[derive(Debug, PartialEq)]
pub(super) struct Header {
    /// Type of a value: byte order (`<`, `>`, `=` or `|`), letter, bytes, such as `<f4`.
    pub descr: String,
    /// Whether the first axis runs fastest.
    pub fortran_order: bool,
    /// Length of every axis.
    pub shape: Vec<u64>,
}

/// The header of `file` and the bytes behind it, or what is wrong with it.
pub(super) fn read(file: &[u8]) -> Result<(Header, &[u8]), String> {
    let rest = file.strip_prefix(b"\x93NUMPY").ok_or("it does not begin with \\x93NUMPY")?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
        _ => return Err("its version is not 1, 2 or 3".to_owned()),
    };
    if length > LONGEST {
        return Err(format!("its header has {length} bytes, at most {LONGEST} are read"));
    }
    let (header, data) = rest.split_at_checked(length).ok_or("it ends within its header")?;
    let header = std::str::from_utf8(header).map_err(|_| "its header is not text")?;
    Ok((dictionary(&mut Scanner(header))?, data))
}

/// The bytes before the values of an array in C order.
pub(super) fn write(descr: &str, shape: &[usize]) -> Vec<u8> {
    let axes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({axes}), }}");
    let before = b"\x93NUMPY\x01\x00".len() + 2;
    let whole = (before + text.len() + 1).next_multiple_of(ALIGNMENT);
    text.push_str(&" ".repeat(whole - before - text.len() - 1));
    text.push('\n');
    let length = u16::try_from(text.len()).expect("an array has few axes");
    [b"\x93NUMPY\x01\x00", &length.to_le_bytes()[..], text.as_bytes()].concat()
}

/// `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`, in any order of the keys.
fn dictionary(scanner: &mut Scanner) -> Result<Header, String> {
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    scanner.expect('{')?;
    while !scanner.take('}') {
        let key = scanner.string()?;
        scanner.expect(':')?;
        match key {
            "descr" => descr = Some(scanner.string()?.to_owned()),
            "fortran_order" => fortran_order = Some(scanner.truth()?),
            "shape" => shape = Some(scanner.integers()?),
            _ => return Err(format!("its header has an unknown key \"{key}\"")),
        }
        if !scanner.take(',') {
            scanner.expect('}')?;
            break;
        }
    }
    if !scanner.0.trim().is_empty() {
        return Err(format!("its header goes on after the dictionary, {}", scanner.here()));
    }
    let missing = |key: &str| format!("its header has no \"{key}\"");
    Ok(Header {
        descr: descr.ok_or_else(|| missing("descr"))?,
        fortran_order: fortran_order.ok_or_else(|| missing("fortran_order"))?,
        shape: shape.ok_or_else(|| missing("shape"))?,
    })
}

/// The rest of the text.
struct Scanner<'a>(&'a str);

impl<'a> Scanner<'a> {
    /// Where the scanner stands, for messages.
    fn here(&self) -> String {
        format!("at \"{}\"", self.0.chars().take(20).collect::<String>())
    }

    /// Whether `sign` comes next; if so, it is passed.
    fn take(&mut self, sign: char) -> bool {
        self.0 = self.0.trim_start();
        self.0.strip_prefix(sign).inspect(|rest| self.0 = rest).is_some()
    }

    fn expect(&mut self, sign: char) -> Result<(), String> {
        if self.take(sign) { Ok(()) } else { Err(format!("its header needs '{sign}' {}", self.here())) }
    }

    /// A string without escapes.
    fn string(&mut self) -> Result<&'a str, String> {
        let quote = ['\'', '"'].into_iter().find(|q| self.take(*q));
        let Some((text, rest)) = quote.and_then(|quote| self.0.split_once(quote)) else {
            return Err(format!("its header needs a string {}", self.here()));
        };
        self.0 = rest;
        Ok(text)
    }

    fn truth(&mut self) -> Result<bool, String> {
        self.0 = self.0.trim_start();
        for (word, value) in [("True", true), ("False", false)] {
            if let Some(rest) = self.0.strip_prefix(word) {
                self.0 = rest;
                return Ok(value);
            }
        }
        Err(format!("its header needs True or False {}", self.here()))
    }

    /// A tuple or a list of whole numbers.
    fn integers(&mut self) -> Result<Vec<u64>, String> {
        let close = if self.take('(') {
            ')'
        } else {
            self.expect('[')?;
            ']'
        };
        let mut numbers = Vec::new();
        while !self.take(close) {
            let digits = self.0.trim_start();
            let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            let number = digits[..end].parse();
            numbers.push(number.map_err(|_| format!("its header needs a length {}", self.here()))?);
            // Python 2 wrote long integers with an L.
            self.0 = digits[end..].strip_prefix('L').unwrap_or(&digits[end..]);
            if !self.take(',') {
                self.expect(close)?;
                break;
            }
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Vec<u8> {
        let length = (text.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes(), b"data"].concat()
    }

    #[test]
    fn what_is_written_is_read_and_aligned() {
        for shape in [&[][..], &[3], &[40, 625, 3], &[1; 30]] {
            let bytes = write("<f4", shape);
            assert_eq!(bytes.len() % ALIGNMENT, 0);
            assert_eq!(bytes.last(), Some(&b'\n'));
            let (header, data) = read(&bytes).unwrap();
            let shape = shape.iter().map(|n| *n as u64).collect();
            assert_eq!(header, Header { descr: "<f4".to_owned(), fortran_order: false, shape });
            assert!(data.is_empty());
        }
    }

    #[test]
    fn forms_of_other_writers() {
        for text in [
            "{'descr': '>f8', 'fortran_order': True, 'shape': (2, 3), }      \n",
            "{\"shape\":[2,3],\"descr\":\">f8\",\"fortran_order\":True}",
            "{'shape': (2L, 3L), 'fortran_order': True, 'descr': '>f8'}\n",
        ] {
            let bytes = file(text);
            let (header, data) = read(&bytes).unwrap();
            assert_eq!(header, Header { descr: ">f8".to_owned(), fortran_order: true, shape: vec![2, 3] });
            assert_eq!(data, b"data");
        }
    }

    #[test]
    fn broken_headers_are_named() {
        for (text, fragment) in [
            ("{'descr': '<f4', 'shape': (2, 3), }", "has no \"fortran_order\""),
            ("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (2,), }", "needs a string"),
            ("{'descr': '<f4', 'fortran_order': [[[[], 'shape': (2,), }", "needs True or False"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (-2,), }", "needs a length"),
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,), }",
                "needs a length",
            ),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), } and", "goes on"),
            ("{'colour': 'red'}", "unknown key \"colour\""),
            ("", "needs '{'"),
        ] {
            let problem = read(&file(text)).unwrap_err();
            assert!(problem.contains(fragment), "{text}: {problem}");
        }
        assert!(read(b"\x93NUMPY\x04\x00\x00\x00").unwrap_err().contains("version"));
        assert!(read(b"\x93NUMPY\x01\x00\xff\x00{}").unwrap_err().contains("ends within"));
        assert!(read(b"\x93NUMPY\x02\x00\xff\xff\xff\xff").unwrap_err().contains("at most"));
    }
}
