//! Elements: an identifier, a size, a content.

use std::io::Read;

use crate::refused::{Refused, damaged};

/// What stands before the content of an element.
pub(super) struct Head {
    pub(super) id: u32,
    /// Bytes of the content; `None` if it ends where another begins.
    pub(super) size: Option<u64>,
    /// Bytes of the head itself.
    pub(super) length: u64,
}

impl Head {
    /// Reads a head of at most `left` bytes.
    pub(super) fn read(from: &mut impl Read, left: u64) -> Result<Head, Refused> {
        let mut from = from.take(left);
        let mut byte = || -> Result<u8, Refused> {
            let mut byte = [0];
            if from.read(&mut byte)? == 0 { damaged("the file ends within an element") } else { Ok(byte[0]) }
        };
        let first = byte()?;
        let id_width = first.leading_zeros() as usize + 1;
        if id_width > 4 {
            return damaged(format!("an element begins with byte {first:#04X}"));
        }
        let mut id = u32::from(first);
        for _ in 1..id_width {
            id = id << 8 | u32::from(byte()?);
        }
        let first = byte()?;
        let width = first.leading_zeros() as usize + 1;
        if width > 8 {
            return damaged(format!("element {id:X} has a size of more than 8 bytes"));
        }
        let mut size = u64::from(first) & ((1 << (8 - width)) - 1);
        for _ in 1..width {
            size = size << 8 | u64::from(byte()?);
        }
        let unknown = size == (1 << (7 * width)) - 1;
        Ok(Head { id, size: (!unknown).then_some(size), length: (id_width + width) as u64 })
    }
}

/// A number of variable length and its bytes.
pub(super) fn variable(bytes: &[u8]) -> Option<(u64, usize)> {
    let first = *bytes.first()?;
    let width = first.leading_zeros() as usize + 1;
    let rest = bytes.get(1..width)?;
    (width <= 8).then(|| {
        (rest.iter().fold(u64::from(first) & ((1 << (8 - width)) - 1), |n, &b| n << 8 | u64::from(b)), width)
    })
}

/// The elements inside of `content`.
pub(super) fn elements(mut content: &[u8]) -> Result<Vec<(u32, &[u8])>, Refused> {
    let mut found = Vec::new();
    while !content.is_empty() {
        let left = content.len() as u64;
        let head = Head::read(&mut content, left)?;
        let size = head.size.and_then(|s| usize::try_from(s).ok()).filter(|s| *s <= content.len());
        let Some(size) = size else {
            return damaged(format!("element {:X} is longer than the one around it", head.id));
        };
        found.push((head.id, &content[..size]));
        content = &content[size..];
        if found.len() > 100_000 {
            return damaged("an element of more than 100000 others");
        }
    }
    Ok(found)
}

/// A whole number.
pub(super) fn number(value: &[u8]) -> Result<u64, Refused> {
    if value.len() > 8 {
        return damaged(format!("a number of {} bytes", value.len()));
    }
    Ok(value.iter().fold(0, |n, &b| n << 8 | u64::from(b)))
}

/// A number with a point.
pub(super) fn float(value: &[u8]) -> Result<f64, Refused> {
    match value.len() {
        0 => Ok(0.0),
        4 => Ok(f32::from_be_bytes(value.try_into().expect("four bytes")).into()),
        8 => Ok(f64::from_be_bytes(value.try_into().expect("eight bytes"))),
        length => damaged(format!("a number of {length} bytes")),
    }
}
