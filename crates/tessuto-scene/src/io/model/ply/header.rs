//! The header of a PLY file: which elements follow, how many, with which properties.
//!
//! Source: G. Turk, "The PLY polygon file format", 1994.

/// How the values behind the header are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(format!("there is no type \"{name}\"")),
        })
    }
}

/// A property of an element: a number, or a list that begins with its length.
#[derive(Debug, PartialEq)]
pub(super) struct Property {
    pub name: String,
    /// Type of the length; `None` if the property is one number.
    pub length: Option<Kind>,
    pub kind: Kind,
}

/// Rows of the same properties.
#[derive(Debug, PartialEq)]
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What the header says, and where it ends.
#[derive(Debug)]
pub(super) struct Header<'a> {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// The bytes behind it.
    pub body: &'a [u8],
    /// Its lines.
    pub lines: usize,
}

/// Reads the header of `file`; an error is a line, counted from 1, and what is wrong there.
pub(super) fn read(file: &[u8]) -> Result<Header<'_>, (usize, String)> {
    let (mut encoding, mut elements) = (None, Vec::new());
    let (mut body, mut lines) = (file, 0);
    loop {
        lines += 1;
        let Some(end) = body.iter().position(|b| *b == b'\n') else {
            return Err((lines, "the header has no end_header".to_owned()));
        };
        // Only a comment may hold something else than ASCII.
        let line = String::from_utf8_lossy(&body[..end]);
        body = &body[end + 1..];
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if words == ["end_header"] {
            break;
        }
        understand(&words, lines, &mut encoding, &mut elements).map_err(|problem| (lines, problem))?;
    }
    let encoding = encoding.ok_or_else(|| (lines, "the header has no line \"format\"".to_owned()))?;
    Ok(Header { encoding, elements, body, lines })
}

/// Takes one line of the header in.
fn understand(
    words: &[&str],
    line: usize,
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Result<(), String> {
    let property = match *words {
        ["ply"] if line == 1 => return Ok(()),
        [] | ["comment" | "obj_info", ..] => return Ok(()),
        ["format", name, _] => {
            *encoding = Some(match name {
                "ascii" => Encoding::Ascii,
                "binary_little_endian" => Encoding::LittleEndian,
                "binary_big_endian" => Encoding::BigEndian,
                _ => return Err(format!("there is no format \"{name}\"")),
            });
            return Ok(());
        }
        ["element", name, count] => {
            let count = count.parse().map_err(|_| format!("\"{count}\" is no count"))?;
            elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            return Ok(());
        }
        ["property", "list", length, kind, name] => {
            let length = Kind::of(length)?;
            if matches!(length, Kind::F32 | Kind::F64) {
                return Err(format!("the length of \"{name}\" is no whole number"));
            }
            Property { name: name.to_owned(), length: Some(length), kind: Kind::of(kind)? }
        }
        ["property", kind, name] => Property { name: name.to_owned(), length: None, kind: Kind::of(kind)? },
        _ => return Err(format!("\"{}\" is no line of a header", words.join(" "))),
    };
    let element = elements.last_mut().ok_or("a property stands before the first element")?;
    element.properties.push(property);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_are_no_header_are_named() {
        for (text, line, fragment) in [
            ("ply\nformat ascii 1.0\nelement vertex many\n", 3, "\"many\" is no count"),
            ("ply\nformat text 1.0\n", 2, "no format \"text\""),
            ("ply\nproperty float x\n", 2, "before the first element"),
            ("ply\nelement v 1\nproperty half x\n", 3, "no type \"half\""),
            ("ply\nelement v 1\nproperty list float int x\n", 3, "no whole number"),
            ("ply\ncomment \u{e9}\nend_header\n", 3, "no line \"format\""),
            ("ply\nformat ascii 1.0\nend_header", 3, "no end_header"),
            ("ply\nply\n", 2, "\"ply\" is no line"),
        ] {
            let (found, problem) = read(text.as_bytes()).unwrap_err();
            assert!(found == line && problem.contains(fragment), "{text}: {found}: {problem}");
        }
    }

    #[test]
    fn lines_may_end_as_on_windows() {
        let header =
            read(b"ply\r\nformat ascii 1.0\r\nelement vertex 2\r\nproperty double x\r\nend_header\r\n1\r\n")
                .unwrap();
        let property = Property { name: "x".to_owned(), length: None, kind: Kind::F64 };
        let element = Element { name: "vertex".to_owned(), count: 2, properties: vec![property] };
        assert_eq!(
            (header.encoding, header.elements, header.body),
            (Encoding::Ascii, vec![element], &b"1\r\n"[..])
        );
    }
}
