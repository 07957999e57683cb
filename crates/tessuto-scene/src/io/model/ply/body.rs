//! The rows behind the header of a PLY file.

use super::super::MAX_COUNT;
use super::header::{Element, Encoding, Header, Kind, Property};

/// The rest of the rows.
pub(super) struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
    /// Words of the present row, and its line (ASCII).
    words: std::str::SplitAsciiWhitespace<'a>,
    line: usize,
}

impl<'a> Body<'a> {
    pub fn new(header: &Header<'a>) -> Self {
        Self {
            encoding: header.encoding,
            rest: header.body,
            words: "".split_ascii_whitespace(),
            line: header.lines,
        }
    }

    /// Calls `visit` with row, property and values (one, or those of the list) of all rows of `element`. An error is a
    /// line, where the file has lines, and what is wrong.
    pub fn read(
        &mut self,
        element: &Element,
        mut visit: impl FnMut(usize, &Property, &[f64]),
    ) -> Result<(), (Option<usize>, String)> {
        let mut values = Vec::new();
        for row in 0..element.count {
            self.row(element, &mut values, |property, values| visit(row, property, values)).map_err(
                |problem| {
                    let line = (self.encoding == Encoding::Ascii).then_some(self.line);
                    (line, format!("{} {} of {}: {problem}", element.name, row + 1, element.count))
                },
            )?;
        }
        Ok(())
    }

    fn row(
        &mut self,
        element: &Element,
        values: &mut Vec<f64>,
        mut visit: impl FnMut(&Property, &[f64]),
    ) -> Result<(), String> {
        if self.encoding == Encoding::Ascii {
            self.next_line()?;
        }
        for property in &element.properties {
            let count = match property.length {
                None => 1,
                Some(kind) => {
                    let length = self.value(kind, property)?;
                    if !(0.0..=MAX_COUNT as f64).contains(&length) || length.fract() != 0.0 {
                        return Err(format!("the length of \"{}\" is {length}", property.name));
                    }
                    length as usize
                }
            };
            values.clear();
            for _ in 0..count {
                values.push(self.value(property.kind, property)?);
            }
            visit(property, values);
        }
        match self.words.next() {
            Some(word) => Err(format!("\"{word}\" stands behind the last property")),
            None => Ok(()),
        }
    }

    /// Goes to the next line that is not empty.
    fn next_line(&mut self) -> Result<(), String> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|b| *b == b'\n');
            let (line, rest) = match end {
                Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
                None => (self.rest, &[][..]),
            };
            (self.rest, self.line) = (rest, self.line + 1);
            let line = std::str::from_utf8(line).map_err(|_| "the line is not text")?;
            if !line.trim_ascii().is_empty() {
                self.words = line.split_ascii_whitespace();
                return Ok(());
            }
        }
        Err("the file ends before it".to_owned())
    }

    fn value(&mut self, kind: Kind, property: &Property) -> Result<f64, String> {
        let big_endian = match self.encoding {
            Encoding::Ascii => {
                let word = self.words.next().ok_or_else(|| format!("\"{}\" is not there", property.name))?;
                return word.parse().map_err(|_| format!("\"{word}\" is not a number"));
            }
            Encoding::LittleEndian => false,
            Encoding::BigEndian => true,
        };
        let value = match kind {
            Kind::I8 => self.bytes().map(|b| i8::from_le_bytes(b).into()),
            Kind::U8 => self.bytes().map(|[b]| b.into()),
            Kind::I16 => self.ordered(big_endian).map(|b| i16::from_le_bytes(b).into()),
            Kind::U16 => self.ordered(big_endian).map(|b| u16::from_le_bytes(b).into()),
            Kind::I32 => self.ordered(big_endian).map(|b| i32::from_le_bytes(b).into()),
            Kind::U32 => self.ordered(big_endian).map(|b| u32::from_le_bytes(b).into()),
            Kind::F32 => self.ordered(big_endian).map(|b| f32::from_le_bytes(b).into()),
            Kind::F64 => self.ordered(big_endian).map(f64::from_le_bytes),
        };
        value.ok_or_else(|| format!("the file ends in \"{}\"", property.name))
    }

    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(*bytes)
    }

    /// The next bytes, the lowest one first.
    fn ordered<const N: usize>(&mut self, big_endian: bool) -> Option<[u8; N]> {
        let mut bytes = self.bytes()?;
        if big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }
}
